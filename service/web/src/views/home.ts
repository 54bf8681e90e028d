import { html, nothing, type TemplateResult } from 'lit-html';
import type { Job } from '../api/types';
import { share } from '../core/format';
import { PLAIN } from '../core/route';
import { dropZone } from '../ui/dropzone';
import { reducedMotion } from '../ui/theme';
import type { Context, View } from './context';
import { Stage } from './stage';
import { upOf } from './up';

export const GALLERY = 'gallery';

/** The first page: drop a mesh, or look at the shapes of the paper. */
export class HomeView implements View {
  readonly title = 'Spherify';
  private stage: Stage | null = null;
  private gallery: readonly Job[] = [];
  private timer: ReturnType<typeof setTimeout> | undefined;
  private closed = false;

  constructor(private readonly context: Context) {
    void this.load();
  }

  render(): TemplateResult {
    return html`<div class="home">
      <section class="hero">
        <div class="words">
          <h1>See a mesh become a sphere</h1>
          <p class="lead">
            Drop a closed triangle mesh. The curvature transformation rounds it, step by step, and every state
            on the way is yours: to watch, to compare, to download.
          </p>
          ${dropZone(this.context)}
        </div>
        <div class="show">${this.stage ? this.stage.viewer.element : nothing} ${this.caption()}</div>
      </section>
      ${this.shapes()}
    </div>`;
  }

  close(): void {
    this.closed = true;
    clearTimeout(this.timer);
    this.stage?.close();
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
          ${job.done ? `Ψ ${share(job.metrics?.sphericity)} after ${job.progress.iteration}` : 'being made …'}
        </span>
      </button>
      <button
        class="plain small"
        aria-label="Use this mesh: ${title(job.name)}"
        @click=${() => {
          this.context.go({ view: 'mesh', mesh: job.mesh_id, up: upOf(job) });
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

  /** Look for the gallery until all of it is there. */
  private async load(): Promise<void> {
    try {
      const { items } = await this.context.api.jobs({ tag: GALLERY }, 20);
      this.gallery = [...items].reverse();
    } catch {
      this.gallery = []; // the page says elsewhere that nothing answers, and this is tried again
    }
    if (this.closed) return;
    const star =
      this.gallery.find((job) => job.done && job.name === 'quadruped') ??
      this.gallery.find((job) => job.done);
    if (star && !this.stage) this.play(star);
    if (this.gallery.length === 0 || this.gallery.some((job) => !job.done))
      this.timer = setTimeout(() => void this.load(), 2500);
    this.context.refresh();
  }

  private play(job: Job): void {
    const camera = { azimuth: 0.75, elevation: 0.25, distance: 2.9, target: [0, 0, 0] as const };
    const stage = new Stage(this.context, job.id, 0, { ...PLAIN, up: upOf(job), camera }, true);
    stage.player.loop = true;
    stage.onChange(() => {
      this.context.refresh();
    });
    const begin = stage.onChange(() => {
      if (stage.triangles === 0) return;
      begin();
      if (!reducedMotion()) stage.toggle();
    });
    this.stage = stage;
  }
}

/** Make a heading of a file's name. */
export function title(name: string): string {
  const words = name.replaceAll(/[-_]+/g, ' ');
  return words.charAt(0).toUpperCase() + words.slice(1);
}
