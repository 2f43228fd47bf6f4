/** Round badges in space, always facing the eye: finger numbers, and crosses at missed keys. */

import { DynamicDrawUsage, InstancedBufferAttribute } from "three";
import type { Texture } from "three";

import { SIGNS } from "./digits";
import type { Look, Paint } from "./look";
import { PaintedQuads } from "./painted_quads";

const MOST = 32;

const VARYINGS = /* glsl */ `
  varying vec2 corner;
  varying vec3 tone;
  varying float sign;
`;

const VERTEX = /* glsl */ `
  attribute vec4 place;
  attribute float paint;
  uniform float radius;
  void main() {
    vec4 middle = modelViewMatrix * vec4(place.xyz, 1.0);
    corner = position.xy;
    tone = paints[int(paint + 0.5)];
    sign = place.w;
    // Halfway between a size in the world and one on the screen, to be read from near and far.
    float size = radius * (0.4 + 0.6 * -middle.z);
    middle.xyz += vec3(position.xy * size, 0.0);
    gl_Position = projectionMatrix * middle;
    // A badge is hidden by what is in front of its fingertip, not by the fingertip.
    vec4 nearer = projectionMatrix * vec4(middle.xy, middle.z + 0.06, 1.0);
    gl_Position.z = nearer.z / nearer.w * gl_Position.w;
  }
`;

const FRAGMENT = /* glsl */ `
  uniform sampler2D signs;
  void main() {
    float r = length(corner);
    float edge = fwidth(r);
    float disc = 1.0 - smoothstep(1.0 - edge, 1.0, r);
    vec2 inside = corner * 0.62 + 0.5;
    float ink = texture2D(signs, vec2((sign + inside.x) / ${SIGNS}.0, inside.y)).a;
    gl_FragColor = vec4(mix(tone, vec3(1.0), ink), disc);
    #include <colorspace_fragment>
  }
`;

export class Badges {
  private readonly place = new InstancedBufferAttribute(new Float32Array(4 * MOST), 4);
  private readonly paint = new InstancedBufferAttribute(new Float32Array(MOST), 1);
  private readonly quads: PaintedQuads;

  constructor(signs: Texture) {
    this.quads = new PaintedQuads(2, VARYINGS, VERTEX, FRAGMENT, {
      signs: { value: signs },
      radius: { value: 0.0078 },
    });
    this.place.setUsage(DynamicDrawUsage);
    this.paint.setUsage(DynamicDrawUsage);
    this.quads.setQuads({ place: this.place, paint: this.paint }, 0);
  }

  get mesh(): PaintedQuads["mesh"] {
    return this.quads.mesh;
  }

  setLook(look: Look): void {
    this.quads.colors.setLook(look);
  }

  /** Begin a new set of badges. */
  clear(): void {
    this.mesh.geometry.instanceCount = 0;
  }

  add(x: number, y: number, z: number, sign: number, paint: Paint): void {
    const i = this.mesh.geometry.instanceCount;
    if (i >= MOST) return;
    this.place.setXYZW(i, x, y, z, sign);
    this.paint.setX(i, paint);
    this.mesh.geometry.instanceCount = i + 1;
    this.place.needsUpdate = this.paint.needsUpdate = true;
  }
}
