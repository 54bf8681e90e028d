/** Where an iteration lies on the timeline: from 0 at the first to 1 at the last, linear or logarithmic. */
export type ScaleKind = 'linear' | 'log';

export interface Scale {
  readonly kind: ScaleKind;
  readonly last: number;
  /** From an iteration, whole or between two, to its place in [0, 1]. */
  place(iteration: number): number;
  /** From a place to the iteration there. */
  iteration(place: number): number;
}

const clamp = (value: number, low: number, high: number): number => Math.min(Math.max(value, low), high);

/** Return the scale from iteration 0 to `last`; log is log(1 + n), so that 0 has a place. */
export function scaleOf(kind: ScaleKind, last: number): Scale {
  const end = Math.max(last, 1);
  if (kind === 'linear')
    return {
      kind,
      last: end,
      place: (iteration) => clamp(iteration / end, 0, 1),
      iteration: (place) => clamp(place, 0, 1) * end,
    };
  const width = Math.log1p(end);
  return {
    kind,
    last: end,
    place: (iteration) => clamp(Math.log1p(Math.max(iteration, 0)) / width, 0, 1),
    iteration: (place) => Math.expm1(clamp(place, 0, 1) * width),
  };
}

/** Where a place lies among kept states: the two around it, and how far it is from the first to the second. */
export interface Between {
  readonly before: number;
  readonly after: number;
  /** 0 at `before`, below 1; 0 if both are the same. */
  readonly blend: number;
}

/** Find the states around an iteration; `states` ascend and are not empty. */
export function between(states: readonly number[], iteration: number, scale: Scale): Between {
  const first = states[0] ?? 0;
  if (iteration <= first) return { before: first, after: first, blend: 0 };
  let low = 0;
  let high = states.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if ((states[middle] ?? 0) <= iteration) low = middle;
    else high = middle;
  }
  const before = states[low] ?? first;
  const after = states[low + 1] ?? before;
  if (after === before || iteration === before) return { before, after: before, blend: 0 };
  const [from, to] = [scale.place(before), scale.place(after)];
  return { before, after, blend: clamp((scale.place(iteration) - from) / (to - from), 0, 0.9999) };
}

/** Return the state nearest to an iteration on a scale. */
export function nearest(states: readonly number[], iteration: number, scale: Scale): number {
  const { before, after, blend } = between(states, iteration, scale);
  return blend < 0.5 ? before : after;
}

/** Return the next state in a direction, or the last one there. */
export function neighbour(states: readonly number[], iteration: number, direction: 1 | -1): number {
  if (direction > 0) return states.find((state) => state > iteration) ?? states.at(-1) ?? 0;
  return states.findLast((state) => state < iteration) ?? states[0] ?? 0;
}

/** Return round iterations to write under a scale, `count` of them or a few more or less. */
export function ticks(scale: Scale, count: number): number[] {
  if (scale.kind === 'log') {
    const found = [0];
    for (let decade = 1; decade < scale.last; decade *= 10)
      for (const factor of count > 8 ? [1, 2, 5] : [1])
        if (decade * factor < scale.last) found.push(decade * factor);
    return apart([...found, scale.last], scale, 0.7 / Math.max(count, 1));
  }
  const rough = scale.last / Math.max(count, 1);
  const power = 10 ** Math.floor(Math.log10(rough));
  const factor = [1, 2, 5, 10].find((candidate) => candidate * power >= rough) ?? 10;
  const step = Math.max(1, factor * power);
  const found: number[] = [];
  for (let tick = 0; tick < scale.last; tick += step) found.push(tick);
  return apart([...found, scale.last], scale, 0.5 / Math.max(count, 1));
}

/** Leave out ticks that lie too near to the one before, or to the last, which always stays. */
function apart(found: readonly number[], scale: Scale, gap: number): number[] {
  const end = found.at(-1) ?? 0;
  const kept: number[] = [];
  for (const tick of found.slice(0, -1)) {
    const place = scale.place(tick);
    const previous = kept.at(-1);
    if ((previous === undefined || place - scale.place(previous) >= gap) && 1 - place >= gap) kept.push(tick);
  }
  return [...kept, end];
}
