import type { Ask, PictureType, Scene, Told } from './asks';

/** Whether this browser can hand a canvas to a worker. */
export function drawsInWorkers(): boolean {
  return 'OffscreenCanvas' in globalThis && 'transferControlToOffscreen' in HTMLCanvasElement.prototype;
}

const open = new Map<number, Remote>();
let worker: Worker | null = null; // one for all canvases of the page, from the first one on
let last = 0;

function started(): Worker {
  const made = new Worker(new URL('./worker.ts', import.meta.url), { type: 'module', name: 'drawing' });
  made.onmessage = ({ data }: MessageEvent<{ canvas: number; told: Told }>) => {
    open.get(data.canvas)?.hear(data.told);
  };
  made.onerror = (event) => {
    if (!event.message && worker === made) worker = null; // its code could not be fetched: tried again next time
    for (const remote of open.values()) remote.hear({ told: 'state', state: 'unsupported' });
  };
  return made;
}

/** Have the worker started before the first canvas, while there is time. */
export function warm(): void {
  if (drawsInWorkers()) worker ??= started();
}

/** A canvas that the worker draws. */
export class Remote {
  private readonly id = ++last;
  private readonly pictures: ((blob: Blob | null) => void)[] = [];

  constructor(
    canvas: OffscreenCanvas,
    private readonly told: (told: Told) => void = () => undefined,
  ) {
    open.set(this.id, this);
    this.send({ ask: 'open', canvas }, [canvas]);
  }

  /** Ask for something; `transfer` is handed over. */
  send(ask: Ask, transfer: Transferable[] = []): void {
    worker ??= started();
    worker.postMessage({ canvas: this.id, ask }, transfer);
  }

  /** Return a picture of a scene. */
  async picture(scene: Scene, type: PictureType): Promise<Blob> {
    const blob = await new Promise<Blob | null>((resolve) => {
      this.pictures.push(resolve);
      this.send({ ask: 'picture', scene, type });
    });
    if (blob === null) throw new Error('the picture could not be made');
    return blob;
  }

  hear(told: Told): void {
    if (told.told === 'picture') this.pictures.shift()?.(told.blob);
    else this.told(told);
  }

  close(): void {
    this.send({ ask: 'close' });
    open.delete(this.id);
    for (const asked of this.pictures.splice(0)) asked(null);
  }
}
