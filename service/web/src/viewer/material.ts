import {
  DataTexture,
  DoubleSide,
  LinearFilter,
  RGBAFormat,
  ShaderMaterial,
  Vector3,
  type Texture,
} from 'three';
import { ramp } from '../core/colormap';
import { matcap } from './matcap';

/** Two states of a surface, mixed; lit by a matcap; coloured by a quantity at the vertices. */

const VERTEX = /* glsl */ `
attribute vec4 shade;
attribute vec3 laterPosition;
attribute vec4 laterShade;
attribute float value;
attribute float laterValue;
uniform float blend;
uniform float nearer;
varying vec3 vNormal;
varying vec3 vView;
varying float vValue;
void main() {
  vec4 place = modelViewMatrix * vec4(mix(position, laterPosition, blend), 1.0);
  vNormal = normalMatrix * mix(shade.xyz, laterShade.xyz, blend);
  vView = -place.xyz;
  vValue = mix(value, laterValue, blend);
  gl_Position = projectionMatrix * place;
  gl_Position.z -= nearer * gl_Position.w;
}`;

const FRAGMENT = /* glsl */ `
uniform sampler2D ball;
uniform sampler2D scale;
uniform vec2 range;
uniform float coloured;
uniform float flatly;
uniform vec3 tint;
varying vec3 vNormal;
varying vec3 vView;
varying float vValue;
void main() {
  vec3 view = normalize(vView);
  vec3 facet = normalize(cross(dFdx(vView), dFdy(vView)));
  vec3 normal = normalize(vNormal);
  if (flatly > 0.5) normal = dot(facet, view) < 0.0 ? -facet : facet;
  else if (!gl_FrontFacing) normal = -normal;
  vec3 right = normalize(vec3(view.z, 0.0, -view.x));
  vec3 up = cross(view, right);
  vec2 at = vec2(dot(right, normal), dot(up, normal)) * 0.495 + 0.5;
  vec3 clay = texture2D(ball, at).rgb * tint;
  vec3 hue = texture2D(scale, vec2((vValue - range.x) / max(range.y - range.x, 1e-30), 0.5)).rgb;
  float light = dot(clay, vec3(0.2126, 0.7152, 0.0722));
  vec3 colour = mix(clay, hue * (0.35 + 0.78 * light), coloured);
  // the inside; but not its last sliver along an outline, which would draw a dotted line there
  float seen = smoothstep(0.1, 0.35, abs(dot(facet, view)));
  if (!gl_FrontFacing) colour *= mix(vec3(1.0), vec3(0.62, 0.5, 0.5), seen);
  gl_FragColor = vec4(colour, 1.0);
}`;

function texture(data: Uint8Array<ArrayBuffer>, width: number, height: number): DataTexture {
  const made = new DataTexture(data, width, height, RGBAFormat);
  made.magFilter = LinearFilter;
  made.minFilter = LinearFilter;
  made.needsUpdate = true;
  return made;
}

/** The surface's material, with names for what changes. */
export class SurfaceMaterial extends ShaderMaterial {
  private readonly scales: readonly [Texture, Texture];

  constructor() {
    const { data, size } = matcap();
    const scales = [texture(ramp(false), 256, 1), texture(ramp(true), 256, 1)] as const;
    super({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      side: DoubleSide,
      uniforms: {
        blend: { value: 0 },
        nearer: { value: 0 },
        ball: { value: texture(data, size, size) },
        scale: { value: scales[0] },
        range: { value: [0, 1] },
        coloured: { value: 0 },
        flatly: { value: 0 },
        tint: { value: new Vector3(1, 1, 1) },
      },
    });
    this.scales = scales;
  }

  set blend(share: number) {
    this.put('blend', share);
  }

  set facets(flat: boolean) {
    this.put('flatly', flat ? 1 : 0);
  }

  /** Colour by the values between two numbers, or by the clay alone. */
  colours(range: { low: number; high: number; diverging: boolean } | null): void {
    this.put('coloured', range ? 1 : 0);
    if (!range) return;
    this.put('range', [range.low, range.high]);
    this.put('scale', this.scales[range.diverging ? 1 : 0]);
  }

  override dispose(): void {
    super.dispose();
    for (const one of [...this.scales, this.uniforms.ball?.value as Texture]) one.dispose();
  }

  private put(name: string, value: unknown): void {
    const uniform = this.uniforms[name];
    if (uniform) uniform.value = value;
  }
}

const LINE = /* glsl */ `
uniform vec3 ink;
uniform float opacity;
uniform float dense;
varying vec3 vNormal;
varying vec3 vView;
void main() {
  // towards an outline lines crowd: where they are dense they would draw it broad and black
  float facing = abs(dot(normalize(vNormal), normalize(vView)));
  gl_FragColor = vec4(ink, opacity * mix(1.0, facing, dense));
}`;

/** The lines of the triangles, moving with the surface: it shares the uniform `blend`. */
export function wireMaterial(surface: SurfaceMaterial): ShaderMaterial {
  return new ShaderMaterial({
    vertexShader: VERTEX,
    fragmentShader: LINE,
    wireframe: true,
    transparent: true,
    depthWrite: false,
    uniforms: {
      ...surface.uniforms,
      nearer: { value: 2e-4 }, // or the lines would be half below the surface they lie in
      ink: { value: new Vector3(0.05, 0.07, 0.09) },
      opacity: { value: 0.34 },
      dense: { value: 0 },
    },
  });
}
