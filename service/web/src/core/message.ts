import { FIELDS, type Field } from './colormap';

/** What a page and the frame in it say to each other. */

/** From the page to the frame: what is to change. */
export interface Command {
  /** null is the newest. */
  readonly iteration?: number | null;
  readonly color?: Field | null;
  readonly wire?: boolean;
  readonly playing?: boolean;
}

/** From the frame to the page: what is shown. */
export interface Report {
  readonly job: string;
  readonly iteration: number;
  readonly status: string;
  readonly playing: boolean;
}

const KEY = 'spherify';

/** Put something into the form in which it is sent. */
export function packed(content: Command | Report): Readonly<Record<string, unknown>> {
  return { [KEY]: content };
}

/** Read a command; what is none, or not one of ours, is null, and so is each part that cannot be. */
export function readCommand(data: unknown): Command | null {
  const content = unpacked(data);
  if (content === null) return null;
  const { iteration, color, wire, playing } = content;
  const field = FIELDS.find((one) => one === color);
  return {
    ...(iteration === null || (typeof iteration === 'number' && Number.isFinite(iteration))
      ? { iteration }
      : {}),
    ...(field !== undefined || color === null ? { color: field ?? null } : {}),
    ...(typeof wire === 'boolean' ? { wire } : {}),
    ...(typeof playing === 'boolean' ? { playing } : {}),
  };
}

/** Read a report; null if it is none. */
export function readReport(data: unknown): Report | null {
  const content = unpacked(data);
  return content !== null && typeof content.job === 'string' && typeof content.iteration === 'number'
    ? (content as unknown as Report)
    : null;
}

function unpacked(data: unknown): Readonly<Record<string, unknown>> | null {
  if (typeof data !== 'object' || data === null) return null;
  const content = (data as Readonly<Record<string, unknown>>)[KEY];
  return typeof content === 'object' && content !== null
    ? (content as Readonly<Record<string, unknown>>)
    : null;
}
