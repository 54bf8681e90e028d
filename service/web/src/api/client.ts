import { asProblem, problemOf, unreachable } from './problem';
import type {
  DryRun,
  Info,
  Job,
  JobStatus,
  Mesh,
  Metrics,
  ParametersDescription,
  Preset,
  Sample,
} from './types';

/** What a job is asked for with: the JSON of `POST /v1/jobs`. */
export interface JobRequest {
  readonly mesh_id: string;
  readonly preset: string;
  readonly parameters?: Readonly<Record<string, unknown>>;
  readonly iterations?: number;
  readonly snapshots?: string | readonly number[];
  readonly name?: string;
  readonly tags?: readonly string[];
}

export interface JobFilter {
  readonly status?: JobStatus;
  readonly tag?: string;
  readonly cursor?: string;
}

export interface Page<T> {
  readonly items: readonly T[];
  readonly next_cursor: string | null;
}

/** The service, through its own API. Every failure is thrown as a `Problem`. */
export class Api {
  info(): Promise<Info> {
    return this.get('/v1/info');
  }

  async presets(): Promise<readonly Preset[]> {
    return (await this.get<{ items: Preset[] }>('/v1/presets')).items;
  }

  parameters(): Promise<ParametersDescription> {
    return this.get('/v1/parameters');
  }

  jobs(filter: JobFilter = {}, limit = 30): Promise<Page<Job>> {
    const query = new URLSearchParams({ limit: String(limit), ...filter });
    return this.get(`/v1/jobs?${query}`);
  }

  job(id: string): Promise<Job> {
    return this.get(`/v1/jobs/${id}`);
  }

  metrics(id: string): Promise<Metrics> {
    return this.get(`/v1/jobs/${id}/metrics`);
  }

  async samples(): Promise<readonly Sample[]> {
    return (await this.get<{ items: Sample[] }>('/v1/samples')).items;
  }

  /** Have a sample shape made; the same one again is the same mesh. */
  sample(name: string): Promise<Mesh> {
    return this.send('POST', `/v1/samples/${name}`);
  }

  mesh(id: string): Promise<Mesh> {
    return this.get(`/v1/meshes/${id}`);
  }

  /** Have a request checked, and told what it would take; no job is made. */
  rehearse(request: JobRequest): Promise<DryRun> {
    return this.send('POST', '/v1/jobs?dry_run=true', request);
  }

  /** Have a kept state of a run made a mesh of its own; the same state again is the same mesh. */
  async meshOf(job: string, iteration: number): Promise<DryRun['mesh']> {
    const request = { from_snapshot: `${job}/${iteration}` };
    return (await this.send<DryRun>('POST', '/v1/jobs?dry_run=true', request)).mesh;
  }

  submit(request: JobRequest): Promise<Job> {
    return this.send('POST', '/v1/jobs', request);
  }

  extend(id: string, iterations: number): Promise<Job> {
    return this.send('POST', `/v1/jobs/${id}/extend`, { iterations });
  }

  retry(id: string): Promise<Job> {
    return this.send('POST', `/v1/jobs/${id}/retry`);
  }

  cancel(id: string): Promise<Job> {
    return this.send('POST', `/v1/jobs/${id}/cancel`);
  }

  async delete(id: string): Promise<void> {
    await this.send('DELETE', `/v1/jobs/${id}`);
  }

  /** Send a mesh as it is; `progress` is told the share that has been sent. */
  upload(
    file: Blob,
    name: string,
    allow: readonly string[],
    progress: (share: number) => void,
  ): Promise<Mesh> {
    const query = new URLSearchParams([['name', name], ...allow.map((one) => ['allow', one])]);
    return new Promise((resolve, reject) => {
      const request = new XMLHttpRequest(); // fetch does not tell how much is sent
      request.open('PUT', `/v1/meshes?${query}`);
      request.upload.onprogress = (event) => {
        if (event.lengthComputable) progress(event.loaded / event.total);
      };
      request.onerror = () => {
        reject(unreachable());
      };
      request.onload = () => {
        if (request.status < 300) resolve(JSON.parse(request.responseText) as Mesh);
        else {
          const wait = request.getResponseHeader('retry-after');
          const headers = new Headers(wait === null ? {} : { 'retry-after': wait });
          reject(problemOf(request.status, request.responseText, headers));
        }
      };
      request.send(file);
    });
  }

  private async get<T>(path: string): Promise<T> {
    return (await this.request(path)).json() as Promise<T>;
  }

  private async send<T>(method: string, path: string, body?: unknown): Promise<T> {
    const init: RequestInit = { method };
    if (body !== undefined) {
      init.body = JSON.stringify(body);
      init.headers = { 'Content-Type': 'application/json' };
    }
    const answer = await this.request(path, init);
    return (answer.status === 204 ? undefined : await answer.json()) as T;
  }

  private async request(path: string, init?: RequestInit): Promise<Response> {
    let answer: Response;
    try {
      answer = await fetch(path, init);
    } catch (thrown) {
      throw asProblem(thrown);
    }
    if (!answer.ok) throw problemOf(answer.status, await answer.text(), answer.headers);
    return answer;
  }
}
