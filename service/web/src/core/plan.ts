/** Which states of a run are kept, as one writes it. The service answers with the list that it made of that. */

const MOST = 1000; // states of a run

/**
 * Return what to ask for so that these states, ascending from 0 to the last iteration, are kept again: `every:N` or
 * `log:N` where that is exactly the same, or else the iterations themselves, without the two ends that are kept anyway.
 */
export function planOf(states: readonly number[]): string {
  const last = states.at(-1) ?? 0;
  const inner = states.slice(1, -1);
  if (inner.length === 0) return `every:${Math.max(last, 1)}`;
  const [first = 1] = inner;
  if (same(states, evenly(first, last))) return `every:${first}`;
  for (let count = inner.length + 1; count <= MOST; count++) {
    const spread = geometric(count, last);
    if (same(states, spread)) return `log:${count}`;
    if (spread.length > states.length) break; // more only make it longer
  }
  return inner.join(',');
}

/** The states of `every:N`. */
function evenly(step: number, last: number): number[] {
  const states = [];
  for (let state = 0; state < last; state += step) states.push(state);
  return [...states, last];
}

/** The states of `log:N`: N of them from 1 to the last, in nearly constant ratio; fewer where they would repeat. */
function geometric(count: number, last: number): number[] {
  const ratio = count > 1 ? last ** (1 / (count - 1)) : last;
  const states = new Set([0]);
  for (let k = 0; k < count; k++) states.add(Math.min(Math.round(ratio ** k), last));
  return [...states.add(last)].sort((a, b) => a - b);
}

function same(one: readonly number[], other: readonly number[]): boolean {
  return one.length === other.length && one.every((state, i) => state === other[i]);
}
