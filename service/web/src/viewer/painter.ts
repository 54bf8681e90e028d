import { ColorManagement, LinearSRGBColorSpace, WebGLRenderer } from 'three';
import { lineOpacity } from '../core/lines';
import type { Pose } from '../core/camera';
import type { Frame } from '../mesh/types';
import type { Ask, Canvas, Scene, Shown, Surface, Told } from './asks';
import { FaultLines } from './faultlines';
import { Sight } from './sight';
import { copyOf, fileOf, sketch } from './sketch';
import { Paints, SurfaceMesh, type Coloured } from './surface';

ColorManagement.enabled = false; // every colour is given as the screen shows it, and drawn as it is given

type Load = Extract<Ask, { ask: 'load' }>;
type Mark = Extract<Ask, { ask: 'mark' }>;
/** What is asked of one that has its canvas. */
type Task = Exclude<Ask, { ask: 'open' | 'pass' | 'sketch' }>;

/** One canvas with one surface, its states, and what is wrong with it; draws when it is asked to. */
export class Painter {
  private readonly renderer: WebGLRenderer | null;
  private readonly sight = new Sight();
  private readonly paints = new Paints();
  /** For what is shown nowhere: what these share is compiled once for both. */
  private readonly aside = new Paints();
  private readonly kept = new Map<string, Frame | Float32Array<ArrayBuffer>>();
  private surface: SurfaceMesh | null = null;
  private faults: FaultLines | null = null;
  private wanted: Scene | null = null;
  private request = 0;
  private unseen = false; // there is a surface, and no picture of it was drawn yet
  private seeing = 0;
  private lost = false;
  private size = '';

  constructor(
    private readonly canvas: Canvas,
    private readonly tell: (told: Told) => void,
  ) {
    this.renderer = this.start();
    const target: EventTarget = canvas;
    target.addEventListener('webglcontextlost', this.lose);
    target.addEventListener('webglcontextrestored', this.restore);
  }

  /** Do what is asked. */
  take(ask: Task): void {
    switch (ask.ask) {
      case 'load':
        this.load(ask);
        break;
      case 'keep':
        this.kept.set(ask.key, ask.numbers);
        break;
      case 'drop':
        this.kept.delete(ask.key);
        break;
      case 'mark':
        this.mark(ask);
        break;
      case 'draw':
        this.wanted = ask.scene;
        this.request ||= requestAnimationFrame(() => {
          this.request = 0;
          if (this.wanted) this.draw(this.wanted);
          this.tell({ told: 'drawn' });
        });
        break;
      case 'picture':
        void this.picture(ask.scene);
        break;
      case 'close':
        this.close();
        break;
    }
  }

  /** Whether it can draw now. */
  get able(): boolean {
    return this.renderer !== null && !this.lost;
  }

  /** Return a square picture of a surface that is not shown, null if there can be none; what is shown stays. */
  async sketch(surface: Surface, pose: Pose, size: number): Promise<Blob | null> {
    if (this.renderer === null) return null;
    try {
      return await fileOf(await sketch(this.renderer, this.aside, surface, pose, size));
    } catch {
      return null; // the card was lost meanwhile
    }
  }

  /** Begin anew, with an empty canvas; what is wrong with it is told again. */
  begin(): void {
    cancelAnimationFrame(this.request);
    cancelAnimationFrame(this.seeing);
    this.request = 0;
    this.unseen = false;
    this.wanted = null;
    this.clear();
    if (this.renderer === null) this.tell({ told: 'state', state: 'unsupported' });
    else if (this.lost) this.tell({ told: 'state', state: 'lost' });
    else this.renderer.clear(); // or what it showed would be seen once more
  }

  private start(): WebGLRenderer | null {
    try {
      const renderer = new WebGLRenderer({ canvas: this.canvas, antialias: true, alpha: true });
      renderer.setClearAlpha(0);
      renderer.outputColorSpace = LinearSRGBColorSpace;
      renderer.debug.checkShaderErrors = false; // asking waits until the compiler is done
      return renderer;
    } catch {
      this.tell({ told: 'state', state: 'unsupported' }); // which the views say in words
      return null;
    }
  }

  private load({ index, key, frame, bounds }: Load): void {
    this.clear();
    this.kept.set(key, frame);
    this.surface = new SurfaceMesh(this.paints, index, frame.positions.length / 3);
    this.surface.show({ frame, values: null }, { frame, values: null }, 0);
    this.sight.place(bounds);
    this.sight.frame.add(this.surface.mesh, this.surface.wire);
    this.unseen = true;
  }

