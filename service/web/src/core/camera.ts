import type { CameraView, Up } from './route';

/** A camera on an orbit, as numbers. */

type Vector = readonly [number, number, number];

/** Where one looks from at first: a little from above, a little from the side. */
export const FRONT: CameraView = { azimuth: 0.65, elevation: 0.38, distance: 3.3, target: [0, 0, 0] };

/** How far from the poles the camera stays, in radians: there is no upright at a pole. */
const POLE = 1e-3;
const FIELD_OF_VIEW = 38;

/** What a camera draws by: its place, where it looks, what is up, and its vertical field of view in degrees. */
export interface Pose {
  readonly eye: Vector;
  readonly target: Vector;
  readonly up: Vector;
  readonly fieldOfView: number;
}

/** Return what a view means in space, on a picture of this width over height. */
export function poseOf(view: CameraView, up: Up, aspect: number): Pose {
  return {
    eye: eyeOf(view, up),
    target: view.target,
    up: axisOf(up),
    fieldOfView: fieldOfView(aspect),
  };
}

/** Return the unit vector that stands upright. */
export function axisOf(up: Up): Vector {
  return up === 'y' ? [0, 1, 0] : [0, 0, 1];
}

/** A picture higher than wide, as on a phone, shows all of the shape nevertheless. */
export function fieldOfView(aspect: number): number {
  return aspect < 1 ? FIELD_OF_VIEW / Math.max(aspect, 0.55) : FIELD_OF_VIEW;
}

/** Return where the camera of a view stands. */
export function eyeOf({ azimuth, elevation, distance, target }: CameraView, up: Up): Vector {
  const angle = Math.min(Math.max(elevation, POLE - Math.PI / 2), Math.PI / 2 - POLE);
  const [right, upright, front] = [
    distance * Math.cos(angle) * Math.sin(azimuth),
    distance * Math.sin(angle),
    distance * Math.cos(angle) * Math.cos(azimuth),
  ];
  const [x, y, z] = up === 'y' ? [right, upright, front] : [right, -front, upright];
  return [target[0] + x, target[1] + y, target[2] + z];
}

/** Return the view of a camera that stands at `eye` and looks at `target`: the inverse of `eyeOf`. */
export function viewOf(eye: Vector, target: Vector, up: Up): CameraView {
  const [x, y, z] = [eye[0] - target[0], eye[1] - target[1], eye[2] - target[2]];
  const [right, upright, front] = up === 'y' ? [x, y, z] : [x, z, -y];
  const distance = Math.hypot(right, upright, front);
  return {
    azimuth: Math.atan2(right, front),
    elevation: Math.asin(Math.min(Math.max(upright / (distance || 1), -1), 1)),
    distance,
    target,
  };
}
