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

/** The figures of a run against its iterations; a click goes there. */
export class Chart {
  readonly element = document.createElement('div');
  private readonly canvas = document.createElement('div');
  private readonly head = document.createElement('div');
  private readonly sizes: ResizeObserver;
  private readonly offTheme: () => void;
  private plot: uPlot | null = null;
  private chosen = 0;
  private rows: readonly Row[] = [];
  private scale: Scale | null = null;
  private at = 0;
  private moved = false; // the scale, since the axes were drawn

  constructor(private readonly seek: (iteration: number) => void) {
    this.element.className = 'chart';
    this.canvas.className = 'plot';
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
    this.moved ||= !same;
    if (this.plot === null) this.build();
    else this.plot.setData(this.columns());
  }

  /** Mark where one stands, and write other iterations below once the scale is another: its places stay 0 to 1. */
  stand(iteration: number): void {
    this.at = iteration;
    this.plot?.redraw(false, this.moved); // drawn a little later, and the last call decides on the axes
  }

  dispose(): void {
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
          draw: [
            (plot) => {
              this.moved = false;
              this.mark(plot);
            },
          ],
          ready: [
            (plot) => {
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

  private mark(plot: uPlot): void {
    const { ctx, bbox } = plot;
    if (!this.scale) return;
    const x = Math.round(plot.valToPos(this.scale.place(this.at), 'x', true));
    ctx.save();
    ctx.strokeStyle = cssColour('--ink');
    ctx.lineWidth = devicePixelRatio;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.restore();
  }

  private listen(plot: uPlot): void {
    plot.over.addEventListener('click', (event) => {
      if (this.scale) this.seek(this.scale.iteration(plot.posToVal(event.offsetX, 'x')));
    });
  }
}
