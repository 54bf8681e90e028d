import { PerspectiveCamera, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { axisOf, eyeOf, fieldOfView, FRONT, viewOf } from '../core/camera';
import type { CameraView, Up } from '../core/route';
import { reducedMotion } from '../ui/theme';

const NEAREST = 0.3;
const FARTHEST = 20;

/** A camera on an orbit that pointers, fingers and keys move; its place as the numbers that an address holds. */
export class OrbitCamera {
  private readonly camera = new PerspectiveCamera();
  private controls: OrbitControls;
  private upright: Up = 'y';

  constructor(
    private readonly element: HTMLElement,
    private readonly moved: () => void,
  ) {
    this.controls = this.control();
    this.view = FRONT;
    this.controls.addEventListener('change', this.moved); // not before there is something to tell
  }

  get up(): Up {
    return this.upright;
  }

  /** Set which axis stands upright; the view keeps its angles to it. */
  set up(up: Up) {
    if (up === this.upright) return;
    const view = this.view;
    this.upright = up;
    this.camera.up.set(...axisOf(up));
    this.controls.dispose();
    this.controls = this.control(); // it takes the axis when it is made
    this.controls.addEventListener('change', this.moved);
    this.view = view;
  }

  get view(): CameraView {
    return viewOf(numbers(this.camera.position), numbers(this.controls.target), this.upright);
  }

  set view(view: CameraView) {
    this.controls.target.set(...view.target);
    this.camera.position.set(...eyeOf(view, this.upright));
    this.controls.update();
  }

  /** Turn or zoom by keys: angles in radians, zoom a factor. */
  nudge(azimuth: number, elevation: number, zoom: number): void {
    const view = this.view;
    this.view = {
      ...view,
      azimuth: view.azimuth + azimuth,
      elevation: view.elevation + elevation,
      distance: Math.min(Math.max(view.distance * zoom, NEAREST), FARTHEST),
    };
    this.moved();
  }

  /** Dragging moves the shape with the pointer, which depends on how large it is drawn. */
  resize(width: number, height: number): void {
    this.camera.aspect = width / Math.max(height, 1);
    this.camera.fov = fieldOfView(this.camera.aspect);
    this.camera.updateProjectionMatrix();
  }

  /** Go on with a movement that runs out; returns whether it still moves. */
  update(): boolean {
    return this.controls.update();
  }

  dispose(): void {
    this.controls.dispose();
  }

  private control(): OrbitControls {
    const controls = new OrbitControls(this.camera, this.element);
    controls.enableDamping = !reducedMotion();
    controls.dampingFactor = 0.12;
    controls.minDistance = NEAREST;
    controls.maxDistance = FARTHEST;
    return controls;
  }
}

function numbers({ x, y, z }: Vector3): [number, number, number] {
  return [x, y, z];
}
