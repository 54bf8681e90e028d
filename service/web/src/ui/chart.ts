import { html, render, type TemplateResult } from 'lit-html';
import type { Row } from '../api/types';
import { axisOf, type Axis } from '../core/axis';
import { count, figure } from '../core/format';
import { figuresAt } from '../core/job';
import { MEANING } from '../core/meaning';
import { ticks, type Scale } from '../core/scale';
import { at, room } from './place';

interface Series {
  readonly title: string;
  readonly meaning: string;
  readonly of: (row: Row, first: Row) => number | null;
}

const number = (value: number | null | undefined): number | null => value ?? null;
const SERIES: readonly Series[] = [
  { title: 'Sphericity', meaning: MEANING.sphericity, of: (row) => number(row.sphericity) },
  {
    title: 'Variation',
    meaning: 'of the radius: standard deviation over mean, 0 for a sphere',
    of: (row) => number(row.radius_variation),
  },
  {
    title: 'Volume',
    meaning: 'as a share of the volume at iteration 0',
    of: (row, first) => (typeof row.volume === 'number' && first.volume ? row.volume / first.volume : null),
  },
  { title: 'Step', meaning: 'the length C in use, in units of the file', of: (row) => number(row.step) },
];

const PAUSE_MS = 300; // between two drawings of a run that goes on
const SIDE = 1000; // of the drawing, which is stretched to its place

/**
 * The figures of a run against its iterations; a click goes there. Drawn as SVG: a canvas would have the page's own
 * thread wait for the graphics card, half a second and more at the first one.
 */
export class Chart {
  readonly element = document.createElement('div');
  private chosen = 0;
  private rows: readonly Row[] = [];
  private axis: Axis | null = null;
  private scale: Scale | null = null;
  private timer: ReturnType<typeof setTimeout> | undefined;
  /** The iteration under the pointer; null if it is elsewhere. */
  private pointed: number | null = null;
  /** What is read off there. It is no part of the drawing either. */
  private readonly reading = document.createElement('div');

  constructor(private readonly seek: (iteration: number) => void) {
    this.element.className = 'chart';
    this.reading.className = 'reading';
    this.draw();
  }

  data(rows: readonly Row[], scale: Scale): void {
    const same = scale.kind === this.scale?.kind && scale.last === this.scale.last;
    if (same && rows === this.rows) return;
    const first = this.rows.length < 2;
    this.rows = rows;
    this.scale = scale;
    if (first) this.draw();
    else this.timer ??= setTimeout(this.draw, PAUSE_MS);
  }

  /** Mark where one stands. The mark is no part of the drawing, as it moves with every frame. */
  stand(iteration: number): void {
    this.element.style.setProperty('--at', String(this.scale?.place(iteration) ?? 0));
  }

  dispose(): void {
    clearTimeout(this.timer);
  }

  private readonly draw = (): void => {
    clearTimeout(this.timer);
    this.timer = undefined;
    const chip = (series: Series, i: number): TemplateResult =>
      html`<button
        class="chip"
        aria-pressed=${i === this.chosen ? 'true' : 'false'}
        title=${series.meaning}
        @click=${() => {
          this.chosen = i;
          this.draw();
        }}
      >
        ${series.title}
      </button>`;
    render(
      html`<div class="chips" role="group" aria-label="Figure">${SERIES.map(chip)}</div>
        <p class="hint">${SERIES[this.chosen]?.meaning}</p>
        ${this.plot()}`,
      this.element,
    );
    this.read();
  };

  private plot(): TemplateResult {
    const { scale, rows } = this;
    const [first] = rows;
    const series = SERIES[this.chosen];
    if (!scale || !series || !first || rows.length < 2)
      return html`<div class="plot empty">The curve begins with the second state.</div>`;
    const points = rows.flatMap((row) => {
      const value = series.of(row, first);
      return value === null ? [] : [{ place: scale.place(row.iteration), value }];
    });
    if (points.length === 0) return html`<div class="plot empty">This run has no such figure.</div>`;
    const values = points.map(({ value }) => value);
    const axis = (this.axis = axisOf(Math.min(...values), Math.max(...values)));
    const below = ticks(scale, 4);
    const line = points.map(
      ({ place, value }, i) => `${i === 0 ? 'M' : 'L'}${across(place)} ${down(axis, value)}`,
    );
    const grid = [
      ...axis.ticks.map((tick) => `M0 ${down(axis, tick)}H${SIDE}`),
      ...below.map((tick) => `M${across(scale.place(tick))} 0V${SIDE}`),
    ];
    const labels = axis.ticks.map((tick) => [axis.place(tick), axis.write(tick)] as const);
    return html`<div class="plot" ${room(Math.max(...labels.map(([, label]) => label.length)))}>
      <div
        class="area"
        @click=${this.press}
        @pointermove=${this.point}
        @pointerleave=${this.point}
        @pointercancel=${this.point}
      >
        <svg
          viewBox="0 0 ${SIDE} ${SIDE}"
          preserveAspectRatio="none"
          role="img"
          aria-label="${series.title} against iteration: ${figure(values[0], 4)} at first, ${figure(values.at(-1), 4)} at last"
        >
          <path class="grid" d=${grid.join('')} />
          <path class="curve" d=${line.join('')} />
        </svg>
        <div class="here"></div>
        ${this.reading}
      </div>
      <div class="up">${labels.map(([place, label]) => html`<span ${at(1 - place)}>${label}</span>`)}</div>
      <div class="along">
        ${below.map((tick) => html`<span ${at(scale.place(tick))}>${count(tick)}</span>`)}
      </div>
    </div>`;
  }

  private readonly press = (event: MouseEvent): void => {
    const iteration = this.under(event);
    if (iteration !== null) this.seek(iteration);
  };

  private readonly point = (event: PointerEvent): void => {
    this.pointed = event.type === 'pointermove' ? this.under(event) : null;
    this.read();
  };

  /** Return the iteration under the pointer. */
  private under(event: MouseEvent): number | null {
    const box = (event.currentTarget as HTMLElement).getBoundingClientRect();
    return this.scale?.iteration((event.clientX - box.left) / box.width) ?? null;
  }

  /** Draw a line under the pointer, the point of the curve there, and its figures. */
  private read(): void {
    const { scale, rows, pointed, reading } = this;
    const [first] = rows;
    const series = SERIES[this.chosen];
    const row = pointed === null ? null : figuresAt(rows, Math.round(pointed));
    const value = row && first && series ? series.of(row, first) : null;
    reading.hidden = value === null;
    if (!scale || !row || value === null) return;
    const place = scale.place(row.iteration);
    reading.classList.toggle('leftwards', place > 0.5);
    reading.style.setProperty('--over', String(place));
    reading.style.setProperty('--down', String(1 - (this.axis?.place(value) ?? 0)));
    render(html`<i></i><span><b>${figure(value, 5)}</b> at ${count(row.iteration)}</span>`, reading);
  }
}

function across(place: number): string {
  return (place * SIDE).toFixed(1);
}

function down(axis: Axis, value: number): string {
  return ((1 - axis.place(value)) * SIDE).toFixed(1);
}
