import { html, nothing, type TemplateResult } from 'lit-html';
import type { Job, JobStatus } from '../api/types';
import { ago, share } from '../core/format';
import { STATUS_WORDS } from '../core/job';
import { PLAIN, type Route } from '../core/route';
import { icon, type IconName } from '../ui/icons';
import type { Context } from './context';
import { attempt, cancellable, remove } from './deeds';
import { upOf } from './up';

const FILTERS: readonly (readonly [JobStatus | '', string])[] = [
  ['', 'All runs'],
  ['running', 'Running'],
  ['accepted', 'Waiting'],
  ['successful', 'Done'],
  ['failed', 'Failed'],
  ['cancelled', 'Cancelled'],
];

/** The jobs at the left, newest first. */
export function rail(context: Context, route: Route): TemplateResult {
  const { jobs } = context;
  const open =
    route.view === 'job'
      ? [route.shown.job]
      : route.view === 'compare'
        ? [route.left.job, route.right.job]
        : [];
  return html`<div class="filters">
      <select
        aria-label="Which runs"
        @change=${(event: Event) => {
          const { value } = event.target as HTMLSelectElement;
          const chosen = FILTERS.find(([status]) => status === value)?.[0] ?? '';
          jobs.filter(chosen === '' ? null : chosen, jobs.tag);
        }}
      >
        ${FILTERS.map(([status, words]) => html`<option value=${status} ?selected=${(jobs.status ?? '') === status}>${words}</option>`)}
      </select>
      <input
        type="search"
        placeholder="Tag"
        aria-label="Only with this tag"
        .value=${jobs.tag ?? ''}
        @change=${(event: Event) => {
          jobs.filter(jobs.status, (event.target as HTMLInputElement).value.trim() || null);
        }}
      />
    </div>
    ${jobs.problem && !jobs.problem.unreachable ? html`<p class="fault">${jobs.problem.detail}</p>` : nothing}
    ${jobs.loaded && jobs.jobs.length === 0 ? html`<p class="hint empty">No runs here yet.</p>` : nothing}
    <ul class="runs">
      ${
        jobs.loaded || jobs.jobs.length > 0
          ? jobs.jobs.map(
              (job) =>
                html`<li>
                  ${entry(context, job, open.includes(job.id))}${deeds(context, job, open.includes(job.id))}
                </li>`,
            )
          : [1, 2, 3].map(() => html`<li class="ghost entry"></li>`)
      }
    </ul>
    ${
      jobs.more
        ? html`<button
            class="plain small"
            @click=${() => {
              jobs.grow();
            }}
          >
            Older ones
          </button>`
        : nothing
    }`;
}

function entry(context: Context, job: Job, open: boolean): TemplateResult {
  const up = upOf(job);
  const picture =
    job.snapshots.available.length > 0 ? context.thumbnails.picture(job.id, 'initial', up) : null;
  const running = job.status === 'running';
  return html`<button
    class="run"
    aria-current=${open ? 'true' : 'false'}
    @click=${() => {
      const look = { ...PLAIN, up };
      context.go({ view: 'job', shown: { job: job.id, iteration: null }, look });
    }}
  >
    ${picture ? html`<img src=${picture} alt="" width="44" height="44" />` : html`<span class="ghost picture"></span>`}
    <span class="what">
      <span class="name">${job.name}</span>
      <span class="hint">
        ${job.status === 'successful' ? nothing : html`<span class="dot ${job.status}"></span>${STATUS_WORDS[job.status]} · `}${
          job.metrics && job.status === 'successful' ? `Ψ ${share(job.metrics.sphericity)} · ` : ''
        }${ago(job.created_at)}
      </span>
      ${running ? html`<progress max="100" .value=${job.progress.percent} aria-label="Progress of ${job.name}"></progress>` : nothing}
    </span>
  </button>`;
}

/** What can be done with a run without opening it. */
function deeds(context: Context, job: Job, open: boolean): TemplateResult {
  const { api } = context;
  const button = (name: IconName, words: string, act: () => Promise<unknown>): TemplateResult =>
    html`<button
      class="tool mini"
      title=${words}
      aria-label="${words}: ${job.name}"
      @click=${() => void act()}
    >
      ${icon(name)}
    </button>`;
  return html`<span class="deeds">
    ${cancellable(job) ? button('stop', 'Cancel', () => attempt(context, () => api.cancel(job.id))) : nothing}
    ${
      job.result_iteration === null
        ? nothing
        : html`<a
            class="tool mini"
            href="/v1/jobs/${job.id}/snapshots/final.ply"
            download
            title="Result as PLY"
            aria-label="Download as PLY: ${job.name}"
            >${icon('download')}</a
          >`
    }
    ${
      job.done
        ? button('trash', 'Delete', async () => {
            if ((await remove(context, job)) && open) context.go({ view: 'home' });
          })
        : nothing
    }
  </span>`;
}
