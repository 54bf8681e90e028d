import { describe, expect, it } from 'vitest';
import { ago, bytes, capital, count, duration, figure, rate, share } from './format';

describe('numbers', () => {
  it('groups thousands from five digits on', () => {
    expect(count(1234)).toBe('1234');
    expect(count(1234567)).toBe('1\u202f234\u202f567');
    expect(count(-12345)).toBe('−12\u202f345');
  });

  it('keeps significant digits', () => {
    expect(figure(0.123456)).toBe('0.1235');
    expect(figure(0)).toBe('0');
    expect(figure(null)).toBe('–');
    expect(figure(12_345_678)).toBe('1.23·10⁷');
    expect(figure(-0.000012)).toBe('−1.20·10⁻⁵');
  });

  it('never rounds a sphericity up to 1', () => {
    expect(share(0.5)).toBe('0.5000');
    expect(share(0.99932)).toBe('0.99932');
    expect(share(0.999999)).toBe('0.99999');
    expect(share(1)).toBe('1.0000');
    expect(share(undefined)).toBe('–');
  });

  it('has units', () => {
    expect(bytes(0)).toBe('0 B');
    expect(bytes(1234)).toBe('1.2 kB');
    expect(bytes(999_900)).toBe('1.0 MB');
    expect(bytes(268_435_456)).toBe('268 MB');
    expect(rate(71.3456)).toBe('71.3 it/s');
    expect(rate(null)).toBe('–');
  });
});

describe('times', () => {
  it('reads like speech', () => {
    expect(duration(8.13)).toBe('8.1 s');
    expect(duration(200)).toBe('3 min 20 s');
    expect(duration(7500)).toBe('2 h 5 min');
    expect(duration(null)).toBe('–');
  });

  it('begins sentences with capitals', () => {
    expect(capital('there is no job')).toBe('There is no job');
    expect(capital('')).toBe('');
  });

  it('tells how long ago', () => {
    const now = Date.parse('2030-01-01T12:00:00Z');
    expect(ago('2030-01-01T11:59:40Z', now)).toBe('just now');
    expect(ago('2030-01-01T11:50:00Z', now)).toBe('10 min ago');
    expect(ago('2030-01-01T06:00:00Z', now)).toBe('6 h ago');
  });
});
