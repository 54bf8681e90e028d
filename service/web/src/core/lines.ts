/** How strongly the lines of triangles are drawn. */

const STRONGEST = 0.34;
const FAINTEST = 0.03;
/** Triangles whose edges are at least so many pixels long have their lines drawn at full strength. */
const APART_PX = 9;

/**
 * Return the opacity of lines, fainter the denser they lie: at full strength those of a million triangles would be
 * one black patch.
 *
 * @param triangles over a shape of the size of a ball of radius 1.
 * @param distance of the camera, in such radii.
 * @param fieldOfView vertical, in degrees.
 * @param height of the picture in pixels.
 */
export function lineOpacity(
  triangles: number,
  distance: number,
  fieldOfView: number,
  height: number,
): number {
  const area = (4 * Math.PI) / Math.max(triangles, 1);
  const edge = Math.sqrt((4 * area) / Math.sqrt(3));
  const pixels =
    (edge * height) / (2 * Math.tan((fieldOfView * Math.PI) / 360) * Math.max(distance - 1, 0.05));
  return Math.max(FAINTEST, STRONGEST * Math.min(pixels / APART_PX, 1));
}
