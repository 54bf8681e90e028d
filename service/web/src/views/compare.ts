import { html, type TemplateResult } from 'lit-html';
import { share } from '../core/format';
import { figuresAt } from '../core/job';
import type { Look, Route, Shown } from '../core/route';
import { icon } from '../ui/icons';
import { lookKeys, standKeys, type Keys } from '../ui/keys';
import { legend, lookBar, type Looks } from '../ui/look';
import { problemCard, wayHome } from '../ui/problem';
import type { Context, View } from './context';
import { over, stageNotes } from './notes';
import { Stage } from './stage';

/** Two states side by side, of one job or of two, seen by one camera. */
export class CompareView implements View {
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

  get title(): string {
    const names = this.stages.flatMap(({ run }) => run.state?.job.name ?? run.problem?.title ?? []);
    if (names.length < 2) return '';
    return `Compare: ${[...new Set(names)].join(' and ')}`;
  }

  render(): TemplateResult {
    return html`<div class="compare">
      <div class="corner">${lookBar(this.looks)}</div>
      ${this.stages.map((stage, i) => this.pane(stage, i))}
    </div>`;
  }

  key(event: KeyboardEvent): boolean {
    const keys: Keys = { ...this.standing(), ...lookKeys(this.looks) };
    const act = keys[event.key];
    act?.();
    return act !== undefined;
  }

  close(): void {
    for (const stage of this.stages) stage.close();
  }

  /** One bar for both: what it changes, it changes on either side. */
  private get looks(): Looks {
    const [first] = this.stages;
    return {
      color: first.color,
      wire: first.wire,
      facets: first.facets,
      range: null,
      viewer: first.viewer,
      setColor: (color) => {
        this.stages.forEach((stage) => {
          stage.setColor(color);
        });
      },
      setWire: (wire) => {
        this.stages.forEach((stage) => {
          stage.setWire(wire);
        });
      },
      setFacets: (facets) => {
        this.stages.forEach((stage) => {
          stage.setFacets(facets);
        });
      },
      setUp: (up) => {
        this.stages.forEach((stage) => {
          stage.setUp(up);
        });
      },
    };
  }

  /** Keys for both sides at once; a timeline that has the focus takes its own. */
  private standing(): Keys {
    const [left, right] = this.stages;
    const playing = left.player.playing || right.player.playing;
    return standKeys({
      states: [Math.max(left.states.at(-1) ?? 0, right.states.at(-1) ?? 0)], // either goes to its own last one
      seek: (iteration) => {
        this.stages.forEach((stage) => {
          stage.seek(iteration);
        });
      },
      step: (direction) => {
        this.stages.forEach((stage) => {
          stage.step(direction);
        });
      },
      toggle: () => {
        this.stages.forEach((stage) => {
          if (stage.player.playing === playing) stage.toggle();
        });
      },
    });
  }

  private pane(stage: Stage, index: number): TemplateResult {
    const { run } = stage;
    const row = figuresAt(run.state?.rows ?? [], Math.round(stage.at));
    if (!run.state && run.problem)
      return html`<section class="pane middle">${problemCard(run.problem, null, wayHome())}</section>`;
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
      <div class="stage">${stage.viewer.element} ${over(stageNotes(stage))} ${legend(stage)}</div>
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
