import { strToU8, zipSync } from 'three/addons/libs/fflate.module.js';
import { describe, expect, it } from 'vitest';
import { decimate, pick } from './decimate';
import { faultsOf } from './faults';
import { vertexNormals } from './normals';
import { outward } from './outward';
import { NoPreviewError, obj, off, parse } from './parse';
import { boundsOf } from './types';
import { weld } from './weld';

const CUBE = `# a box of quads
v -1 -1 -1
v 1 -1 -1
v 1 1 -1
v -1 1 -1
v -1 -1 1
v 1 -1 1
v 1 1 1
v -1 1 1
f 4 3 2 1
f 5/1/1 6/2/1 7/3/1 8/4/1
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f -8 -4 -1 -5
`;
const withoutLid = CUBE.replace(/f 5.*\n/, '');

/** A torus of m × n quads, each cut in two. */
function torus(
  m: number,
  n: number,
): { positions: Float32Array<ArrayBuffer>; index: Uint32Array<ArrayBuffer> } {
  const positions: number[] = [];
  const index: number[] = [];
  for (let i = 0; i < m; i++)
    for (let j = 0; j < n; j++) {
      const [u, v] = [(2 * Math.PI * i) / m, (2 * Math.PI * j) / n];
      positions.push((3 + Math.cos(v)) * Math.cos(u), (3 + Math.cos(v)) * Math.sin(u), Math.sin(v));
      const at = (a: number, b: number): number => (a % m) * n + (b % n);
      index.push(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1));
    }
  return { positions: Float32Array.from(positions), index: Uint32Array.from(index) };
}

/** Count the triangles of the torus that look into its tube, by more than an edge-on one would. */
function inward(positions: Float32Array, index: Uint32Array): number {
  let count = 0;
  for (let t = 0; t < index.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map((corner) => {
      const v = index[t + corner] ?? 0;
      return positions.subarray(3 * v, 3 * v + 3);
    }) as [Float32Array, Float32Array, Float32Array];
    const at = (p: Float32Array, axis: number): number => p[axis] ?? 0;
    const [u, v] = [b, c].map((p) => [0, 1, 2].map((axis) => at(p, axis) - at(a, axis))) as [
      number[],
      number[],
    ];
    const normal = [0, 1, 2].map((i) => {
      const [j, k] = [(i + 1) % 3, (i + 2) % 3];
      return (u[j] ?? 0) * (v[k] ?? 0) - (u[k] ?? 0) * (v[j] ?? 0);
    });
    const ring = 3 / Math.hypot(at(a, 0), at(a, 1)); // the tube's middle beside this corner
    const out = [at(a, 0) * (1 - ring), at(a, 1) * (1 - ring), at(a, 2)];
    const cosine =
      normal.reduce((sum, n, axis) => sum + n * (out[axis] ?? 0), 0) /
      (Math.hypot(...normal) * Math.hypot(...out));
    if (cosine < -0.2) count += 1;
  }
  return count;
}

describe('reading', () => {
  it('takes polygons, slashes and negative indices of OBJ', () => {
    const cube = obj(CUBE);
    expect(cube.positions.length).toBe(24);
    expect(cube.index.length).toBe(36);
    expect(faultsOf(cube).open.length).toBe(0);
  });

  it('takes OFF with comments', () => {
    const text = 'OFF # four\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n';
    expect(off(text).index.length).toBe(12);
  });

  it('takes the bodies of 3MF where they are placed', async () => {
    const body = `<object id="1"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
      <vertex y='1' x='0' z='0'/><vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/>
      <triangle v1="0" v2="1" v3="3"/><triangle v1="1" v2="2" v3="3"/><triangle v1="2" v2="0" v3="3"/></triangles></mesh>
      </object>`;
    const item = '<item objectid="1" transform="0 2 0 -2 0 0 0 0 2 10 20 30"/>';
    const packed = (model: string): ArrayBuffer =>
      zipSync({ '3D/3dmodel.model': strToU8(model) }).slice().buffer;
    const read = await parse(packed(`<model>${body}<build>${item}</build></model>`), 'a.3MF');
    expect([...read.positions]).toEqual([10, 20, 30, 10, 22, 30, 8, 20, 30, 10, 20, 32]);
    expect([...read.index]).toEqual([0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3]);
    const twice = await parse(packed(`<model>${body}<build>${item}${item}</build></model>`), 'b.3mf');
    expect(twice.positions.length).toBe(24);
    expect([...twice.index].slice(12, 15)).toEqual([4, 6, 5]);
    const pair = `<object id="9"><components><component objectid="1" transform="1 0 0 0 1 0 0 0 1 0 0 5"/></components></object>`;
    const placed = item.replace('"1"', '"9"');
    const inner = await parse(packed(`<model>${body}${pair}<build>${placed}</build></model>`), 'c.3mf');
    expect([...inner.positions]).toEqual([10, 20, 40, 10, 22, 40, 8, 20, 40, 10, 20, 42]);
    expect(inner.index).toEqual(read.index);
    const endless = `<object id="9"><components><component objectid="9"/></components></object>`;
    await expect(parse(packed(`<model>${endless}<build>${placed}</build></model>`), 'd.3mf')).rejects.toThrow(
      NoPreviewError,
    );
  });

  it('refuses what it cannot draw', async () => {
    expect(() => obj('v 0 0 0\nf 1 2 3\n')).toThrow(NoPreviewError);
    await expect(parse(new ArrayBuffer(4), 'mesh.step')).rejects.toThrow(NoPreviewError);
    const points =
      'ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n1 0 0\n0 1 0\n';
    const data = new TextEncoder().encode(points).buffer;
    await expect(parse(data, 'points.ply')).rejects.toThrow(NoPreviewError);
  });
});

