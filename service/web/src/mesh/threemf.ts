import { strFromU8, unzipSync } from 'three/addons/libs/fflate.module.js';

/** Positions and triangles of a 3MF package. */
export interface Packed {
  readonly positions: number[];
  readonly index: number[];
}

/**
 * Read a 3MF package that holds one body and places it once, which is what programs mostly write; null for any other,
 * which is the service's to put together. A worker has no parser of XML, and the format's elements for a mesh have
 * nothing but attributes.
 */
export function threemf(data: ArrayBuffer): Packed | null {
  const parts = Object.values(
    unzipSync(new Uint8Array(data), { filter: ({ name }) => /\.model$/i.test(name) }),
  );
  const [model] = parts;
  if (model === undefined || parts.length > 1) return null;
  const text = strFromU8(model);
  const items = elements(text, 'item');
  const bodies = elements(text, 'mesh').length;
  if (bodies !== 1 || items.length !== 1 || elements(text, 'component').length > 0) return null;
  const place = placement(items[0] ?? '');
  const positions = elements(text, 'vertex').flatMap((vertex) =>
    place(['x', 'y', 'z'].map((axis) => Number(attribute(vertex, axis)))),
  );
  const index = elements(text, 'triangle').flatMap((triangle) =>
    ['v1', 'v2', 'v3'].map((corner) => Number(attribute(triangle, corner))),
  );
  return { positions, index };
}

function elements(text: string, name: string): string[] {
  return text.match(new RegExp(`<(?:\\w+:)?${name}(?=[\\s/>])[^>]*>`, 'g')) ?? [];
}

function attribute(element: string, name: string): string | undefined {
  return new RegExp(`\\s${name}\\s*=\\s*["']([^"']*)["']`).exec(element)?.[1];
}

/** Return what an item's `transform` does to a point: twelve numbers, by rows, the last row moves. */
function placement(item: string): (point: readonly number[]) => number[] {
  const matrix = attribute(item, 'transform')?.trim().split(/\s+/).map(Number);
  if (matrix === undefined) return (point) => [...point];
  return (point) =>
    [0, 1, 2].map((column) =>
      [...point, 1].reduce((sum, value, row) => sum + value * (matrix[3 * row + column] ?? NaN), 0),
    );
}
