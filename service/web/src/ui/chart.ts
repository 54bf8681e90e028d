import { html, render } from 'lit-html';
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import type { Row } from '../api/types';
import { count, figure } from '../core/format';
import { MEANING } from '../core/meaning';
import { ticks, type Scale } from '../core/scale';
import { cssColour, onTheme } from './theme';

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

/** The figures of a run against its iterations; a click goes there. */
export class Chart {
  readonly element = document.createElement('div');
  private readonly canvas = document.createElement('div');
  private readonly mark = document.createElement('div');
  private readonly head = document.createElement('div');
  private readonly sizes: ResizeObserver;
  private readonly offTheme: () => void;
  private plot: uPlot | null = null;
  private chosen = 0;
  private rows: readonly Row[] = [];
  private scale: Scale | null = null;
  private at = 0;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly seek: (iteration: number) => void) {
    this.element.className = 'chart';
    this.canvas.className = 'plot';
    this.mark.className = 'here';
    this.element.append(this.head, this.canvas);
    this.sizes = new ResizeObserver(() => {
      this.plot?.setSize(this.size());
    });
    this.sizes.observe(this.canvas);
    this.offTheme = onTheme(() => {
      this.build();
    });
    this.choose(0);
  }

  data(rows: readonly Row[], scale: Scale): void {
    const same = scale.kind === this.scale?.kind && scale.last === this.scale.last;
    if (same && rows === this.rows) return;
    this.rows = rows;
    this.scale = scale;
    this.stand(this.at);
    if (this.plot === null) this.build();
    else this.timer ??= setTimeout(this.redraw, PAUSE_MS);
  }

  /** Mark where one stands. The mark is no part of the drawing, as it moves with every frame. */
  stand(iteration: number): void {
    this.at = iteration;
    const place = this.scale?.place(iteration) ?? 0;
    this.mark.style.left = `${100 * place}%`;
  }

  dispose(): void {
    clearTimeout(this.timer);
    this.sizes.disconnect();
    this.offTheme();
    this.plot?.destroy();
  }

  private choose(index: number): void {
    this.chosen = index;
    const chip = (series: Series, i: number): unknown =>
      html`<button
        class="chip"
        aria-pressed=${i === index ? 'true' : 'false'}
        title=${series.meaning}
        @click=${() => {
          this.choose(i);
        }}
      >
        ${series.title}
      </button>`;
    render(
      html`<div class="chips" role="group" aria-label="Figure">${SERIES.map(chip)}</div>
        <p class="hint">${SERIES[index]?.meaning}</p>`,
      this.head,
    );
    this.build();
  }

  /** Draw what is new, and write other iterations below: the scale's places stay 0 to 1. */
  private readonly redraw = (): void => {
    this.timer = undefined;
    this.plot?.setData(this.columns());
    this.plot?.redraw(false, true);
  };

  private columns(): uPlot.AlignedData {
    const { scale, rows } = this;
    const [first] = rows;
    const series = SERIES[this.chosen];
    if (!scale || !series || !first) return [[], []];
    return [rows.map((row) => scale.place(row.iteration)), rows.map((row) => series.of(row, first))];
  }

  private size(): { width: number; height: number } {
    return { width: Math.max(this.canvas.clientWidth, 120), height: 168 };
  }

  private build(): void {
    this.plot?.destroy();
    this.plot = null;
    const { scale } = this;
    const empty = this.rows.length < 2;
    this.canvas.classList.toggle('empty', empty);
    this.canvas.textContent = empty ? 'The curve begins with the second state.' : '';
    if (!scale || empty) return;
    const axis = {
      stroke: cssColour('--ink-soft'),
      font: '11px system-ui, sans-serif',
      grid: { stroke: cssColour('--line'), width: 1 },
      ticks: { show: false },
    };
    const accent = cssColour('--accent');
    this.plot = new uPlot(
      {
        ...this.size(),
        legend: { show: false },
        cursor: { y: false, points: { size: 7, fill: accent }, drag: { x: false, y: false } },
        scales: { x: { time: false, range: [0, 1] } },
        series: [{}, { stroke: accent, width: 2, points: { show: false }, spanGaps: true }],
        axes: [
          {
            ...axis,
            size: 24,
            gap: 4,
            splits: () => this.ticks().map(([place]) => place),
            values: () => this.ticks().map(([, tick]) => count(tick)),
          },
          { ...axis, size: 48, gap: 4, values: (_, values) => values.map((value) => figure(value, 3)) },
        ],
        hooks: {
          ready: [
            (plot) => {
              plot.over.append(this.mark);
              this.listen(plot);
            },
          ],
        },
      },
      this.columns(),
      this.canvas,
    );
  }

  /** Where to write which iteration. */
  private ticks(): [number, number][] {
    const { scale } = this;
    return scale === null ? [] : ticks(scale, 4).map((tick) => [scale.place(tick), tick]);
  }

  private listen(plot: uPlot): void {
    plot.over.addEventListener('click', (event) => {
      if (this.scale) this.seek(this.scale.iteration(plot.posToVal(event.offsetX, 'x')));
    });
  }
}
