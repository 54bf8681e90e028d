import { html, render, type TemplateResult } from 'lit-html';
import type { Row } from '../api/types';
import { count } from '../core/format';
import type { Player } from '../core/player';
import { scaleOf, ticks, type Between, type Scale, type ScaleKind } from '../core/scale';
import { icon } from './icons';
import { standKeys } from './keys';
import { at } from './place';

export interface TimelineEvents {
  readonly seek: (iteration: number) => void;
  readonly step: (direction: 1 | -1) => void;
  readonly toggle: () => void;
  readonly scale: (kind: ScaleKind) => void;
}

/** A slider goes by either pair of arrows. */
const UPRIGHT: Readonly<Record<string, string>> = { ArrowDown: 'ArrowLeft', ArrowUp: 'ArrowRight' };
const WIDTH = 1000;
const HEIGHT = 44;

/** The whole run from left to right: its sphericity as a hill, a mark for each kept state, and where one stands. */
export class Timeline {
  readonly element = document.createElement('section');
  private scale: Scale = scaleOf('log', 1);
  private states: readonly number[] = [];
  private rows: readonly Row[] = [];
  private at = 0;
  private place: Between = { before: 0, after: 0, blend: 0 };
  private busy = false;
  private reached = 0;
  private width = 800; // as it was last told: asking would lay the page out anew in every frame
  /** The hill and the marks: made when they change, not in every frame. */
  private outline: { hill: string; marks: string } | null = null;

  constructor(
    private readonly player: Player,
    private readonly events: TimelineEvents,
    private readonly small = false,
  ) {
    this.element.className = small ? 'timeline small' : 'timeline';
    this.element.setAttribute('aria-label', 'Timeline');
    new ResizeObserver(() => {
      this.width = this.element.clientWidth;
      this.draw();
    }).observe(this.element);
    this.draw();
  }

  /** Take what is known of the run. */
  data(states: readonly number[], rows: readonly Row[], scale: Scale, reached: number): void {
    const same = this.states === states && this.rows === rows && this.reached === reached;
    if (same && scale.kind === this.scale.kind && scale.last === this.scale.last) return;
    [this.states, this.rows, this.scale, this.reached] = [states, rows, scale, reached];
    this.outline = null;
    this.draw();
  }

  /** Stand somewhere; `busy` while what belongs there is on its way. */
  stand(at: number, place: Between, busy: boolean): void {
    [this.at, this.place, this.busy] = [at, place, busy];
    this.draw();
  }

  private draw(): void {
    render(html`${this.transport()}${this.track()}`, this.element);
    this.element.style.setProperty('--at', String(this.scale.place(this.at)));
    this.element.style.setProperty('--reached', String(this.scale.place(this.reached)));
  }

  private transport(): TemplateResult {
    const { player, events } = this;
    const button = (name: Parameters<typeof icon>[0], label: string, act: () => void): TemplateResult =>
      html`<button class="tool" title=${label} aria-label=${label} @click=${act}>${icon(name)}</button>`;
    const ends = html`${button('first', 'To the beginning (Home)', () => {
      events.seek(0);
    })}
    ${button('previous', 'One state back (left arrow)', () => {
      events.step(-1);
    })}`;
    const playing = player.playing;
    return html`<div class="transport">
      <div class="buttons">
        ${this.small ? '' : ends}
        <button
          class="tool play"
          title="${playing ? 'Pause' : 'Play'} (space)"
          aria-label=${playing ? 'Pause' : 'Play'}
          @click=${() => {
            events.toggle();
          }}
        >
          ${icon(playing ? 'pause' : 'play')}
        </button>
        ${
          this.small
            ? ''
            : html`${button('next', 'One state on (right arrow)', () => {
                events.step(1);
              })}
              ${button('last', 'To the end (End)', () => {
                events.seek(this.states.at(-1) ?? 0);
              })}`
        }
      </div>
      <p class="readout"><b>${count(this.at)}</b> <span>${this.where()}</span></p>
      ${this.small ? '' : this.settings()}
    </div>`;
  }

  private where(): string {
    const { before, after, blend } = this.place;
    if (this.states.length === 0) return ''; // it has not begun
    if (this.busy) return 'loading …';
    if (blend > 0) return `between ${count(before)} and ${count(after)}, interpolated`;
    // what lies ahead of a run that goes on is room to draw in, not a number of iterations
    return this.reached < this.scale.last
      ? `of ${count(this.reached)} iterations so far`
      : `of ${count(this.scale.last)} iterations`;
  }

