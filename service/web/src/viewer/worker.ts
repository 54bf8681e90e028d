import type { Ask, Told } from './asks';
import { Painter } from './painter';

/** Draws every canvas of the page, so that the page's own thread never waits for the graphics card. */

const painters = new Map<number, Painter>();

self.onmessage = ({ data }: MessageEvent<{ canvas: number; ask: Ask }>) => {
  const { canvas, ask } = data;
  if (ask.ask === 'open') {
    const tell = (told: Told): void => {
      self.postMessage({ canvas, told });
    };
    painters.set(canvas, new Painter(ask.canvas, tell));
    return;
  }
  painters.get(canvas)?.take(ask);
  if (ask.ask === 'close') painters.delete(canvas);
};
