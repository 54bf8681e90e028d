import type { Pose } from '../core/camera';
import type { Ask, Asked, Canvas, Heard, Scene, Surface, Told } from './asks';

/** Whether this browser can hand a canvas to a worker. */
export function drawsInWorkers(): boolean {
  return 'OffscreenCanvas' in globalThis && 'transferControlToOffscreen' in HTMLCanvasElement.prototype;
}

const open = new Map<number, Pick<Remote, 'hear'>>();
/** Does what is asked: a worker, or where there is none for it, this thread. */
interface Hand {
  postMessage(asked: Asked, transfer: Transferable[]): void;
}

let hand: Hand | null = null; // one for all canvases of the page, from the first one on
let last = 0;

function hear({ canvas, told }: Heard): void {
  open.get(canvas)?.hear(told);
}

function fail(): void {
  for (const remote of open.values()) remote.hear({ told: 'state', state: 'unsupported' });
}

function started(): Hand {
  return drawsInWorkers() ? inWorker() : here();
}

/** Draw on the page's own thread, as older browsers must; the code for it is fetched by them alone. */
function here(): Hand {
  const studio = import('./studio').then(({ Studio }) => new Studio(hear));
  const made: Hand = {
    postMessage: (asked) => {
      studio.then((one) => {
        one.take(asked);
      }, failed);
    },
  };
  const failed = (): void => {
    if (hand === made) hand = null;
    fail();
  };
  return made;
}

function inWorker(): Worker {
  const made = new Worker(new URL('./worker.ts', import.meta.url), { type: 'module', name: 'drawing' });
  made.onmessage = ({ data }: MessageEvent<Heard>) => {
    hear(data);
  };
  made.onerror = (event) => {
    if (!event.message && hand === made) hand = null; // its code could not be fetched: tried again next time
    fail();
  };
  return made;
}

function send(asked: Asked, transfer: Transferable[]): void {
  hand ??= started();
  hand.postMessage(asked, transfer);
}

/** Return a square picture of a surface that is shown nowhere; it is handed over. There must be a canvas already. */
export async function sketch(surface: Surface, pose: Pose, size: number): Promise<Blob> {
  const { index, frame, bounds } = surface;
  const id = ++last;
  const blob = await new Promise<Blob | null>((resolve) => {
    open.set(id, {
      hear: (told) => {
        resolve(told.told === 'picture' ? told.blob : null);
      },
    });
    const transfer = [index.buffer, frame.positions.buffer, frame.normals.buffer];
    send({ canvas: id, ask: { ask: 'sketch', surface: { index, frame, bounds }, pose, size } }, transfer);
  });
  open.delete(id);
  return made(blob);
}

function made(blob: Blob | null): Blob {
  if (blob === null) throw new Error('The picture could not be made.');
  return blob;
}

/** A canvas that is drawn by a worker, if there is one. */
export class Remote {
  private id = ++last;
  private readonly pictures: ((blob: Blob | null) => void)[] = [];

  constructor(
    canvas: Canvas,
    private told: (told: Told) => void = () => undefined,
  ) {
    open.set(this.id, this);
    this.send({ ask: 'open', canvas }, canvas instanceof HTMLCanvasElement ? [] : [canvas]);
  }

  /** Ask for something; `transfer` is handed over. */
  send(ask: Ask, transfer: Transferable[] = []): void {
    send({ canvas: this.id, ask }, transfer);
  }

  /** Return a picture of a scene, as PNG. */
  async picture(scene: Scene): Promise<Blob> {
    const blob = await new Promise<Blob | null>((resolve) => {
      this.pictures.push(resolve);
      this.send({ ask: 'picture', scene });
    });
    return made(blob);
  }

  hear(told: Told): void {
    if (told.told === 'picture') this.pictures.shift()?.(told.blob);
    else this.told(told);
  }

  /** Belong to somebody else from now on, emptied: what is on its way to the former one is not heard any more. */
  pass(told: (told: Told) => void): void {
    const from = this.id;
    this.leave();
    this.id = ++last;
    this.told = told;
    open.set(this.id, this);
    this.send({ ask: 'pass', from });
  }

  close(): void {
    hand?.postMessage({ canvas: this.id, ask: { ask: 'close' } }, []); // none is begun for that
    this.leave();
  }

  private leave(): void {
    open.delete(this.id);
    for (const asked of this.pictures.splice(0)) asked(null);
  }
}
