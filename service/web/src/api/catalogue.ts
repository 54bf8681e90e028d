import { Emitter } from '../core/emitter';
import type { Api } from './client';
import { asProblem, type Problem } from './problem';
import type { Info, ParametersDescription, Preset } from './types';

/** What the service offers, fetched once: limits, presets, parameters. */
export class Catalogue extends Emitter {
  info: Info | null = null;
  presets: readonly Preset[] = [];
  parameters: ParametersDescription | null = null;
  problem: Problem | null = null;

  constructor(private readonly api: Api) {
    super();
    void this.load();
  }

  async load(): Promise<void> {
    this.problem = null;
    try {
      [this.info, this.presets, this.parameters] = await Promise.all([
        this.api.info(),
        this.api.presets(),
        this.api.parameters(),
      ]);
    } catch (thrown) {
      this.problem = asProblem(thrown);
    }
    this.changed();
  }
}
