import { html, nothing, type TemplateResult } from 'lit-html';
import { asProblem, Problem } from '../api/problem';
import type { Job, Mesh } from '../api/types';
import { bytes, count, share } from '../core/format';
import { STATUS_WORDS } from '../core/job';
import type { Column } from '../core/matrix';
import { formatRoute, PLAIN, type Route } from '../core/route';
import { broken } from '../ui/broken';
import { BatchForm, MOST_RUNS } from './batchform';
import type { Context, View } from './context';
import { tagsOf, upOf, upOfFile } from './up';
import '../styles/batch.css';

export const MOST_FILES = 50;
const AT_ONCE = 2;
const LOOK_MS = 2000;

/** A file on its way to its runs. */
interface Entry {
  readonly file: File;
  /** The share that is sent; null before its turn. */
  sent: number | null;
  mesh: Mesh | null;
  problem: Problem | null;
  /** What became of it in each column, as far as it was asked for. */
  readonly runs: (Job | Problem)[];
}

/** Several files: each is sent and judged, and those that are accepted are run, in every way that is asked for. */
export class BatchView implements View {
  readonly headed = true;
  private readonly entries: readonly Entry[];
  private readonly tag = `batch-${Date.now().toString(36)}`;
  private readonly form: BatchForm;
  /** In which ways they are run; empty until they are. */
  private columns: readonly Column[] = [];
  private timer: ReturnType<typeof setTimeout> | undefined;
  private closed = false;

  constructor(
    private readonly context: Context,
    files: readonly File[],
  ) {
    if (files.length > MOST_FILES) context.toast(`The first ${MOST_FILES} files are taken`, 'bad');
    this.form = new BatchForm(context);
    this.entries = files
      .slice(0, MOST_FILES)
      .map((file) => ({ file, sent: null, mesh: null, problem: null, runs: [] }));
    for (let one = 0; one < AT_ONCE; one++) void this.send();
  }

  get title(): string {
    return this.entries.length === 1 ? '1 file' : `${this.entries.length} files`;
  }

  render(): TemplateResult {
    const judged = this.entries.filter((entry) => entry.mesh !== null || entry.problem !== null).length;
    const begun = this.columns.length > 0;
    return html`<div class="batch">
      <h1 tabindex="-1">${this.title}</h1>
      <p class="hint" role="status">
        ${judged < this.entries.length ? `${judged} of ${this.entries.length} judged …` : nothing}
        ${begun ? html`The runs carry the tag <code>${this.tag}</code>, by which the list finds them.` : nothing}
      </p>
      <div class="matrix">
        <table class="entries">
          <thead>
            <tr>
              <th scope="col">File</th>
              <th scope="col">${begun ? 'Mesh' : 'What became of it'}</th>
              ${this.columns.map(({ title }) => html`<th scope="col">${title}</th>`)}
            </tr>
          </thead>
          <tbody>
            ${this.entries.map((entry) => this.row(entry))}
          </tbody>
        </table>
      </div>
      ${
        begun // and the table shows what becomes of it
          ? nothing
          : this.form.render(this.ready.length, judged < this.entries.length, () => {
              void this.submit();
            })
      }
    </div>`;
  }

  close(): void {
    this.closed = true;
    clearTimeout(this.timer);
  }

  private get ready(): (Entry & { mesh: Mesh })[] {
    return this.entries.filter((entry): entry is Entry & { mesh: Mesh } => entry.mesh !== null);
  }

  private row(entry: Entry): TemplateResult {
    return html`<tr>
      <th scope="row">${broken(entry.file.name)} <span class="hint keep">${bytes(entry.file.size)}</span></th>
      <td>${this.fate(entry)}</td>
      ${this.columns.map((column, i) => html`<td>${this.cell(entry, entry.runs[i], column)}</td>`)}
    </tr>`;
  }

  /** What became of a file before its runs. */
  private fate({ file, sent, mesh, problem }: Entry): TemplateResult | string {
    if (problem)
      return html`<span class="fault">${problem.detail}</span>
        <button
          class="plain small"
          aria-label="See why: ${file.name}"
          @click=${() => {
            this.context.files([file]);
          }}
        >
          See why
        </button>`;
    if (mesh) {
      const name = mesh.name === file.name ? null : file.name;
      const route: Route = { view: 'mesh', mesh: mesh.id, up: upOfFile(file.name), name };
      return html`${count(mesh.report.vertices)} vertices${this.columns.length > 0 ? '' : ', ready'} ·
      ${this.link(route, 'Open', file.name)}`;
    }
    if (sent === null) return 'Waiting';
    return sent < 1
      ? html`<progress max="1" .value=${sent} aria-label="Sent"></progress>`
      : 'The service reads it …';
  }

