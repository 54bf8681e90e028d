import { describe, expect, it } from 'vitest';
import { carried, changes, fieldsOf, wrong, type FormField, type NumberField } from './schema';

const SCHEMA = {
  $defs: {
    Stage: { type: 'object', properties: { repeat: { type: 'integer', minimum: 1, title: 'Iterations' } } },
    Annealing: {
      title: 'AnnealingParameters',
      type: 'object',
      properties: { factor: { type: 'number', exclusiveMinimum: 0, exclusiveMaximum: 1 } },
    },
  },
  properties: {
    iterations: { type: 'integer', minimum: 0, maximum: 100, title: 'Iterations', description: 'At most.' },
    measure: { enum: ['vtk', 'length'], type: 'string', title: 'Measure' },
    schedule: { type: 'array', items: { $ref: '#/$defs/Stage' }, maxItems: 3, title: 'Schedule' },
    window: { type: 'array', prefixItems: [{ type: 'number' }, { type: 'number' }], title: 'Window' },
    annealing: { anyOf: [{ $ref: '#/$defs/Annealing' }, { type: 'null' }], title: 'Annealing' },
    exact: { type: 'boolean' },
    limit: { anyOf: [{ type: 'number', minimum: 2 }, { type: 'null' }], title: 'Limit' },
  },
};

const fields = fieldsOf(SCHEMA);
const field = (name: string): FormField => {
  const found = fields.find((one) => one.name === name);
  if (!found) throw new Error(name);
  return found;
};

describe('fieldsOf', () => {
  it('knows every kind of field, in order', () => {
    expect(fields.map((one) => one.kind)).toEqual([
      'number',
      'choice',
      'rows',
      'tuple',
      'group',
      'switch',
      'number',
    ]);
    expect(field('iterations')).toMatchObject({
      title: 'Iterations',
      description: 'At most.',
      whole: true,
      most: 100,
    });
    expect(field('exact').title).toBe('exact');
  });

  it('follows references, and keeps the title of the place and not of the type', () => {
    expect(field('annealing')).toMatchObject({ title: 'Annealing', optional: true });
    expect(field('schedule')).toMatchObject({ most: 3, row: [{ name: 'repeat', least: 1 }] });
  });
});

describe('wrong', () => {
  it('names the bound that is broken', () => {
    const iterations = field('iterations') as NumberField;
    expect(wrong(iterations, 5)).toBe('');
    expect(wrong(iterations, 0.5)).toBe('a whole number is needed');
    expect(wrong(iterations, 101)).toBe('at most 100');
    expect(wrong(iterations, NaN)).toBe('a number is needed');
    const annealing = field('annealing');
    const factor = (annealing.kind === 'group' ? annealing.fields[0] : undefined) as NumberField;
    expect(wrong(factor, 1)).toBe('less than 1');
    expect(wrong(factor, 0)).toBe('more than 0');
  });
});

it('sends only what differs from the preset', () => {
  const preset = { step: 0.1, window: [0, 100], annealing: null };
  expect(changes({ ...preset, window: [5, 100] }, preset)).toEqual({ window: [5, 100] });
  expect(changes({ ...preset }, preset)).toEqual({});
});

it('carries over to another preset what was changed and what that one has', () => {
  const robust = { method: 'curvature', iterations: 5000, step: 0.05, measure: 'vtk' };
  const conformal = { method: 'conformal', iterations: 500, measure: 'vtk', time_step: 0.01 };
  const typed = { ...robust, iterations: 70, step: 0.02 };
  expect(carried(typed, robust, conformal)).toEqual({ ...conformal, iterations: 70 });
  expect(carried({}, {}, robust)).toEqual(robust);
});
