import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { Api } from './client';
import { Follow, type Connection } from './follow';
import { unreachable } from './problem';
import { Stream } from './teststream';
import type { Job } from './types';

const RUNNING = { id: 'job_1', rev: 1, status: 'running', done: false } as unknown as Job;

/** An API whose answer is held until the test gives it. */
function held(): { api: Api; asked: () => number; answer: () => void } {
  const waiting: ((job: Job) => void)[] = [];
  let asked = 0;
  const job = (): Promise<Job> => {
    asked += 1;
    return new Promise((resolve) => waiting.push(resolve));
  };
  const answer = (): void => {
    waiting.shift()?.(RUNNING);
  };
  return { api: { job } as unknown as Api, asked: () => asked, answer };
}

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('EventSource', Stream);
  Stream.made = [];
});

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

test('a question that was on its way when the stream opened is the last one', async () => {
  const connections: Connection[] = [];
  const { api, asked, answer } = held();
  new Follow(api, 'job_1', vi.fn(), (connection) => connections.push(connection));
  const [stream] = Stream.made;
  stream?.breaks(Stream.CONNECTING);
  await vi.advanceTimersByTimeAsync(1000);
  expect(asked()).toBe(1);
  stream?.opens();
  answer();
  await vi.advanceTimersByTimeAsync(60_000);
  expect(asked()).toBe(1);
  expect(vi.getTimerCount()).toBe(0);
  expect(connections).toEqual(['live']);
});

test('while the stream is broken it is asked for again and again', async () => {
  const told = vi.fn();
  const { api, asked, answer } = held();
  new Follow(api, 'job_1', told, vi.fn());
  Stream.made[0]?.breaks(Stream.CLOSED);
  for (const time of [1, 2, 3]) {
    await vi.advanceTimersByTimeAsync(1000);
    expect(asked()).toBe(time);
    answer();
    await vi.advanceTimersByTimeAsync(0);
    expect(told).toHaveBeenLastCalledWith({ kind: 'status', job: RUNNING });
    expect(Stream.made.length).toBe(time + 1);
    Stream.made.at(-1)?.breaks(Stream.CLOSED);
  }
});

test('what was closed while a question was on its way says nothing more', async () => {
  const connected = vi.fn();
  const told = vi.fn();
  for (const fails of [false, true]) {
    let answer: () => void = () => undefined;
    const job = (): Promise<Job> =>
      new Promise((resolve, reject) => {
        answer = () => {
          if (fails) reject(unreachable());
          else resolve(RUNNING);
        };
      });
    const follow = new Follow({ job } as unknown as Api, 'job_1', told, connected);
    Stream.made.at(-1)?.breaks(Stream.CONNECTING);
    await vi.advanceTimersByTimeAsync(1000);
    follow.close();
    answer();
    await vi.advanceTimersByTimeAsync(60_000);
    expect(vi.getTimerCount()).toBe(0);
  }
  expect(connected).not.toHaveBeenCalled();
  expect(told).not.toHaveBeenCalled();
});
