import { Emitter } from '../core/emitter';
import type { Api } from './client';
import { asProblem, type Problem } from './problem';
import type { Info, ParametersDescription, Preset, Sample } from './types';

/** What the service offers, fetched once: limits, presets, parameters. */
export class Catalogue extends Emitter {
  info: Info | null = null;
  presets: readonly Preset[] = [];
  samples: readonly Sample[] = [];
  parameters: ParametersDescription | null = null;
  problem: Problem | null = null;

  constructor(private readonly api: Api) {
    super();
    void this.load();
  }

  async load(): Promise<void> {
    this.problem = null;
    try {
      [this.info, this.presets, this.parameters, this.samples] = await Promise.all([
        this.api.info(),
        this.api.presets(),
        this.api.parameters(),
        this.api.samples(),
      ]);
    } catch (thrown) {
      this.problem = asProblem(thrown);
    }
    this.changed();
  }
}
