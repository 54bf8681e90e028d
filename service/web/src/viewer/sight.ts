import { Group, PerspectiveCamera, Scene as Space } from 'three';
import type { Pose } from '../core/camera';
import type { Bounds } from '../mesh/types';

/** A surface's place in front of a camera. */
export class Sight {
  readonly space = new Space();
  readonly camera = new PerspectiveCamera(38, 1, 0.01, 100);
  /** Scales what is in it to a ball of radius 1 around the origin. */
  readonly frame = new Group();

  constructor() {
    this.space.add(this.frame);
  }

  /** Scale by where a surface lies, in units of its file. */
  place({ centre, radius }: Bounds): void {
    this.frame.scale.setScalar(1 / radius);
    this.frame.position.set(-centre[0] / radius, -centre[1] / radius, -centre[2] / radius);
  }

  aim({ eye, target, up, fieldOfView }: Pose): void {
    this.camera.fov = fieldOfView;
    this.camera.up.set(...up);
    this.camera.position.set(...eye);
    this.camera.lookAt(...target);
    this.camera.updateProjectionMatrix();
  }
}
