import type { ProgressEvent, RunEvent } from '../core/job';
import type { Api } from './client';
import { asProblem } from './problem';
import type { Job } from './types';

/** How the news of a job come in. */
export type Connection = 'live' | 'polling' | 'lost' | 'ended';

const POLL_MS = 1000;
const LOST_POLL_MS = 2000;

/**
 * Brings every event of a job: by the event stream, and by asking every second while the stream is broken. The
 * browser reconnects by itself and names the last event it has, so nothing is missed.
 */
export class Follow {
  private source: EventSource | null = null;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private over = false;

  constructor(
    private readonly api: Api,
    private readonly id: string,
    private readonly tell: (event: RunEvent) => void,
    private readonly connected: (connection: Connection) => void,
  ) {
    this.open();
  }

  /** Stop listening. */
  close(): void {
    this.over = true;
    this.source?.close();
    clearTimeout(this.timer);
  }

  private open(): void {
    const source = new EventSource(`/v1/jobs/${this.id}/events`);
    this.source = source;
    const hear = (name: string, read: (data: unknown) => RunEvent): void => {
      source.addEventListener(name, (message: MessageEvent<string>) => {
        this.take(read(JSON.parse(message.data)));
      });
    };
    hear('status', (data) => ({ kind: 'status', job: data as Job }));
    hear('done', (data) => ({ kind: 'done', job: data as Job }));
    hear('progress', (data) => ({ kind: 'progress', progress: data as ProgressEvent }));
    hear('snapshot', (data) => ({ kind: 'snapshot', iteration: (data as { iteration: number }).iteration }));
    source.onopen = () => {
      clearTimeout(this.timer);
      if (!this.over) this.connected('live');
    };
    source.onerror = () => {
      if (this.over) return;
      clearTimeout(this.timer);
      this.timer = setTimeout(() => void this.poll(), POLL_MS);
    };
  }

  private take(event: RunEvent): void {
    if (this.over) return;
    this.tell(event);
    if (event.kind === 'done' || (event.kind === 'status' && event.job.done)) {
      this.close();
      this.connected('ended');
    }
  }

  private async poll(): Promise<void> {
    if (this.over) return;
    let wait = POLL_MS;
    try {
      const job = await this.api.job(this.id);
      if (this.finished() || this.live()) return; // a stream that came back tells what was missed
      this.connected('polling');
      this.take({ kind: job.done ? 'done' : 'status', job });
    } catch (thrown) {
      if (this.finished() || this.live()) return;
      const problem = asProblem(thrown);
      if (!problem.passing) {
        this.close(); // it was deleted
        this.connected('ended');
        return;
      }
      this.connected('lost');
      wait = problem.waitMs(LOST_POLL_MS);
    }
    if (this.source?.readyState === EventSource.CLOSED && !this.finished()) this.open();
    if (!this.finished()) this.timer = setTimeout(() => void this.poll(), wait);
  }

  private live(): boolean {
    return this.source?.readyState === EventSource.OPEN;
  }

  private finished(): boolean {
    return this.over; // it may have been closed meanwhile
  }
}
