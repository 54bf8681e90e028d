import { expect, it } from 'vitest';
import { packed, readCommand, readReport } from './message';

it('carries commands, and drops what cannot be', () => {
  expect(readCommand(packed({ iteration: 5, color: 'quality', wire: true, playing: false }))).toEqual({
    iteration: 5,
    color: 'quality',
    wire: true,
    playing: false,
  });
  expect(readCommand({ spherify: { iteration: NaN, color: 'pink', wire: 1 } })).toEqual({});
  expect(readCommand({ spherify: { color: null } })).toEqual({ color: null });
  expect(readCommand(packed({ iteration: null }))).toEqual({ iteration: null });
  for (const noise of [null, 'hello', 5, { other: {} }, { spherify: 'x' }])
    expect(readCommand(noise)).toBeNull();
});

it('carries reports', () => {
  const report = { job: 'job_1', iteration: 3, status: 'running', playing: true };
  expect(readReport(packed(report))).toEqual(report);
  expect(readReport({ spherify: { iteration: 3 } })).toBeNull();
});
