import type { Location } from '../api/types';
import type { Pose } from '../core/camera';
import type { Faults } from '../mesh/faults';
import type { Bounds, Frame } from '../mesh/types';

/** What the page asks of the worker that draws, and what it is told: `worker.ts` draws, `remote.ts` asks. */

/** One that was handed to a worker, or one of the page. */
export type Canvas = OffscreenCanvas | HTMLCanvasElement;

/** A state that was handed over, and the quantity it is coloured by, by their keys. */
export interface Shown {
  readonly frame: string;
  readonly values: string | null;
}

/** Everything that decides on a picture. */
export interface Scene {
  /** In pixels of the style sheet; `ratio` of the screen's to each. */
  readonly size: { readonly width: number; readonly height: number; readonly ratio: number };
  readonly pose: Pose;
  /** Two states and the share of the second; null shows what was loaded. */
  readonly states: { readonly before: Shown; readonly after: Shown; readonly blend: number } | null;
  readonly colours: { readonly low: number; readonly high: number; readonly diverging: boolean } | null;
  readonly wire: boolean;
  readonly facets: boolean;
}

/** A surface in its first state, ready to be drawn. */
export interface Surface {
  readonly index: Uint32Array<ArrayBuffer>;
  readonly frame: Frame;
  readonly bounds: Bounds;
}

export type Ask =
  | { readonly ask: 'open'; readonly canvas: Canvas }
  /** Take the canvas over that another was, emptied. */
  | { readonly ask: 'pass'; readonly from: number }
  /** Put another surface in, with its first state. */
  | ({ readonly ask: 'load'; readonly key: string } & Surface)
  | { readonly ask: 'keep'; readonly key: string; readonly numbers: Frame | Float32Array<ArrayBuffer> }
  | { readonly ask: 'drop'; readonly key: string }
  /** Draw what is wrong with the surface. */
  | {
      readonly ask: 'mark';
      readonly faults: Faults | null;
      readonly places: readonly Location[];
      readonly positions: Float32Array<ArrayBuffer> | null;
    }
  | { readonly ask: 'draw'; readonly scene: Scene }
  | { readonly ask: 'picture'; readonly scene: Scene }
  /** Hand over a square picture of what is shown nowhere: whichever canvas there is lends what draws it. */
  | { readonly ask: 'sketch'; readonly surface: Surface; readonly pose: Pose; readonly size: number }
  | { readonly ask: 'close' };

export type DrawingState = 'ready' | 'lost' | 'unsupported';

export type Told =
  | { readonly told: 'drawn' }
  /** The first picture of a surface is to be seen. */
  | { readonly told: 'shown' }
  | { readonly told: 'state'; readonly state: DrawingState }
  /** A picture, in the order they were asked for; null if it could not be made. */
  | { readonly told: 'picture'; readonly blob: Blob | null };

/** What is asked of a canvas, and what is heard of it. */
export interface Asked {
  readonly canvas: number;
  readonly ask: Ask;
}
export interface Heard {
  readonly canvas: number;
  readonly told: Told;
}
