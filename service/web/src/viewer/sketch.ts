import { type WebGLRenderer, WebGLRenderTarget } from 'three';
import type { Pose } from '../core/camera';
import type { Canvas, Surface } from './asks';
import { Sight } from './sight';
import { type Paints, SurfaceMesh } from './surface';

const SAMPLES = 4; // of each pixel, against jagged outlines
const IN_MEMORY = { willReadFrequently: true }; // the graphics card has no part in it

/**
 * Draw a square picture of a surface without a canvas of its own: to make one takes as long as many pictures. What is
 * shown on the canvas of the renderer stays, and nobody waits for the graphics card.
 *
 * @param size of its sides, in pixels.
 */
export async function sketch(
  renderer: WebGLRenderer,
  paints: Paints,
  { index, frame, bounds }: Surface,
  pose: Pose,
  size: number,
): Promise<ImageData> {
  const sight = new Sight();
  sight.place(bounds);
  sight.aim(pose);
  const surface = new SurfaceMesh(paints, index, frame.positions.length / 3);
  const target = new WebGLRenderTarget(size, size, { samples: SAMPLES });
  const pixels = new Uint8Array(4 * size * size);
  try {
    surface.show({ frame, values: null }, { frame, values: null }, 0);
    sight.frame.add(surface.mesh);
    renderer.setRenderTarget(target);
    renderer.render(sight.space, sight.camera);
    renderer.setRenderTarget(null);
    await renderer.readRenderTargetPixelsAsync(target, 0, 0, size, size, pixels);
  } finally {
    surface.dispose();
    target.dispose();
  }
  return new ImageData(upright(pixels, size), size, size);
}

/** Return pixels from the top row on, whose colours are not multiplied by their opacity, as files have them. */
function upright(pixels: Uint8Array, size: number): Uint8ClampedArray<ArrayBuffer> {
  const turned = new Uint8ClampedArray(pixels.length);
  const row = 4 * size;
  for (let at = 0; at < pixels.length; at += 4) {
    const from = pixels.length - row * (Math.floor(at / row) + 1) + (at % row);
    const opacity = pixels[from + 3] ?? 0;
    for (const c of [0, 1, 2]) turned[at + c] = ((pixels[from + c] ?? 0) * 255) / Math.max(opacity, 1);
    turned[at + 3] = opacity;
  }
  return turned;
}

/** Return pixels as a small file. */
export function fileOf(pixels: ImageData): Promise<Blob | null> {
  if (typeof document === 'undefined') {
    const sheet = new OffscreenCanvas(pixels.width, pixels.height);
    sheet.getContext('2d', IN_MEMORY)?.putImageData(pixels, 0, 0);
    return copyOf(sheet, 'image/webp');
  }
  const sheet = document.createElement('canvas');
  [sheet.width, sheet.height] = [pixels.width, pixels.height];
  sheet.getContext('2d')?.putImageData(pixels, 0, 0);
  return copyOf(sheet, 'image/webp');
}

/** Return what is on a canvas as a file. */
export function copyOf(canvas: Canvas, type: string): Promise<Blob | null> {
  if ('convertToBlob' in canvas) return canvas.convertToBlob({ type });
  return new Promise((resolve) => {
    canvas.toBlob(resolve, type);
  });
}
