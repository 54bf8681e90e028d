/** What is kept within a number of bytes: the least recently used goes first. */
export class ByteBudget<T> {
  private readonly entries = new Map<string, { value: T; bytes: number }>();
  private used = 0;

  /**
   * @param limit bytes that are kept at most, the newest entry aside.
   * @param dropped told about everything that goes.
   */
  constructor(
    readonly limit: number,
    private readonly dropped: (value: T) => void = () => undefined,
  ) {}

  /** Bytes held now. */
  get bytes(): number {
    return this.used;
  }

  get size(): number {
    return this.entries.size;
  }

  has(key: string): boolean {
    return this.entries.has(key);
  }

  /** Return an entry, which is from now on the most recently used one. */
  get(key: string): T | undefined {
    const entry = this.entries.get(key);
    if (entry === undefined) return undefined;
    this.entries.delete(key);
    this.entries.set(key, entry);
    return entry.value;
  }

  /** Keep an entry; what was used longest ago makes room. The newest entry stays even if it alone is too large. */
  set(key: string, value: T, bytes: number): void {
    this.delete(key);
    this.entries.set(key, { value, bytes });
    this.used += bytes;
    for (const oldest of this.entries.keys()) {
      if (this.used <= this.limit || oldest === key) break;
      this.delete(oldest);
    }
  }

  delete(key: string): void {
    const entry = this.entries.get(key);
    if (entry === undefined) return;
    this.entries.delete(key);
    this.used -= entry.bytes;
    this.dropped(entry.value);
  }

  clear(): void {
    for (const key of [...this.entries.keys()]) this.delete(key);
  }
}
