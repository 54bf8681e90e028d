import {
  BufferAttribute,
  BufferGeometry,
  Group,
  Mesh,
  MeshBasicMaterial,
  Points,
  PointsMaterial,
  type Material,
  type Object3D,
} from 'three';
import { LineMaterial } from 'three/addons/lines/LineMaterial.js';
import { LineSegments2 } from 'three/addons/lines/LineSegments2.js';
import { LineSegmentsGeometry } from 'three/addons/lines/LineSegmentsGeometry.js';
import type { Location } from '../api/types';
import type { Faults } from '../mesh/faults';

const RED = 0xe5252a;
const WIDTH_PX = 3;

/** What is wrong with a mesh, drawn on it in red: through the surface faintly, before it fully. */
export class FaultLines {
  readonly group = new Group();

  /**
   * @param faults found by this page; null where it could not read the file.
   * @param places named by the service.
   * @param positions of the drawn vertices, for the triangles of stray parts.
   */
  constructor(faults: Faults | null, places: readonly Location[], positions: Float32Array | null) {
    const edges = places.filter((place) => place.kind === 'edge').flatMap((place) => place.positions.flat());
    const points = places
      .filter((place) => place.kind === 'vertex')
      .flatMap((place) => place.positions.flat());
    const found = faults === null ? [] : [faults.open, faults.crowded, faults.turned];
    const drawn = found.some((some) => some.length > 0);
    for (const some of drawn ? found : [Float32Array.from(edges)]) if (some.length > 0) this.lines(some);
    if (points.length > 0) this.points(Float32Array.from(points));
    if (faults !== null && positions !== null && faults.strays.length > 0)
      this.part(faults.strays, positions);
  }

  dispose(): void {
    for (const child of this.group.children as (Object3D & {
      geometry: BufferGeometry;
      material: Material;
    })[]) {
      child.geometry.dispose();
      child.material.dispose();
    }
  }

  private lines(ends: Float32Array): void {
    const geometry = new LineSegmentsGeometry().setPositions(ends);
    const look = { color: RED, linewidth: WIDTH_PX };
    this.group.add(
      new LineSegments2(
        geometry,
        new LineMaterial({ ...look, transparent: true, opacity: 0.3, depthTest: false }),
      ),
      new LineSegments2(geometry, new LineMaterial(look)),
    );
    if (ends.length <= 6 * 2000) this.points(ends, 4); // a short edge is seen by its ends
  }

  private points(at: Float32Array, size = 11): void {
    const geometry = new BufferGeometry().setAttribute('position', new BufferAttribute(at, 3));
    const look = { color: RED, sizeAttenuation: false, depthTest: false, transparent: true };
    this.group.add(
      new Points(geometry, new PointsMaterial({ ...look, size, opacity: size > 5 ? 0.9 : 0.45 })),
    );
  }

  private part(triangles: Uint32Array, positions: Float32Array): void {
    const geometry = new BufferGeometry().setAttribute('position', new BufferAttribute(positions, 3));
    geometry.setIndex(new BufferAttribute(triangles, 1));
    this.group.add(
      new Mesh(
        geometry,
        new MeshBasicMaterial({ color: RED, transparent: true, opacity: 0.45, depthWrite: false }),
      ),
    );
  }
}
