import { describe, expect, it } from 'vitest';
import { ByteBudget } from './budget';

describe('ByteBudget', () => {
  it('drops what was used longest ago, and says so', () => {
    const gone: string[] = [];
    const kept = new ByteBudget<string>(10, (value) => gone.push(value));
    kept.set('a', 'A', 4);
    kept.set('b', 'B', 4);
    expect(kept.get('a')).toBe('A');
    kept.set('c', 'C', 4);
    expect(gone).toEqual(['B']);
    expect(kept.bytes).toBe(8);
    expect(kept.has('a') && kept.has('c')).toBe(true);
  });

  it('keeps one entry that is larger than the budget', () => {
    const kept = new ByteBudget<number>(10);
    kept.set('small', 1, 3);
    kept.set('huge', 2, 50);
    expect(kept.get('huge')).toBe(2);
    expect(kept.size).toBe(1);
    expect(kept.bytes).toBe(50);
  });

  it('never exceeds its limit over a run of 500 states', () => {
    const kept = new ByteBudget<number>(1000);
    for (let state = 0; state < 500; state++) {
      kept.set(String(state), state, 90);
      expect(kept.bytes).toBeLessThanOrEqual(1000);
    }
    expect(kept.size).toBe(11);
    kept.set('499', 7, 10);
    expect(kept.bytes).toBe(10 * 90 + 10);
  });
});
