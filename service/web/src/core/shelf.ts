/** Small texts that the browser keeps from one visit to the next: so many at most, the oldest go first. */
export class Shelf {
  private keys: string[];

  /**
   * @param storage the browser's; null where there is none, and nothing is kept.
   * @param name of the shelf within it; another name, and what lay on the old one is forgotten.
   * @param most entries.
   */
  constructor(
    private readonly storage: Pick<Storage, 'getItem' | 'setItem' | 'removeItem'> | null,
    private readonly name: string,
    private readonly most: number,
  ) {
    this.keys = parsed(storage?.getItem(name) ?? null);
  }

  get(key: string): string | null {
    return this.storage?.getItem(`${this.name} ${key}`) ?? null;
  }

  /** Keep a text; where there is no room even without the older half, it is not kept. */
  put(key: string, text: string): void {
    if (this.storage === null) return;
    this.keys = [...this.keys.filter((one) => one !== key), key];
    this.drop(this.keys.length - this.most);
    try {
      this.write(key, text);
    } catch {
      this.drop(Math.ceil(this.keys.length / 2)); // the browser's room is used up
      try {
        this.write(key, text);
      } catch {
        this.keys = this.keys.filter((one) => one !== key); // by others: it is made again next time
      }
    }
  }

  private write(key: string, text: string): void {
    this.storage?.setItem(`${this.name} ${key}`, text);
    this.storage?.setItem(this.name, JSON.stringify(this.keys));
  }

  private drop(count: number): void {
    for (const key of this.keys.slice(0, Math.max(count, 0))) this.storage?.removeItem(`${this.name} ${key}`);
    this.keys = this.keys.slice(Math.max(count, 0));
  }
}

function parsed(text: string | null): string[] {
  try {
    const keys: unknown = JSON.parse(text ?? '[]');
    return Array.isArray(keys) ? keys.filter((key) => typeof key === 'string') : [];
  } catch {
    return []; // somebody else's
  }
}
