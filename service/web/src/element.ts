import { packed, readReport, type Command } from './core/message';
import { FIELDS } from './core/colormap';

/**
 * `<spherify-viewer service="https://…" job="job_…">`: a run on any page.
 *
 * Attributes: `service`, where Spherify is (by default where this file came from); `job`; `iteration`, left out for
 * the newest; `color`, `curvature`, `distance`, `displacement` or `quality`; `wire`. Changes take effect at once.
 * Methods: `play()`, `pause()`. Event `iterationchange`, its `detail` with `job`, `iteration`, `status`, `playing`.
 */
export class SpherifyViewer extends HTMLElement {
  static readonly observedAttributes = ['service', 'job', 'iteration', 'color', 'wire'];
  private readonly frame = document.createElement('iframe');
  private shown = '';

  constructor() {
    super();
    this.frame.title = 'A mesh becomes a sphere';
    this.frame.loading = 'lazy';
    this.frame.allow = 'fullscreen';
    Object.assign(this.frame.style, { border: '0', width: '100%', height: '100%', display: 'block' });
    const style = document.createElement('style');
    style.textContent = ':host { display: block; aspect-ratio: 4 / 3; background: rgb(128 128 128 / 12%); }';
    this.attachShadow({ mode: 'open' }).append(style, this.frame);
  }

  connectedCallback(): void {
    addEventListener('message', this.hear);
    this.load();
  }

  disconnectedCallback(): void {
    removeEventListener('message', this.hear);
    this.shown = ''; // what it is told meanwhile is in the next address, and the old one is not loaded again
    this.frame.removeAttribute('src');
  }

  attributeChangedCallback(name: string, _: string | null, value: string | null): void {
    if (this.shown === '') return;
    if (name === 'service' || name === 'job') this.load();
    else if (name === 'iteration') this.send({ iteration: value === null ? null : Number(value) });
    else if (name === 'color') this.send({ color: FIELDS.find((field) => field === value) ?? null });
    else if (name === 'wire') this.send({ wire: value !== null });
  }

  play(): void {
    this.send({ playing: true });
  }

  pause(): void {
    this.send({ playing: false });
  }

  private get service(): string {
    return new URL(this.getAttribute('service') ?? '/', import.meta.url).origin;
  }

  private load(): void {
    const query = new URLSearchParams({ job: this.getAttribute('job') ?? '' });
    const iteration = this.getAttribute('iteration');
    const color = this.getAttribute('color');
    if (iteration !== null) query.set('it', iteration);
    if (color !== null) query.set('color', color);
    if (this.hasAttribute('wire')) query.set('wire', '1');
    const address = `${this.service}/embed?${query}`;
    if (address === this.shown) return;
    this.shown = address;
    this.frame.src = address;
  }

  private send(command: Command): void {
    this.frame.contentWindow?.postMessage(packed(command), this.service);
  }

  private readonly hear = (event: MessageEvent<unknown>): void => {
    if (event.source !== this.frame.contentWindow || event.origin !== this.service) return;
    const report = readReport(event.data);
    if (report) this.dispatchEvent(new CustomEvent('iterationchange', { detail: report }));
  };
}

if (!customElements.get('spherify-viewer')) customElements.define('spherify-viewer', SpherifyViewer);
