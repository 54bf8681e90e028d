import { Emitter } from '../core/emitter';
import { withNextFrame } from '../core/frame';
import { afterEvent, withRows, type RunEvent, type RunState } from '../core/job';
import type { Api } from './client';
import { Follow, type Connection } from './follow';
import { asProblem, type Problem } from './problem';

const SERIES_MS = 4000;
const AGAIN_MS = 2000;

/** A job as it goes: its record, its kept states and its figures, always the newest there are. */
export class Run extends Emitter {
  state: RunState | null = null;
  problem: Problem | null = null;
  connection: Connection = 'ended';
  /** Events come in bunches; who listens is told once a frame. */
  private readonly news = withNextFrame(() => {
    if (!this.closed) this.changed();
  });
  private follow: Follow | null = null;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private closed = false;
  private asked = 0; // how often the series was asked for

  constructor(
    private readonly api: Api,
    readonly id: string,
  ) {
    super();
    document.addEventListener('visibilitychange', this.look);
    void this.open();
  }

  /** Rest while nobody looks: what is missed comes at once when somebody does again. */
  private readonly look = (): void => {
    if (this.closed || this.state?.job.done) return;
    if (!document.hidden) {
      void this.open();
      return;
    }
    this.follow?.close();
    clearTimeout(this.timer);
  };

  /** Begin again after a failure. */
  async open(): Promise<void> {
    clearTimeout(this.timer);
    this.problem = null;
    try {
      const job = await this.api.job(this.id);
      if (this.isClosed()) return;
      this.state = { job, states: job.snapshots.available, rows: this.state?.rows ?? [] };
      if (job.done)
        this.connection = 'ended'; // it may have ended while nobody listened
      else if (!document.hidden) this.listen();
      this.changed();
      await this.series();
    } catch (thrown) {
      if (this.isClosed()) return;
      this.problem = asProblem(thrown);
      this.changed();
      if (this.problem.passing) this.later(() => this.open(), this.problem.waitMs(AGAIN_MS));
    }
  }

  close(): void {
    this.closed = true;
    document.removeEventListener('visibilitychange', this.look);
    this.follow?.close();
    clearTimeout(this.timer);
  }

  private isClosed(): boolean {
    return this.closed; // it may be closed while something is awaited
  }

  private listen(): void {
    this.follow?.close();
    this.follow = new Follow(
      this.api,
      this.id,
      (event) => {
        this.take(event);
      },
      (connection) => {
        if (connection === this.connection) return;
        this.connection = connection;
        this.changed();
      },
    );
  }

  private take(event: RunEvent): void {
    if (this.state === null) return;
    const before = this.state;
    this.state = afterEvent(before, event);
    if (this.state === before) return;
    if (this.state.job.done && !before.job.done) void this.series();
    this.news();
  }

  /** Fetch the whole time series: events bring two rows a second, and the service has more. */
  private async series(): Promise<void> {
    clearTimeout(this.timer);
    let complete = this.state?.job.done ?? true;
    const asked = ++this.asked;
    try {
      const { rows } = await this.api.metrics(this.id);
      if (asked !== this.asked) return; // a newer answer has come or will
      if (this.state !== null && !this.isClosed()) {
        this.state = withRows(this.state, rows);
        this.changed();
      }
    } catch (thrown) {
      if (asked !== this.asked || !asProblem(thrown).passing) return; // deleted: the record tells
      complete = false;
    }
    if (!complete) this.later(() => this.series(), SERIES_MS);
  }

  /** Do something in a while, and that alone, unless nobody looks by now: `look` begins again. */
  private later(act: () => Promise<void>, wait: number): void {
    clearTimeout(this.timer);
    if (this.isClosed() || document.hidden) return;
    this.timer = setTimeout(() => void act(), wait);
  }
}
