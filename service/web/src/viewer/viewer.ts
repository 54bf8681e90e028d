import { Group, Scene, WebGLRenderer } from 'three';
import type { Location } from '../api/types';
import type { CameraView, Up } from '../core/route';
import type { Faults } from '../mesh/faults';
import type { Drawable } from '../mesh/tasks';
import { OrbitCamera } from './camera';
import { FaultLines } from './faultlines';
import { Paints, SurfaceMesh, type Coloured } from './surface';

export type ViewerState = 'ready' | 'lost' | 'unsupported';

/** A canvas with one surface, drawn when something has changed and at no other time. */
export class Viewer {
  readonly element: HTMLDivElement;
  readonly camera: OrbitCamera;
  /** Told when the camera has come to rest after a movement. */
  onRest: (view: CameraView) => void = () => undefined;
  /** Told of every movement, for a second viewer to follow. */
  onMove: (view: CameraView) => void = () => undefined;
  onState: (state: ViewerState) => void = () => undefined;
  state: ViewerState = 'ready';

  private readonly canvas = document.createElement('canvas');
  private readonly renderer: WebGLRenderer | null;
  private readonly scene = new Scene();
  private readonly frame = new Group();
  private readonly sizes: ResizeObserver;
  private readonly paints = new Paints();
  private surface: SurfaceMesh | null = null;
  private faults: FaultLines | null = null;
  private request = 0;
  private rest: ReturnType<typeof setTimeout> | undefined;

  /** @param fixed width and height in pixels of a canvas that stands on no page; else it fills its element. */
  constructor(label: string, fixed: number | null = null) {
    this.element = document.createElement('div');
    this.element.className = 'viewer';
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute('role', 'img');
    this.describe(label);
    this.element.append(this.canvas);
    this.renderer = this.start();
    this.camera = new OrbitCamera(this.canvas, () => {
      this.invalidate();
      this.settle();
    });
    this.scene.add(this.frame);
    this.canvas.addEventListener('webglcontextlost', this.lose);
    this.canvas.addEventListener('webglcontextrestored', this.restore);
    this.canvas.addEventListener('keydown', this.key);
    this.sizes = new ResizeObserver(() => {
      this.resize();
    });
    if (fixed === null) this.sizes.observe(this.element);
    else this.fit(fixed, fixed);
  }

  /** Say what is shown to those who cannot see it. */
  describe(text: string): void {
    this.canvas.setAttribute(
      'aria-label',
      `${text}. Drag or use the arrow keys to turn, plus and minus to zoom.`,
    );
  }

  /** Put another surface in, scaled to a ball of radius 1 around the origin. */
  load({ index, frame, bounds }: Drawable): void {
    this.clear();
    this.surface = new SurfaceMesh(this.paints, index, frame.positions.length / 3);
    this.surface.show({ frame, values: null }, { frame, values: null }, 0);
    this.place(bounds);
    this.frame.add(this.surface.mesh, this.surface.wire);
    this.invalidate();
  }

  /** Draw what is wrong with the surface; it may stand alone, if there is no preview. */
  mark(faults: Faults | null, places: readonly Location[], positions: Float32Array | null): void {
    this.faults?.dispose();
    if (this.faults) this.frame.remove(this.faults.group);
    this.faults = new FaultLines(faults, places, positions);
    this.frame.add(this.faults.group);
    this.invalidate();
  }

  show(before: Coloured, after: Coloured, blend: number): void {
    this.surface?.show(before, after, blend);
    this.invalidate();
  }

  colours(range: { low: number; high: number; diverging: boolean } | null): void {
    this.paints.clay.colours(range);
    this.invalidate();
  }

  set wire(shown: boolean) {
    if (this.surface) this.surface.wire.visible = shown;
    this.invalidate();
  }

  set facets(flat: boolean) {
    this.paints.clay.facets = flat;
    this.invalidate();
  }

  set up(up: Up) {
    this.camera.up = up;
    this.invalidate();
  }

  /** Look from somewhere; nobody is told. */
  look(view: CameraView): void {
    const told = this.onMove;
    this.onMove = () => undefined;
    this.camera.view = view;
    this.onMove = told;
    clearTimeout(this.rest);
    this.invalidate();
  }

  /** Return the picture, drawn anew: the canvas does not keep what it showed. */
  picture(type: 'image/png' | 'image/webp' = 'image/png'): Promise<Blob> {
    this.draw();
    return new Promise((resolve, reject) => {
      this.canvas.toBlob((blob) => {
        if (blob) resolve(blob);
        else reject(new Error('the picture could not be made'));
      }, type);
    });
  }

  invalidate(): void {
    this.request ||= requestAnimationFrame(() => {
      this.request = 0;
      const moving = this.camera.update();
      this.draw();
      if (moving) this.invalidate();
    });
  }

  dispose(): void {
    cancelAnimationFrame(this.request);
    clearTimeout(this.rest);
    this.sizes.disconnect();
    this.camera.dispose();
    this.clear();
    this.paints.dispose();
    this.canvas.removeEventListener('webglcontextlost', this.lose);
    this.renderer?.dispose();
    this.renderer?.forceContextLoss(); // a browser keeps but a few
    this.element.remove();
  }

  private start(): WebGLRenderer | null {
    try {
      const renderer = new WebGLRenderer({ canvas: this.canvas, antialias: true, alpha: true });
      renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
      renderer.setClearAlpha(0);
      renderer.debug.checkShaderErrors = false; // asking stops the page until the compiler is done
      return renderer;
    } catch {
      this.state = 'unsupported'; // which the views say in words
      return null;
    }
  }

  private place({ centre, radius }: Drawable['bounds']): void {
    this.frame.scale.setScalar(1 / radius);
    this.frame.position.set(-centre[0] / radius, -centre[1] / radius, -centre[2] / radius);
  }

  private draw(): void {
    if (this.state === 'ready') this.renderer?.render(this.scene, this.camera.camera);
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (width === 0 || height === 0) return;
    this.fit(width, height);
    this.draw(); // at once: a resized canvas is empty
  }

  private fit(width: number, height: number): void {
    this.renderer?.setSize(width, height, false);
    this.camera.resize(width, height);
  }

  private settle(): void {
    const view = this.camera.view;
    this.onMove(view);
    clearTimeout(this.rest);
    this.rest = setTimeout(() => {
      this.onRest(this.camera.view);
    }, 250);
  }

  private clear(): void {
    this.surface?.dispose();
    this.faults?.dispose();
    this.surface = null;
    this.faults = null;
    this.frame.clear();
  }

  private readonly lose = (event: Event): void => {
    event.preventDefault(); // asks the browser to give it back
    this.state = 'lost';
    this.onState(this.state);
  };

  private readonly restore = (): void => {
    this.state = 'ready';
    this.onState(this.state);
    this.invalidate(); // three sends everything again
  };

  private readonly key = (event: KeyboardEvent): void => {
    const turns: Readonly<Record<string, readonly [number, number, number]>> = {
      ArrowLeft: [-0.12, 0, 1],
      ArrowRight: [0.12, 0, 1],
      ArrowUp: [0, 0.12, 1],
      ArrowDown: [0, -0.12, 1],
      '+': [0, 0, 0.9],
      '=': [0, 0, 0.9],
      '-': [0, 0, 1.11],
    };
    const turn = turns[event.key];
    if (!turn || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation(); // the arrows are the timeline's elsewhere
    this.camera.nudge(...turn);
  };
}