  private settings(): TemplateResult {
    const { player, events, scale } = this;
    return html`<div class="buttons end">
      <button
        class="tool"
        aria-pressed=${player.loop ? 'true' : 'false'}
        title="Loop (L)"
        aria-label="Loop"
        @click=${() => {
          player.loop = !player.loop;
          this.draw();
        }}
      >
        ${icon('loop')}
      </button>
      <button
        class="tool word"
        title="Speed ([ and ])"
        aria-label="Speed ${player.speed}×"
        @click=${() => {
          if (player.speed === 4) player.speed = 0.25;
          else player.faster(1);
          this.draw();
        }}
      >
        ${player.speed}×
      </button>
      <button
        class="tool word"
        title="Spread early iterations, or all alike (G)"
        aria-label="Scale: ${scale.kind === 'log' ? 'log' : 'linear'}"
        @click=${() => {
          events.scale(scale.kind === 'log' ? 'linear' : 'log');
        }}
      >
        ${scale.kind === 'log' ? 'log' : 'linear'}
      </button>
    </div>`;
  }

  private track(): TemplateResult {
    const { scale, place } = this;
    const { hill, marks } = (this.outline ??= { hill: this.hill(), marks: this.marks() });
    const text =
      place.blend > 0
        ? `iteration ${Math.round(this.at)}, interpolated between ${place.before} and ${place.after}`
        : `iteration ${Math.round(this.at)}`;
    return html`<div
      class="track"
      role="slider"
      tabindex="0"
      aria-label="Iteration"
      aria-valuemin="0"
      aria-valuemax=${Math.round(scale.last)}
      aria-valuenow=${Math.round(this.at)}
      aria-valuetext=${text}
      @pointerdown=${this.press}
      @pointermove=${this.drag}
      @keydown=${this.key}
    >
      <svg viewBox="0 0 ${WIDTH} ${HEIGHT}" preserveAspectRatio="none" aria-hidden="true">
        <path class="hill" d=${hill} />
        <path class="mark" d=${marks} />
      </svg>
      <div class="reached"></div>
      <div class="head"></div>
      ${this.small ? '' : html`<div class="ticks" aria-hidden="true">${this.ticks()}</div>`}
    </div>`;
  }

  private ticks(): TemplateResult[] {
    const many = Math.max(3, Math.floor(this.width / 110));
    return ticks(this.scale, many).map(
      (tick) => html`<span ${at(this.scale.place(tick))}>${count(tick)}</span>`,
    );
  }

  private marks(): string {
    const { scale } = this;
    return this.states.map((state) => `M${(scale.place(state) * WIDTH).toFixed(1)} 34V${HEIGHT}`).join('');
  }

  /** The sphericity so far, from the lowest that was to 1. */
  private hill(): string {
    const { rows, scale } = this;
    const values = rows.map((row) => row.sphericity ?? NaN).filter(Number.isFinite);
    if (values.length < 2) return '';
    const low = Math.min(...values);
    const step = Math.max(1, Math.floor(rows.length / 400));
    let path = '';
    let last = 0;
    rows.forEach((row, i) => {
      if (typeof row.sphericity !== 'number' || (i % step !== 0 && i !== rows.length - 1)) return;
      last = scale.place(row.iteration) * WIDTH;
      const height = 30 - 26 * ((row.sphericity - low) / Math.max(1 - low, 1e-9));
      path += `${path === '' ? `M${last.toFixed(1)} 34L` : 'L'}${last.toFixed(1)} ${height.toFixed(1)}`;
    });
    return `${path}L${last.toFixed(1)} 34Z`;
  }

  private readonly press = (event: PointerEvent): void => {
    if (event.button !== 0) return;
    const track = event.currentTarget as HTMLElement;
    track.setPointerCapture(event.pointerId);
    track.focus({ preventScroll: true });
    this.go(event);
  };

  private readonly drag = (event: PointerEvent): void => {
    if (event.buttons & 1) this.go(event);
  };

  private readonly key = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { seek, step, toggle } = this.events;
    const keys = standKeys({ states: this.states, seek, step, toggle });
    const act = keys[UPRIGHT[event.key] ?? event.key];
    if (!act) return;
    event.preventDefault(); // and so it is not the view's any more
    act();
  };

  /** Go where the pointer is, and exactly to a kept state that is near. */
  private go(event: PointerEvent): void {
    const box = (event.currentTarget as HTMLElement).getBoundingClientRect();
    const place = (event.clientX - box.left) / box.width;
    const near = this.states.find((state) => Math.abs(this.scale.place(state) - place) * box.width < 5);
    this.events.seek(near ?? this.scale.iteration(place));
  }
}
