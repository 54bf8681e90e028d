import type { Surface } from './types';

/** Turn a surface that is inside out, as the service does: one that encloses a negative volume. */
export function outward(surface: Surface): Surface {
  const { positions, index } = surface;
  const [ox, oy, oz] = [positions[0] ?? 0, positions[1] ?? 0, positions[2] ?? 0]; // far from 0 digits would be lost
  let volume = 0; // six times
  for (let t = 0; t < index.length; t += 3) {
    const a = 3 * (index[t] ?? 0);
    const b = 3 * (index[t + 1] ?? 0);
    const c = 3 * (index[t + 2] ?? 0);
    const ax = (positions[a] ?? 0) - ox;
    const ay = (positions[a + 1] ?? 0) - oy;
    const az = (positions[a + 2] ?? 0) - oz;
    const bx = (positions[b] ?? 0) - ox;
    const by = (positions[b + 1] ?? 0) - oy;
    const bz = (positions[b + 2] ?? 0) - oz;
    const cx = (positions[c] ?? 0) - ox;
    const cy = (positions[c + 1] ?? 0) - oy;
    const cz = (positions[c + 2] ?? 0) - oz;
    volume += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx);
  }
  if (volume >= 0) return surface;
  const turned = index.slice();
  for (let t = 0; t < turned.length; t += 3)
    [turned[t + 1], turned[t + 2]] = [index[t + 2] ?? 0, index[t + 1] ?? 0];
  return { positions, index: turned };
}
