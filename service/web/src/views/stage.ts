import { asProblem, type Problem } from '../api/problem';
import { Run } from '../api/run';
import { FIELD_INFO, type Field, type Range } from '../core/colormap';
import { Emitter } from '../core/emitter';
import { Glide } from '../core/glide';
import { Player } from '../core/player';
import type { Look, Up } from '../core/route';
import { between, neighbour, scaleOf, type Between, type Scale, type ScaleKind } from '../core/scale';
import { Frames, willPass } from '../mesh/frames';
import { reducedMotion } from '../ui/theme';
import { Timeline } from '../ui/timeline';
import { Viewer } from '../viewer/viewer';
import type { Shown } from '../viewer/asks';
import type { Context } from './context';
import { upOf } from './up';

const GLIDE_S = 0.5;
const AHEAD = 2;
const RETRY_MS = 1500;
/** While it plays, figures and legend follow the picture at some distance: each time costs more than a frame. */
const TELL_MS = 100;

/** A state that is here, with the range of what it is coloured by. */
interface Coloured extends Shown {
  readonly range: Range | null;
}

/** One job on a canvas, with its timeline: what is known, where one stands, and what is drawn. */
export class Stage extends Emitter {
  readonly run: Run;
  readonly viewer: Viewer;
  readonly timeline: Timeline;
  readonly player = new Player();
  /** Where one stands: an iteration, or between two. */
  at = 0;
  /** Whether one goes along with a running job. */
  following: boolean;
  /** The range of the colours that are shown; null without colours. */
  range: Range | null = null;
  /** Another state beside this one, coloured by one scale with it. */
  beside: Stage | null = null;
  private own: Range | null = null;
  problem: Problem | null = null;
  triangles = 0;
  drawn = 0;
  color: Field | null;
  wire: boolean;
  facets = false;
  private kind: ScaleKind;
  private up: Up | null;
  private readonly frames: Frames;
  private opened: 'no' | 'opening' | 'yes' = 'no';
  private readonly glide = new Glide();
  private tick = 0;
  private last = 0;
  private told = 0;
  private closed = false;
  private retry: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly context: Pick<Context, 'api' | 'worker' | 'toast'>,
    readonly job: string,
    iteration: number | null,
    look: Look,
    small = false,
  ) {
    super();
    this.following = iteration === null;
    this.at = iteration ?? 0;
    ({ color: this.color, wire: this.wire, scale: this.kind, up: this.up } = look);
    this.viewer = new Viewer('The mesh');
    if (look.camera) this.viewer.look(look.camera);
    this.frames = new Frames(context.worker, job, this.viewer);
    this.timeline = new Timeline(
      this.player,
      {
        seek: (at) => {
          this.seek(at);
        },
        step: (direction) => {
          this.step(direction);
        },
        toggle: () => {
          this.toggle();
        },
        scale: (kind) => {
          this.setScale(kind);
        },
      },
      small,
    );
    this.run = new Run(context.api, job);
    this.run.onChange(() => {
      this.news();
    });
    this.viewer.onState = () => {
      this.changed();
    };
  }

  /** Whether there is a state to look at, and not a picture of any yet. */
  get coming(): boolean {
    const kept = this.run.state?.job.snapshots.available.length ?? 0;
    return kept > 0 && !this.viewer.shown && this.viewer.state !== 'unsupported';
  }

  get scale(): Scale {
    const state = this.run.state;
    const total = state?.job.progress.iterations_total ?? 1;
    const reached = Math.max(state?.job.progress.iteration ?? 0, state?.states.at(-1) ?? 0);
    // A run often ends long before its most iterations: what lies ahead gets no more room than what was done.
    const end = state?.job.done
      ? (state.states.at(-1) ?? reached)
      : Math.min(total, Math.max(2 * reached, 50));
    return scaleOf(this.kind, end);
  }

  /** The address' look as it is now. */
  get look(): Look {
    const { color, wire, kind, up } = this;
    return { color, wire, scale: kind, up, camera: this.viewer.camera.view };
  }

  /** The kept state that is shown, or the nearest one before. */
  get state(): number {
    return between(this.states, this.at, this.scale).before;
  }

  get states(): readonly number[] {
    return this.run.state?.states ?? [];
  }

  seek(at: number): void {
    this.player.playing = false;
    this.stand(at);
  }

  step(direction: 1 | -1): void {
    this.seek(neighbour(this.states, this.at, direction));
  }

  toggle(): void {
    this.following = false;
    this.at = this.player.toggle(this.at, this.scale);
    this.glide.stop();
    this.animate();
  }

  /** Go along with the newest state. */
  follow(): void {
    this.following = true;
    this.player.playing = false;
    this.glideTo(this.states.at(-1) ?? 0);
  }

  setScale(kind: ScaleKind): void {
    this.kind = kind;
    this.update();
    this.changed();
  }

  setColor(color: Field | null): void {
    this.color = color;
    this.problem = null;
    this.update();
    this.changed();
  }

  setWire(wire: boolean): void {
    this.wire = this.viewer.wire = wire;
    this.changed();
  }

  setFacets(facets: boolean): void {
    this.facets = this.viewer.facets = facets;
    this.changed();
  }

  setUp(up: Up): void {
    this.up = this.viewer.up = up;
    this.changed();
  }

  close(): void {
    this.closed = true;
    cancelAnimationFrame(this.tick);
    clearTimeout(this.retry);
    this.run.close();
    this.viewer.dispose();
    this.frames.close();
  }

  private stand(at: number): void {
    this.following = !(this.run.state?.job.done ?? true) && at >= (this.states.at(-1) ?? 0);
    this.glide.stop();
    this.at = Math.min(Math.max(at, 0), this.states.at(-1) ?? 0);
    this.update();
    this.changed();
  }

  /** Take what is new of the run. */
  private news(): void {
    const newest = this.states.at(-1);
    if (newest === undefined && this.run.state?.job.done) this.viewer.expect(false); // it failed before its first state
    if (newest !== undefined && this.opened === 'no') void this.open();
    else if (newest !== undefined && this.following && this.opened === 'yes') this.glideTo(newest);
    this.update();
    this.changed();
  }

  private async open(): Promise<void> {
    this.opened = 'opening';
    this.problem = null;
    try {
      await this.frames.open(this.states[0] ?? 0, (drawable, key) => {
        this.triangles = drawable.triangles;
        this.drawn = drawable.index.length / 3;
        this.viewer.load(drawable, key);
      });
      if (this.isClosed()) return;
      const job = this.run.state?.job;
      if (job && upOf(job) === 'z') this.up ??= 'z'; // an address need not say what the run does
      if (this.up !== null) this.viewer.up = this.up;
      this.viewer.wire = this.wire;
      this.opened = 'yes';
      const newest = this.states.at(-1) ?? 0;
      this.at = this.following ? newest : Math.min(this.at, newest);
    } catch (thrown) {
      if (this.isClosed()) return;
      this.opened = 'no';
      this.fail(thrown);
    }
    this.update();
    this.changed();
  }

  private isClosed(): boolean {
    return this.closed; // it may be closed while something is awaited
  }

  /** Go to a state as soon as it is here. */
  private glideTo(state: number): void {
    if (document.hidden) this.at = state;
    else this.glide.begin(this.at, state);
    this.update();
    if (this.arrived()) this.animate();
  }

  /** Whether the state that one is to go to is here. */
  private arrived(): boolean {
    const { target } = this.glide;
    return target !== null && this.frames.has(target, this.color);
  }

  private animate(): void {
    this.last = performance.now();
    cancelAnimationFrame(this.tick);
    this.tick = requestAnimationFrame(this.move);
    this.update();
    this.changed();
  }

  private readonly move = (now: number): void => {
    const seconds = Math.min((now - this.last) / 1000, 0.1);
    this.last = now;
    if (this.arrived()) {
      const near = neighbour(this.states, this.at, 1) === this.glide.target;
      this.at = this.glide.at(now, near && !reducedMotion() ? GLIDE_S : 0, this.scale);
    } else if (this.player.playing && this.shown()) {
      this.at = Math.min(this.player.advance(this.at, seconds, this.scale), this.states.at(-1) ?? 0);
    }
    this.update();
    if (!this.arrived() && !this.player.playing) {
      this.rest();
      return;
    }
    this.tick = requestAnimationFrame(this.move);
    if (now - this.told < TELL_MS) return;
    this.told = now;
    this.changed();
  };

  /** The movement is over; there may be a newer state by now. */
  private rest(): void {
    const newest = this.states.at(-1);
    if (this.following && newest !== undefined && newest !== this.at) this.glideTo(newest);
    this.changed();
  }

  private shown(): boolean {
    const { before, after } = between(this.states, this.at, this.scale);
    return this.frames.has(before, this.color) && this.frames.has(after, this.color);
  }

  /** Draw where one stands, as far as it is here, and fetch what is not. */
  private update(): void {
    const state = this.run.state;
    const place = between(this.states, this.at, this.scale);
    if (state) this.timeline.data(state.states, state.rows, this.scale, state.job.progress.iteration);
    if (this.opened === 'yes') this.draw(place);
    this.timeline.stand(this.at, place, this.opened !== 'yes' || !this.frames.has(place.before, this.color));
  }

  private draw(place: Between): void {
    const { before, after, blend } = place;
    const { target } = this.glide;
    for (const wanted of [...(target === null ? [] : [target]), before, after, ...this.ahead(after)])
      if (!this.frames.has(wanted, this.color)) {
        void this.fetch(wanted);
        break; // one after another, the most wanted first
      }
    const first = this.coloured(before);
    if (!first) return;
    const second = blend > 0 ? this.coloured(after) : first;
    const share = second ? blend : 0;
    this.viewer.show({ before: first, after: second ?? first, blend: share });
    this.own = rangeBetween(first, second ?? first, share);
    this.paint();
    this.beside?.paint();
    const percent = state(this.run)?.sphericity;
    this.viewer.describe(
      `${this.run.state?.job.name ?? 'The mesh'} at iteration ${Math.round(this.at)}` +
        (typeof percent === 'number' ? `, newest sphericity ${percent.toFixed(3)}` : ''),
    );
  }

  /** Colour what is drawn; with a state beside it, by the range of both. */
  private paint(): void {
    const { beside } = this;
    const other = beside !== null && beside.color === this.color ? beside.own : null;
    this.range = this.own && other ? widest(this.own, other) : this.own;
    const diverging = this.color !== null && FIELD_INFO[this.color].diverging;
    this.viewer.colours(this.range ? { ...this.range, diverging } : null);
  }

  private ahead(iteration: number): number[] {
    const index = this.states.findIndex((state) => state > iteration);
    return index < 0 ? [] : this.states.slice(index, index + AHEAD);
  }

  private coloured(iteration: number): Coloured | null {
    const frame = this.frames.frame(iteration);
    if (frame === undefined) return null;
    if (this.color === null) return { frame, values: null, range: null };
    const values = this.frames.values(iteration, this.color);
    return values ? { frame, values: values.key, range: values.range } : null;
  }

  private fetching: number | null = null;

  private async fetch(iteration: number): Promise<void> {
    if (this.fetching !== null) return;
    this.fetching = iteration;
    try {
      await this.frames.load(iteration, this.color);
      this.problem = null;
    } catch (thrown) {
      this.fail(thrown);
      return;
    } finally {
      this.fetching = null;
    }
    if (this.isClosed()) return;
    if (this.arrived()) this.animate();
    else this.update();
    this.changed(); // the legend's numbers came with it
  }

  private fail(thrown: unknown): void {
    if (this.closed) return;
    this.problem = asProblem(thrown);
    if (this.opened !== 'yes') this.viewer.expect(willPass(thrown));
    if (willPass(thrown)) {
      clearTimeout(this.retry);
      this.retry = setTimeout(() => {
        this.news();
      }, this.problem.waitMs(RETRY_MS));
    } else if (this.color !== null && this.opened === 'yes') {
      this.context.toast(this.problem.detail, 'bad');
      this.color = null; // this mesh has no such field
    }
    this.changed();
  }
}

function state(run: Run): { sphericity?: number | null } | null {
  return run.state?.job.metrics ?? null;
}

function widest(one: Range, other: Range): Range {
  return { low: Math.min(one.low, other.low), high: Math.max(one.high, other.high) };
}

function rangeBetween({ range: a }: Coloured, { range: b }: Coloured, blend: number): Range | null {
  if (!a || !b) return null;
  return { low: a.low + (b.low - a.low) * blend, high: a.high + (b.high - a.high) * blend };
}
