import { describe, expect, it } from 'vitest';
import { axisOf } from './axis';

const written = (least: number, most: number): string[] => {
  const { ticks, write } = axisOf(least, most);
  return ticks.map(write);
};

describe('an axis', () => {
  it('has round values between its ends', () => {
    expect(written(0.55, 1)).toEqual(['0.6', '0.7', '0.8', '0.9', '1.0']);
    expect(written(0.9, 1)).toEqual(['0.90', '0.95', '1.00']);
    expect(written(-0.2, 0.2)).toEqual(['−0.2', '−0.1', '0.0', '0.1', '0.2']);
    expect(written(0, 38)).toEqual(['0', '10', '20', '30', '40']);
  });

  it('tells values apart that differ in late digits alone', () => {
    const ticks = written(0.99951, 0.99968);
    expect(ticks.length).toBeGreaterThan(2);
    expect(new Set(ticks).size).toBe(ticks.length);
  });

  it('tells powers of ten apart', () => {
    expect(written(1e-5, 3e-5)).toEqual(['1.0·10⁻⁵', '1.5·10⁻⁵', '2.0·10⁻⁵', '2.5·10⁻⁵', '3.0·10⁻⁵']);
  });

  it('has room around one value that never changes', () => {
    const { low, high, place } = axisOf(0.02, 0.02);
    expect(low).toBeLessThan(0.02);
    expect(high).toBeGreaterThan(0.02);
    expect(place(0.02)).toBeCloseTo(0.5);
    expect(written(0, 0)).toContain('0.0');
  });

  it('takes values that differ by rounding alone for one', () => {
    const { ticks, place } = axisOf(1, 1 + Number.EPSILON);
    expect(ticks.length).toBeGreaterThan(1);
    expect(ticks.length).toBeLessThan(10);
    expect(place(1)).toBeCloseTo(0.5);
  });

  it('puts values where they belong', () => {
    const { low, high, place } = axisOf(1, 3);
    expect(place(low)).toBe(0);
    expect(place(high)).toBe(1);
    expect(place(2)).toBeCloseTo(0.5);
  });
});
