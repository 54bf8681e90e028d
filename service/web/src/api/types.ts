import type { components } from '../generated/api';

/** The API's objects, as openapi.json describes them. */
type Schemas = components['schemas'];

export type Job = Schemas['JobOut'];
export type JobStatus = Job['status'];
export type Progress = Schemas['ProgressOut'];
export type Figures = Schemas['FiguresOut'];
export type Row = Schemas['RowOut'];
export type Metrics = Schemas['MetricsOut'];
export type Info = Schemas['InfoOut'];
export type Preset = Schemas['PresetOut'];
export type ParametersDescription = Schemas['ParametersOut'];
export type DryRun = Schemas['DryRunOut'];
export type Sample = Schemas['SampleOut'];
export type ProblemDocument = Schemas['ProblemOut'];

/** What is found out about a mesh; the description leaves it open. */
export interface Report {
  readonly format: string;
  readonly vertices: number;
  readonly faces: number;
  readonly components: number;
  readonly genus: number | null;
  readonly euler: number;
  readonly boundary_loops: number;
  readonly boundary_edges: number;
  readonly degenerate_faces: number;
  readonly bbox: readonly [Point, Point];
  readonly area: number;
  readonly volume: number;
  readonly sphericity: number;
  readonly mean_edge: number;
  readonly least_quality: number;
  readonly eligible: boolean;
  readonly defects: readonly { readonly code: string }[];
  readonly repairs: readonly { readonly code: string; readonly count: number; readonly detail: string }[];
}

export type Point = readonly [number, number, number];

export type Mesh = Omit<Schemas['MeshOut'], 'report'> & { readonly report: Report };

/** One place where a mesh is broken. */
export interface Location {
  readonly kind: 'vertex' | 'edge' | 'component';
  readonly indices: readonly number[];
  readonly positions: readonly Point[];
}

/** One thing that is wrong with a request or a mesh. */
export interface Defect {
  readonly pointer: string;
  readonly code: string;
  readonly detail: string;
  readonly locations?: readonly Location[];
}
