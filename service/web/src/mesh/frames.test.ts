import { expect, test } from 'vitest';
import { Frames, type Store } from './frames';
import type { MeshWorker } from './pool';
import type { TaskName, Tasks } from './tasks';
import { bytesOf, type Frame } from './types';

const VERTICES = 500;
const STATES = 500;
const BYTES = VERTICES * (12 + 4);
const BUDGET = 20 * BYTES + 1;

/** A surface that swells: every state is told from the others by its first number. */
function generated(iteration: number): Frame {
  const positions = Float32Array.from({ length: 3 * VERTICES }, (_, i) => iteration + Math.sin(i));
  return { positions, normals: new Int8Array(4 * VERTICES) };
}

/** Answers as the worker does, with generated numbers. */
const worker: Pick<MeshWorker, 'ask'> = {
  ask: <K extends TaskName>(task: K, ask: Tasks[K]['ask']) => {
    const iteration = Number(/snapshots\/(\d+)\//.exec(JSON.stringify(ask))?.[1]);
    const bounds = { centre: [0, 0, 0], radius: 1 };
    const answers = {
      topology: () => ({ index: new Uint32Array(6), frame: generated(iteration), bounds, triangles: 2 }),
      frame: () => generated(iteration),
      field: () => ({ values: new Float32Array(VERTICES).fill(iteration), range: { low: 0, high: 1 } }),
      forget: () => null,
      preview: () => null,
      faults: () => null,
    };
    return Promise.resolve(answers[task]()) as unknown as Promise<Tasks[K]['answer']>;
  },
};

/** What the worker that draws would hold. */
class Held implements Store {
  readonly numbers = new Map<string, Frame | Float32Array>();
  most = 0;

  keep(key: string, numbers: Frame | Float32Array<ArrayBuffer>): void {
    this.numbers.set(key, numbers);
    this.most = Math.max(this.most, this.bytes);
  }

  drop(key: string): void {
    expect(this.numbers.delete(key), key).toBe(true);
  }

  get bytes(): number {
    return [...this.numbers.values()].reduce(
      (sum, one) => sum + ('normals' in one ? bytesOf(one) : one.byteLength),
      0,
    );
  }
}

async function opened(): Promise<{ frames: Frames; held: Held }> {
  const held = new Held();
  const frames = new Frames(worker, 'job_1', held, BUDGET);
  await frames.open(0, (drawable, key) => {
    held.keep(key, drawable.frame);
  });
  return { frames, held };
}

test('going through five hundred states shows each of them and never holds more than the budget', async () => {
  const { frames, held } = await opened();
  const there = Array.from({ length: STATES }, (_, iteration) => iteration);
  for (const iteration of [...there, ...[...there].reverse()]) {
    await frames.load(iteration, null);
    const key = frames.frame(iteration) ?? '';
    expect((held.numbers.get(key) as Frame).positions[0]).toBeCloseTo(iteration, 4);
    expect(frames.bytes).toBe(held.bytes);
  }
  expect(held.most).toBeLessThanOrEqual(BUDGET);
  expect(held.numbers.size).toBe(20);
});

test('colours count as well, and what is shown now is the last to go', async () => {
  const { frames, held } = await opened();
  for (let iteration = 0; iteration < STATES; iteration++) {
    await frames.load(iteration, 'curvature');
    expect(frames.has(iteration, 'curvature')).toBe(true);
    const { key } = frames.values(iteration, 'curvature') ?? { key: '' };
    expect(held.numbers.get(key)).toEqual(new Float32Array(VERTICES).fill(iteration));
  }
  expect(held.most).toBeLessThanOrEqual(BUDGET);
  frames.close();
  expect(held.numbers.size).toBe(0);
});

test('a state that is larger than the budget is shown, alone', async () => {
  const held = new Held();
  const frames = new Frames(worker, 'job_1', held, 1);
  await frames.load(3, null);
  await frames.load(4, null);
  expect([...held.numbers.keys()]).toEqual(['frame 4']);
});

test('a state that is asked for twice at once is fetched once', async () => {
  let fetched = 0;
  const counting: Pick<MeshWorker, 'ask'> = {
    ask: (task, ask) => {
      if (task === 'frame') fetched += 1;
      return worker.ask(task, ask);
    },
  };
  const held = new Held();
  const frames = new Frames(counting, 'job_1', held, BUDGET);
  await Promise.all([frames.load(7, null), frames.load(7, null)]);
  expect(fetched).toBe(1);
});

test('what comes after the run was left is not kept, and the worker forgets it', async () => {
  const asked: string[] = [];
  const logging: Pick<MeshWorker, 'ask'> = {
    ask: async (task, ask) => {
      const answer = await worker.ask(task, ask);
      asked.push(task); // in the order in which the worker knows
      return answer;
    },
  };
  const held = new Held();
  const late = new Frames(logging, 'job_1', held, BUDGET);
  const opening = late.open(0, (drawable, key) => {
    held.keep(key, drawable.frame);
  });
  const loading = late.load(3, 'curvature');
  late.close();
  await Promise.all([opening, loading]);
  expect(held.numbers.size).toBe(0);
  expect(late.bytes).toBe(0);
  expect(asked.lastIndexOf('forget')).toBeGreaterThan(asked.lastIndexOf('topology'));
});
