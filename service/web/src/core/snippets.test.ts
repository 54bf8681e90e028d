import { execFileSync } from 'node:child_process';
import { describe, expect, it } from 'vitest';
import { curl, python } from './snippets';

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
});
