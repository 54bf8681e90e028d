import { html, nothing, type TemplateResult } from 'lit-html';
import { repeat } from 'lit-html/directives/repeat.js';
import type { JobRequest } from '../api/client';
import { asProblem } from '../api/problem';
import type { Job } from '../api/types';
import { ago } from '../core/format';
import { formatRoute, type Look, type Route, type Shown } from '../core/route';
import { curl, python, requestOf } from '../core/snippets';
import { Chart } from '../ui/chart';
import { copy } from '../ui/clipboard';
import { downloads } from '../ui/downloads';
import { icon, type IconName } from '../ui/icons';
import { lookKeys, standKeys, type Keys } from '../ui/keys';
import { legend, lookBar } from '../ui/look';
import { problemCard, wayHome } from '../ui/problem';
import { statusCard } from '../ui/status';
import type { Context, View } from './context';
import { attempt, cancellable, remove } from './deeds';
import { over, stageNotes } from './notes';
import { Stage } from './stage';
import { tagsOf } from './up';

const MOST_OTHERS = 30;

/** A run: the mesh as it changes, its timeline, its figures, and what can be done with it. */
export class JobView implements View {
  private readonly stage: Stage;
  private readonly chart: Chart;
  private busy = false;
  private tab: 'look' | 'figures' = 'look';

  constructor(
    private readonly context: Context,
    shown: Shown,
    look: Look,
  ) {
    this.stage = new Stage(context, shown.job, shown.iteration, look);
    this.chart = new Chart((iteration) => {
      this.stage.seek(iteration);
    });
    this.stage.onChange(() => {
      this.news();
    });
    this.stage.viewer.onRest = () => {
      this.address();
    };
  }

  get title(): string {
    const { state, problem } = this.stage.run;
    return state?.job.name ?? problem?.title ?? '';
  }

  render(): TemplateResult {
    const { run } = this.stage;
    if (!run.state && run.problem)
      return html`<div class="middle">
        ${problemCard(run.problem, run.problem.passing ? () => void run.open() : null, wayHome())}
      </div>`;
    return html`<div class="work with-timeline" data-tab=${this.tab}>
      <div class="stage">
        ${this.stage.viewer.element} ${over(stageNotes(this.stage))}
        <div class="corner">${lookBar(this.stage)}</div>
        ${legend(this.stage)}
      </div>
      ${this.stage.timeline.element}
      <div class="tabs" role="group" aria-label="Show">
        ${this.tabButton('look', 'Picture')} ${this.tabButton('figures', 'Figures and downloads')}
      </div>
      <aside class="panel" aria-label="Run">${run.state ? this.panel(run.state.job) : waiting()}</aside>
    </div>`;
  }

  key(event: KeyboardEvent): boolean {
    const { stage } = this;
    const keys: Keys = {
      ...standKeys(stage),
      ...lookKeys(stage),
      l: () => {
        stage.player.loop = !stage.player.loop;
        stage.setScale(stage.scale.kind);
      },
      '[': () => {
        stage.player.faster(-1);
        stage.setScale(stage.scale.kind);
      },
      ']': () => {
        stage.player.faster(1);
        stage.setScale(stage.scale.kind);
      },
      g: () => {
        stage.setScale(stage.scale.kind === 'log' ? 'linear' : 'log');
      },
    };
    const act = keys[event.key];
    act?.();
    return act !== undefined;
  }

  close(): void {
    this.context.thumbnails.hold = false;
    this.chart.dispose();
    this.stage.close();
  }

  private news(): void {
    const { state } = this.stage.run;
    if (state) this.chart.data(state.rows, this.stage.scale);
    this.context.thumbnails.hold = this.stage.coming || this.stage.player.playing;
    this.chart.stand(this.stage.at);
    this.address();
    this.context.refresh();
  }

  /** Keep the address up to date, so that it can be shared at any moment. */
  private address(): void {
    if (this.stage.player.playing) return;
    this.context.go(this.route, true);
  }

  private get route(): Route {
    const { stage } = this;
    const iteration = stage.following ? null : Math.round(stage.at);
    return { view: 'job', shown: { job: stage.job, iteration }, look: stage.look };
  }

  private panel(job: Job): TemplateResult {
    const { stage, context } = this;
    const rows = stage.run.state?.rows ?? [];
    return html`${statusCard(job, rows, stage.at, stage.run.connection)} ${this.actions(job)}
      <section class="card" aria-label="Chart">${this.chart.element}</section>
      ${downloads(job, stage.state, stage.color, () => void this.picture())}
      <section class="card" aria-label="Share">
        <h2>Share</h2>
        <div class="actions pairs">
          ${this.button('link', 'Copy link', () => void this.copied(new URL(formatRoute(this.route), location.href).href, 'Link copied'))}
          ${this.button('copy', 'curl', () => void this.copied(curl(location.origin, this.request(job)), 'Copied as curl'))}
          ${this.button('copy', 'Python', () => void this.copied(python(location.origin, this.request(job)), 'Copied as Python'))}
          ${this.button('copy', 'Embed', () => void this.copied(this.frame(), 'Copied as HTML'))}
        </div>
        <p class="hint">The link opens this state, camera and colouring.</p>
      </section>
      ${stage.problem && !stage.problem.passing ? problemCard(stage.problem, null) : nothing}
      ${stage.states.length === 0 ? nothing : this.compareWith(context.jobs.jobs.filter((other) => other.id !== job.id))}`;
  }

  private request(job: Job): JobRequest {
    const defaults = this.context.catalogue.parameters?.defaults[job.preset] ?? null;
    return requestOf(job, defaults, tagsOf(this.stage.viewer.camera.up));
  }

