import { describe, expect, it } from 'vitest';
import { columnsOf, valuesOf } from './matrix';

const paper = { name: 'paper', title: 'Paper', defaults: { step: 0.0025, measure: 'vtk' } };
const flow = { name: 'conformal', title: 'Conformal flow', defaults: { time_step: 1 } };
const step = { name: 'step', title: 'Step' };

describe('values', () => {
  it('are read between commas or blanks, each once', () => {
    expect(valuesOf('0.02, 5e-2;vtk  0.020,')).toEqual([0.02, 0.05, 'vtk']);
    expect(valuesOf(' , ')).toEqual([]);
  });
});

describe('columns', () => {
  it('are the presets where nothing is varied', () => {
    const titles = columnsOf([paper, flow], null, [1]).map(({ title }) => title);
    expect(titles).toEqual(['Paper', 'Conformal flow']);
    expect(columnsOf([paper], step, [])).toEqual([{ title: 'Paper', preset: 'paper', parameters: {} }]);
  });

  it('are the values where the method has the parameter', () => {
    expect(columnsOf([paper, flow], step, [0.01, 0.02])).toEqual([
      { title: 'Paper, step 0.01', preset: 'paper', parameters: { step: 0.01 } },
      { title: 'Paper, step 0.02', preset: 'paper', parameters: { step: 0.02 } },
      { title: 'Conformal flow', preset: 'conformal', parameters: {} },
    ]);
    expect(columnsOf([paper], step, [0.01])[0]?.title).toBe('step 0.01');
  });
});
