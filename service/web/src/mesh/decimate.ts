import type { Surface } from './types';

/** Above this many triangles the page draws fewer, and says so. */
export const MOST_TRIANGLES = 400_000;

/** A coarser surface over a choice of the same vertices, so that it can be drawn at every state of a run. */
export interface Decimation {
  readonly index: Uint32Array<ArrayBuffer>;
  /** The whole mesh's number of each vertex kept; null if all are. */
  readonly kept: Uint32Array<ArrayBuffer> | null;
}

/**
 * Lay a grid over the surface and draw one vertex for all in a cell (Rossignac and Borrel 1993): of each triangle
 * whose corners lie in three cells one is left. The grid is refined until the target is met from below.
 */
export function decimate(surface: Surface, most = MOST_TRIANGLES): Decimation {
  if (surface.index.length / 3 <= most) return { index: surface.index, kept: null };
  // A surface of T triangles fills about T / 2 cells of a grid as fine as its edges; with g cells along the longest
  // side it meets some c·g² of them. One coarse try finds c.
  let grid = 64;
  let found = cluster(surface, grid);
  for (let attempt = 0; attempt < 4; attempt++) {
    const triangles = found.index.length / 3;
    if (triangles <= most && triangles > 0.5 * most) break;
    grid = Math.max(8, Math.floor(grid * Math.sqrt((0.85 * most) / Math.max(triangles, 1))));
    found = cluster(surface, grid);
  }
  return found;
}

function cluster({ positions, index }: Surface, grid: number): Decimation {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let axis = 0; axis < 3; axis++) {
    let [least, most] = [Infinity, -Infinity];
    for (let i = axis; i < positions.length; i += 3) {
      const value = positions[i] ?? 0;
      if (value < least) least = value;
      if (value > most) most = value;
    }
    [low[axis], high[axis]] = [least, most];
  }
  const [lowX = 0, lowY = 0, lowZ = 0] = low;
  const size = Math.max(...high.map((top, axis) => top - (low[axis] ?? 0))) || 1;
  const scale = (grid - 1e-6) / size;
  const cells = new Map<number, number>();
  const kept: number[] = [];
  const number = new Uint32Array(positions.length / 3);
  for (let v = 0; v < number.length; v++) {
    const x = Math.floor(((positions[3 * v] ?? 0) - lowX) * scale);
    const y = Math.floor(((positions[3 * v + 1] ?? 0) - lowY) * scale);
    const z = Math.floor(((positions[3 * v + 2] ?? 0) - lowZ) * scale);
    const cell = (z * grid + y) * grid + x;
    let representative = cells.get(cell);
    if (representative === undefined) {
      representative = kept.length;
      cells.set(cell, representative);
      kept.push(v);
    }
    number[v] = representative;
  }
  const coarse = new Uint32Array(index.length);
  let length = 0;
  for (let t = 0; t < index.length; t += 3) {
    const a = number[index[t] ?? 0] ?? 0;
    const b = number[index[t + 1] ?? 0] ?? 0;
    const c = number[index[t + 2] ?? 0] ?? 0;
    if (a === b || b === c || c === a) continue;
    const turned = against(positions, index, t, kept[a] ?? 0, kept[b] ?? 0, kept[c] ?? 0);
    coarse[length++] = a;
    coarse[length++] = turned ? c : b;
    coarse[length++] = turned ? b : c;
  }
  return { index: coarse.slice(0, length), kept: Uint32Array.from(kept) };
}

/**
 * Whether the triangle (a, b, c) looks against the one at `t` of the whole surface, which it stands for: where cells
 * cut the surface aslant some are turned over, and would be dark specks in the picture.
 */
function against(
  positions: Float32Array,
  index: Uint32Array,
  t: number,
  a: number,
  b: number,
  c: number,
): boolean {
  const [x, y, z] = areaVector(positions, index[t] ?? 0, index[t + 1] ?? 0, index[t + 2] ?? 0);
  const [u, v, w] = areaVector(positions, a, b, c);
  return x * u + y * v + z * w < 0;
}

/** Return (b − a) × (c − a), of corners by number. */
function areaVector(positions: Float32Array, a: number, b: number, c: number): [number, number, number] {
  const at = (vertex: number, axis: number): number =>
    (positions[3 * vertex + axis] ?? 0) - (positions[3 * a + axis] ?? 0);
  const [px, py, pz] = [at(b, 0), at(b, 1), at(b, 2)];
  const [qx, qy, qz] = [at(c, 0), at(c, 1), at(c, 2)];
  return [py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx];
}

/** Pick the kept vertices out of `width` numbers a vertex. */
export function pick(
  values: Float32Array<ArrayBuffer>,
  kept: Uint32Array | null,
  width: number,
): Float32Array<ArrayBuffer> {
  if (kept === null) return values;
  const picked = new Float32Array(kept.length * width);
  for (let i = 0; i < kept.length; i++)
    for (let c = 0; c < width; c++) picked[i * width + c] = values[(kept[i] ?? 0) * width + c] ?? 0;
  return picked;
}
