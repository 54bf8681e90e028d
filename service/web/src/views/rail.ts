import { html, nothing, type TemplateResult } from 'lit-html';
import { live } from 'lit-html/directives/live.js';
import { repeat } from 'lit-html/directives/repeat.js';
import type { Job, JobStatus } from '../api/types';
import { ago, share } from '../core/format';
import { cellAfter, type Cell } from '../core/grid';
import { STATUS_WORDS } from '../core/job';
import { PLAIN, type Route } from '../core/route';
import { icon, type IconName } from '../ui/icons';
import type { Context } from './context';
import { attempt, cancellable, remove } from './deeds';
import type { JobList } from './joblist';
import { upOf } from './up';

const FILTERS: readonly (readonly [JobStatus | '', string])[] = [
  ['', 'All runs'],
  ['running', 'Running'],
  ['accepted', 'Waiting'],
  ['successful', 'Done'],
  ['failed', 'Failed'],
  ['cancelled', 'Cancelled'],
];

/**
 * The jobs at the left, newest first: one Tab stop for all of them, from which the arrow keys lead up and down from run
 * to run, and to the right to what can be done with one.
 */
export class Rail {
  /** What Tab leads to: a cell, and the run whose it was. */
  private stop: Cell & { readonly job: string } = { job: '', row: 0, column: 0 };

  /** The runs that are open. */
  private open: readonly string[] = [];

  constructor(private readonly context: Context) {}

