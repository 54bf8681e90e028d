/** How strongly the lines of triangles are drawn. */

export const STRONGEST = 0.34;
const FAINTEST = 0.04;
/** Triangles whose edges are at least so many pixels long have their lines drawn at full strength. */
const APART_PX = 16;
const SAMPLES = 256;

/**
 * Return the opacity of lines, fainter the denser they lie: at full strength those of a million triangles would be
 * one black patch.
 *
 * @param edge how long one is, in radii of the shape.
 * @param distance of the camera, in such radii.
 * @param fieldOfView vertical, in degrees.
 * @param height of the picture in pixels.
 */
export function lineOpacity(edge: number, distance: number, fieldOfView: number, height: number): number {
  const nearest = Math.max(distance - 1, 0.05);
  const pixels = (edge * height) / (2 * Math.tan((fieldOfView * Math.PI) / 360) * nearest);
  return Math.max(FAINTEST, STRONGEST * Math.min(pixels / APART_PX, 1));
}

/** Return the mean length of an edge, from some hundred triangles that are spread over the list. */
export function meanEdge(index: ArrayLike<number>, positions: ArrayLike<number>): number {
  const triangles = index.length / 3;
  const stride = Math.max(1, Math.floor(triangles / SAMPLES));
  let [sum, edges] = [0, 0];
  for (let t = 0; t < triangles; t += stride)
    for (let side = 0; side < 3; side++) {
      const a = 3 * (index[3 * t + side] ?? 0);
      const b = 3 * (index[3 * t + ((side + 1) % 3)] ?? 0);
      const along = (axis: number): number => (positions[a + axis] ?? 0) - (positions[b + axis] ?? 0);
      sum += Math.hypot(along(0), along(1), along(2));
      edges += 1;
    }
  return edges === 0 ? 0 : sum / edges;
}
