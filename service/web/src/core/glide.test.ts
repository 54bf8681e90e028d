import { describe, expect, it } from 'vitest';
import { Glide } from './glide';
import { scaleOf } from './scale';

const scale = scaleOf('linear', 100);

describe('a glide', () => {
  it('begins when it is first asked, and ends at its target', () => {
    const glide = new Glide();
    glide.begin(10, 20);
    expect(glide.at(5000, 0.5, scale)).toBe(10);
    const halfway = glide.at(5250, 0.5, scale);
    expect(halfway).toBeGreaterThan(15);
    expect(halfway).toBeLessThan(20);
    expect(glide.at(5500, 0.5, scale)).toBe(20);
    expect(glide.target).toBeNull();
  });

  it('keeps its target whatever comes meanwhile', () => {
    const glide = new Glide();
    glide.begin(10, 20);
    glide.begin(10, 30);
    expect(glide.target).toBe(20);
    expect(glide.at(0, 0, scale)).toBe(20);
    glide.begin(20, 30);
    expect(glide.target).toBe(30);
  });

  it('is none where one stands already, or when it was stopped', () => {
    const glide = new Glide();
    glide.begin(10, 10);
    expect(glide.target).toBeNull();
    glide.begin(10, 20);
    glide.stop();
    expect(glide.target).toBeNull();
    expect(() => glide.at(0, 1, scale)).toThrow(RangeError);
  });
});
