import type { Surface } from './types';

/** Make one vertex of all that lie in exactly the same place, as a file of loose triangles needs. */
export function weld(surface: Surface): Surface {
  const { positions, index } = surface;
  const bits = new Uint32Array(positions.buffer, positions.byteOffset, positions.length);
  const count = positions.length / 3;
  let capacity = 1024;
  while (capacity < 2 * count) capacity *= 2;
  const table = new Int32Array(capacity).fill(-1);
  const number = new Uint32Array(count);
  const kept = new Float32Array(positions.length);
  const keptBits = new Uint32Array(kept.buffer);
  let found = 0;
  for (let v = 0; v < count; v++) {
    const x = positiveZero(bits[3 * v] ?? 0);
    const y = positiveZero(bits[3 * v + 1] ?? 0);
    const z = positiveZero(bits[3 * v + 2] ?? 0);
    let slot = (Math.imul(x, 73856093) ^ Math.imul(y, 19349663) ^ Math.imul(z, 83492791)) & (capacity - 1);
    for (;;) {
      const other = table[slot] ?? -1;
      if (other < 0) {
        table[slot] = found;
        keptBits.set([x, y, z], 3 * found);
        number[v] = found++;
        break;
      }
      if (keptBits[3 * other] === x && keptBits[3 * other + 1] === y && keptBits[3 * other + 2] === z) {
        number[v] = other;
        break;
      }
      slot = (slot + 1) & (capacity - 1);
    }
  }
  if (found === count) return surface;
  return { positions: kept.slice(0, 3 * found), index: index.map((v) => number[v] ?? 0) };
}

function positiveZero(bits: number): number {
  return bits === 0x80000000 ? 0 : bits;
}
