import { asProblem } from '../api/problem';
import { poseOf } from '../core/camera';
import { Emitter } from '../core/emitter';
import type { CameraView, Up } from '../core/route';
import { Shelf } from '../core/shelf';
import { storage } from '../core/storage';
import type { MeshWorker } from '../mesh/pool';
import { idle, painted } from '../ui/painted';
import { warm } from '../viewer/easels';
import { sketch } from '../viewer/remote';

const SIZE = 192;
const FROM: CameraView = { azimuth: 0.65, elevation: 0.38, distance: 3.3, target: [0, 0, 0] };
const AGAIN_MS = 3000;
const MOST = 150; // some 4 kB each
const NAME = 'spherify thumbnails 2'; // another number where they are drawn another way
const NEVER_OLD = new Set(['initial', 'final']); // what is asked for of finished jobs alone, or never changes

/** Small pictures of states of jobs, drawn one after another where there is time, and kept by the browser. */
export class Thumbnails extends Emitter {
  private readonly pictures = new Map<string, string | null>();
  private readonly shelf = new Shelf(storage(), NAME, MOST);
  /** First what all begin with, then what they became. */
  private readonly queues: readonly [(() => Promise<void>)[], (() => Promise<void>)[]] = [[], []];
  private working = false;
  private awaited: (() => void) | null = null;
  private held = false;

  constructor(private readonly worker: MeshWorker) {
    super();
  }

  /** Return the address of a picture, or null until there is one; `which` is an iteration or a name. */
  picture(job: string, which: string, up: Up): string | null {
    const key = `${job} ${which} ${up}`;
    const known = this.pictures.get(key);
    if (known !== undefined) return known;
    const kept = this.shelf.get(key);
    this.pictures.set(key, kept);
    if (kept !== null) return kept;
    this.queues[which === 'initial' ? 0 : 1].push(() => this.attempt(key, job, which, up));
    if (!this.working) void this.work();
    return null;
  }

  /** Let them wait while something moves that is looked at, or is waited for: they are drawn by the same hand. */
  set hold(held: boolean) {
    this.held = held;
    if (!held) this.awaited?.();
  }

  private async work(): Promise<void> {
    this.working = true;
    await painted();
    for (let next = this.next(); next; next = this.next()) {
      await this.turn();
      await next();
    }
    this.working = false;
  }

  /** Wait until there is time: what the visitor looks at comes first. */
  private async turn(): Promise<void> {
    await idle();
    while (this.held)
      await new Promise<void>((resolve) => {
        this.awaited = resolve;
      });
  }

  private next(): (() => Promise<void>) | undefined {
    return this.queues[0].shift() ?? this.queues[1].shift();
  }

  private async attempt(key: string, job: string, which: string, up: Up): Promise<void> {
    try {
      await this.draw(key, job, which, up);
    } catch (thrown) {
      // its job may have been deleted meanwhile, and its place stays empty; or the service is away for a moment
      const problem = asProblem(thrown);
      if (problem.passing)
        setTimeout(() => {
          this.forget(key);
        }, problem.waitMs(AGAIN_MS));
    }
  }

  /** Let a picture be asked for once more. */
  private forget(key: string): void {
    this.pictures.delete(key);
    this.changed();
  }

  private async draw(key: string, job: string, which: string, up: Up): Promise<void> {
    const name = `thumbnail of ${key}`;
    const drawable = await this.worker.ask('topology', {
      key: name,
      faces: `/v1/jobs/${job}/topology`,
      positions: `/v1/jobs/${job}/snapshots/${which}/positions?dtype=f32`,
    });
    void this.worker.ask('forget', { key: name });
    await this.turn();
    warm({ width: SIZE, height: SIZE });
    const picture = await address(await sketch(drawable, poseOf(FROM, up, 1), SIZE));
    this.pictures.set(key, picture);
    if (NEVER_OLD.has(which)) this.shelf.put(key, picture);
    this.changed();
  }
}

/** The picture itself as an address, which outlives the page. */
function address(blob: Blob): Promise<string> {
  return new Promise((resolve, reject) => {
    const reader = new FileReader();
    reader.onload = () => {
      resolve(reader.result as string);
    };
    reader.onerror = () => {
      reject(reader.error ?? new Error('the picture could not be read'));
    };
    reader.readAsDataURL(blob);
  });
}
