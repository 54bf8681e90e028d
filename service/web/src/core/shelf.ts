/** Small texts that the browser keeps from one visit to the next: so many at most, the oldest go first. */
export class Shelf {
  /**
   * @param storage the browser's; null where there is none, and nothing is kept.
   * @param name of the shelf within it; another name, and what lay on the old one is forgotten.
   * @param most entries.
   */
  constructor(
    private readonly storage: Pick<Storage, 'getItem' | 'setItem' | 'removeItem'> | null,
    private readonly name: string,
    private readonly most: number,
  ) {}

  get(key: string): string | null {
    return this.storage?.getItem(`${this.name} ${key}`) ?? null;
  }

  /** Keep a text; where there is no room even without the older half, it is not kept. */
  put(key: string, text: string): void {
    if (this.storage === null) return;
    // read anew each time: the page may stand in another tab, too, which keeps texts of its own here
    const others = parsed(this.storage.getItem(this.name)).filter((one) => one !== key);
    const keys = this.dropped(others, others.length + 1 - this.most);
    try {
      this.write(key, text, keys);
    } catch {
      const fewer = this.dropped(keys, Math.ceil(keys.length / 2)); // the browser's room is used up
      try {
        this.write(key, text, fewer);
      } catch {
        // by others: it is made again next time
      }
    }
  }

  private write(key: string, text: string, others: readonly string[]): void {
    this.storage?.setItem(`${this.name} ${key}`, text);
    this.storage?.setItem(this.name, JSON.stringify([...others, key]));
  }

  /** Forget the first so many; returns the keys of the others. */
  private dropped(keys: readonly string[], count: number): readonly string[] {
    const gone = keys.slice(0, Math.max(count, 0));
    for (const key of gone) this.storage?.removeItem(`${this.name} ${key}`);
    return keys.slice(gone.length);
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
