import type { Scale } from './scale';

/** Seconds in which a whole run is played at speed 1. */
export const WHOLE_RUN_S = 8;
export const SPEEDS = [0.25, 0.5, 1, 2, 4] as const;

/** What moves the playhead while it plays: evenly along the scale, so that each part is seen as long as it is wide. */
export class Player {
  playing = false;
  loop = false;
  speed = 1;

  /** Return the iteration a moment later; stops at the end unless it loops. */
  advance(iteration: number, seconds: number, scale: Scale): number {
    if (!this.playing) return iteration;
    const place = scale.place(iteration) + (seconds * this.speed) / WHOLE_RUN_S;
    if (place < 1) return scale.iteration(place);
    if (this.loop) return scale.iteration(place % 1);
    this.playing = false;
    return scale.last;
  }

  /** Start, from the beginning if it stands at the end, or stop; returns where it stands. */
  toggle(iteration: number, scale: Scale): number {
    this.playing = !this.playing;
    return this.playing && iteration >= scale.last ? 0 : iteration;
  }

  /** Take the next speed up or down. */
  faster(direction: 1 | -1): void {
    const index = SPEEDS.findIndex((speed) => speed >= this.speed) + direction;
    this.speed = SPEEDS[Math.min(Math.max(index, 0), SPEEDS.length - 1)] ?? 1;
  }
}
