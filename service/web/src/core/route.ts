import { FIELDS, type Field } from './colormap';
import type { ScaleKind } from './scale';

/** Everything that a shared address holds. */

export type Up = 'y' | 'z';

/** A camera around the shape, in radians and in radii of the shape at iteration 0, so that it fits any mesh. */
export interface CameraView {
  readonly azimuth: number;
  readonly elevation: number;
  readonly distance: number;
  readonly target: readonly [number, number, number];
}

export interface Look {
  readonly color: Field | null;
  readonly wire: boolean;
  readonly up: Up | null;
  readonly camera: CameraView | null;
  readonly scale: ScaleKind;
}

/** A state of a job: an iteration, or null for the newest. */
export interface Shown {
  readonly job: string;
  readonly iteration: number | null;
}

export type Route =
  | { readonly view: 'home' }
  | { readonly view: 'mesh'; readonly mesh: string; readonly up: Up | null; readonly name: string | null }
  | { readonly view: 'job'; readonly shown: Shown; readonly look: Look }
  | { readonly view: 'compare'; readonly left: Shown; readonly right: Shown; readonly look: Look };

export const PLAIN: Look = { color: null, wire: false, up: null, camera: null, scale: 'log' };
const MOST_NAME = 120;
const JOB = /^job_[0-9A-Z]{26}$/;
const MESH = /^mesh_[0-9A-Z]{26}$/;

/** Read an address; what it holds that cannot be is left out. */
export function parseRoute(search: string): Route {
  const query = new URLSearchParams(search);
  const compared = (query.get('compare') ?? '').split(',').map(parseShown);
  const [left, right] = compared;
  if (left && right) return { view: 'compare', left, right, look: parseLook(query) };
  const job = query.get('job') ?? '';
  if (JOB.test(job))
    return { view: 'job', shown: { job, iteration: whole(query.get('it')) }, look: parseLook(query) };
  const mesh = query.get('mesh') ?? '';
  const name = query.get('name')?.slice(0, MOST_NAME) ?? null;
  return MESH.test(mesh) ? { view: 'mesh', mesh, up: parseLook(query).up, name } : { view: 'home' };
}

/** Write an address, beginning with `/`. */
export function formatRoute(route: Route, path = '/'): string {
  const query = new URLSearchParams();
  if (route.view === 'mesh') {
    query.set('mesh', route.mesh);
    if (route.up) query.set('up', route.up);
    if (route.name) query.set('name', route.name);
  }
  if (route.view === 'job') {
    query.set('job', route.shown.job);
    if (route.shown.iteration !== null) query.set('it', String(route.shown.iteration));
    formatLook(route.look, query);
  }
  if (route.view === 'compare') {
    query.set('compare', [route.left, route.right].map(formatShown).join(','));
    formatLook(route.look, query);
  }
  const text = query.toString().replaceAll('%2C', ',').replaceAll('%40', '@');
  return text === '' ? path : `${path}?${text}`;
}

function parseShown(text: string): Shown | null {
  const [job = '', iteration] = text.split('@');
  return JOB.test(job) ? { job, iteration: whole(iteration ?? null) } : null;
}

function formatShown(shown: Shown): string {
  return shown.iteration === null ? shown.job : `${shown.job}@${shown.iteration}`;
}

function parseLook(query: URLSearchParams): Look {
  const up = query.get('up');
  return {
    color: FIELDS.find((field) => field === query.get('color')) ?? null,
    wire: query.get('wire') === '1',
    up: up === 'y' || up === 'z' ? up : null,
    camera: parseCamera(query.get('cam')),
    scale: query.get('scale') === 'linear' ? 'linear' : 'log',
  };
}

function formatLook(look: Look, query: URLSearchParams): void {
  if (look.color) query.set('color', look.color);
  if (look.wire) query.set('wire', '1');
  if (look.up) query.set('up', look.up);
  if (look.scale === 'linear') query.set('scale', 'linear');
  if (look.camera) {
    const { azimuth, elevation, distance, target } = look.camera;
    query.set(
      'cam',
      [azimuth, elevation, distance, ...target].map((n) => String(Number(n.toFixed(3)))).join(','),
    );
  }
}

function parseCamera(text: string | null): CameraView | null {
  const numbers = (text ?? '').split(',').map(Number);
  const [azimuth, elevation, distance, x, y, z] = numbers;
  if (numbers.length !== 6 || !numbers.every(Number.isFinite)) return null;
  if (azimuth === undefined || elevation === undefined || distance === undefined || distance <= 0)
    return null;
  return { azimuth, elevation, distance, target: [x ?? 0, y ?? 0, z ?? 0] };
}

function whole(text: string | null): number | null {
  return text !== null && /^\d{1,9}$/.test(text) ? Number(text) : null;
}
