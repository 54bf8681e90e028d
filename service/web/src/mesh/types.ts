/** Triangles as they are drawn: positions of n vertices, and 3 indices a triangle. */
export interface Surface {
  readonly positions: Float32Array<ArrayBuffer>;
  readonly index: Uint32Array<ArrayBuffer>;
}

/** One state of a surface, ready for the graphics card. */
export interface Frame {
  readonly positions: Float32Array<ArrayBuffer>;
  /** Unit normals, 4 signed bytes a vertex, the last unused. */
  readonly normals: Int8Array<ArrayBuffer>;
}

/** A ball around a surface, and its box. */
export interface Bounds {
  readonly centre: readonly [number, number, number];
  readonly radius: number;
}

/** How many bytes a frame takes. */
export function bytesOf(frame: Frame): number {
  return frame.positions.byteLength + frame.normals.byteLength;
}

/** Return the ball around the box of a surface. */
export function boundsOf(positions: Float32Array): Bounds {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < positions.length; i++) {
    const value = positions[i] ?? 0;
    const axis = i % 3;
    if (value < (low[axis] ?? 0)) low[axis] = value;
    if (value > (high[axis] ?? 0)) high[axis] = value;
  }
  const middle = (axis: number): number => ((low[axis] ?? 0) + (high[axis] ?? 0)) / 2;
  const half = (axis: number): number => ((high[axis] ?? 0) - (low[axis] ?? 0)) / 2;
  const radius = Math.hypot(half(0), half(1), half(2));
  return {
    centre: [middle(0), middle(1), middle(2)],
    radius: Number.isFinite(radius) && radius > 0 ? radius : 1,
  };
}
