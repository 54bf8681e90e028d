import { Emitter } from '../core/emitter';
import { FRONT } from './camera';
import type { MeshWorker } from '../mesh/pool';
import { Viewer } from './viewer';
import type { Up } from '../core/route';

const SIZE = 192;

/** Small pictures of states of jobs, drawn one after another on a canvas nobody sees. */
export class Thumbnails extends Emitter {
  private readonly pictures = new Map<string, string | null>();
  private readonly queue: (() => Promise<void>)[] = [];
  private working = false;
  private viewer: Viewer | null = null;

  constructor(private readonly worker: MeshWorker) {
    super();
  }

  /** Return the address of a picture, or null until there is one; `which` is an iteration or a name. */
  picture(job: string, which: string, up: Up): string | null {
    const key = `${job} ${which} ${up}`;
    const known = this.pictures.get(key);
    if (known !== undefined) return known;
    this.pictures.set(key, null);
    this.queue.push(() => this.draw(key, job, which, up));
    void this.work();
    return null;
  }

  private async work(): Promise<void> {
    if (this.working) return;
    this.working = true;
    for (let next = this.queue.shift(); next; next = this.queue.shift()) {
      try {
        await next();
      } catch {
        // a picture less: its job may have been deleted meanwhile, and its place stays empty
      }
    }
    this.viewer?.dispose();
    this.viewer = null;
    this.working = false;
  }

  private async draw(key: string, job: string, which: string, up: Up): Promise<void> {
    const name = `thumbnail of ${key}`;
    const drawable = await this.worker.ask('topology', {
      key: name,
      faces: `/v1/jobs/${job}/topology`,
      positions: `/v1/jobs/${job}/snapshots/${which}/positions?dtype=f32`,
    });
    void this.worker.ask('forget', { key: name });
    const viewer = this.viewer ?? this.open();
    viewer.load(drawable);
    viewer.up = up;
    viewer.look({ ...FRONT, distance: 2.95 });
    this.pictures.set(key, URL.createObjectURL(await viewer.picture()));
    this.changed();
  }

  private open(): Viewer {
    this.viewer = new Viewer('thumbnail', SIZE);
    return this.viewer;
  }
}
