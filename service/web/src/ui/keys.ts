import { FIELDS } from '../core/colormap';
import type { Looks } from './look';

/** What a key does. */
export type Keys = Readonly<Record<string, () => void>>;

/** The keys that lead through the states of a run. */
export function standKeys(stage: {
  readonly states: readonly number[];
  seek(iteration: number): void;
  step(direction: 1 | -1): void;
  toggle(): void;
}): Keys {
  return {
    ' ': () => {
      stage.toggle();
    },
    ArrowLeft: () => {
      stage.step(-1);
    },
    ArrowRight: () => {
      stage.step(1);
    },
    Home: () => {
      stage.seek(0);
    },
    End: () => {
      stage.seek(stage.states.at(-1) ?? 0);
    },
  };
}

/** The keys that change how it looks. */
export function lookKeys(stage: Looks): Keys {
  return {
    w: () => {
      stage.setWire(!stage.wire);
    },
    f: () => {
      stage.setFacets(!stage.facets);
    },
    u: () => {
      stage.setUp(stage.viewer.camera.up === 'y' ? 'z' : 'y');
    },
    c: () => {
      const next = stage.color === null ? 0 : FIELDS.indexOf(stage.color) + 1;
      stage.setColor(FIELDS[next] ?? null);
    },
  };
}
