import { html, nothing, type TemplateResult } from 'lit-html';
import type { Problem } from '../api/problem';
import { capital } from '../core/format';
import { broken } from './broken';
import { icon } from './icons';

/** A link to the first page, which the page follows by itself. */
export function wayHome(): TemplateResult {
  return html`<a class="plain" href="/">To the first page</a>`;
}

/** What went wrong, in the service's own words, with what, and a way on: trying it again, or another page. */
export function problemCard(
  problem: Problem,
  again: (() => void) | null,
  back: TemplateResult | typeof nothing = nothing,
  about = '',
): TemplateResult {
  const known = !problem.unreachable && problem.slug !== 'unknown' && problem.slug !== 'page';
  return html`<section class="card refusal" role="alert">
    <h2>${icon('warn')} ${problem.title}</h2>
    ${about ? html`<p><b>${broken(about)}</b></p>` : nothing}
    <p>${capital(problem.detail)}</p>
    ${
      problem.defects.length > 1
        ? html`<ul>
            ${problem.defects.map((defect) => html`<li><code>${defect.pointer}</code> ${defect.detail}</li>`)}
          </ul>`
        : nothing
    }
    ${again ? html`<button class="plain" @click=${again}>${icon('reset')} Try again</button>` : nothing}
    ${back}
    <p class="hint">
      ${known ? html`<a href="/problems/${problem.slug}">About this problem</a>` : nothing}
      ${problem.requestId ? html` · request <code>${problem.requestId}</code>` : nothing}
    </p>
  </section>`;
}
