import { afterEach, expect, it, vi } from 'vitest';
import { Problem } from '../api/problem';
import { MeshWorker } from './pool';

/** The worker's code with its two ends tied together. */
class Tied {
  onmessage: (event: { data: unknown }) => void = () => undefined;
  private readonly code = import('./worker');

  constructor() {
    vi.stubGlobal('self', {
      postMessage: (data: unknown) => {
        this.onmessage({ data });
      },
    });
  }

  postMessage(data: unknown): void {
    void this.code.then(() => {
      (self.onmessage as unknown as (event: { data: unknown }) => void)({ data });
    });
  }
}

afterEach(() => {
  vi.unstubAllGlobals();
  vi.resetModules();
});

const BROKEN = () => Promise.reject(new TypeError('network error'));

it.each([
  ['nothing answers', () => Promise.reject(new TypeError('Load failed'))],
  ['an answer breaks off', () => Promise.resolve({ ok: true, arrayBuffer: BROKEN })],
  ['a refusal breaks off', () => Promise.resolve({ ok: false, status: 500, text: BROKEN })],
])('the service cannot be reached when %s, whatever the browser calls that', async (_, fetched) => {
  vi.stubGlobal('Worker', Tied);
  vi.stubGlobal('fetch', fetched);
  const asked = new MeshWorker().ask('topology', { key: 'a', faces: '/faces', positions: '/positions' });
  const problem: unknown = await asked.catch((thrown: unknown) => thrown);
  expect(problem).toBeInstanceOf(Problem);
  expect((problem as Problem).unreachable).toBe(true);
});