  private mark({ faults, places, positions }: Mark): void {
    this.faults?.dispose();
    if (this.faults) this.sight.frame.remove(this.faults.group);
    this.faults = new FaultLines(faults, places, positions);
    this.sight.frame.add(this.faults.group);
  }

  private draw(scene: Scene): void {
    const { renderer, surface, paints } = this;
    if (renderer === null || this.lost) return;
    this.fit(scene);
    this.sight.aim(scene.pose);
    paints.clay.facets = scene.facets;
    paints.clay.colours(scene.colours);
    if (surface) {
      this.show(surface, scene);
      surface.wire.visible = scene.wire;
      const { eye, target, fieldOfView } = scene.pose;
      const distance = Math.hypot(...eye.map((value, axis) => value - (target[axis] ?? 0)));
      const edge = surface.edge * this.sight.frame.scale.x;
      paints.strength = lineOpacity(edge, distance, fieldOfView, scene.size.height);
    }
    renderer.render(this.sight.space, this.sight.camera);
    if (surface && this.unseen) this.see(renderer.getContext() as WebGL2RenderingContext);
  }

  /** Tell when the first picture of a surface is there: the graphics card may have to compile for a second before. */
  private see(card: WebGL2RenderingContext): void {
    this.unseen = false;
    cancelAnimationFrame(this.seeing);
    const drawn = card.fenceSync(card.SYNC_GPU_COMMANDS_COMPLETE, 0);
    card.flush();
    const look = (): void => {
      if (card.isContextLost()) {
        this.unseen = true; // it is drawn anew once the card is back
        return;
      }
      if (drawn !== null && card.getSyncParameter(drawn, card.SYNC_STATUS) !== card.SIGNALED) {
        this.seeing = requestAnimationFrame(look);
        return;
      }
      card.deleteSync(drawn);
      this.tell({ told: 'shown' });
    };
    this.seeing = requestAnimationFrame(look);
  }

  private show(surface: SurfaceMesh, { states }: Scene): void {
    if (states === null) return;
    const [before, after] = [this.coloured(states.before), this.coloured(states.after)];
    if (before && after) surface.show(before, after, states.blend);
  }

  private coloured({ frame, values }: Shown): Coloured | null {
    const state = this.kept.get(frame) as Frame | undefined;
    if (state === undefined) return null;
    return {
      frame: state,
      values:
        values === null ? null : ((this.kept.get(values) as Float32Array<ArrayBuffer> | undefined) ?? null),
    };
  }

  /** Take another size just before drawing: a canvas that was resized is empty. */
  private fit({ size: { width, height, ratio } }: Scene): void {
    const size = `${width} ${height} ${ratio}`;
    if (size === this.size) return;
    this.size = size;
    this.renderer?.setPixelRatio(ratio);
    this.renderer?.setSize(width, height, false);
    this.sight.camera.aspect = width / Math.max(height, 1);
  }

  /** Draw anew, as the canvas does not keep what it showed, and hand over a copy. */
  private async picture(scene: Scene): Promise<void> {
    let blob: Blob | null = null;
    try {
      this.draw(scene);
      blob = await copyOf(this.canvas, 'image/png');
    } catch {
      // a canvas without a size, or a card that was lost: whoever asked is told that there is none
    }
    this.tell({ told: 'picture', blob });
  }

  private clear(): void {
    this.surface?.dispose();
    this.faults?.dispose();
    this.surface = null;
    this.faults = null;
    this.sight.frame.clear();
    this.kept.clear();
  }

  private close(): void {
    cancelAnimationFrame(this.request);
    cancelAnimationFrame(this.seeing);
    this.clear();
    this.paints.dispose();
    this.aside.dispose();
    (this.canvas as EventTarget).removeEventListener('webglcontextlost', this.lose);
    this.renderer?.dispose();
    this.renderer?.forceContextLoss(); // a browser keeps but a few
  }

  private readonly lose = (event: Event): void => {
    event.preventDefault(); // asks the browser to give it back
    this.lost = true;
    this.tell({ told: 'state', state: 'lost' });
  };

  private readonly restore = (): void => {
    this.lost = false;
    this.tell({ told: 'state', state: 'ready' }); // it is asked to draw again, and three sends everything again
  };
}
