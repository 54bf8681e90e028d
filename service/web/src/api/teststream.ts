/** An event stream whose connection the test decides on: a browser's own cannot be held at a moment. */
export class Stream {
  static readonly CONNECTING = 0;
  static readonly OPEN = 1;
  static readonly CLOSED = 2;
  static made: Stream[] = [];
  readyState = Stream.CONNECTING;
  onopen: () => void = () => undefined;
  onerror: () => void = () => undefined;
  private readonly listeners = new Map<string, (message: { data: string }) => void>();

  constructor(readonly url: string) {
    Stream.made.push(this);
  }

  addEventListener(name: string, hear: (message: { data: string }) => void): void {
    this.listeners.set(name, hear);
  }

  tells(name: string, data: unknown): void {
    this.listeners.get(name)?.({ data: JSON.stringify(data) });
  }

  close(): void {
    this.readyState = Stream.CLOSED;
  }

  opens(): void {
    this.readyState = Stream.OPEN;
    this.onopen();
  }

  breaks(state: number): void {
    this.readyState = state;
    this.onerror();
  }
}
