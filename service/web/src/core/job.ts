import type { Figures, Job, Progress, Row } from '../api/types';

/** What the events of a job do to what is known of it. No network here: `api/follow.ts` brings them. */

/** What is known of a run. */
export interface RunState {
  readonly job: Job;
  /** Iterations of the kept states, ascending. */
  readonly states: readonly number[];
  /** The figures so far, ascending in iteration. */
  readonly rows: readonly Row[];
}

export interface ProgressEvent {
  readonly rev: number;
  readonly status: Job['status'];
  readonly progress: Progress;
  readonly metrics: Figures | null;
}

export type RunEvent =
  | { readonly kind: 'status' | 'done'; readonly job: Job }
  | { readonly kind: 'progress'; readonly progress: ProgressEvent }
  | { readonly kind: 'snapshot'; readonly iteration: number };

/** Return the state after an event; one that is older than what is known changes nothing it should not. */
export function afterEvent(state: RunState, event: RunEvent): RunState {
  switch (event.kind) {
    case 'status':
    case 'done':
      return withJob(state, event.job);
    case 'snapshot':
      return { ...state, states: withState(state.states, event.iteration) };
    case 'progress': {
      const { rev, status, progress, metrics } = event.progress;
      if (rev < state.job.rev || state.job.done) return state;
      const job = { ...state.job, rev, status, progress, metrics: metrics ?? state.job.metrics };
      const rows = metrics ? withRow(state.rows, { ...metrics, iteration: progress.iteration }) : state.rows;
      return { ...state, job, rows };
    }
  }
}

/** Take a newer record of the job over. */
export function withJob(state: RunState, job: Job): RunState {
  if (job.rev < state.job.rev) return state;
  const { available } = job.snapshots;
  if (job.done) return { ...state, job, states: available }; // what only a former attempt had is gone
  const known = new Set(state.states);
  const states = available.every((iteration) => known.has(iteration))
    ? state.states
    : [...new Set([...state.states, ...available])].sort((a, b) => a - b);
  return { ...state, job, states };
}

/**
 * Put a whole time series in the place of what was gathered from events, and keep what is newer than it while the run
 * goes on. After its end the series is complete: what goes beyond it, only a former attempt had.
 */
export function withRows(state: RunState, rows: readonly Row[]): RunState {
  if (state.job.done) return { ...state, rows };
  const last = rows.at(-1)?.iteration ?? -1;
  return { ...state, rows: [...rows, ...state.rows.filter((row) => row.iteration > last)] };
}

function withState(states: readonly number[], iteration: number): readonly number[] {
  if (iteration > (states.at(-1) ?? -1)) return [...states, iteration]; // as they come, but for a run taken up again
  if (states.includes(iteration)) return states;
  return [...states, iteration].sort((a, b) => a - b);
}

function withRow(rows: readonly Row[], row: Row): readonly Row[] {
  const last = rows.at(-1);
  if (last === undefined || last.iteration < row.iteration) return [...rows, row];
  return rows; // it is there, or the run was taken up again from before
}

/** Return the figures at an iteration: those of the row there, or of the last one before. */
export function figuresAt(rows: readonly Row[], iteration: number): Row | null {
  let low = 0;
  let high = rows.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((rows[middle]?.iteration ?? 0) <= iteration) low = middle + 1;
    else high = middle;
  }
  return rows[low - 1] ?? rows[0] ?? null;
}

const STALLED = 'nothing gets better any more';

const REASONS: Readonly<Record<string, string>> = {
  iterations: 'all iterations done',
  converged: 'round enough',
  stalled: STALLED,
  'constant-curvature': 'the curvature is the same everywhere',
  deadline: 'time was up',
  collapsed: 'the surface collapsed',
  cancelled: 'cancelled on request',
};

/** Say in a few words how the mathematics ended. */
export function reason(job: Job): string {
  if (job.stop_reason === null) return '';
  if (job.stop_reason === 'stalled' && isRound(job)) return `round, and ${STALLED}`;
  return REASONS[job.stop_reason] ?? job.stop_reason;
}

/** Whether the end is as round as would have counted as converged: what stalls may be a sphere all the same. */
function isRound({ metrics, parameters }: Job): boolean {
  return metrics?.inward_faces === 0 && (metrics.radius_variation ?? 1) < parameters.stop_radius_variation;
}

export const STATUS_WORDS: Readonly<Record<Job['status'], string>> = {
  accepted: 'Waiting',
  running: 'Running',
  cancelling: 'Cancelling',
  successful: 'Done',
  failed: 'Failed',
  cancelled: 'Cancelled',
};
