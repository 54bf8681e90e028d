import type { Ask, Asked, Canvas, Heard } from './asks';
import { Painter } from './painter';

type Sketch = Extract<Ask, { ask: 'sketch' }>;

/** A painter, and the number that its canvas has now. */
interface Seat {
  readonly plate: { number: number };
  readonly painter: Painter;
}

/** All canvases of the page, and who draws them: in a worker, or where there are none for it, on the page's thread. */
export class Studio {
  private readonly seats = new Map<number, Seat>();

  constructor(private readonly say: (heard: Heard) => void) {}

  /** Have the painter of a canvas do what is asked. */
  take({ canvas, ask }: Asked): void {
    if (ask.ask === 'open') this.seats.set(canvas, this.seated(canvas, ask.canvas));
    else if (ask.ask === 'pass') this.pass(canvas, ask.from);
    else if (ask.ask === 'sketch') void this.sketch(canvas, ask);
    else this.seats.get(canvas)?.painter.take(ask);
    if (ask.ask === 'close') this.seats.delete(canvas);
  }

  /** Have any painter that can draw a picture of what is shown nowhere, also if its canvas is handed on meanwhile. */
  private async sketch(number: number, { surface, pose, size }: Sketch): Promise<void> {
    const seat = [...this.seats.values()].find(({ painter }) => painter.able);
    const blob = seat === undefined ? null : await seat.painter.sketch(surface, pose, size);
    this.say({ canvas: number, told: { told: 'picture', blob } });
  }

  private seated(number: number, canvas: Canvas): Seat {
    const plate = { number };
    const painter = new Painter(canvas, (told) => {
      this.say({ canvas: plate.number, told });
    });
    return { plate, painter };
  }

  /** Know a painter by another number; what it says from now on is said under that. */
  private pass(number: number, from: number): void {
    const seat = this.seats.get(from);
    if (seat === undefined) return;
    this.seats.delete(from);
    this.seats.set(number, seat);
    seat.plate.number = number;
    seat.painter.begin();
  }
}
