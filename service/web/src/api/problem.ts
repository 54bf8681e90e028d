import type { Defect, ProblemDocument, Report } from './types';

/** An answer that is no success: the service's problem document, or what stands for it. */
export class Problem extends Error {
  override readonly name = 'Problem';

  constructor(
    readonly title: string,
    readonly detail: string,
    readonly status: number,
    readonly slug: string,
    readonly requestId: string | null = null,
    readonly defects: readonly Defect[] = [],
    readonly report: Report | null = null,
    readonly retryAfter: number | null = null,
  ) {
    super(`${title}: ${detail}`);
  }

  /** Whether nothing answered at all. */
  get unreachable(): boolean {
    return this.status === 0;
  }

  /** How long to wait before asking again: what the service says, or else what is usual. */
  waitMs(usual: number): number {
    return Math.max(usual, Math.min(this.retryAfter ?? 0, MOST_WAIT_S) * 1000);
  }

  /** Whether asking again may help. */
  get passing(): boolean {
    return this.unreachable || this.status === 429 || this.status >= 500;
  }
}

const MOST_WAIT_S = 30;
export const UNREACHABLE = 'unreachable';

/** Return the problem that stands for a connection that failed. */
export function unreachable(): Problem {
  return new Problem('No answer', 'The service cannot be reached.', 0, UNREACHABLE);
}

/** Read an answer that is no success. */
export function problemOf(status: number, text: string, headers: Headers): Problem {
  const wait = Number(headers.get('retry-after') ?? NaN);
  const retryAfter = Number.isFinite(wait) ? wait : null;
  const document = parse(text);
  if (document === null)
    return new Problem(
      `Answer ${status}`,
      'The service gave no reason.',
      status,
      'unknown',
      null,
      [],
      null,
      retryAfter,
    );
  const slug = document.type.split('/').at(-1) ?? document.type;
  const report = (document.report as Report | null | undefined) ?? null;
  const defects = document.errors as unknown as readonly Defect[];
  return new Problem(
    document.title,
    document.detail,
    status,
    slug,
    document.request_id,
    defects,
    report,
    retryAfter,
  );
}

/** Make a problem of anything that was thrown. */
export function asProblem(thrown: unknown): Problem {
  if (thrown instanceof Problem) return thrown;
  if (thrown instanceof TypeError) return unreachable(); // what fetch throws when nothing answers
  return new Problem(
    'Something went wrong here',
    thrown instanceof Error ? thrown.message : String(thrown),
    -1,
    'page',
  );
}

function parse(text: string): (ProblemDocument & Record<string, unknown>) | null {
  try {
    const document = JSON.parse(text) as Record<string, unknown>;
    return typeof document.title === 'string' && typeof document.detail === 'string'
      ? (document as unknown as ProblemDocument & Record<string, unknown>)
      : null;
  } catch {
    return null; // a proxy's page, say
  }
}
