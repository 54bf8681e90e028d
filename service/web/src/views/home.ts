import { html, nothing, type TemplateResult } from 'lit-html';
import { asProblem } from '../api/problem';
import type { Job } from '../api/types';
import { count, share } from '../core/format';
import { PLAIN } from '../core/route';
import { dropZone } from '../ui/dropzone';
import { idle, painted } from '../ui/painted';
import { reducedMotion } from '../ui/theme';
import { warm } from '../viewer/easels';
import type { Context, View } from './context';
import type { Stage } from './stage';
import { upOf } from './up';

export const GALLERY = 'gallery';

/** The first page: drop a mesh, or look at the shapes of the paper. */
export class HomeView implements View {
  readonly title = 'Spherify';
  readonly headed = true;
  private stage: Stage | null = null;
  private gallery: readonly Job[] = [];
  private looked = false;
  /** Ends listening to the list of runs. */
  private readonly deaf: () => void;
  private loading = false;
  private closed = false;
  private choice = false; // somebody is choosing a file
  private resting = false; // it played until somebody began to choose a file
  private building: string | null = null;

  constructor(private readonly context: Context) {
    this.deaf = context.jobs.onChange(() => {
      if (!this.whole) void this.load(); // the list is asked for again and again, and rests while nobody looks
    });
    void this.load();
    void this.prepare();
  }

  render(): TemplateResult {
    return html`<div class="home">
      <section class="hero">
        <div class="words">
          <h1 tabindex="-1">See a mesh become a sphere</h1>
          <p class="lead">
            Drop a closed triangle mesh. The curvature transformation rounds it, step by step, and every state
            on the way is yours: to watch, to compare, to download.
          </p>
          ${dropZone(this.context)} ${this.samples()}
        </div>
        <div class="show">${this.show()} ${this.caption()}</div>
      </section>
      ${this.shapes()}
    </div>`;
  }

  choosing(begun: boolean): void {
    this.context.thumbnails.hold = this.choice = begun;
    if (!begun && !this.stage) void this.load();
    if (begun ? this.stage?.player.playing : this.resting) {
      this.stage?.toggle();
      this.resting = begun;
    }
  }

  close(): void {
    this.closed = true;
    this.context.thumbnails.hold = false;
    this.deaf();
    this.stage?.close();
  }

  /** The star of the gallery, or its place as long as there may be one. */
  private show(): HTMLElement | TemplateResult | typeof nothing {
    if (this.stage) return this.stage.viewer.element;
    return this.gallery.length > 0 || !this.looked ? html`<div class="viewer expecting"></div>` : nothing;
  }

  private caption(): TemplateResult | typeof nothing {
    const { stage } = this;
    if (!stage?.run.state) return nothing;
    const { job } = stage.run.state;
    return html`<div class="caption">
      ${stage.timeline.element}
      <button
        class="plain small"
        @click=${() => {
          this.open(job);
        }}
      >
        Open this run
      </button>
    </div>`;
  }

  /** The shapes that the service builds, for those who have no mesh at hand. */
  private samples(): TemplateResult | typeof nothing {
    const { samples } = this.context.catalogue;
    if (samples.length === 0) return nothing;
    return html`<p class="samples" aria-label="Sample shapes">
      <span class="hint">No mesh at hand? Take</span>
      ${samples.map(
        (sample) =>
          html`<button
            class="chip"
            title=${sample.title}
            ?disabled=${this.building !== null}
            aria-busy=${this.building === sample.name ? 'true' : 'false'}
            @click=${() => void this.build(sample.name)}
          >
            ${title(sample.name)}
          </button>`,
      )}
    </p>`;
  }

  private async build(sample: string): Promise<void> {
    this.building = sample;
    this.context.refresh();
    try {
      const mesh = await this.context.api.sample(sample);
      const own = `${sample}.ply`;
      const name = mesh.name === own ? null : own; // the service keeps the first name of the same bytes
      this.context.go({ view: 'mesh', mesh: mesh.id, up: 'z', name });
    } catch (thrown) {
      this.context.toast(asProblem(thrown).detail, 'bad');
    }
    this.building = null;
    this.context.refresh();
  }

  private shapes(): TemplateResult {
    if (this.gallery.length === 0) return html``;
    return html`<section aria-labelledby="gallery">
      <h2 id="gallery">The paper's shapes</h2>
      <ul class="gallery">
        ${this.gallery.map((job) => this.card(job))}
      </ul>
    </section>`;
  }

