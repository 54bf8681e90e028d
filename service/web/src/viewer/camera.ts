import { PerspectiveCamera, Quaternion, Spherical, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import type { CameraView, Up } from '../core/route';

/** Where one looks from at first: a little from above, a little from the side. */
export const FRONT: CameraView = { azimuth: 0.65, elevation: 0.38, distance: 3.1, target: [0, 0, 0] };
const Y = new Vector3(0, 1, 0);

/** A camera on an orbit, and its place as the numbers that an address holds. */
export class OrbitCamera {
  readonly camera = new PerspectiveCamera(38, 1, 0.01, 100);
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
    this.camera.up.set(0, up === 'y' ? 1 : 0, up === 'z' ? 1 : 0);
    this.controls.dispose();
    this.controls = this.control(); // it takes the axis when it is made
    this.controls.addEventListener('change', this.moved);
    this.view = view;
  }

  get view(): CameraView {
    const offset = this.camera.position.clone().sub(this.controls.target).applyQuaternion(this.toY());
    const { radius, phi, theta } = new Spherical().setFromVector3(offset);
    const { x, y, z } = this.controls.target;
    return { azimuth: theta, elevation: Math.PI / 2 - phi, distance: radius, target: [x, y, z] };
  }

  set view({ azimuth, elevation, distance, target }: CameraView) {
    this.controls.target.set(...target);
    const phi = Math.PI / 2 - Math.min(Math.max(elevation, -1.57), 1.57);
    const offset = new Vector3().setFromSpherical(new Spherical(distance, phi, azimuth));
    this.camera.position.copy(offset.applyQuaternion(this.toY().invert())).add(this.controls.target);
    this.controls.update();
  }

  /** Turn or zoom by keys: angles in radians, zoom a factor. */
  nudge(azimuth: number, elevation: number, zoom: number): void {
    const view = this.view;
    this.view = {
      ...view,
      azimuth: view.azimuth + azimuth,
      elevation: view.elevation + elevation,
      distance: Math.min(Math.max(view.distance * zoom, 0.3), 20),
    };
    this.moved();
  }

  resize(width: number, height: number): void {
    this.camera.aspect = width / Math.max(height, 1);
    this.camera.fov = this.camera.aspect < 1 ? 38 / Math.max(this.camera.aspect, 0.55) : 38; // a phone: show all of it
    this.camera.updateProjectionMatrix();
  }

  /** Go on with a movement that runs out; returns whether it still moves. */
  update(): boolean {
    return this.controls.update();
  }

  dispose(): void {
    this.controls.dispose();
  }

  private toY(): Quaternion {
    return new Quaternion().setFromUnitVectors(this.camera.up, Y);
  }

  private control(): OrbitControls {
    const controls = new OrbitControls(this.camera, this.element);
    controls.enableDamping = !matchMedia('(prefers-reduced-motion: reduce)').matches;
    controls.dampingFactor = 0.12;
    controls.minDistance = 0.3;
    controls.maxDistance = 20;
    return controls;
  }
}
