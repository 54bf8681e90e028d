import type { Location } from '../api/types';
import { poseOf } from '../core/camera';
import type { CameraView, Up } from '../core/route';
import type { Drawable, Located } from '../mesh/tasks';
import type { Frame } from '../mesh/types';
import type { DrawingState, Scene, Told } from './asks';
import { OrbitCamera } from './camera';
import { giveBack, take, type Easel } from './easels';
import type { Remote } from './remote';

const TURNS: Readonly<Record<string, readonly [number, number, number]>> = {
  ArrowLeft: [-0.12, 0, 1],
  ArrowRight: [0.12, 0, 1],
  ArrowUp: [0, 0.12, 1],
  ArrowDown: [0, -0.12, 1],
  '+': [0, 0, 0.9],
  '=': [0, 0, 0.9],
  '-': [0, 0, 1.11],
};
const PLAIN: Pick<Scene, 'states' | 'colours' | 'wire' | 'facets'> = {
  states: null,
  colours: null,
  wire: false,
  facets: false,
};

/**
 * A canvas with one surface and its camera. A worker draws it, when something has changed and at no other time; while
 * it draws, what changes is gathered for the next picture, so that none wait in a queue.
 */
export class Viewer {
  readonly element: HTMLDivElement;
  readonly camera: OrbitCamera;
  /** Told when the camera has come to rest after a movement. */
  onRest: (view: CameraView) => void = () => undefined;
  /** Told of every movement, for a second viewer to follow. */
  onMove: (view: CameraView) => void = () => undefined;
  onState: () => void = () => undefined;
  state: DrawingState = 'ready';
  /** Whether there is something to see: a surface was loaded, and the graphics card has drawn it once. */
  shown = false;

  private readonly easel: Easel;
  private readonly sizes: ResizeObserver;
  private size = { width: 0, height: 0 };
  private scene = PLAIN;
  private sharpness: MediaQueryList | null = null;
  private request = 0;
  private drawing = false;
  private stale = false; // something changed while a picture was drawn
  private rest: ReturnType<typeof setTimeout> | undefined;

  constructor(label: string) {
    this.element = document.createElement('div');
    this.element.className = 'viewer';
    this.expect(true);
    this.easel = take(this.hear);
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute('role', 'img');
    this.describe(label);
    this.element.append(this.canvas);
    this.camera = new OrbitCamera(this.canvas, () => {
      this.invalidate();
      this.settle();
    });
    this.canvas.addEventListener('keydown', this.key);
    this.sizes = new ResizeObserver(() => {
      this.resize();
    });
    this.sizes.observe(this.element);
    this.sharpen();
  }

  /** Say what is shown to those who cannot see it. */
  describe(text: string): void {
    this.canvas.setAttribute(
      'aria-label',
      `${text}. Drag or use the arrow keys to turn, plus and minus to zoom.`,
    );
  }

  /** Say whether a picture is to come: until it is there its place is held by a pale ball. */
  expect(coming: boolean): void {
    this.element.classList.toggle('expecting', coming && !this.shown);
  }

  /** Put another surface in; its first state, which is handed over, is `key` from then on. */
  load({ index, frame, bounds }: Drawable, key = 'first'): void {
    this.scene = { ...this.scene, states: null };
    this.remote.send({ ask: 'load', index, key, frame, bounds }, [index.buffer, ...buffersOf(frame)]);
    this.invalidate();
  }

  /** Hand over a state of the surface, or a quantity, for `show` to name. */
  keep(key: string, numbers: Frame | Float32Array<ArrayBuffer>): void {
    this.remote.send({ ask: 'keep', key, numbers }, buffersOf(numbers));
  }

  drop(key: string): void {
    this.remote.send({ ask: 'drop', key });
  }

  /** Draw what is wrong with the surface that was loaded last. */
  mark(faults: Located | null, places: readonly Location[]): void {
    this.remote.send({ ask: 'mark', faults, places, positions: faults?.positions ?? null });
    this.invalidate();
  }

  show(states: Scene['states']): void {
    this.put({ states });
  }

  colours(colours: Scene['colours']): void {
    this.put({ colours });
  }

  set wire(wire: boolean) {
    this.put({ wire });
  }

  set facets(facets: boolean) {
    this.put({ facets });
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

  /** Return the picture as PNG. */
  picture(): Promise<Blob> {
    return this.remote.picture(this.whole());
  }

  dispose(): void {
    cancelAnimationFrame(this.request);
    clearTimeout(this.rest);
    this.sizes.disconnect();
    this.sharpness?.removeEventListener('change', this.sharpen);
    this.camera.dispose();
    this.canvas.removeEventListener('keydown', this.key);
    giveBack(this.easel, this.state === 'ready');
    this.element.remove();
  }

  private get canvas(): HTMLCanvasElement {
    return this.easel.canvas;
  }

  private get remote(): Remote {
    return this.easel.remote;
  }

  private put(change: Partial<typeof PLAIN>): void {
    this.scene = { ...this.scene, ...change };
    this.invalidate();
  }

  private whole(): Scene {
    const { scene, camera } = this;
    const size = { ...this.size, ratio: Math.min(devicePixelRatio, 2) };
    return { ...scene, size, pose: poseOf(camera.view, camera.up, size.width / Math.max(size.height, 1)) };
  }

  /** Have it drawn with the next frame, or, if a picture is being drawn, after it. */
  private invalidate(): void {
    this.element.dataset.drawn = 'no';
    if (this.drawing) this.stale = true;
    else
      this.request ||= requestAnimationFrame(() => {
        this.request = 0;
        this.draw();
      });
  }

  private draw(): void {
    if (this.size.width === 0) return;
    this.drawing = true;
    this.stale = false;
    if (this.camera.update()) this.stale = true; // a movement that runs out goes on
    this.remote.send({ ask: 'draw', scene: this.whole() });
  }

  private readonly hear = (told: Told): void => {
    if (told.told === 'drawn') {
      this.drawing = false;
      if (this.stale) this.invalidate();
      else this.element.dataset.drawn = 'yes';
    } else if (told.told === 'state') {
      this.state = told.state;
      if (told.state === 'ready') this.invalidate();
      if (told.state === 'unsupported') this.expect(false);
      this.onState();
    } else if (told.told === 'shown') {
      this.shown = true;
      this.expect(false);
      this.onState();
    }
  };

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (width === 0 || height === 0) return;
    this.size = { width, height };
    this.camera.resize(width, height);
    this.invalidate();
  }

  /** Draw as finely as the screen shows, also on another screen: the size alone does not tell of that. */
  private readonly sharpen = (): void => {
    this.sharpness = matchMedia(`(resolution: ${devicePixelRatio}dppx)`);
    this.sharpness.addEventListener('change', this.sharpen, { once: true });
    this.invalidate();
  };

  private settle(): void {
    this.onMove(this.camera.view);
    clearTimeout(this.rest);
    this.rest = setTimeout(() => {
      this.onRest(this.camera.view);
    }, 250);
  }

  private readonly key = (event: KeyboardEvent): void => {
    const turn = TURNS[event.key];
    if (!turn || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation(); // the arrows are the timeline's elsewhere
    this.camera.nudge(...turn);
  };
}

function buffersOf(numbers: Frame | Float32Array<ArrayBuffer>): ArrayBuffer[] {
  return 'normals' in numbers ? [numbers.positions.buffer, numbers.normals.buffer] : [numbers.buffer];
}
