import { figure, fixed } from './format';

/** The upright axis of a chart. */
export interface Axis {
  readonly low: number;
  readonly high: number;
  /** Round values within, ascending. */
  readonly ticks: readonly number[];
  /** Write one with as many digits as tell it from the others, the same number for all. */
  readonly write: (tick: number) => string;
  /** Where a value lies, from 0 at the lowest to 1 at the highest. */
  readonly place: (value: number) => number;
}

const ROOM = 0.06; // above and below, as a share of what lies between
const [LEAST_PLAIN, MOST_PLAIN] = [1e-3, 1e6]; // beyond them all labels are powers of ten
const SAME = 1e-12; // values that differ by less, as a share of their size, differ by rounding alone

/** Return an axis for values from `least` to `most`, with some `count` round ones to write beside it. */
export function axisOf(least: number, most: number, count = 4): Axis {
  const size = Math.max(Math.abs(least), Math.abs(most));
  const width = most - least > SAME * size ? most - least : 0.1 * size || 1;
  const [middle, half] = [least + (most - least) / 2, (0.5 + ROOM) * width];
  const [low, high] = [middle - half, middle + half];
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = ([1, 2, 5].find((factor) => factor * power >= rough * 0.75) ?? 10) * power;
  const ticks = [];
  const [begin, end] = [Math.ceil(low / step), Math.floor(high / step)];
  for (let n = begin; n <= end; n++) ticks.push(n * step);
  const largest = Math.max(Math.abs(low), Math.abs(high));
  const finest = Math.floor(Math.log10(step * (1 + SAME)));
  const digits = Math.floor(Math.log10(largest)) - finest + 1;
  const plain = largest >= LEAST_PLAIN && largest < MOST_PLAIN;
  return {
    low,
    high,
    ticks,
    // `figure` writes a power of ten with one digit less
    write: (tick) => (plain ? fixed(tick, Math.max(0, -finest)) : figure(tick, digits + 1)),
    place: (value) => (value - low) / (high - low),
  };
}
