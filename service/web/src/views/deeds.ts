import { asProblem } from '../api/problem';
import type { Job } from '../api/types';
import type { Context } from './context';

/** What can be done with a run wherever it is shown. */

/** Do something with the service, say what went wrong, and look at the jobs again; returns whether it went well. */
export async function attempt(context: Context, ask: () => Promise<unknown>): Promise<boolean> {
  try {
    await ask();
    void context.jobs.load();
    return true;
  } catch (thrown) {
    context.toast(asProblem(thrown).detail, 'bad');
    return false;
  }
}

/** Whether a run can be asked to end. */
export function cancellable(job: Job): boolean {
  return 'cancel' in job.links && job.status !== 'cancelling';
}

/** Ask whether a run shall go, and delete it; returns whether it is gone. */
export async function remove(context: Context, job: Job): Promise<boolean> {
  if (!confirm(`Delete the run “${job.name}” with all its states?`)) return false;
  return attempt(context, () => context.api.delete(job.id));
}
