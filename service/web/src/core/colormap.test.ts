import { describe, expect, it } from 'vitest';
import { FIELDS, FIELD_INFO, gradient, ramp, rangeOf } from './colormap';

describe('ramp', () => {
  it('has 256 opaque colours, and a bright middle where it diverges', () => {
    const bytes = ramp(true);
    expect(bytes.length).toBe(1024);
    expect(bytes.filter((_, i) => i % 4 === 3).every((alpha) => alpha === 255)).toBe(true);
    const light = (i: number): number =>
      (bytes[4 * i] ?? 0) + (bytes[4 * i + 1] ?? 0) + (bytes[4 * i + 2] ?? 0);
    expect(light(128)).toBeGreaterThan(light(0));
    expect(light(128)).toBeGreaterThan(light(255));
  });

  it('grows lighter all the way where it does not', () => {
    const bytes = ramp(false);
    const lightness = (i: number): number =>
      0.2126 * (bytes[4 * i] ?? 0) + 0.7152 * (bytes[4 * i + 1] ?? 0) + 0.0722 * (bytes[4 * i + 2] ?? 0);
    for (let i = 8; i < 256; i += 8) expect(lightness(i)).toBeGreaterThan(lightness(i - 8));
  });

  it('is described for every field', () => {
    for (const field of FIELDS) expect(FIELD_INFO[field].meaning).not.toBe('');
    expect(gradient(false)).toContain('rgb(244 232 112)');
  });
});

const SHORT = { diverging: false, tail: 0.02 };
const DIVERGES = { diverging: true, tail: 0.02 };

describe('rangeOf', () => {
  it('ignores outliers and what is not finite', () => {
    const values = Float32Array.from({ length: 1000 }, (_, i) => i / 999);
    values[0] = 1e9;
    values[1] = NaN;
    const { low, high } = rangeOf(values, SHORT);
    expect(low).toBeCloseTo(0.02, 1);
    expect(high).toBeCloseTo(0.98, 1);
  });

  it('is symmetric around zero where colours diverge, and one-sided values keep their own range', () => {
    expect(rangeOf(Float32Array.from([-1, 0, 0.5]), DIVERGES)).toEqual({ low: -1, high: 1 });
    expect(rangeOf(Float32Array.from([1, 2]), DIVERGES)).toEqual({ low: 1, high: 2 });
  });

  it('is not taken by limbs that vanish, and has the edges of a cube', () => {
    const bent = Float32Array.from({ length: 1000 }, (_, i) =>
      i < 920 ? 0.5 + i / 919 : -30 + (i - 920) * 1.5,
    );
    const { low, high } = rangeOf(bent, FIELD_INFO.curvature);
    expect(low).toBeGreaterThan(0.5);
    expect(high).toBeLessThan(1.8);
    const edges = Float32Array.from({ length: 1000 }, (_, i) => (i < 950 ? 0 : 5));
    expect(rangeOf(edges, FIELD_INFO.curvature)).toEqual({ low: 0, high: 5 });
  });

  it('has a width even if all values are equal', () => {
    const { low, high } = rangeOf(Float32Array.from([2, 2, 2]), SHORT);
    expect(high).toBeGreaterThan(low);
    expect(rangeOf(new Float32Array(), SHORT)).toEqual({ low: 0, high: 1 });
  });
});
