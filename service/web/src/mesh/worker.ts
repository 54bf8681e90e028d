import { rangeOf } from '../core/colormap';
import { decimate, pick, type Decimation } from './decimate';
import { faultsOf } from './faults';
import { vertexNormals } from './normals';
import { outward } from './outward';
import { parse } from './parse';
import type { Failure, TaskName, Tasks } from './tasks';
import { boundsOf, type Frame, type Surface } from './types';
import { weld } from './weld';

/** Off the page's own thread: fetching, parsing, normals, decimation, ranges of colours. */

class AnswerError extends Error {
  override readonly name = 'AnswerError';

  constructor(
    readonly status: number,
    readonly body: string,
    readonly wait: string | null,
  ) {
    super(`answer ${status}`);
  }
}

/** Nothing answered, or an answer broke off; browsers say so in words of their own. */
class UnreachableError extends Error {
  override readonly name = 'UnreachableError';
}

const runs = new Map<string, Decimation>();
let previewed: Surface | null = null; // the last one, should it be refused

type Handlers = { [K in TaskName]: (ask: Tasks[K]['ask']) => Promise<Tasks[K]['answer']> };

const handlers: Handlers = {
  async preview({ data, name }) {
    const surface = outward(weld(await parse(data, name)));
    previewed = { ...surface };
    const drawn = decimate(surface);
    const frame = frameOf(pick(surface.positions, drawn.kept, 3), drawn.index);
    const bounds = boundsOf(surface.positions);
    const index = drawn.kept === null ? drawn.index.slice() : drawn.index; // the surface's own stays here
    return { index, frame: apart(frame, surface), bounds, triangles: surface.index.length / 3 };
  },

  faults() {
    if (previewed === null) throw new Error('nothing is previewed');
    return Promise.resolve({ ...faultsOf(previewed), positions: previewed.positions.slice() });
  },

  async topology({ key, faces, positions }) {
    const [index, first] = await Promise.all([fetched(faces), fetched(positions)]);
    const surface = { positions: new Float32Array(first), index: new Uint32Array(index) };
    const drawn = decimate(surface);
    runs.set(key, drawn);
    const frame = frameOf(pick(surface.positions, drawn.kept, 3), drawn.index);
    const bounds = boundsOf(surface.positions);
    return { index: drawn.index.slice(), frame, bounds, triangles: surface.index.length / 3 };
  },

  async frame({ key, url, exact }) {
    const drawn = known(key);
    const data = await fetched(url);
    return frameOf(pick(exact ? new Float32Array(data) : unpacked(data), drawn.kept, 3), drawn.index);
  },

  async field({ key, url, ...tails }) {
    const values = pick(new Float32Array(await fetched(url)), known(key).kept, 1);
    return { values, range: rangeOf(values, tails) };
  },

  forget({ key }) {
    runs.delete(key);
    return Promise.resolve(null);
  },
};

/** Turn 6 float32 (the box) and 3n uint16 into positions. */
function unpacked(data: ArrayBuffer): Float32Array<ArrayBuffer> {
  const box = new Float32Array(data, 0, 6);
  const packed = new Uint16Array(data, 24);
  const positions = new Float32Array(packed.length);
  for (let axis = 0; axis < 3; axis++) {
    const low = box[axis] ?? 0;
    const scale = ((box[axis + 3] ?? 0) - low) / 65535;
    for (let i = axis; i < packed.length; i += 3) positions[i] = low + (packed[i] ?? 0) * scale;
  }
  return positions;
}

function frameOf(positions: Float32Array<ArrayBuffer>, index: Uint32Array): Frame {
  return { positions, normals: vertexNormals(positions, index) };
}

/** Let a frame have positions of its own: what is handed over is gone here. */
function apart(frame: Frame, surface: Surface): Frame {
  return frame.positions === surface.positions ? { ...frame, positions: frame.positions.slice() } : frame;
}

function known(key: string): Decimation {
  const drawn = runs.get(key);
  if (drawn === undefined) throw new Error(`${key} was forgotten`);
  return drawn;
}

async function fetched(url: string): Promise<ArrayBuffer> {
  try {
    const answer = await fetch(url);
    if (answer.ok) return await answer.arrayBuffer();
    throw new AnswerError(answer.status, await answer.text(), answer.headers.get('retry-after'));
  } catch (thrown) {
    throw thrown instanceof TypeError ? new UnreachableError() : thrown;
  }
}

/** Collect the buffers of an answer, which are handed over and not copied. */
function buffers(value: unknown, found = new Set<ArrayBuffer>()): Set<ArrayBuffer> {
  if (ArrayBuffer.isView(value)) found.add(value.buffer as ArrayBuffer);
  else if (typeof value === 'object' && value !== null)
    for (const inner of Object.values(value)) buffers(inner, found);
  return found;
}

async function handle<K extends TaskName>(id: number, task: K, ask: Tasks[K]['ask']): Promise<void> {
  try {
    const answer = await handlers[task](ask);
    self.postMessage({ id, answer }, { transfer: [...buffers(answer)] });
  } catch (thrown) {
    const { name, message } = thrown instanceof Error ? thrown : new Error(String(thrown));
    const failure: Failure =
      thrown instanceof AnswerError
        ? { name, message, status: thrown.status, body: thrown.body, wait: thrown.wait }
        : { name, message };
    self.postMessage({ id, failure });
  }
}

self.onmessage = (event: MessageEvent<{ id: number; task: TaskName; ask: never }>) => {
  const { id, task, ask } = event.data;
  void handle(id, task, ask);
};
