import type { Range, Tails } from '../core/colormap';
import type { Bounds, Frame, Surface } from './types';
import type { Faults } from './faults';

/** What the page asks of the worker, and what it answers: `worker.ts` does it, `pool.ts` asks. */

/** A mesh ready to be drawn. */
export interface Drawable {
  /** The triangles that are drawn, over the frame's vertices. */
  readonly index: Uint32Array<ArrayBuffer>;
  readonly frame: Frame;
  readonly bounds: Bounds;
  /** Of the whole mesh. */
  readonly triangles: number;
}

/** What is wrong, with all positions of the mesh, which `strays` names. */
export interface Located extends Faults {
  readonly positions: Float32Array<ArrayBuffer>;
}

/** A quantity at the vertices that are drawn. */
export interface Values {
  readonly values: Float32Array<ArrayBuffer>;
  readonly range: Range;
}

export interface Tasks {
  /** Read a file, and weld it. */
  preview: { ask: { data: ArrayBuffer; name: string }; answer: Drawable };
  /** Find what is wrong with the file that was previewed last. */
  faults: { ask: Record<string, never>; answer: Located };
  /** Fetch the triangles of a run and its first state; `key` names it from then on. */
  topology: { ask: { key: string; faces: string; positions: string }; answer: Drawable };
  /** Fetch the positions of a state. */
  frame: { ask: { key: string; url: string; exact: boolean }; answer: Frame };
  /** Fetch a field of a state. */
  field: { ask: { key: string; url: string } & Tails; answer: Values };
  /** Forget a run. */
  forget: { ask: { key: string }; answer: null };
}

export type TaskName = keyof Tasks;

export interface Failure {
  readonly message: string;
  readonly name: string;
  /** What the service answered, when it was not what was asked for. */
  readonly status?: number;
  readonly body?: string;
  /** Its Retry-After. */
  readonly wait?: string | null;
}

export type { Surface };
