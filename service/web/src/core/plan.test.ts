import { describe, expect, it } from 'vitest';
import { planOf } from './plan';

/** What the service makes of `log:12`, its default, for 5000 iterations, and of `log:12` for 40. */
const LOG_12 = [0, 1, 2, 5, 10, 22, 48, 104, 226, 490, 1063, 2305, 5000];
const LOG_12_OF_40 = [0, 1, 2, 3, 4, 5, 7, 10, 15, 20, 29, 40];

describe('the states that are kept', () => {
  it('are named by their distance where that is even', () => {
    expect(planOf([0, 20, 40, 60])).toBe('every:20');
    expect(planOf([0, 20, 40, 50])).toBe('every:20');
    expect(planOf([0, 1, 2, 3])).toBe('every:1');
  });

  it('are named by their number where they are spread', () => {
    expect(planOf(LOG_12)).toBe('log:12');
    expect(planOf(LOG_12_OF_40)).toBe('log:12');
  });

  it('are listed where they follow no rule, without the ends that are kept anyway', () => {
    expect(planOf([0, 20, 40, 70])).toBe('20,40');
    expect(planOf([0, 100, 500, 1000, 5000])).toBe('100,500,1000');
  });

  it('need a plan even if only the ends are kept', () => {
    expect(planOf([0, 300])).toBe('every:300');
    expect(planOf([0])).toBe('every:1');
  });
});
