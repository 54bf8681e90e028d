import { html, nothing, type TemplateResult } from 'lit-html';
import type { Problem } from '../api/problem';
import type { Report } from '../api/types';
import { count, figure, share } from '../core/format';
import { MEANING } from '../core/meaning';
import { broken } from './broken';
import { icon } from './icons';

/** What is wrong with a mesh that its figures do not tell. */
const UNSOUND: Readonly<Record<string, string>> = {
  'mesh-not-manifold': 'no surface',
  'mesh-not-oriented': 'not oriented',
};

/** What was found out about a mesh, as a card. */
export function reportCard(name: string, report: Report): TemplateResult {
  const [low, high] = report.bbox;
  const size = ([0, 1, 2] as const).map((axis) => figure(high[axis] - low[axis], 3)).join(' × ');
  const closed = report.boundary_edges === 0;
  const checks: readonly (readonly [boolean, string])[] = [
    [
      closed,
      closed ? 'closed' : `${count(report.boundary_loops)} ${report.boundary_loops === 1 ? 'hole' : 'holes'}`,
    ],
    [report.components === 1, report.components === 1 ? 'one part' : `${count(report.components)} parts`],
    [report.genus === 0, report.genus === null ? 'genus undefined' : `genus ${report.genus}`],
    ...report.defects.flatMap(({ code }) => {
      const words = UNSOUND[code];
      return words === undefined ? [] : [[false, words] as const];
    }),
  ];
  // an open surface encloses nothing: what the formulas give depends on where the origin is
  const figures: readonly (readonly [string, string, string?])[] = [
    ['Vertices', count(report.vertices)],
    ['Triangles', count(report.faces)],
    ['Sphericity Ψ', closed ? share(report.sphericity) : '–', MEANING.sphericity],
    ['Mean edge', figure(report.mean_edge, 3)],
    ['Worst triangle', figure(report.least_quality, 2), MEANING.quality],
    ['Volume', closed ? figure(report.volume) : '–'],
    ['Size, in units of the file', size],
  ];
  return html`<section class="card report" aria-label="Report">
    <h2>${broken(name)}</h2>
    <ul class="checks">
      ${checks.map(
        ([good, words]) =>
          html`<li class=${good ? 'good' : 'bad'}>${icon(good ? 'check' : 'warn')}${words}</li>`,
      )}
    </ul>
    <dl class="figures">
      ${figures.map(
        ([term, value, meaning]) =>
          html`<div class=${value === size ? 'wide' : ''} title=${meaning ?? nothing}>
            <dt>${term}</dt>
            <dd>${value}</dd>
          </div>`,
      )}
    </dl>
    ${
      report.repairs.length > 0
        ? html`<h3>Repaired on the way in</h3>
            <ul class="repairs">
              ${report.repairs.map((repair) => html`<li>${repair.detail}</li>`)}
            </ul>`
        : nothing
    }
  </section>`;
}

const CURES: Readonly<Record<string, { readonly allow: string; readonly words: string }>> = {
  'mesh-not-closed': { allow: 'boundary', words: 'Morph it with its holes' },
  'mesh-not-connected': { allow: 'components', words: 'Morph the largest part' },
  'mesh-genus': { allow: 'genus', words: 'Morph it with its handles' },
  'nonmanifold-vertex': { allow: 'nonmanifold-vertex', words: 'Morph it all the same' },
};

/** Why a mesh was refused, where, and what can be done; `drawn` if the mesh is in sight, `retry` sends it again with switches. */
export function refusal(
  problem: Problem,
  drawn: boolean,
  retry: (allow: readonly string[]) => void,
): TemplateResult {
  const switches = [...new Set(problem.defects.map(switchOf))];
  const able = switches.length > 0 && switches.every((one) => one !== null);
  const names = switches.filter((one) => one !== null);
  return html`<section class="card refusal" aria-label="Why it was refused">
    <h2>${icon('warn')} ${problem.title}</h2>
    ${
      problem.defects.length > 0
        ? problem.defects.map((defect) => html`<p>${defect.detail}</p>`)
        : html`<p>${problem.detail}</p>`
    }
    ${
      drawn && problem.defects.some((defect) => (defect.locations ?? []).length > 0)
        ? html`<p class="hint"><span class="swatch red"></span>What is wrong is drawn in red on the mesh.</p>`
        : nothing
    }
    ${
      able
        ? html`<button
            class="plain"
            @click=${() => {
              retry(names.map((one) => one.allow));
            }}
          >
            ${names.length === 1 ? names[0]?.words : 'Morph it all the same'}
          </button>`
        : nothing
    }
    <p class="hint">
      <a href="/problems/${problem.slug}">About this problem</a>${
        problem.requestId ? html` · request <code>${problem.requestId}</code>` : nothing
      }
    </p>
  </section>`;
}

function switchOf(defect: {
  readonly code: string;
  readonly detail: string;
}): { allow: string; words: string } | null {
  // one code for edges and vertices, and only the vertices can be let in
  const code =
    defect.code === 'mesh-not-manifold' && defect.detail.includes('allow nonmanifold-vertex')
      ? 'nonmanifold-vertex'
      : defect.code;
  return CURES[code] ?? null;
}
