import type { Surface } from './types';

/** Where a surface is not a closed one, for drawing. */
export interface Faults {
  /** Both ends of every edge with one triangle, 6 numbers each. */
  readonly open: Float32Array<ArrayBuffer>;
  /** The same of every edge with more than two. */
  readonly crowded: Float32Array<ArrayBuffer>;
  /** The same of every edge whose two triangles look to different sides. */
  readonly turned: Float32Array<ArrayBuffer>;
  /** Triangles that do not belong to the largest part. */
  readonly strays: Uint32Array<ArrayBuffer>;
}

const BACK = 2 ** 26; // more than an edge has triangles

/** Find what is wrong with a welded surface. */
export function faultsOf({ positions, index }: Surface): Faults {
  const vertices = positions.length / 3;
  // an edge as one number, exact up to 9·10¹⁵; how often it is passed from its lesser end on, and how often back
  const uses = new Map<number, number>();
  const parent = Uint32Array.from({ length: vertices }, (_, v) => v);
  const root = (v: number): number => {
    let at = v;
    while ((parent[at] ?? at) !== at) {
      parent[at] = parent[parent[at] ?? at] ?? at;
      at = parent[at] ?? at;
    }
    return at;
  };
  for (let t = 0; t < index.length; t += 3) {
    for (let side = 0; side < 3; side++) {
      const a = index[t + side] ?? 0;
      const b = index[t + ((side + 1) % 3)] ?? 0;
      if (a === b) continue;
      const key = Math.min(a, b) * vertices + Math.max(a, b);
      uses.set(key, (uses.get(key) ?? 0) + (a < b ? 1 : BACK));
      parent[root(a)] = root(b);
    }
  }
  const open: number[] = [];
  const crowded: number[] = [];
  const turned: number[] = [];
  for (const [key, passed] of uses) {
    if (passed === 1 + BACK) continue;
    const count = (passed % BACK) + Math.floor(passed / BACK);
    const found = count === 1 ? open : count === 2 ? turned : crowded;
    const ends = [Math.floor(key / vertices), key % vertices];
    for (const v of ends) for (let axis = 0; axis < 3; axis++) found.push(positions[3 * v + axis] ?? 0);
  }
  return {
    open: Float32Array.from(open),
    crowded: Float32Array.from(crowded),
    turned: Float32Array.from(turned),
    strays: strays(index, root),
  };
}

function strays(index: Uint32Array, root: (v: number) => number): Uint32Array<ArrayBuffer> {
  const sizes = new Map<number, number>();
  for (let t = 0; t < index.length; t += 3) {
    const part = root(index[t] ?? 0);
    sizes.set(part, (sizes.get(part) ?? 0) + 1);
  }
  if (sizes.size < 2) return new Uint32Array();
  const [largest] = [...sizes].reduce((best, next) => (next[1] > best[1] ? next : best));
  const found: number[] = [];
  for (let t = 0; t < index.length; t += 3)
    if (root(index[t] ?? 0) !== largest) found.push(index[t] ?? 0, index[t + 1] ?? 0, index[t + 2] ?? 0);
  return Uint32Array.from(found);
}