  private card(job: Job): TemplateResult {
    const { thumbnails } = this.context;
    const up = upOf(job);
    const shown = job.snapshots.available.length > 0;
    const first = shown ? thumbnails.picture(job.id, 'initial', up) : null;
    const last = job.done && shown ? thumbnails.picture(job.id, 'final', up) : null;
    return html`<li>
      <button
        class="shape"
        @click=${() => {
          this.open(job);
        }}
      >
        <span class="pictures">
          ${first ? html`<img src=${first} alt="" />` : html`<span class="ghost"></span>`}
          ${last ? html`<img class="then" src=${last} alt="" />` : nothing}
        </span>
        <span class="name">${title(job.name)}</span>
        <span class="hint">
          ${job.done ? `Ψ ${share(job.metrics?.sphericity)} · ${count(job.progress.iteration)} iterations` : 'being made …'}
        </span>
      </button>
      <button
        class="plain small"
        aria-label="Use this mesh: ${title(job.name)}"
        @click=${() => {
          this.context.go({ view: 'mesh', mesh: job.mesh_id, up: upOf(job), name: null });
        }}
      >
        Use this mesh
      </button>
    </li>`;
  }

  private open(job: Job): void {
    const look = { ...PLAIN, up: upOf(job) };
    this.context.go({ view: 'job', shown: { job: job.id, iteration: job.done ? 0 : null }, look });
  }

  /** Fetch what the next step needs: a file that is dropped is drawn the sooner. */
  private async prepare(): Promise<void> {
    await painted();
    await idle();
    if (this.isClosed()) return;
    warm(roomOf(document.querySelector('main')));
    await import('./mesh').catch(() => undefined); // if it fails it is said when it is wanted
  }

  /** Whether each of the shapes has a run in the gallery, and all of them have ended; one is made after the other. */
  private get whole(): boolean {
    const named = new Set(this.gallery.map((job) => job.name));
    const { samples } = this.context.catalogue;
    return (
      samples.length > 0 &&
      samples.every(({ name }) => named.has(name)) &&
      this.gallery.every((job) => job.done)
    );
  }

  private async load(): Promise<void> {
    if (this.loading) return;
    this.loading = true;
    try {
      const { items } = await this.context.api.jobs({ tag: GALLERY }, 20);
      this.gallery = [...items].reverse();
    } catch {
      // the page says elsewhere that nothing answers, and this is tried again
    }
    this.loading = false;
    this.looked = true;
    if (this.closed) return;
    const star =
      this.gallery.find((job) => job.done && job.name === 'quadruped') ??
      this.gallery.find((job) => job.done);
    if (star && !this.stage && !this.choice) void this.play(star);
    this.context.refresh();
  }

  private isClosed(): boolean {
    return this.closed; // it may be closed while something is awaited
  }

  private async play(job: Job): Promise<void> {
    await painted(); // the words come first
    const code = await import('./stage').catch(() => null); // tried again with the next news of the list
    if (code === null || this.isClosed() || this.stage || this.choice) return;
    const camera = { azimuth: 0.75, elevation: 0.25, distance: 2.9, target: [0, 0, 0] as const };
    const stage = new code.Stage(this.context, job.id, 0, { ...PLAIN, up: upOf(job), camera }, true);
    stage.player.loop = true;
    stage.onChange(() => {
      this.context.refresh();
    });
    const begin = stage.onChange(() => {
      if (stage.triangles === 0) return;
      begin();
      if (reducedMotion()) return;
      if (this.choice) this.resting = true;
      else stage.toggle();
    });
    this.stage = stage;
  }
}

/** Return the size that the picture of a mesh will have beside its panel. */
function roomOf(main: HTMLElement | null): { width: number; height: number } {
  const { clientWidth, clientHeight } = main ?? document.body;
  const panel = parseFloat(getComputedStyle(main ?? document.body).getPropertyValue('--panel')) || 0;
  return { width: Math.max(clientWidth - panel, 1), height: Math.max(clientHeight, 1) };
}

/** Make a heading of a file's name. */
export function title(name: string): string {
  const words = name.replaceAll(/[-_]+/g, ' ');
  return words.charAt(0).toUpperCase() + words.slice(1);
}
