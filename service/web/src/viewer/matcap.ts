/**
 * A matcap: the picture of a lit clay ball, looked up by the direction a surface faces, so that shading shows form
 * and needs no lights. Drawn here, a pixel at a time, from a few soft lamps.
 */

type Vector = readonly [number, number, number];

interface Lamp {
  readonly from: Vector;
  readonly colour: Vector;
  readonly softness: number;
}

const SIZE = 256;
const CLAY: Vector = [0.83, 0.77, 0.7];
const LAMPS: readonly Lamp[] = [
  { from: [-0.45, 0.65, 0.62], colour: [0.88, 0.85, 0.79], softness: 0.08 },
  { from: [0.85, 0.1, 0.35], colour: [0.16, 0.21, 0.28], softness: 0.25 },
  { from: [0, -0.9, 0.3], colour: [0.12, 0.085, 0.07], softness: 0.4 },
];
const AMBIENT: Vector = [0.085, 0.092, 0.11];

let drawn: Uint8Array<ArrayBuffer> | null = null; // once for all surfaces

/** Return SIZE × SIZE pixels as RGBA bytes, sRGB, the ball filling the square. */
export function matcap(): { data: Uint8Array<ArrayBuffer>; size: number } {
  drawn ??= draw();
  return { data: drawn, size: SIZE };
}

function draw(): Uint8Array<ArrayBuffer> {
  const data = new Uint8Array(SIZE * SIZE * 4);
  for (let row = 0; row < SIZE; row++)
    for (let column = 0; column < SIZE; column++) {
      const x = ((column + 0.5) / SIZE) * 2 - 1;
      const y = ((row + 0.5) / SIZE) * 2 - 1; // textures have their first row at the bottom
      const length = Math.min(Math.hypot(x, y), 0.9999);
      const angle = Math.atan2(y, x);
      const normal: Vector = [
        length * Math.cos(angle),
        length * Math.sin(angle),
        Math.sqrt(1 - length * length),
      ];
      data.set(shade(normal), 4 * (row * SIZE + column));
    }
  return data;
}

function shade(n: Vector): [number, number, number, number] {
  const light: [number, number, number] = [...AMBIENT];
  for (const { from, colour, softness } of LAMPS) {
    const size = Math.hypot(...from);
    const cosine = (n[0] * from[0] + n[1] * from[1] + n[2] * from[2]) / size;
    const wrapped = Math.max((cosine + softness) / (1 + softness), 0); // light that reaches around the edge
    for (const c of [0, 1, 2] as const) light[c] += colour[c] * wrapped ** 1.25;
  }
  const half = normalised([-0.45, 0.65, 1.62]);
  const gloss = 0.17 * Math.max(n[0] * half[0] + n[1] * half[1] + n[2] * half[2], 0) ** 36;
  const rim = 0.13 * (1 - n[2]) ** 3 * (0.4 + 0.6 * Math.max(n[1], 0));
  const channel = (c: 0 | 1 | 2): number =>
    Math.round(255 * encoded(Math.min(light[c] * CLAY[c] + gloss + rim, 1)));
  return [channel(0), channel(1), channel(2), 255];
}

function normalised(v: Vector): Vector {
  const size = Math.hypot(...v);
  return [v[0] / size, v[1] / size, v[2] / size];
}

/** From linear light to sRGB. */
function encoded(value: number): number {
  return value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055;
}
