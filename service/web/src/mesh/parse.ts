import { BufferAttribute, type BufferGeometry, type Mesh, type Object3D } from 'three';
import type { Surface } from './types';

/** A preview of a file before the service has read it: its triangles, as far as this page can read them. */

/** Thrown for formats and files that only the service can read. */
export class NoPreviewError extends Error {
  override readonly name = 'NoPreviewError';
}

/** Read a file by the ending of its name. */
export async function parse(data: ArrayBuffer, name: string): Promise<Surface> {
  const format = name.toLowerCase().split('.').at(-1) ?? '';
  switch (format) {
    case 'obj':
      return obj(new TextDecoder().decode(data));
    case 'off':
      return off(new TextDecoder().decode(data));
    case 'stl': {
      const { STLLoader } = await import('three/addons/loaders/STLLoader.js');
      return surfaceOf(new STLLoader().parse(data));
    }
    case 'ply': {
      const { PLYLoader } = await import('three/addons/loaders/PLYLoader.js');
      const geometry = new PLYLoader().parse(data);
      if (!geometry.getIndex()) throw new NoPreviewError('points, or faces of another kind');
      return surfaceOf(geometry);
    }
    case 'glb': {
      const { GLTFLoader } = await import('three/addons/loaders/GLTFLoader.js');
      const { scene } = await new GLTFLoader().parseAsync(data, '');
      return firstMesh(scene);
    }
    case '3mf': {
      const { threemf } = await import('./threemf');
      const bodies = threemf(data);
      if (bodies === null) throw new NoPreviewError('several model files');
      return checked(bodies.positions, bodies.index);
    }
    default:
      throw new NoPreviewError(`no preview of ${format}`);
  }
}

/** Read vertices and faces of Wavefront OBJ; polygons are cut into fans, everything else is left out. */
export function obj(text: string): Surface {
  const positions: number[] = [];
  const index: number[] = [];
  for (const line of lines(text)) {
    if (line.startsWith('v ') || line.startsWith('v\t')) {
      const [, x, y, z] = line.split(/\s+/);
      positions.push(Number(x), Number(y), Number(z));
    } else if (line.startsWith('f ') || line.startsWith('f\t')) {
      const corners = line
        .trim()
        .split(/\s+/)
        .slice(1)
        .map((corner) => parseInt(corner, 10))
        .map((n) => (n < 0 ? positions.length / 3 + n : n - 1));
      fan(corners, index);
    }
  }
  return checked(positions, index);
}

/** Read an OFF file. */
export function off(text: string): Surface {
  const words = [...lines(text)]
    .flatMap((line) => line.split('#')[0]?.trim().split(/\s+/) ?? [])
    .filter(Boolean);
  let at = words[0]?.endsWith('OFF') ? 1 : 0;
  const next = (): number => Number(words[at++]);
  const [vertices, faces] = [next(), next()];
  at += 1; // the number of edges, which nobody fills in
  const positions = Array.from({ length: 3 * vertices }, next);
  const index: number[] = [];
  for (let f = 0; f < faces; f++) fan(Array.from({ length: next() }, next), index);
  return checked(positions, index);
}

function* lines(text: string): Generator<string> {
  let start = 0;
  while (start < text.length) {
    let end = text.indexOf('\n', start);
    if (end < 0) end = text.length;
    yield text.slice(start, end);
    start = end + 1;
  }
}

function fan(corners: readonly number[], index: number[]): void {
  for (let i = 2; i < corners.length; i++)
    index.push(corners[0] ?? -1, corners[i - 1] ?? -1, corners[i] ?? -1);
}

/** Refuse what cannot be drawn; lists of a million entries are gone through without a function for each. */
function checked(positions: ArrayLike<number>, index: ArrayLike<number>): Surface {
  const vertices = positions.length / 3;
  let sound = index.length > 0;
  for (let i = 0; i < index.length && sound; i++) {
    const v = index[i] ?? -1;
    sound = v >= 0 && v < vertices && v % 1 === 0;
  }
  for (let i = 0; i < positions.length && sound; i++) sound = Number.isFinite(positions[i]);
  if (!sound) throw new NoPreviewError('numbers or indices that cannot be');
  return { positions: Float32Array.from(positions), index: Uint32Array.from(index) };
}

function surfaceOf(geometry: BufferGeometry): Surface {
  const position = geometry.getAttribute('position');
  const plain = position instanceof BufferAttribute && !position.normalized && position.itemSize === 3;
  const positions = plain
    ? Float32Array.from(position.array)
    : Float32Array.from({ length: 3 * position.count }, (_, i) =>
        position.getComponent(Math.floor(i / 3), i % 3),
      );
  const own = geometry.getIndex();
  const index = own ? Uint32Array.from(own.array) : Uint32Array.from({ length: position.count }, (_, i) => i);
  return checked(positions, index);
}

function firstMesh(scene: Object3D): Surface {
  let found: Mesh | undefined;
  scene.updateMatrixWorld(true);
  scene.traverse((object) => {
    if ('isMesh' in object) found ??= object as Mesh;
  });
  if (found === undefined) throw new NoPreviewError('no triangles');
  return surfaceOf(found.geometry.applyMatrix4(found.matrixWorld));
}
