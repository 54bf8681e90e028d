import { strFromU8, unzipSync } from 'three/addons/libs/fflate.module.js';

/** Positions and triangles of a 3MF package. */
export interface Packed {
  readonly positions: number[];
  readonly index: number[];
}

type Place = (point: readonly number[]) => readonly number[];

const DEEPEST = 8; // parts of parts; a file whose parts are made of themselves ends here

/**
 * Read a 3MF package: every body where the build places it, also those that are put together of others. Null for a
 * package of several model files, which is the service's to read. A worker has no parser of XML, and the format's
 * elements for a mesh have nothing but attributes.
 */
export function threemf(data: ArrayBuffer): Packed | null {
  const parts = Object.values(
    unzipSync(new Uint8Array(data), { filter: ({ name }) => /\.model$/i.test(name) }),
  );
  const [model] = parts;
  if (model === undefined || parts.length > 1) return null;
  const text = strFromU8(model);
  const objects = new Map(
    (text.match(OBJECT) ?? []).map((object) => [attribute(object, 'id') ?? '', object] as const),
  );
  const packed: Packed = { positions: [], index: [] };
  for (const item of elements(text, 'item')) build(objects, item, (point) => point, packed, 0);
  return packed;
}

const OBJECT = /<(?:\w+:)?object(?=[\s>])[\s\S]*?<\/(?:\w+:)?object>/g;

/** Put in what an item or a component names. */
function build(
  objects: ReadonlyMap<string, string>,
  reference: string,
  outer: Place,
  packed: Packed,
  depth: number,
): void {
  const object = objects.get(attribute(reference, 'objectid') ?? '');
  if (object === undefined || depth > DEEPEST) return;
  const inner = placement(reference);
  const place: Place = (point) => outer(inner(point));
  const first = packed.positions.length / 3;
  for (const vertex of elements(object, 'vertex'))
    packed.positions.push(...place(['x', 'y', 'z'].map((axis) => Number(attribute(vertex, axis)))));
  for (const triangle of elements(object, 'triangle'))
    for (const corner of ['v1', 'v2', 'v3']) packed.index.push(first + Number(attribute(triangle, corner)));
  for (const component of elements(object, 'component')) build(objects, component, place, packed, depth + 1);
}

function elements(text: string, name: string): string[] {
  return text.match(new RegExp(`<(?:\\w+:)?${name}(?=[\\s/>])[^>]*>`, 'g')) ?? [];
}

function attribute(element: string, name: string): string | undefined {
  return new RegExp(`\\s${name}\\s*=\\s*["']([^"']*)["']`).exec(element)?.[1];
}

/** Return what an item's `transform` does to a point: twelve numbers, by rows, the last row moves. */
function placement(item: string): Place {
  const matrix = attribute(item, 'transform')?.trim().split(/\s+/).map(Number);
  if (matrix === undefined) return (point) => point;
  return (point) =>
    [0, 1, 2].map((column) =>
      [...point, 1].reduce((sum, value, row) => sum + value * (matrix[3 * row + column] ?? NaN), 0),
    );
}