  private actions(job: Job): TemplateResult {
    const { api } = this.context;
    const able = !this.busy;
    return html`<div class="actions bar">
      ${cancellable(job) ? this.button('stop', 'Cancel', () => void this.act(() => api.cancel(job.id)), able) : nothing}
      ${'extend' in job.links ? this.button('play', 'Go on', () => void this.go(() => api.extend(job.id, job.progress.iterations_total)), able, 'As many iterations again, from where it ended') : nothing}
      ${'retry' in job.links ? this.button('reset', 'Run again', () => void this.go(() => api.retry(job.id)), able, 'The same run once more') : nothing}
      ${this.button(
        'more',
        'New run',
        () => {
          this.prepare(job.mesh_id);
        },
        true,
        'Another run of the same mesh',
      )}
      ${this.stage.states.length > 0 ? this.button('branch', 'From here', () => void this.branch(job), able, `A new run that begins with iteration ${this.stage.state}`) : nothing}
      ${job.done ? this.button('trash', 'Delete', () => void this.remove(job), able) : nothing}
    </div>`;
  }

  private button(name: IconName, words: string, act: () => void, able = true, more = ''): TemplateResult {
    return html`<button class="plain" title=${more || nothing} ?disabled=${!able} @click=${act}>
      ${icon(name)} ${words}
    </button>`;
  }

  private tabButton(tab: 'look' | 'figures', words: string): TemplateResult {
    return html`<button
      class="chip"
      aria-pressed=${this.tab === tab ? 'true' : 'false'}
      @click=${() => {
        this.tab = tab;
        this.context.refresh();
      }}
    >
      ${words}
    </button>`;
  }

  private compareWith(others: readonly Job[]): TemplateResult {
    const { stage } = this;
    const open = (right: Shown): void => {
      const left = { job: stage.job, iteration: stage.following ? null : stage.state };
      this.context.go({ view: 'compare', left, right, look: stage.look });
    };
    return html`<section class="card" aria-label="Compare">
      <h2>Compare</h2>
      <div class="actions">
        ${
          stage.state > 0
            ? this.button('compare', 'With its beginning', () => {
                open({ job: stage.job, iteration: 0 });
              })
            : this.button('compare', 'With its end', () => {
                open({ job: stage.job, iteration: null });
              })
        }
      </div>
      ${others.length > 0 ? this.another(others.slice(0, MOST_OTHERS), open) : nothing}
    </section>`;
  }

  /** The other runs, and a button: a list that goes on by itself cannot be gone through by keys. */
  private another(others: readonly Job[], open: (right: Shown) => void): TemplateResult {
    return html`<form
      class="with-button"
      @submit=${(event: SubmitEvent) => {
        event.preventDefault();
        const list = (event.target as HTMLFormElement).elements.namedItem('other') as HTMLSelectElement;
        open({ job: list.value, iteration: null });
      }}
    >
      <select name="other" aria-label="Another run">
        ${repeat(
          others,
          (other) => other.id, // so that what is chosen stays so when a new run comes before it
          (other) =>
            html`<option value=${other.id}>
              ${other.name} · ${other.preset} · ${ago(other.created_at)}
            </option>`,
        )}
      </select>
      <button class="plain" type="submit" title="Compare with this run">${icon('compare')} Compare</button>
    </form>`;
  }

  private frame(): string {
    const source = new URL(formatRoute(this.route, '/embed'), location.href).href.replaceAll('&', '&amp;');
    return `<iframe src="${source}" width="640" height="480" title="A mesh becomes a sphere"></iframe>`;
  }

  private async copied(text: string, said: string): Promise<void> {
    if (await copy(text)) this.context.toast(said);
    else this.context.toast('The browser does not let this page copy', 'bad');
  }

  private async picture(): Promise<void> {
    let blob: Blob;
    try {
      blob = await this.stage.viewer.picture();
    } catch (thrown) {
      this.context.toast(asProblem(thrown).detail, 'bad');
      return;
    }
    const link = document.createElement('a');
    link.href = URL.createObjectURL(blob);
    link.download = `${this.title}_it${String(Math.round(this.stage.at)).padStart(5, '0')}.png`;
    link.click();
    URL.revokeObjectURL(link.href);
  }

  private async act(ask: () => Promise<unknown>): Promise<boolean> {
    this.busy = true;
    this.context.refresh();
    const well = await attempt(this.context, ask);
    this.busy = false;
    this.context.refresh();
    return well;
  }

  /** Go to the form of a new run. */
  private prepare(mesh: string): void {
    const { up } = this.stage.viewer.camera;
    this.context.go({ view: 'mesh', mesh, up, name: null });
  }

  /** Let a new run begin with the state that is shown, which becomes a mesh of its own. */
  private async branch(job: Job): Promise<void> {
    await this.act(async () => {
      const { id } = await this.context.api.meshOf(job.id, this.stage.state);
      this.prepare(id);
    });
  }

  /** Have a new job made, and go to it. */
  private async go(ask: () => Promise<Job>): Promise<void> {
    await this.act(async () => {
      const { id } = await ask();
      const look = this.stage.look;
      this.context.go({ view: 'job', shown: { job: id, iteration: null }, look });
    });
  }

  private async remove(job: Job): Promise<void> {
    if (await remove(this.context, job)) this.context.go({ view: 'home' });
  }
}

function waiting(): TemplateResult {
  return html`<section class="card" aria-busy="true">
    <span class="ghost line"></span><span class="ghost line"></span>
  </section>`;
}