  /** One run of the matrix. */
  private cell(
    { file }: Entry,
    run: Job | Problem | undefined,
    column: Column,
  ): TemplateResult | typeof nothing {
    if (run === undefined) return nothing;
    if (run instanceof Problem) return html`<span class="fault">${run.detail}</span>`;
    const look = { ...PLAIN, up: upOf(run) };
    const route: Route = { view: 'job', shown: { job: run.id, iteration: null }, look };
    const which = this.columns.length > 1 ? `${file.name}, ${column.title}` : file.name;
    const round = run.metrics
      ? html`<span class="hint keep">Ψ ${share(run.metrics.sphericity)}</span>`
      : nothing;
    return html`<span class="dot ${run.status}"></span
      >${this.link(route, STATUS_WORDS[run.status], which, 'See the run')} ${round}
      ${run.done ? nothing : html`<progress max="100" .value=${run.progress.percent} aria-label="Progress of ${which}"></progress>`}`;
  }

  private link(route: Route, words: string, name: string, said = words): TemplateResult {
    return html`<a
      href=${formatRoute(route)}
      aria-label="${said}: ${name}"
      @click=${(event: MouseEvent) => {
        if (event.ctrlKey || event.metaKey || event.shiftKey) return;
        event.preventDefault();
        this.context.go(route);
      }}
      >${words}</a
    >`;
  }

  /** Send one file after the other. */
  private async send(): Promise<void> {
    const entry = this.entries.find((one) => one.sent === null);
    if (!entry || this.closed) return;
    entry.sent = 0;
    try {
      entry.mesh = await this.context.api.upload(entry.file, entry.file.name, [], (sent) => {
        entry.sent = sent;
        this.context.refresh();
      });
    } catch (thrown) {
      entry.problem = asProblem(thrown);
    }
    this.context.refresh();
    await this.send();
  }

  private async submit(): Promise<void> {
    this.columns = this.form.columns;
    window.addEventListener('beforeunload', ask); // what is not sent yet would be lost
    for (const entry of this.ready)
      for (const column of this.columns) {
        entry.runs.push(await this.begin(entry, column));
        this.context.refresh();
      }
    window.removeEventListener('beforeunload', ask);
    void this.context.jobs.load();
    this.look();
  }

  private async begin({ file, mesh }: Entry & { mesh: Mesh }, column: Column): Promise<Job | Problem> {
    const { iterations, ...parameters } = column.parameters;
    const name = file.name.replace(/\.\w+$/, '') + (this.columns.length > 1 ? ` · ${column.title}` : '');
    try {
      return await this.context.api.submit({
        mesh_id: mesh.id,
        preset: column.preset,
        ...(Object.keys(parameters).length > 0 ? { parameters } : {}),
        ...(typeof iterations === 'number' ? { iterations } : {}),
        name: name.slice(0, 120),
        tags: [this.tag, ...tagsOf(upOfFile(file.name))],
      });
    } catch (thrown) {
      return asProblem(thrown);
    }
  }

  /** Look after the runs until all have ended. */
  private look(): void {
    clearTimeout(this.timer);
    this.context.refresh();
    const going = this.entries.some(({ runs }) => runs.some((run) => !(run instanceof Problem) && !run.done));
    if (this.closed || !going) return;
    this.timer = setTimeout(() => {
      void this.news();
    }, LOOK_MS);
  }

  private async news(): Promise<void> {
    try {
      const { items } = await this.context.api.jobs({ tag: this.tag }, MOST_RUNS);
      const found = new Map(items.map((job) => [job.id, job]));
      for (const { runs } of this.entries)
        runs.forEach((run, i) => {
          if (!(run instanceof Problem)) runs[i] = found.get(run.id) ?? run;
        });
    } catch {
      // the page says elsewhere that nothing answers, and this is tried again
    }
    this.look();
  }
}

/** Have the browser ask before it leaves the page. */
function ask(event: BeforeUnloadEvent): void {
  event.preventDefault();
}
