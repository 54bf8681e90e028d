import { html, type TemplateResult } from 'lit-html';
import type { Problem } from '../api/problem';
import { problemCard } from '../ui/problem';
import type { View } from './context';

/** What is seen while the code of a view is on its way. */
export class LoadingView implements View {
  readonly title = '';
  problem: Problem | null = null;

  render(): TemplateResult {
    return html`<div class="middle" aria-busy=${this.problem ? 'false' : 'true'}>
      ${
        this.problem
          ? problemCard(this.problem, () => {
              location.reload();
            })
          : html`<progress aria-label="Loading"></progress>`
      }
    </div>`;
  }

  close(): void {
    this.problem = null;
  }
}
