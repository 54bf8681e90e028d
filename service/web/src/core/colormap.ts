/** Colour scales: control points in sRGB, chosen so that lightness runs evenly; drawn by us. */

export type Field = 'curvature' | 'distance' | 'displacement' | 'quality';
export const FIELDS: readonly Field[] = ['curvature', 'distance', 'displacement', 'quality'];

type Rgb = readonly [number, number, number];

const DIVERGING: readonly Rgb[] = [
  [38, 74, 135],
  [84, 138, 196],
  [164, 201, 226],
  [240, 238, 233],
  [244, 190, 148],
  [218, 119, 76],
  [150, 46, 36],
];
const SEQUENTIAL: readonly Rgb[] = [
  [26, 28, 68],
  [44, 72, 122],
  [33, 121, 134],
  [56, 166, 122],
  [148, 203, 92],
  [244, 232, 112],
];

export interface FieldInfo {
  readonly title: string;
  readonly unit: string;
  readonly meaning: string;
  /** Colours on both sides of zero, of one on the left and of another on the right. */
  readonly diverging: boolean;
  /** The share of the vertices beyond either end of the scale. */
  readonly tail: number;
}

export const FIELD_INFO: Readonly<Record<Field, FieldInfo>> = {
  curvature: {
    title: 'Curvature',
    unit: '1 / unit of the file',
    meaning: 'K at each vertex: 1 / r on a sphere of radius r; what the transformation evens out',
    diverging: true,
    tail: 0.1, // a limb that vanishes bends without bound, and would leave all the rest one colour
  },
  distance: {
    title: 'Distance to sphere',
    unit: '× its radius',
    meaning: 'how far each vertex is outside (+) or inside (−) the sphere that fits best',
    diverging: true,
    tail: 0.02,
  },
  displacement: {
    title: 'Displacement',
    unit: 'mean edges',
    meaning: 'how far each vertex has moved since iteration 0',
    diverging: false,
    tail: 0.02,
  },
  quality: {
    title: 'Triangle quality',
    unit: '1 is equilateral',
    meaning: 'the worst triangle at each vertex',
    diverging: false,
    tail: 0.02,
  },
};

/** Return 256 colours as RGBA bytes. */
export function ramp(diverging: boolean): Uint8Array<ArrayBuffer> {
  const points = diverging ? DIVERGING : SEQUENTIAL;
  const bytes = new Uint8Array(256 * 4);
  for (let i = 0; i < 256; i++) {
    const [r, g, b] = mix(points, i / 255);
    bytes.set([r, g, b, 255], 4 * i);
  }
  return bytes;
}

/** Return the same as stops for a CSS gradient. */
export function gradient(diverging: boolean): string {
  const points = diverging ? DIVERGING : SEQUENTIAL;
  return `linear-gradient(90deg, ${points.map(([r, g, b]) => `rgb(${r} ${g} ${b})`).join(', ')})`;
}

function mix(points: readonly Rgb[], place: number): Rgb {
  const at = place * (points.length - 1);
  const index = Math.min(Math.floor(at), points.length - 2);
  const [from, to] = [points[index], points[index + 1]];
  if (from === undefined || to === undefined) throw new RangeError('a scale needs two points');
  const t = at - index;
  const channel = (c: 0 | 1 | 2): number => Math.round(from[c] + (to[c] - from[c]) * t);
  return [channel(0), channel(1), channel(2)];
}

export type Tails = Pick<FieldInfo, 'diverging' | 'tail'>;

export interface Range {
  readonly low: number;
  readonly high: number;
}

const SAMPLES = 20_000;
const LEAST_TAIL = 0.02;

/**
 * Return the range that is coloured: without the tails, as a few slivers would else take all colours; around zero,
 * symmetric, for a diverging scale. Where all between the tails is the same, as on flat faces, they are shortened.
 */
export function rangeOf(values: Float32Array, { diverging, tail }: Tails): Range {
  const stride = Math.max(1, Math.ceil(values.length / SAMPLES));
  const sorted: number[] = [];
  for (let i = 0; i < values.length; i += stride) {
    const value = values[i] ?? NaN;
    if (Number.isFinite(value)) sorted.push(value);
  }
  if (sorted.length === 0) return { low: 0, high: 1 };
  sorted.sort((a, b) => a - b);
  const at = (share: number): number => sorted[Math.round(share * (sorted.length - 1))] ?? 0;
  for (const share of [tail, LEAST_TAIL]) {
    const [low, high] = [at(share), at(1 - share)];
    const most = Math.max(Math.abs(low), Math.abs(high));
    if (diverging && low < 0 && high > 0) return { low: -most, high: most };
    if (high - low > 1e-12 * most) return { low, high };
  }
  const middle = at(0.5);
  const half = Math.abs(middle) * 1e-3 || 1;
  return { low: middle - half, high: middle + half };
}