  render(route: Route): TemplateResult {
    const { jobs } = this.context;
    this.open = shownBy(route);
    return html`${filters(jobs)}
    ${jobs.problem && !jobs.problem.unreachable ? html`<p class="fault">${jobs.problem.detail}</p>` : nothing}
    ${jobs.loaded && jobs.jobs.length === 0 ? empty(jobs) : nothing}
    ${jobs.loaded || jobs.jobs.length > 0 ? this.grid(jobs) : ghosts()}
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

  /** Have something done that draws the page anew; the focus stays in the list although what had it may be gone. */
  keepingFocus(draw: () => void): void {
    const within = document.activeElement?.closest('.runs') ?? null;
    draw();
    if (within === null || document.activeElement !== document.body) return;
    const next = document.querySelector<HTMLElement>('.runs [tabindex="0"]');
    (next ?? document.querySelector<HTMLElement>('.rail select'))?.focus();
  }

  private grid({ jobs, loaded }: JobList): TemplateResult | typeof nothing {
    if (jobs.length === 0) return nothing;
    const stop = this.stopIn(jobs);
    return html`<div
      class="runs"
      role="grid"
      aria-label="Runs, the newest first"
      aria-busy=${loaded ? 'false' : 'true'}
      @keydown=${this.key}
      @focusin=${(event: FocusEvent) => {
        this.stand(event.target as HTMLElement, jobs);
      }}
    >
      ${repeat(
        jobs,
        (job) => job.id,
        (job, row) => this.row(job, row === stop.row ? stop.column : null),
      )}
    </div>`;
  }

  /** One run; `stop` is the cell that Tab leads to, null if it is another run's. */
  private row(job: Job, stop: number | null): TemplateResult {
    const open = (): boolean => this.open.includes(job.id);
    const cells = [entry(this.context, job, open()), ...deeds(this.context, job, open)];
    const at = Math.min(stop ?? -1, cells.length - 1);
    const [first, ...rest] = cells.map((cell, i) => cell(i === at ? 0 : -1));
    return html`<div role="row">${first}<span class="deeds" role="presentation">${rest}</span></div>`;
  }

  /** The cell that Tab leads to: where it last was, or in its place, or the run that is open, or the first. */
  private stopIn(jobs: readonly Job[]): Cell {
    const { job, row, column } = this.stop;
    const place = jobs.findIndex(({ id }) => id === job);
    if (place >= 0) return { row: place, column };
    if (job !== '') return { row: Math.min(row, jobs.length - 1), column: 0 };
    return {
      row: Math.max(
        jobs.findIndex(({ id }) => this.open.includes(id)),
        0,
      ),
      column: 0,
    };
  }

  private stand(target: HTMLElement, jobs: readonly Job[]): void {
    const row = target.closest('[role=row]');
    if (row === null) return;
    const place = [...(row.parentElement?.children ?? [])].indexOf(row);
    const column = cellsOf(row).indexOf(target);
    this.stop = { job: jobs[place]?.id ?? '', row: place, column };
    for (const cell of row.parentElement?.querySelectorAll('[tabindex]') ?? [])
      cell.setAttribute('tabindex', cell === target ? '0' : '-1'); // at once: Tab may be the next key
  }

  private readonly key = (event: KeyboardEvent): void => {
    if (event.altKey || event.metaKey || event.shiftKey) return;
    const rows = [...(event.currentTarget as HTMLElement).querySelectorAll('[role=row]')].map(cellsOf);
    const row = rows.findIndex((cells) => cells.includes(event.target as HTMLElement));
    const column = rows[row]?.indexOf(event.target as HTMLElement) ?? 0;
    const widths = rows.map((cells) => cells.length);
    const next = cellAfter({ row, column }, event.key, event.ctrlKey, widths);
    if (row < 0 || next === null) return;
    event.preventDefault(); // the arrows are the timeline's elsewhere
    rows[next.row]?.[next.column]?.focus();
  };
}

function cellsOf(row: Element): HTMLElement[] {
  return [...row.querySelectorAll<HTMLElement>('button, a')];
}

function shownBy(route: Route): readonly string[] {
  if (route.view === 'job') return [route.shown.job];
  return route.view === 'compare' ? [route.left.job, route.right.job] : [];
}

function filters(jobs: JobList): TemplateResult {
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
  </div>`;
}

function empty(jobs: JobList): TemplateResult {
  const all = jobs.status === null && jobs.tag === null;
  return html`<p class="hint empty">
    ${all ? 'No runs yet. Drop a mesh to begin one.' : 'No run fits this filter.'}
  </p>`;
}

function ghosts(): TemplateResult {
  return html`<div class="runs" aria-hidden="true">
    ${[1, 2, 3].map(() => html`<div class="ghost entry"></div>`)}
  </div>`;
}

/** Something to press, as a cell of the grid, by its tabindex. */
type Pressed = (tabindex: number) => TemplateResult;

function entry(context: Context, job: Job, open: boolean): Pressed {
  const up = upOf(job);
  const picture =
    job.snapshots.available.length > 0 ? context.thumbnails.picture(job.id, 'initial', up) : null;
  const running = job.status === 'running';
  return (tabindex) =>
    html`<div role="gridcell">
      <button
        class="run"
        tabindex=${live(String(tabindex))}
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
      </button>
    </div>`;
}

/** What can be done with a run without opening it; `open` tells whether it is open at the time. */
function deeds(context: Context, job: Job, open: () => boolean): Pressed[] {
  const { api } = context;
  const button =
    (name: IconName, words: string, act: () => Promise<unknown>): Pressed =>
    (tabindex) =>
      html`<span role="gridcell"
        ><button
          class="tool mini"
          tabindex=${live(String(tabindex))}
          title=${words}
          aria-label="${words}: ${job.name}"
          @click=${() => void act()}
        >
          ${icon(name)}
        </button></span
      >`;
  const file: Pressed = (tabindex) =>
    html`<span role="gridcell"
      ><a
        class="tool mini"
        tabindex=${live(String(tabindex))}
        href="/v1/jobs/${job.id}/snapshots/final.ply"
        download
        title="Result as PLY"
        aria-label="Download as PLY: ${job.name}"
        >${icon('download')}</a
      ></span
    >`;
  const cancel = button('stop', 'Cancel', () => attempt(context, () => api.cancel(job.id)));
  const drop = button('trash', 'Delete', async () => {
    if ((await remove(context, job)) && open()) context.go({ view: 'home' });
  });
  return [
    ...(cancellable(job) ? [cancel] : []),
    ...(job.result_iteration === null ? [] : [file]),
    ...(job.done ? [drop] : []),
  ];
}
