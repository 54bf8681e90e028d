import { expect, test } from 'vitest';
import { lineOpacity, meanEdge } from './lines';

test('lines that lie apart are drawn at full strength, whatever the distance', () => {
  expect(lineOpacity(0.4, 3.1, 38, 560)).toBe(lineOpacity(2, 1, 38, 560));
});

test('the denser lines lie on the picture, the fainter they are', () => {
  const opacities = [0.2, 0.02, 0.008].map((edge) => lineOpacity(edge, 3.1, 38, 700));
  expect(opacities).toEqual([...opacities].sort((a, b) => b - a));
  expect(opacities[2]).toBeLessThan(0.5 * (opacities[0] ?? 0));
  expect(lineOpacity(0.008, 1.3, 38, 700)).toBeGreaterThan(opacities[2] ?? 1); // nearer, they lie apart
  expect(lineOpacity(1e-9, 20, 38, 700)).toBeGreaterThan(0);
});

test('an edge is as long as it is on the mean', () => {
  const square = [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0];
  expect(meanEdge([0, 1, 2, 0, 2, 3], square)).toBeCloseTo((4 + 2 * Math.SQRT2) / 6, 12);
  const many = Array.from({ length: 3000 }, (_, i) => i % 3);
  expect(meanEdge(many, square)).toBeCloseTo((2 + Math.SQRT2) / 3, 12);
  expect(meanEdge([], [])).toBe(0);
});
