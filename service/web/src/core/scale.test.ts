import { describe, expect, it } from 'vitest';
import { between, nearest, neighbour, scaleOf, ticks } from './scale';

const STATES = [0, 1, 3, 10, 30, 100];

describe('scaleOf', () => {
  it.each(['linear', 'log'] as const)('maps %s there and back', (kind) => {
    const scale = scaleOf(kind, 5000);
    expect(scale.place(0)).toBe(0);
    expect(scale.place(5000)).toBeCloseTo(1, 12);
    for (const iteration of [0, 1, 7.5, 120, 4999])
      expect(scale.iteration(scale.place(iteration))).toBeCloseTo(iteration, 6);
  });

  it('gives early iterations room on a log scale', () => {
    expect(scaleOf('log', 5000).place(10)).toBeGreaterThan(0.25);
    expect(scaleOf('linear', 5000).place(10)).toBeCloseTo(0.002);
  });

  it('stays within its ends, and works for a run of no iterations', () => {
    expect(scaleOf('linear', 100).place(200)).toBe(1);
    expect(scaleOf('log', 100).iteration(-1)).toBe(0);
    expect(scaleOf('log', 0).place(0)).toBe(0);
  });
});

describe('between', () => {
  const linear = scaleOf('linear', 100);

  it('is exact at a kept state', () => {
    for (const state of STATES)
      expect(between(STATES, state, linear)).toEqual({ before: state, after: state, blend: 0 });
  });

  it('blends in the middle', () => {
    expect(between(STATES, 20, linear)).toEqual({
      before: 10,
      after: 30,
      blend: expect.closeTo(0.5, 9) as number,
    });
    const log = scaleOf('log', 100);
    const middle = log.iteration((log.place(10) + log.place(30)) / 2);
    expect(between(STATES, middle, log).blend).toBeCloseTo(0.5);
  });

  it('ends at the last state', () => {
    expect(between(STATES, 250, linear)).toEqual({ before: 100, after: 100, blend: 0 });
    expect(between([5], 3, linear)).toEqual({ before: 5, after: 5, blend: 0 });
  });
});

describe('stepping', () => {
  it('goes to neighbours and stops at the ends', () => {
    expect(neighbour(STATES, 10, 1)).toBe(30);
    expect(neighbour(STATES, 20, -1)).toBe(10);
    expect(neighbour(STATES, 100, 1)).toBe(100);
    expect(neighbour(STATES, 0, -1)).toBe(0);
  });

  it('finds the nearest', () => {
    expect(nearest(STATES, 16, scaleOf('linear', 100))).toBe(10);
    expect(nearest(STATES, 24, scaleOf('linear', 100))).toBe(30);
  });
});

describe('ticks', () => {
  it('are round, ascending, and hold both ends', () => {
    expect(ticks(scaleOf('linear', 250), 5)).toEqual([0, 50, 100, 150, 200, 250]);
    expect(ticks(scaleOf('log', 5000), 6)).toEqual([0, 10, 100, 1000, 5000]);
    expect(ticks(scaleOf('linear', 1), 5)).toEqual([0, 1]);
  });
});
