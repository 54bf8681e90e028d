import { expect, test } from 'vitest';
import { axisOf, eyeOf, fieldOfView, FRONT, viewOf } from './camera';

test.each(['y', 'z'] as const)('a view with %s upright is found again from where its camera stands', (up) => {
  const view = { azimuth: -2.1, elevation: -0.7, distance: 2.5, target: [0.1, -0.3, 0.2] as const };
  const again = viewOf(eyeOf(view, up), view.target, up);
  expect(again.azimuth).toBeCloseTo(view.azimuth, 12);
  expect(again.elevation).toBeCloseTo(view.elevation, 12);
  expect(again.distance).toBeCloseTo(view.distance, 12);
});

test.each(['y', 'z'] as const)('what is above the shape is above it along %s', (up) => {
  const above = eyeOf({ ...FRONT, elevation: Math.PI / 2 }, up);
  const height = above.reduce((sum, value, i) => sum + value * (axisOf(up)[i] ?? 0), 0);
  expect(height / FRONT.distance).toBeCloseTo(1, 5);
  expect(Math.hypot(...above)).toBeCloseTo(FRONT.distance, 12);
});

test('a narrow picture is taken with a wider lens', () => {
  expect(fieldOfView(1.6)).toBe(fieldOfView(1));
  expect(fieldOfView(0.6)).toBeGreaterThan(fieldOfView(1));
  expect(fieldOfView(0.1)).toBe(fieldOfView(0.2));
});
