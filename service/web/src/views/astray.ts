import { html, type TemplateResult } from 'lit-html';
import { icon } from '../ui/icons';
import { wayHome } from '../ui/problem';
import type { View } from './context';

/** An address of nothing: what is wrong with it, and where to go instead. */
export class AstrayView implements View {
  readonly title = 'This address leads nowhere';

  constructor(private readonly why: string) {}

  render(): TemplateResult {
    return html`<div class="middle">
      <section class="card refusal" role="alert">
        <h2>${icon('warn')} ${this.title}</h2>
        <p>${this.why}</p>
        <p class="hint">The list of runs leads to every run that this service keeps.</p>
        ${wayHome()}
      </section>
    </div>`;
  }

  close(): void {
    // nothing was opened
  }
}
