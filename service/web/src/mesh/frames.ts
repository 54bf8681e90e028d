import { Problem } from '../api/problem';
import { ByteBudget } from '../core/budget';
import { FIELD_INFO, type Field, type Range } from '../core/colormap';
import type { MeshWorker } from './pool';
import type { Drawable } from './tasks';
import { bytesOf, type Frame } from './types';

/** Above this many vertices positions come as 16-bit numbers: half the bytes, and no difference to see. */
const EXACT_VERTICES = 100_000;
export const BUDGET_BYTES = 256 * 1024 * 1024;

/** Takes what is to be drawn, and keeps it until it is to be dropped: the worker that draws, by way of a viewer. */
export interface Store {
  keep(key: string, numbers: Frame | Float32Array<ArrayBuffer>): void;
  drop(key: string): void;
}

interface Kept {
  readonly key: string;
  /** Of a quantity; null for positions. */
  readonly range: Range | null;
}

/**
 * The states of one job as they are drawn: fetched when wanted, kept within a number of bytes. Here are their names;
 * their numbers go from the worker that reads them to the one that draws.
 */
export class Frames {
  private readonly run: string;
  private readonly kept: ByteBudget<Kept>;
  private readonly coming = new Map<string, Promise<void>>();
  private exact = true;
  private closed = false;
  private static made = 0;

  constructor(
    private readonly worker: Pick<MeshWorker, 'ask'>,
    private readonly job: string,
    private readonly store: Store,
    budget = BUDGET_BYTES,
  ) {
    this.run = `${job}#${++Frames.made}`; // two views of a job do not forget each other's
    this.kept = new ByteBudget(budget, ({ key }) => {
      store.drop(key);
    });
  }

  /** Bytes that the store holds now. */
  get bytes(): number {
    return this.kept.bytes;
  }

  /** Fetch the triangles and a first state, which `load` is to put into the store under a key. */
  async open(first: number, load: (drawable: Drawable, key: string) => void): Promise<void> {
    const drawable = await this.worker.ask('topology', {
      key: this.run,
      faces: `/v1/jobs/${this.job}/topology`,
      positions: `/v1/jobs/${this.job}/snapshots/${first}/positions?dtype=f32`,
    });
    if (this.closed) {
      this.forget(); // the worker knows the run since it answered, whatever it was told before
      return;
    }
    this.exact = drawable.triangles / 2 <= EXACT_VERTICES;
    const key = frameKey(first);
    this.kept.set(key, { key, range: null }, bytesOf(drawable.frame)); // makes room first
    load(drawable, key);
  }

  /** Return the key of a state if it is here. */
  frame(iteration: number): string | undefined {
    return this.kept.get(frameKey(iteration))?.key;
  }

  /** Return the key and the range of a quantity of a state if it is here. */
  values(iteration: number, field: Field): { readonly key: string; readonly range: Range } | undefined {
    const found = this.kept.get(fieldKey(iteration, field));
    return found?.range ? { key: found.key, range: found.range } : undefined;
  }

  /** Fetch a state, and the quantity it is coloured by. */
  async load(iteration: number, field: Field | null): Promise<void> {
    const wanted = [this.once(frameKey(iteration), (key) => this.fetchFrame(iteration, key))];
    if (field !== null)
      wanted.push(this.once(fieldKey(iteration, field), (key) => this.fetchField(iteration, field, key)));
    await Promise.all(wanted);
  }

  has(iteration: number, field: Field | null): boolean {
    const values = field === null || this.kept.has(fieldKey(iteration, field));
    return values && this.kept.has(frameKey(iteration));
  }

  close(): void {
    this.closed = true;
    this.kept.clear();
    this.forget();
  }

  private forget(): void {
    void this.worker.ask('forget', { key: this.run });
  }

  /** Keep what was fetched, unless it came too late to be dropped again. */
  private keep(kept: Kept, numbers: Frame | Float32Array<ArrayBuffer>, size: number): void {
    if (this.closed) return;
    this.kept.set(kept.key, kept, size); // makes room first
    this.store.keep(kept.key, numbers);
  }

  private async once(key: string, fetch: (key: string) => Promise<void>): Promise<void> {
    if (this.kept.has(key)) return;
    let promise = this.coming.get(key);
    if (promise === undefined) {
      promise = fetch(key).finally(() => this.coming.delete(key));
      this.coming.set(key, promise);
    }
    await promise;
  }

  private async fetchFrame(iteration: number, key: string): Promise<void> {
    const dtype = this.exact ? 'f32' : 'u16';
    const url = `/v1/jobs/${this.job}/snapshots/${iteration}/positions?dtype=${dtype}`;
    const frame = await this.worker.ask('frame', { key: this.run, url, exact: this.exact });
    this.keep({ key, range: null }, frame, bytesOf(frame));
  }

  private async fetchField(iteration: number, field: Field, key: string): Promise<void> {
    const url = `/v1/jobs/${this.job}/snapshots/${iteration}/fields/${field}`;
    const { diverging, tail } = FIELD_INFO[field];
    const { values, range } = await this.worker.ask('field', { key: this.run, url, diverging, tail });
    this.keep({ key, range }, values, values.byteLength);
  }
}

function frameKey(iteration: number): string {
  return `frame ${iteration}`;
}

function fieldKey(iteration: number, field: Field): string {
  return `${field} ${iteration}`;
}

/** Whether a failure to load will pass by itself. */
export function willPass(thrown: unknown): boolean {
  return thrown instanceof Problem && (thrown.passing || thrown.slug === 'result-not-ready');
}
