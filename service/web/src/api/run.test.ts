import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { Api } from './client';
import { unreachable } from './problem';
import { Run } from './run';
import { Stream } from './teststream';
import type { Job, Row } from './types';

/** What of the browser's document a run looks at. */
class Page extends EventTarget {
  hidden = false;

  turn(hidden: boolean): void {
    this.hidden = hidden;
    this.dispatchEvent(new Event('visibilitychange'));
  }
}

const job = (done: boolean): Job =>
  ({ id: 'job_1', rev: done ? 2 : 1, done, snapshots: { available: [0] } }) as unknown as Job;

let page: Page;
let answer: () => Promise<Job>;
let asked: number;
let series: () => Promise<{ rows: readonly Row[] }>;

/** A run of an API that answers as the test says. */
function begun(): Run {
  const api = {
    job: () => {
      asked += 1;
      return answer();
    },
    metrics: () => series(),
  };
  return new Run(api as unknown as Api, 'job_1');
}

beforeEach(() => {
  vi.useFakeTimers();
  page = new Page();
  asked = 0;
  series = () => Promise.resolve({ rows: [] });
  vi.stubGlobal('document', page);
  vi.stubGlobal('EventSource', Stream);
  vi.stubGlobal('requestAnimationFrame', vi.fn());
  Stream.made = [];
});

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

test('a run that ended while nobody looked and nothing answered is known to have ended', async () => {
  answer = () => Promise.resolve(job(false));
  const run = begun();
  await vi.advanceTimersByTimeAsync(0);
  answer = () => Promise.reject(unreachable());
  Stream.made[0]?.breaks(Stream.CONNECTING);
  await vi.advanceTimersByTimeAsync(1000);
  expect(run.connection).toBe('lost');
  page.turn(true);
  answer = () => Promise.resolve(job(true));
  page.turn(false);
  await vi.advanceTimersByTimeAsync(0);
  expect(run.connection).toBe('ended');
  expect(vi.getTimerCount()).toBe(0);
});

test('a run that cannot be read is asked for again, by one chain alone, and only while somebody looks', async () => {
  answer = () => Promise.reject(unreachable());
  begun();
  page.turn(false); // shown anew while the first question is on its way
  await vi.advanceTimersByTimeAsync(0);
  expect(asked).toBe(2);
  await vi.advanceTimersByTimeAsync(2000);
  expect(asked).toBe(3);
  page.turn(true);
  await vi.advanceTimersByTimeAsync(60_000);
  expect(asked).toBe(3);
  page.turn(false);
  await vi.advanceTimersByTimeAsync(2000);
  expect(asked).toBe(5);
});

test('the series that was asked for at the end is the last word, however late an earlier one comes', async () => {
  const rows = (last: number): { rows: Row[] } => ({ rows: [{ iteration: 0 }, { iteration: last }] });
  let late: (answer: { rows: Row[] }) => void = () => undefined;
  answer = () => Promise.resolve(job(false));
  series = () =>
    new Promise((resolve) => {
      late = resolve;
    });
  const run = begun();
  await vi.advanceTimersByTimeAsync(0);
  series = () => Promise.reject(unreachable());
  Stream.made[0]?.tells('done', job(true));
  await vi.advanceTimersByTimeAsync(0);
  series = () => Promise.resolve(rows(20)); // asked for until it is there
  await vi.advanceTimersByTimeAsync(4000);
  late(rows(40)); // what a former attempt had reached
  await vi.advanceTimersByTimeAsync(60_000);
  expect(run.state?.rows.map((row) => row.iteration)).toEqual([0, 20]);
  expect(vi.getTimerCount()).toBe(0);
});

test('a run that was left tells nobody of a failure that comes late', async () => {
  let fail: (problem: Error) => void = () => undefined;
  answer = () =>
    new Promise((_, reject) => {
      fail = reject;
    });
  const run = begun();
  const told = vi.fn();
  run.onChange(told);
  run.close();
  fail(unreachable());
  await vi.advanceTimersByTimeAsync(60_000);
  expect(told).not.toHaveBeenCalled();
  expect(asked).toBe(1);
});
