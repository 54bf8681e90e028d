import { html, type TemplateResult } from 'lit-html';

const SHOWN_MS = 4500;

/** Short words that come and go. */
export class Toasts {
  private list: readonly { readonly id: number; readonly text: string; readonly kind: 'good' | 'bad' }[] = [];
  private last = 0;

  constructor(private readonly changed: () => void) {}

  say(text: string, kind: 'good' | 'bad' = 'good'): void {
    const id = ++this.last;
    this.list = [...this.list.slice(-2), { id, text, kind }];
    this.changed();
    setTimeout(() => {
      this.list = this.list.filter((one) => one.id !== id);
      this.changed();
    }, SHOWN_MS);
  }

  render(): TemplateResult {
    return html`<div class="toasts" role="status" aria-live="polite">
      ${this.list.map((one) => html`<p class=${one.kind}>${one.text}</p>`)}
    </div>`;
  }
}
