import { html, nothing, type TemplateResult } from 'lit-html';
import type { Job } from '../api/types';
import { FIELD_INFO, type Field } from '../core/colormap';
import { count } from '../core/format';
import { icon } from './icons';

const FORMATS = ['ply', 'obj', 'stl', 'glb', 'off'] as const;
const COLOURED: readonly string[] = ['ply', 'glb', 'obj'];

/** The files of a job: the state that is shown, the best, the result; everything at once; the figures; a picture. */
export function downloads(job: Job, state: number, color: Field | null, picture: () => void): TemplateResult {
  const { available } = job.snapshots;
  if (available.length === 0) return html``;
  const path = `/v1/jobs/${job.id}`;
  const row = (which: string, words: string): TemplateResult =>
    html`<tr>
      <th scope="row">${words}</th>
      ${FORMATS.map(
        (format) =>
          html`<td>
            <a
              href="${path}/snapshots/${which}.${format}${color !== null && COLOURED.includes(format) ? `?color=${color}` : ''}"
              download
              aria-label="${words} as ${format.toUpperCase()}"
              >${format}</a
            >
          </td>`,
      )}
    </tr>`;
  return html`<section class="card" aria-label="Downloads">
    <h2>Downloads</h2>
    <table class="files">
      <tbody>
        ${row(String(state), `Iteration ${count(state)}`)}
        ${job.result_iteration === null ? nothing : row('final', 'Result')}
        ${job.best_iteration === null ? nothing : row('best', 'Best')}
      </tbody>
    </table>
    ${color === null ? nothing : html`<p class="hint">PLY, OBJ and GLB come with the colours: ${FIELD_INFO[color].title.toLowerCase()}.</p>`}
    <div class="actions bar">
      ${
        'archive' in job.links
          ? html`<a class="plain" href=${job.links.archive} download>${icon('download')} All as ZIP</a>`
          : nothing
      }
      <a class="plain" href="${path}/metrics.csv" download>${icon('download')} Figures</a>
      <button class="plain" @click=${picture}>${icon('camera')} Picture</button>
    </div>
  </section>`;
}
