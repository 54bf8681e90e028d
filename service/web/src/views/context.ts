import type { TemplateResult } from 'lit-html';
import type { Api } from '../api/client';
import type { Catalogue } from '../api/catalogue';
import type { Route } from '../core/route';
import type { MeshWorker } from '../mesh/pool';
import type { JobList } from './joblist';
import type { Thumbnails } from './thumbnails';

/** What every view works with. */
export interface Context {
  readonly api: Api;
  readonly worker: MeshWorker;
  readonly catalogue: Catalogue;
  readonly jobs: JobList;
  readonly thumbnails: Thumbnails;
  /** Go to another view; where one `stays`, the view that is shown has this address from now on. */
  go(route: Route, stays?: boolean): void;
  /** Somebody is about to choose files, or does so no more. */
  choosing(begun: boolean): void;
  /** Show a file that was dropped or chosen, or several. */
  files(files: readonly File[]): void;
  /** Say something for a moment. */
  toast(text: string, kind?: 'good' | 'bad'): void;
  /** Draw the page anew, soon. */
  refresh(): void;
}

/** One page of the page. */
export interface View {
  /** What it shows, in a few words; empty until that is known. */
  readonly title: string;
  /** Whether it draws its heading itself; without one it has its title for a heading, for those who hear the page. */
  readonly headed?: boolean;
  render(): TemplateResult;
  /** A key that nobody nearer took; returns whether it was taken. */
  key?(event: KeyboardEvent): boolean;
  /** Rest while somebody chooses files: what comes next shall not wait for what they leave. */
  choosing?(begun: boolean): void;
  close(): void;
}
