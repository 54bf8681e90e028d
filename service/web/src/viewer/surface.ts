import { BufferAttribute, BufferGeometry, Mesh, type ShaderMaterial } from 'three';
import { meanEdge, STRONGEST } from '../core/lines';
import type { Frame } from '../mesh/types';
import { SurfaceMaterial, wireMaterial } from './material';

/** A state with the quantity it is coloured by, if there is one. */
export interface Coloured {
  readonly frame: Frame;
  readonly values: Float32Array<ArrayBuffer> | null;
}

/** Room on the graphics card for one state: its size never changes, whatever is shown. */
class Slot {
  private frame: Frame | null = null;
  private values: Float32Array | null = null;
  private readonly position: BufferAttribute;
  private readonly shade: BufferAttribute;
  private readonly value: BufferAttribute;

  constructor(geometry: BufferGeometry, names: readonly [string, string, string], vertices: number) {
    this.position = new BufferAttribute(new Float32Array(3 * vertices), 3);
    this.shade = new BufferAttribute(new Int8Array(4 * vertices), 4, true);
    this.value = new BufferAttribute(new Float32Array(vertices), 1);
    geometry.setAttribute(names[0], this.position);
    geometry.setAttribute(names[1], this.shade);
    geometry.setAttribute(names[2], this.value);
  }

  put({ frame, values }: Coloured): void {
    if (frame !== this.frame) {
      this.frame = frame;
      exchange(this.position, frame.positions);
      exchange(this.shade, frame.normals);
    }
    if (values !== null && values !== this.values) {
      this.values = values;
      exchange(this.value, values);
    }
  }
}

/** Send other numbers into the same buffer; they are not copied here first. */
function exchange(
  attribute: BufferAttribute,
  array: Float32Array<ArrayBuffer> | Int8Array<ArrayBuffer>,
): void {
  if (array.length !== attribute.array.length) throw new RangeError('a state of another mesh');
  attribute.array = array;
  attribute.needsUpdate = true;
}

/** How the surfaces on one canvas are drawn. */
export class Paints {
  readonly clay = new SurfaceMaterial();
  readonly lines: ShaderMaterial = wireMaterial(this.clay);

  /** How strongly lines are drawn. */
  set strength(opacity: number) {
    const { uniforms } = this.lines;
    if (uniforms.opacity) uniforms.opacity.value = opacity;
    if (uniforms.dense) uniforms.dense.value = 1 - opacity / STRONGEST;
  }

  dispose(): void {
    this.clay.dispose();
    this.lines.dispose();
  }
}

/** The triangles on the graphics card: two states at a time, and a share between them. */
export class SurfaceMesh {
  private readonly geometry = new BufferGeometry();
  readonly mesh: Mesh;
  readonly wire: Mesh;
  private measured: { readonly frame: Frame; readonly edge: number } | null = null;
  private readonly before: Slot;
  private readonly after: Slot;

  /** @param paints of the canvas, which outlive the surface: a new one would have to be compiled. */
  constructor(
    private readonly paints: Paints,
    private readonly index: Uint32Array,
    vertices: number,
  ) {
    this.mesh = new Mesh(this.geometry, paints.clay);
    this.wire = new Mesh(this.geometry, paints.lines);
    this.geometry.setIndex(new BufferAttribute(index, 1));
    this.before = new Slot(this.geometry, ['position', 'shade', 'value'], vertices);
    this.after = new Slot(this.geometry, ['laterPosition', 'laterShade', 'laterValue'], vertices);
    this.mesh.frustumCulled = false; // its bounds are those of two states
    this.wire.frustumCulled = false;
    this.wire.visible = false;
  }

  /** Mean length of an edge of the state that is shown, in units of the file. */
  get edge(): number {
    return this.measured?.edge ?? 0;
  }

  /** Show the mix of two states. */
  show(before: Coloured, after: Coloured, blend: number): void {
    if (this.measured?.frame !== before.frame)
      this.measured = { frame: before.frame, edge: meanEdge(this.index, before.frame.positions) };
    this.before.put(before);
    if (blend > 0) this.after.put(after);
    this.paints.clay.blend = blend;
  }

  dispose(): void {
    this.geometry.dispose();
  }
}
