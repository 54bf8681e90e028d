import { html, nothing, type TemplateResult } from 'lit-html';
import { asProblem, type Problem } from '../api/problem';
import type { Job, Mesh } from '../api/types';
import { bytes, count, share } from '../core/format';
import { STATUS_WORDS } from '../core/job';
import { formatRoute, PLAIN, type Route } from '../core/route';
import type { Context, View } from './context';
import { upOf, upOfFile } from './up';

export const MOST_FILES = 50;
const AT_ONCE = 2;
const LOOK_MS = 2000;

/** A file on its way to a run. */
interface Entry {
  readonly file: File;
  /** The share that is sent; null before its turn. */
  sent: number | null;
  mesh: Mesh | null;
  job: Job | null;
  problem: Problem | null;
}

/** Several files: each is sent and judged, and those that are accepted are run with one preset. */
export class BatchView implements View {
  readonly headed = true;
  private readonly entries: readonly Entry[];
  private readonly tag = `batch-${Date.now().toString(36)}`;
  private preset = '';
  private submitting = false;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private closed = false;

  constructor(
    private readonly context: Context,
    files: readonly File[],
  ) {
    if (files.length > MOST_FILES) context.toast(`The first ${MOST_FILES} files are taken`, 'bad');
    this.entries = files
      .slice(0, MOST_FILES)
      .map((file) => ({ file, sent: null, mesh: null, job: null, problem: null }));
    for (let one = 0; one < AT_ONCE; one++) void this.send();
  }

  get title(): string {
    return this.entries.length === 1 ? '1 file' : `${this.entries.length} files`;
  }

  render(): TemplateResult {
    const judged = this.entries.filter((entry) => entry.mesh !== null || entry.problem !== null).length;
    const ready = this.ready;
    const begun = this.entries.some((entry) => entry.job !== null);
    return html`<div class="batch">
      <h1 tabindex="-1">${this.title}</h1>
      <p class="hint" role="status">
        ${judged < this.entries.length ? `${judged} of ${this.entries.length} judged …` : nothing}
        ${begun ? html`The runs carry the tag <code>${this.tag}</code>, by which the list finds them.` : nothing}
      </p>
      <table class="entries">
        <thead>
          <tr>
            <th scope="col">File</th>
            <th scope="col">What became of it</th>
            <th scope="col"><span class="hidden">Go there</span></th>
          </tr>
        </thead>
        <tbody>
          ${this.entries.map((entry) => this.row(entry))}
        </tbody>
      </table>
      ${
        begun && ready.length === 0
          ? nothing
          : html`<form
              class="actions"
              aria-label="Run"
              @submit=${(event: Event) => {
                event.preventDefault();
                void this.submit();
              }}
            >
              ${this.presets()}
              <button class="primary" type="submit" ?disabled=${ready.length === 0 || this.submitting}>
                ${this.submitting ? 'Starting …' : `Run ${ready.length === 1 ? 'it' : `all ${ready.length}`}`}
              </button>
            </form>`
      }
    </div>`;
  }

  close(): void {
    this.closed = true;
    clearTimeout(this.timer);
  }

  private get ready(): (Entry & { mesh: Mesh })[] {
    return this.entries.filter(
      (entry): entry is Entry & { mesh: Mesh } => entry.mesh !== null && entry.job === null,
    );
  }

  private presets(): TemplateResult {
    const { info, presets } = this.context.catalogue;
    if (this.preset === '') this.preset = info?.default_preset ?? '';
    return html`<label for="batch-preset">Preset</label>
      <select
        id="batch-preset"
        @change=${(event: Event) => {
          this.preset = (event.target as HTMLSelectElement).value;
        }}
      >
        ${presets.map(({ name, title }) => html`<option value=${name} ?selected=${name === this.preset}>${title}</option>`)}
      </select>`;
  }

  private row(entry: Entry): TemplateResult {
    return html`<tr>
      <th scope="row">${entry.file.name} <span class="hint">${bytes(entry.file.size)}</span></th>
      <td>${this.fate(entry)}</td>
      <td>${this.way(entry)}</td>
    </tr>`;
  }

  private fate({ sent, mesh, job, problem }: Entry): TemplateResult | string {
    if (problem) return html`<span class="fault">${problem.detail}</span>`;
    if (job) {
      const round = job.metrics ? ` · Ψ ${share(job.metrics.sphericity)}` : '';
      return html`<span class="dot ${job.status}"></span>${STATUS_WORDS[job.status]}${round}
        ${job.done ? nothing : html`<progress max="100" .value=${job.progress.percent} aria-label="Progress of ${job.name}"></progress>`}`;
    }
    if (mesh) return `${count(mesh.report.vertices)} vertices, ready`;
    if (sent === null) return 'Waiting';
    return sent < 1
      ? html`<progress max="1" .value=${sent} aria-label="Sent"></progress>`
      : 'The service reads it …';
  }

  private way({ file, mesh, job, problem }: Entry): TemplateResult | typeof nothing {
    if (job) {
      const look = { ...PLAIN, up: upOf(job) };
      return this.link(
        { view: 'job', shown: { job: job.id, iteration: null }, look },
        'See the run',
        file.name,
      );
    }
    if (mesh) {
      const name = mesh.name === file.name ? null : file.name;
      return this.link({ view: 'mesh', mesh: mesh.id, up: upOfFile(file.name), name }, 'Open', file.name);
    }
    if (!problem) return nothing;
    return html`<button
      class="plain small"
      aria-label="See why: ${file.name}"
      @click=${() => {
        this.context.files([file]);
      }}
    >
      See why
    </button>`;
  }

  private link(route: Route, words: string, name: string): TemplateResult {
    return html`<a
      href=${formatRoute(route)}
      aria-label="${words}: ${name}"
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
    this.submitting = true;
    for (const entry of this.ready) {
      try {
        entry.job = await this.context.api.submit({
          mesh_id: entry.mesh.id,
          preset: this.preset,
          name: entry.file.name.replace(/\.\w+$/, '').slice(0, 120),
          tags: [this.tag],
        });
      } catch (thrown) {
        entry.problem = asProblem(thrown);
      }
      this.context.refresh();
    }
    this.submitting = false;
    void this.context.jobs.load();
    this.look();
  }

  /** Look after the runs until all have ended. */
  private look(): void {
    clearTimeout(this.timer);
    this.context.refresh();
    if (this.closed || this.entries.every(({ job }) => job?.done ?? true)) return;
    this.timer = setTimeout(() => {
      void this.news();
    }, LOOK_MS);
  }

  private async news(): Promise<void> {
    try {
      const { items } = await this.context.api.jobs({ tag: this.tag }, MOST_FILES);
      const found = new Map(items.map((job) => [job.id, job]));
      for (const entry of this.entries) entry.job = found.get(entry.job?.id ?? '') ?? entry.job;
    } catch {
      // the page says elsewhere that nothing answers, and this is tried again
    }
    this.look();
  }
}
