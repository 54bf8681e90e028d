import type { JobRequest } from '../api/client';
import { planOf } from './plan';
import { changes, type Json, type Values } from './schema';

/** The same request for a terminal and for a program: what the page does, anyone can. */

/** Return the request as a line of curl. */
export function curl(origin: string, request: JobRequest): string {
  return `curl --json ${quoted(JSON.stringify(request))} ${origin}/v1/jobs`;
}

/** Return the request as a Python program that waits for the result and saves it. */
export function python(origin: string, request: JobRequest): string {
  return `import time
import httpx

with httpx.Client(base_url="${origin}", timeout=60) as http:
    job = http.post("/v1/jobs", json=${literal(request as unknown as Json, 1)}).raise_for_status().json()
    while not job["done"]:
        time.sleep(1)
        job = http.get(f"/v1/jobs/{job['id']}").raise_for_status().json()
    print(job["status"], job["stop_reason"], (job["metrics"] or {}).get("sphericity"))
    if job["result_iteration"] is None:
        raise SystemExit((job["error"] or {}).get("detail", "there is no result"))
    mesh = http.get(f"/v1/jobs/{job['id']}/snapshots/final.ply").raise_for_status()
    with open("final.ply", "wb") as file:
        file.write(mesh.content)
`;
}

/**
 * Return the request again for a job that there is.
 *
 * @param defaults of its preset: only what differs from them is named; null where they are not known.
 * @param tags for the new job: those of the old one may say where it alone belongs.
 */
export function requestOf(
  job: {
    readonly mesh_id: string;
    readonly preset: string;
    readonly parameters: unknown;
    readonly snapshots: { readonly requested: readonly number[] };
    readonly name: string;
  },
  defaults: Values | null,
  tags: readonly string[] = [],
): JobRequest {
  const { iterations, ...parameters } = changes(job.parameters as Values, defaults ?? {});
  return {
    mesh_id: job.mesh_id,
    preset: job.preset,
    ...(Object.keys(parameters).length > 0 ? { parameters } : {}),
    ...(typeof iterations === 'number' ? { iterations } : {}),
    snapshots: planOf(job.snapshots.requested),
    name: job.name,
    ...(tags.length > 0 ? { tags: [...tags] } : {}),
  };
}

function quoted(text: string): string {
  return `'${text.replaceAll("'", String.raw`'\''`)}'`;
}

function literal(value: Json, depth: number): string {
  if (value === null) return 'None';
  if (typeof value === 'boolean') return value ? 'True' : 'False';
  if (Array.isArray(value)) return `[${value.map((item: Json) => literal(item, depth + 1)).join(', ')}]`;
  if (typeof value !== 'object') return JSON.stringify(value);
  const pad = '    '.repeat(depth);
  const rows = Object.entries(value).map(
    ([name, inner]) => `${pad}    ${JSON.stringify(name)}: ${literal(inner, depth + 1)},\n`,
  );
  return rows.length === 0 ? '{}' : `{\n${rows.join('')}${pad}}`;
}
