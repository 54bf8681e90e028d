/** Something that changes, and tells those who asked to be told. */
export class Emitter {
  private readonly listeners = new Set<() => void>();

  /** Listen; the returned function ends it. */
  onChange(listener: () => void): () => void {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  }

  protected changed(): void {
    for (const listener of [...this.listeners]) listener();
  }
}
