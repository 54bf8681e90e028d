import type { Job } from '../api/types';
import type { Up } from '../core/route';

/** By which a run tells its pictures that z stands upright; most meshes have y. */
const UPRIGHT_Z = 'up:z';

/** Guess which axis stands upright: files for printing and our own samples have z, those from modellers y. */
export function upOf(job: Pick<Job, 'tags'>): Up {
  return job.tags.includes('gallery') || job.tags.includes(UPRIGHT_Z) ? 'z' : 'y';
}

/** Return the tags by which a run tells it. */
export function tagsOf(up: Up): string[] {
  return up === 'z' ? [UPRIGHT_Z] : [];
}

/** Guess the same from a file's name. */
export function upOfFile(name: string): Up {
  return /\.(stl|3mf)$/i.test(name) ? 'z' : 'y';
}
