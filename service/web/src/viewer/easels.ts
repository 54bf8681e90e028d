import type { Scene, Surface, Told } from './asks';
import { drawsInWorkers, Remote } from './remote';

/**
 * Canvases with those who draw them. They are handed on from view to view and not made anew: to make one, some thirty
 * things are asked of the browser's graphics process one after another, each of which may wait for a whole picture of the
 * page, and what is drawn first on it waits until the way surfaces are drawn is compiled.
 */
export interface Easel {
  readonly canvas: HTMLCanvasElement;
  readonly remote: Remote;
}

type Hearing = (told: Told) => void;

const MOST_SPARE = 2; // a comparison has two
const spare: Easel[] = [];
let out = 0;

/** Return an empty one, a used one if there is one. */
export function take(told: Hearing): Easel {
  out += 1;
  const found = spare.pop();
  if (found === undefined) return made(told);
  found.remote.pass(told);
  return found;
}

/** Hand one back; it may be taken again `whole`, that is while nothing is wrong with it. */
export function giveBack(easel: Easel, whole: boolean): void {
  out -= 1;
  if (whole && spare.length < MOST_SPARE) keep(easel);
  else easel.remote.close();
}

/**
 * Have one ready before the first is wanted, on which a surface was drawn already.
 *
 * @param size that it will likely have, in pixels: to change it waits for the graphics process eight times.
 */
export function warm(size: { readonly width: number; readonly height: number }): void {
  if (out + spare.length > 0) return; // it will be handed on
  const easel = made(() => undefined);
  keep(easel);
  const { index, frame, bounds } = tetrahedron();
  easel.remote.send({ ask: 'load', index, key: 'first', frame, bounds });
  const ratio = Math.min(devicePixelRatio, 2);
  easel.remote.send({ ask: 'draw', scene: { ...BEFORE, size: { ...size, ratio } } });
}

function made(told: Hearing): Easel {
  const canvas = document.createElement('canvas');
  const drawn = drawsInWorkers() ? canvas.transferControlToOffscreen() : canvas;
  return { canvas, remote: new Remote(drawn, told) };
}

/** Keep one until it is wanted or lost. */
function keep(easel: Easel): void {
  easel.canvas.remove();
  spare.push(easel);
  easel.remote.pass((told) => {
    if (told.told !== 'state' || told.state === 'ready') return;
    spare.splice(spare.indexOf(easel), 1);
    easel.remote.close();
  });
}

const BEFORE: Omit<Scene, 'size'> = {
  pose: { eye: [0, 0, 3], target: [0, 0, 0], up: [0, 1, 0], fieldOfView: 38 },
  states: null,
  colours: null,
  wire: false,
  facets: false,
};

/** Return the least surface there is. */
function tetrahedron(): Surface {
  const corners = [1, 1, 1, 1, -1, -1, -1, 1, -1, -1, -1, 1];
  return {
    index: new Uint32Array([0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2]),
    frame: { positions: new Float32Array(corners), normals: new Int8Array(16).fill(73) },
    bounds: { centre: [0, 0, 0], radius: 2 },
  };
}
