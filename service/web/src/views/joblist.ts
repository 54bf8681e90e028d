import type { Api, JobFilter } from '../api/client';
import { asProblem, type Problem } from '../api/problem';
import type { Job, JobStatus } from '../api/types';
import { Emitter } from '../core/emitter';

const BUSY_MS = 2000;
const IDLE_MS = 10_000;
const AFTER_MS = 10_000; // a run is often followed by another, as in a batch or in the gallery
const SLICE = 30;

/** The service's jobs, newest first, asked for again and again while the page is looked at. */
export class JobList extends Emitter {
  jobs: readonly Job[] = [];
  more = false;
  loaded = false;
  problem: Problem | null = null;
  status: JobStatus | null = null;
  tag: string | null = null;
  private shown = SLICE;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private asked = 0;
  private moved = -AFTER_MS; // when a run was last on its way

  constructor(private readonly api: Api) {
    super();
    document.addEventListener('visibilitychange', () => {
      if (!document.hidden) void this.load();
    });
    void this.load();
  }

  filter(status: JobStatus | null, tag: string | null): void {
    [this.status, this.tag, this.shown] = [status, tag, SLICE];
    this.loaded = false;
    this.changed();
    void this.load();
  }

  /** Show more of them. */
  grow(): void {
    this.shown += SLICE;
    void this.load();
  }

  /** Ask now, and then again after a while. */
  async load(): Promise<void> {
    clearTimeout(this.timer);
    const asked = ++this.asked;
    try {
      const { jobs, more } = await this.fetch();
      if (asked !== this.asked) return;
      this.jobs = jobs;
      this.more = more;
      this.problem = null;
      this.loaded = true;
    } catch (thrown) {
      if (asked !== this.asked) return;
      this.problem = asProblem(thrown);
    }
    this.changed();
    if (document.hidden) return;
    const none = this.jobs.length === 0 && this.status === null && this.tag === null; // a gallery may be on its way
    if (this.jobs.some((job) => !job.done)) this.moved = performance.now();
    const usual = none || performance.now() - this.moved < AFTER_MS ? BUSY_MS : IDLE_MS;
    const wait = this.problem?.waitMs(BUSY_MS) ?? usual;
    this.timer = setTimeout(() => void this.load(), wait);
  }

  private async fetch(): Promise<{ jobs: readonly Job[]; more: boolean }> {
    const filter: JobFilter = {
      ...(this.status === null ? {} : { status: this.status }),
      ...(this.tag === null ? {} : { tag: this.tag }),
    };
    let page = await this.api.jobs(filter, SLICE);
    const jobs = [...page.items];
    while (jobs.length < this.shown && page.next_cursor !== null) {
      page = await this.api.jobs({ ...filter, cursor: page.next_cursor }, SLICE);
      jobs.push(...page.items);
    }
    return { jobs, more: page.next_cursor !== null };
  }
}
