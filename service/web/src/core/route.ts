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
  | { readonly view: 'compare'; readonly left: Shown; readonly right: Shown; readonly look: Look }
  /** An address of nothing; `why` says in words what is wrong with it. */
  | { readonly view: 'astray'; readonly why: string };

export const PLAIN: Look = { color: null, wire: false, up: null, camera: null, scale: 'log' };
const MOST_NAME = 120;
const JOB = /^job_[0-9A-Z]{26}$/;
const MESH = /^mesh_[0-9A-Z]{26}$/;
const MOST_QUOTED = 40;
const ITERATION = /^\d{1,9}$/;

/** Read an address: the view it is of, and beside it whatever it holds that is wrong, see `leftOut`. */
export function parseRoute(search: string): Route {
  const query = new URLSearchParams(search);
  const compare = query.get('compare');
  if (compare !== null) return parseCompared(compare, parseLook(query));
  const job = query.get('job');
  if (job !== null)
    return JOB.test(job)
      ? { view: 'job', shown: { job, iteration: whole(query.get('it')) }, look: parseLook(query) }
      : { view: 'astray', why: noId(job, 'run', 'job_') };
  const mesh = query.get('mesh');
  if (mesh === null) return { view: 'home' };
  if (!MESH.test(mesh)) return { view: 'astray', why: noId(mesh, 'mesh', 'mesh_') };
  return {
    view: 'mesh',
    mesh,
    up: parseLook(query).up,
    name: query.get('name')?.slice(0, MOST_NAME) ?? null,
  };
}

/**
 * Return what an address holds beside what it is of and cannot be followed, as it was written: values that cannot be,
 * and names that this page does not know. What others hang on links to count visitors is none of that.
 */
export function leftOut(search: string): readonly string[] {
  const query = new URLSearchParams(search);
  const { view } = parseRoute(search);
  if (view === 'astray') return [];
  const look = parseLook(query);
  const taken: Readonly<Record<string, (value: string) => boolean>> = {
    up: () => look.up !== null,
    ...(view === 'mesh' ? { mesh: () => true, name: () => true } : {}),
    ...(view === 'job' ? { job: () => true, it: (value) => ITERATION.test(value) } : {}),
    ...(view === 'compare' ? { compare: (value) => !value.split(',').some(oddIteration) } : {}),
    ...(view === 'job' || view === 'compare'
      ? {
          color: () => look.color !== null,
          wire: (value) => value === '0' || value === '1',
          scale: (value) => value === 'log' || value === 'linear',
          cam: () => look.camera !== null,
        }
      : {}),
  };
  return [...query]
    .filter(
      ([name, value]) =>
        !/^utm_|clid$/.test(name) && !(Object.hasOwn(taken, name) && taken[name]?.(value) === true),
    )
    .map(([name, value]) => quoted(`${name}=${value}`));
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

function parseCompared(text: string, look: Look): Route {
  const parts = text.split(',');
  const [left, right] = parts.map(parseShown);
  if (parts.length !== 2)
    return {
      view: 'astray',
      why: 'A comparison needs two runs with a comma between them: compare=job_…@0,job_…@50, each with the iteration to show, or without one for the newest.',
    };
  if (left && right) return { view: 'compare', left, right, look };
  const wrong = (left ? parts[1] : parts[0]) ?? '';
  return { view: 'astray', why: noId(wrong.split('@')[0] ?? '', 'run', 'job_') };
}

function noId(text: string, of: string, begin: string): string {
  const id = `${begin} and then 26 digits and capital letters`;
  return text === ''
    ? `The address names no ${of}: an id is ${id}.`
    : `“${quoted(text)}” is not the id of a ${of}: that is ${id}. A part of it may have been lost when the address was copied.`;
}

function quoted(text: string): string {
  return text.length > MOST_QUOTED ? `${text.slice(0, MOST_QUOTED)}…` : text;
}

function oddIteration(part: string): boolean {
  const [, iteration] = part.split('@');
  return iteration !== undefined && !ITERATION.test(iteration);
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
  return text !== null && ITERATION.test(text) ? Number(text) : null;
}
