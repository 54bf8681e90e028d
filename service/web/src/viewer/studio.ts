import type { Asked, Heard } from './asks';
import { Painter } from './painter';

/** All canvases of the page, and who draws them: in a worker, or where there are none for it, on the page's thread. */
export class Studio {
  private readonly painters = new Map<number, Painter>();

  constructor(private readonly say: (heard: Heard) => void) {}

  /** Have the painter of a canvas do what is asked. */
  take({ canvas, ask }: Asked): void {
    if (ask.ask === 'open') {
      const painter = new Painter(ask.canvas, (told) => {
        this.say({ canvas, told });
      });
      this.painters.set(canvas, painter);
      return;
    }
    this.painters.get(canvas)?.take(ask);
    if (ask.ask === 'close') this.painters.delete(canvas);
  }
}
