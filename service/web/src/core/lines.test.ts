import { expect, test } from 'vitest';
import { lineOpacity } from './lines';

test('lines of few triangles are drawn at full strength, whatever the distance', () => {
  expect(lineOpacity(600, 3.1, 38, 560)).toBe(lineOpacity(20, 1, 38, 560));
});

test('the denser lines lie on the picture, the fainter they are', () => {
  const opacities = [2_000, 50_000, 400_000].map((triangles) => lineOpacity(triangles, 3.1, 38, 700));
  expect(opacities).toEqual([...opacities].sort((a, b) => b - a));
  expect(opacities[2]).toBeLessThan(0.5 * (opacities[0] ?? 0));
  expect(lineOpacity(400_000, 1.3, 38, 700)).toBeGreaterThan(opacities[2] ?? 1); // nearer, they lie apart
  expect(lineOpacity(1e9, 20, 38, 700)).toBeGreaterThan(0);
});
