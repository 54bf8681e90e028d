import { describe, expect, it } from 'vitest';
import type { Job, Row } from '../api/types';
import { afterEvent, figuresAt, reason, withRows, type RunState } from './job';

const progress = {
  percent: 10,
  iteration: 10,
  iterations_total: 100,
  iterations_per_s: 5,
  eta_s: 18,
  elapsed_s: 2,
};
const job = {
  id: 'job_1',
  status: 'running',
  done: false,
  rev: 5,
  progress,
  metrics: null,
  stop_reason: null,
  snapshots: { requested: [0, 50, 100], available: [0] },
} as unknown as Job;
const row = (iteration: number): Row => ({ iteration, sphericity: 1 - 1 / (iteration + 2) });
const start: RunState = { job, states: [0], rows: [row(0)] };

describe('afterEvent', () => {
  it('adds snapshots in order, each once, whatever the order they come in', () => {
    let state = afterEvent(start, { kind: 'snapshot', iteration: 100 });
    state = afterEvent(state, { kind: 'snapshot', iteration: 50 });
    state = afterEvent(state, { kind: 'snapshot', iteration: 50 });
    expect(state.states).toEqual([0, 50, 100]);
  });

  it('takes progress over, and its figures into the series', () => {
    const event = {
      rev: 6,
      status: 'running' as const,
      progress: { ...progress, iteration: 20 },
      metrics: row(20),
    };
    const state = afterEvent(start, { kind: 'progress', progress: event });
    expect(state.job.progress.iteration).toBe(20);
    expect(state.rows.map((one) => one.iteration)).toEqual([0, 20]);
    expect(afterEvent(state, { kind: 'progress', progress: { ...event, rev: 4 } })).toBe(state);
  });

  it('learns of snapshots from the record too, and ignores an older record', () => {
    const ended = {
      ...job,
      rev: 9,
      done: true,
      snapshots: { requested: [], available: [0, 50, 64] },
    } as unknown as Job;
    const state = afterEvent(start, { kind: 'done', job: ended });
    expect(state.states).toEqual([0, 50, 64]);
    expect(afterEvent(state, { kind: 'status', job })).toBe(state);
  });

  it('forgets at the end what only a former attempt had', () => {
    const ended = { ...job, rev: 9, done: true, snapshots: { requested: [], available: [0, 10] } };
    const before = { ...start, states: [0, 10, 20] };
    expect(afterEvent(before, { kind: 'done', job: ended as unknown as Job }).states).toEqual([0, 10]);
  });
});

describe('rows', () => {
  it('are replaced by a whole series up to its end', () => {
    const state = withRows({ ...start, rows: [row(0), row(7), row(40)] }, [row(0), row(1), row(2), row(8)]);
    expect(state.rows.map((one) => one.iteration)).toEqual([0, 1, 2, 8, 40]);
  });

  it('of a former attempt are forgotten when the run has ended', () => {
    const ended = { ...start, job: { ...job, done: true }, rows: [row(0), row(8), row(40)] };
    expect(withRows(ended, [row(0), row(8)]).rows.map((one) => one.iteration)).toEqual([0, 8]);
  });

  it('are found by iteration', () => {
    const rows = [row(0), row(10), row(20)];
    expect(figuresAt(rows, 15)?.iteration).toBe(10);
    expect(figuresAt(rows, 20)?.iteration).toBe(20);
    expect(figuresAt([], 3)).toBeNull();
  });
});

it('says how a run ended', () => {
  expect(reason({ ...job, stop_reason: 'converged' })).toBe('round enough');
  expect(reason(job)).toBe('');
});

it('is said of what stalled whether it is a sphere', () => {
  const stalled = (inward_faces: number, radius_variation: number): string =>
    reason({
      ...job,
      stop_reason: 'stalled',
      parameters: { ...job.parameters, stop_radius_variation: 1e-3 },
      metrics: { inward_faces, radius_variation },
    });
  expect(stalled(0, 3.6e-4)).toBe('round, and nothing gets better any more');
  expect(stalled(2, 3.6e-4)).toBe('nothing gets better any more');
  expect(stalled(0, 0.02)).toBe('nothing gets better any more');
});
