import { html, type TemplateResult } from 'lit-html';
import { share } from '../core/format';
import { figuresAt } from '../core/job';
import type { Look, Route, Shown } from '../core/route';
import { icon } from '../ui/icons';
import { legend, lookBar } from '../ui/look';
import { problemCard } from '../ui/problem';
import type { Context, View } from './context';
import { stageNotes } from './notes';
import { Stage } from './stage';

/** Two states side by side, of one job or of two, seen by one camera. */
export class CompareView implements View {
  readonly title = 'Compare';
  private readonly stages: readonly [Stage, Stage];

  constructor(
    private readonly context: Context,
    left: Shown,
    right: Shown,
    look: Look,
  ) {
    const stage = (shown: Shown): Stage => new Stage(context, shown.job, shown.iteration, look, true);
    this.stages = [stage(left), stage(right)];
    for (const [one, other] of [this.stages, [this.stages[1], this.stages[0]]] as const) {
      one.beside = other;
      one.onChange(() => {
        this.address();
        this.context.refresh();
      });
      one.viewer.onMove = (view) => {
        other.viewer.look(view);
      };
      one.viewer.onRest = () => {
        this.address();
      };
    }
  }

  render(): TemplateResult {
    const both = (act: (stage: Stage) => void): void => {
      this.stages.forEach(act);
    };
    const [first] = this.stages;
    // one bar for both: what it changes, it changes on either side
    const bar = lookBar({
      color: first.color,
      wire: first.wire,
      facets: first.facets,
      range: null,
      viewer: first.viewer,
      setColor: (color) => {
        both((stage) => {
          stage.setColor(color);
        });
      },
      setWire: (wire) => {
        both((stage) => {
          stage.setWire(wire);
        });
      },
      setFacets: (facets) => {
        both((stage) => {
          stage.setFacets(facets);
        });
      },
      setUp: (up) => {
        both((stage) => {
          stage.setUp(up);
        });
      },
    });
    return html`<div class="compare">
      <div class="corner">${bar}</div>
      ${this.stages.map((stage, i) => this.pane(stage, i))}
    </div>`;
  }

  key(event: KeyboardEvent): boolean {
    if (event.key !== ' ') return false;
    const playing = this.stages.some((stage) => stage.player.playing);
    for (const stage of this.stages) if (stage.player.playing === playing) stage.toggle();
    return true;
  }

  close(): void {
    for (const stage of this.stages) stage.close();
  }

  private pane(stage: Stage, index: number): TemplateResult {
    const { run } = stage;
    const row = figuresAt(run.state?.rows ?? [], stage.at);
    if (!run.state && run.problem)
      return html`<section class="pane middle">${problemCard(run.problem, null)}</section>`;
    return html`<section class="pane" aria-label=${index === 0 ? 'Left' : 'Right'}>
      <header>
        <h2>${run.state?.job.name ?? '…'}</h2>
        <span class="hint">${run.state?.job.preset ?? ''} · Ψ ${share(row?.sphericity)}</span>
        <button
          class="plain small"
          @click=${() => {
            this.context.go({ view: 'job', shown: shownOn(stage), look: stage.look });
          }}
        >
          ${icon('link')} Open
        </button>
      </header>
      <div class="stage">
        ${stage.viewer.element}
        <div class="over">${stageNotes(stage)}</div>
        ${legend(stage)}
      </div>
      ${stage.timeline.element}
    </section>`;
  }

  private address(): void {
    const [left, right] = this.stages;
    if (left.player.playing || right.player.playing) return;
    const route: Route = { view: 'compare', left: shownOn(left), right: shownOn(right), look: left.look };
    this.context.go(route, true);
  }
}

function shownOn(stage: Stage): Shown {
  return { job: stage.job, iteration: stage.following ? null : Math.round(stage.at) };
}
