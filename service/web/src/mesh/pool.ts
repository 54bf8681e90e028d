import { problemOf, unreachable } from '../api/problem';
import type { Failure, TaskName, Tasks } from './tasks';

/** Asks the worker; one for the page is enough, as what it waits for most is the network. */
export class MeshWorker {
  private readonly worker = new Worker(new URL('./worker.ts', import.meta.url), {
    type: 'module',
    name: 'reading',
  });
  private readonly waiting = new Map<
    number,
    { resolve: (answer: never) => void; reject: (reason: Error) => void }
  >();
  private last = 0;

  constructor() {
    this.worker.onmessage = (event: MessageEvent<{ id: number; answer?: never; failure?: Failure }>) => {
      const { id, answer, failure } = event.data;
      const asked = this.waiting.get(id);
      this.waiting.delete(id);
      if (failure) asked?.reject(errorOf(failure));
      else asked?.resolve(answer as never);
    };
    this.worker.onerror = (event) => {
      for (const asked of this.waiting.values())
        asked.reject(new Error(event.message || 'the worker did not start'));
      this.waiting.clear();
    };
  }

  /** Have something done; `transfer` is handed over. */
  ask<K extends TaskName>(
    task: K,
    ask: Tasks[K]['ask'],
    transfer: Transferable[] = [],
  ): Promise<Tasks[K]['answer']> {
    const id = ++this.last;
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject });
      this.worker.postMessage({ id, task, ask }, transfer);
    });
  }
}

function errorOf(failure: Failure): Error {
  if (failure.status !== undefined) {
    const headers = new Headers(failure.wait ? { 'retry-after': failure.wait } : {});
    return problemOf(failure.status, failure.body ?? '', headers);
  }
  if (failure.name === 'UnreachableError') return unreachable();
  const error = new Error(failure.message);
  error.name = failure.name;
  return error;
}
