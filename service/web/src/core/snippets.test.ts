import { execFileSync } from 'node:child_process';
import { describe, expect, it } from 'vitest';
import { curl, python, requestOf } from './snippets';

const request = {
  mesh_id: 'mesh_1',
  preset: 'robust',
  parameters: { window: [1, 99], annealing: null, step: 0.02 },
  name: "it's a cat",
};

describe('snippets', () => {
  it('survive the shell whatever is in them', () => {
    const line = curl('http://localhost:8000', request)
      .replace(/^curl --json /, 'printf %s ')
      .replace(/ http:\S+$/, '');
    const shown = execFileSync('sh', ['-c', line], { encoding: 'utf8' });
    expect(JSON.parse(shown)).toEqual(request);
  });

  it('are Python, not JSON', () => {
    const program = python('http://localhost:8000', request);
    expect(program).toContain('"annealing": None');
    expect(program).toContain('"name": "it\'s a cat"');
    expect(program).not.toContain('null');
  });

  it('name of a job what differs from its preset', () => {
    const job = {
      mesh_id: 'mesh_1',
      preset: 'robust',
      parameters: { iterations: 70, step: 0.02, window: [1, 99], annealing: { factor: 0.5 } },
      snapshots: { requested: [0, 1, 2, 5, 70] },
      name: 'cat',
    };
    const defaults = { iterations: 5000, step: 0.01, window: [1, 99], annealing: { factor: 0.5 } };
    expect(requestOf(job, defaults)).toEqual({
      mesh_id: 'mesh_1',
      preset: 'robust',
      parameters: { step: 0.02 },
      iterations: 70,
      snapshots: '1,2,5',
      name: 'cat',
    });
    expect(requestOf({ ...job, parameters: defaults }, defaults)).not.toHaveProperty('parameters');
    expect(requestOf(job, defaults, ['up:z']).tags).toEqual(['up:z']);
    expect(requestOf(job, null).parameters).toHaveProperty('window');
  });
});
