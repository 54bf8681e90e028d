import type { Job } from '../api/types';
import type { Up } from '../core/route';

/** Guess which axis stands upright: files for printing and our own samples have z, those from modellers y. */
export function upOf(job: Pick<Job, 'tags'>): Up {
  return job.tags.includes('gallery') || job.tags.includes('up:z') ? 'z' : 'y';
}

/** Guess the same from a file's name. */
export function upOfFile(name: string): Up {
  return /\.(stl|3mf)$/i.test(name) ? 'z' : 'y';
}
