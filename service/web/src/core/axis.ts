/** The upright axis of a chart. */
export interface Axis {
  readonly low: number;
  readonly high: number;
  /** Round values within, ascending, and how many significant digits tell them apart. */
  readonly ticks: readonly number[];
  readonly digits: number;
  /** Where a value lies, from 0 at the lowest to 1 at the highest. */
  readonly place: (value: number) => number;
}

const ROOM = 0.06; // above and below, as a share of what lies between

/** Return an axis for values from `least` to `most`, with some `count` round ones to write beside it. */
export function axisOf(least: number, most: number, count = 4): Axis {
  const width = most - least || Math.abs(most) || 1;
  const [low, high] = [least - ROOM * width, most + ROOM * width];
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = ([1, 2, 5].find((factor) => factor * power >= rough * 0.75) ?? 10) * power;
  const ticks = [];
  for (let n = Math.ceil(low / step); n * step <= high; n++) ticks.push(n * step);
  const largest = Math.max(Math.abs(low), Math.abs(high));
  return {
    low,
    high,
    ticks,
    digits: Math.floor(Math.log10(largest)) - Math.floor(Math.log10(step)) + 1,
    place: (value) => (value - low) / (high - low),
  };
}
