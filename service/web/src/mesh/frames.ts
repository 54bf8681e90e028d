import { Problem } from '../api/problem';
import { ByteBudget } from '../core/budget';
import { FIELD_INFO, type Field } from '../core/colormap';
import type { MeshWorker } from './pool';
import type { Drawable, Values } from './tasks';
import { bytesOf, type Frame } from './types';

/** Above this many vertices positions come as 16-bit numbers: half the bytes, and no difference to see. */
const EXACT_VERTICES = 100_000;
export const BUDGET_BYTES = 256 * 1024 * 1024;

/** The states of one job as they are drawn: fetched when wanted, kept within a number of bytes. */
export class Frames {
  private readonly key: string;
  private readonly kept: ByteBudget<Frame | Values>;
  private readonly coming = new Map<string, Promise<Frame | Values>>();
  private exact = true;
  private static made = 0;

  constructor(
    private readonly worker: MeshWorker,
    private readonly job: string,
    budget = BUDGET_BYTES,
  ) {
    this.key = `${job}#${++Frames.made}`; // two views of a job do not forget each other's
    this.kept = new ByteBudget(budget);
  }

  /** Fetch the triangles, and the state at iteration 0 with them. */
  async open(first: number): Promise<Drawable> {
    const drawable = await this.worker.ask('topology', {
      key: this.key,
      faces: `/v1/jobs/${this.job}/topology`,
      positions: `/v1/jobs/${this.job}/snapshots/${first}/positions?dtype=f32`,
    });
    this.exact = drawable.triangles / 2 <= EXACT_VERTICES;
    this.kept.set(`frame ${first}`, drawable.frame, bytesOf(drawable.frame));
    return drawable;
  }

  /** Return a state if it is here. */
  frame(iteration: number): Frame | undefined {
    return this.kept.get(`frame ${iteration}`) as Frame | undefined;
  }

  /** Return a quantity of a state if it is here. */
  values(iteration: number, field: Field): Values | undefined {
    return this.kept.get(`${field} ${iteration}`) as Values | undefined;
  }

  /** Fetch a state, and the quantity it is coloured by. */
  async load(iteration: number, field: Field | null): Promise<void> {
    const wanted = [this.once(`frame ${iteration}`, () => this.fetchFrame(iteration))];
    if (field !== null)
      wanted.push(this.once(`${field} ${iteration}`, () => this.fetchField(iteration, field)));
    await Promise.all(wanted);
  }

  has(iteration: number, field: Field | null): boolean {
    return this.kept.has(`frame ${iteration}`) && (field === null || this.kept.has(`${field} ${iteration}`));
  }

  close(): void {
    this.kept.clear();
    void this.worker.ask('forget', { key: this.key });
  }

  private async once(key: string, make: () => Promise<Frame | Values>): Promise<void> {
    if (this.kept.has(key)) return;
    let promise = this.coming.get(key);
    if (promise === undefined) {
      promise = make();
      this.coming.set(key, promise);
    }
    try {
      const made = await promise;
      const bytes = 'positions' in made ? bytesOf(made) : made.values.byteLength;
      if (!this.kept.has(key)) this.kept.set(key, made, bytes);
    } finally {
      this.coming.delete(key);
    }
  }

  private fetchFrame(iteration: number): Promise<Frame> {
    const dtype = this.exact ? 'f32' : 'u16';
    const url = `/v1/jobs/${this.job}/snapshots/${iteration}/positions?dtype=${dtype}`;
    return this.worker.ask('frame', { key: this.key, url, exact: this.exact });
  }

  private fetchField(iteration: number, field: Field): Promise<Values> {
    const url = `/v1/jobs/${this.job}/snapshots/${iteration}/fields/${field}`;
    return this.worker.ask('field', { key: this.key, url, diverging: FIELD_INFO[field].diverging });
  }
}

/** Whether a failure to load will pass by itself. */
export function willPass(thrown: unknown): boolean {
  return thrown instanceof Problem && (thrown.passing || thrown.slug === 'result-not-ready');
}
