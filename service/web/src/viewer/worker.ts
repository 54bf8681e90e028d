import type { Asked } from './asks';
import { Studio } from './studio';

/** Draws every canvas of the page, so that the page's own thread never waits for the graphics card. */

const studio = new Studio((heard) => {
  self.postMessage(heard);
});

self.onmessage = ({ data }: MessageEvent<Asked>) => {
  studio.take(data);
};