describe('faults', () => {
  it('are the four edges around a missing lid', () => {
    const { open, crowded, strays } = faultsOf(obj(withoutLid));
    expect(open.length / 6).toBe(4);
    expect([...open].filter((_, i) => i % 3 === 2)).toEqual(Array(8).fill(1));
    expect(crowded.length + strays.length).toBe(0);
  });

  it('are edges with three triangles, and smaller parts', () => {
    const wing = obj(`${CUBE}v 3 3 3\nf 7 8 9\nv 9 9 9\nv 9 9 8\nv 9 8 9\nf 10 11 12\n`);
    const { open, crowded, strays } = faultsOf(wing);
    expect(crowded.length / 6).toBe(1);
    expect(open.length / 6).toBe(5);
    expect([...strays]).toEqual([9, 10, 11]);
  });

  it('are the edges around a side that looks inward', () => {
    const { open, crowded, turned } = faultsOf(obj(CUBE.replace('f 4 3 2 1', 'f 1 2 3 4')));
    expect(turned.length / 6).toBe(4);
    expect([...turned].filter((_, i) => i % 3 === 2)).toEqual(Array(8).fill(-1));
    expect(open.length + crowded.length).toBe(0);
  });

  it('vanish where loose triangles are welded', () => {
    const { positions, index } = obj(CUBE);
    const loose = Float32Array.from([...index].flatMap((v) => [...positions.slice(3 * v, 3 * v + 3)]));
    const soup = { positions: loose, index: Uint32Array.from(index, (_, i) => i) };
    expect(faultsOf(soup).open.length).toBeGreaterThan(0);
    const welded = weld(soup);
    expect(welded.positions.length).toBe(24);
    expect(faultsOf(welded).open.length).toBe(0);
    expect(weld(welded)).toBe(welded);
  });
});

describe('a surface that is inside out', () => {
  it('is turned, and another is left alone', () => {
    const cube = obj(CUBE);
    expect(outward(cube)).toBe(cube);
    const inside = { positions: cube.positions, index: cube.index.toReversed() };
    const turned = outward(inside);
    expect(outward(turned)).toBe(turned);
    expect(faultsOf(turned).open.length).toBe(0);
  });
});

describe('drawing', () => {
  it('has unit normals that look outward', () => {
    const { positions, index } = obj(CUBE);
    const normals = vertexNormals(positions, index);
    for (let v = 0; v < 8; v++) {
      const n = [0, 1, 2].map((axis) => (normals[4 * v + axis] ?? 0) / 127);
      expect(Math.hypot(...n)).toBeCloseTo(1, 1);
      expect(n.reduce((sum, value, axis) => sum + value * (positions[3 * v + axis] ?? 0), 0)).toBeGreaterThan(
        1,
      );
    }
  });

  it('draws fewer triangles of a large mesh, over vertices of its own', () => {
    const whole = torus(200, 80);
    const { index, kept } = decimate(whole, 8000);
    expect(index.length / 3).toBeLessThanOrEqual(8000);
    expect(index.length / 3).toBeGreaterThan(2000);
    const positions = pick(whole.positions, kept, 3);
    expect(Math.max(...index)).toBeLessThan(positions.length / 3);
    expect(boundsOf(positions).radius).toBeCloseTo(boundsOf(whole.positions).radius, 0);
  });

  it('turns no triangle of it inside out', () => {
    const whole = torus(200, 80);
    const { index, kept } = decimate(whole, 8000);
    const positions = pick(whole.positions, kept, 3);
    expect(inward(whole.positions, whole.index)).toBe(0);
    expect(inward(positions, index)).toBe(0);
  });

  it('leaves a small mesh as it is', () => {
    const small = torus(20, 10);
    const { index, kept } = decimate(small);
    expect(index).toBe(small.index);
    expect(pick(small.positions, kept, 3)).toBe(small.positions);
  });

  it('knows the ball around it', () => {
    const { centre, radius } = boundsOf(obj(CUBE).positions);
    expect(centre).toEqual([0, 0, 0]);
    expect(radius).toBeCloseTo(Math.sqrt(3));
    expect(boundsOf(new Float32Array()).radius).toBe(1);
  });
});
