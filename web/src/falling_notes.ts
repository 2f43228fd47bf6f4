/** Notes as bars that fall onto their keys, in an upright plane at the keyboard's far edge. */

import { InstancedBufferAttribute } from "three";
import type { Texture } from "three";

import { SIGNS } from "./digits";
import type { Notes, SceneContent } from "./format";
import type { Look } from "./look";
import { handPaint, isMissed } from "./look";
import { PaintedQuads } from "./painted_quads";

/** [m] Height of the plane. */
export const HEIGHT = 0.44;
/** [s] How long a note is seen before it sounds. */
const AHEAD = 3;
/** [m] How far the plane stands behind the keys. */
const BEHIND = 0.006;
/** [m] How far its lower edge is above the keys, so that nothing behind them hides it. */
const ABOVE = 0.008;

const VARYINGS = /* glsl */ `
  varying vec2 inside;
  varying vec2 size;
  varying vec3 tone;
  varying float black;
  varying float missed;
  varying float finger;
  varying float up;
  varying float sounding;
`;

const VERTEX = /* glsl */ `
  attribute vec4 span;
  attribute vec3 mark;
  uniform float time;
  uniform vec3 origin;
  void main() {
    float low = max((span.x - time) * ${(HEIGHT / AHEAD).toFixed(5)}, 0.0);
    float high = min((span.y - time) * ${(HEIGHT / AHEAD).toFixed(5)}, ${HEIGHT.toFixed(3)});
    // What is not between the plane's edges shrinks to nothing.
    high = max(high, low);
    size = vec2(2.0 * span.w, high - low);
    inside = (0.5 * position.xy + 0.5) * size;
    up = low + inside.y;
    black = step(4.0, mark.x);
    tone = paints[int(mod(mark.x, 4.0) + 0.5)];
    finger = mark.y;
    missed = mark.z;
    sounding = span.x <= time ? 1.0 : 0.0;
    vec3 at = origin + vec3(0.0, span.z + position.x * span.w, up);
    gl_Position = projectionMatrix * modelViewMatrix * vec4(at, 1.0);
  }
`;

const FRAGMENT = /* glsl */ `
  uniform sampler2D signs;
  uniform float numbers;
  void main() {
    float round = min(0.0035, 0.5 * min(size.x, size.y));
    vec2 q = abs(inside - 0.5 * size) - 0.5 * size + round;
    float out_ = length(max(q, 0.0)) + min(max(q.x, q.y), 0.0) - round;
    float soft = max(fwidth(out_), 1e-5);
    float alpha = 1.0 - smoothstep(-soft, 0.0, out_);
    vec3 color = mix(tone, tone * 0.68, black);
    color = mix(color, vec3(1.0), 0.12 * sounding);
    float rim = smoothstep(-0.0016 - soft, -0.0016, out_);
    if (missed > 0.5) {
      // Hollow, as in the roll: it was asked for and did not sound.
      color = mix(color, paints[3], rim);
      alpha *= mix(0.25, 1.0, rim);
    } else {
      color = mix(color, color * 0.8, rim);
    }
    if (numbers > 0.5 && finger >= 0.0) {
      float square = size.x;
      vec2 at = inside / square;
      if (at.y < 1.0 && size.y > 0.6 * square) {
        float ink = texture2D(signs, vec2((finger + at.x) / ${SIGNS}.0, at.y)).a;
        color = mix(color, vec3(1.0), ink);
        alpha = max(alpha, ink * step(out_, 0.0));
      }
    }
    alpha *= 1.0 - smoothstep(0.72, 1.0, up / ${HEIGHT.toFixed(3)});
    gl_FragColor = vec4(color, alpha * 0.95);
    #include <colorspace_fragment>
  }
`;

export class FallingNotes {
  private readonly uniforms = { time: { value: 0 }, numbers: { value: 1 } };
  private readonly quads: PaintedQuads;

  constructor(
    private readonly scene: SceneContent,
    signs: Texture,
  ) {
    let back = Infinity;
    let top = -Infinity;
    for (const { top: place, half } of scene.keys) {
      back = Math.min(back, place[0] - half[0]);
      top = Math.max(top, place[2]);
    }
    this.quads = new PaintedQuads(1, VARYINGS, VERTEX, FRAGMENT, {
      ...this.uniforms,
      origin: { value: [back - BEHIND, 0, top + ABOVE] },
      signs: { value: signs },
    });
  }

  get mesh(): PaintedQuads["mesh"] {
    return this.quads.mesh;
  }

  setLook(look: Look): void {
    this.quads.colors.setLook(look);
  }

  setNotes(notes: Notes): void {
    const count = notes.key.length;
    const span = new Float32Array(4 * count);
    const mark = new Float32Array(3 * count);
    for (let i = 0; i < count; i++) {
      const key = this.scene.keys[notes.key[i]!]!;
      span[4 * i] = notes.onset[i]!;
      span[4 * i + 1] = notes.offset[i]!;
      span[4 * i + 2] = key.top[1];
      span[4 * i + 3] = key.half[1] * (key.black ? 1 : 0.86);
      mark[3 * i] = handPaint(notes.hand[i]!) + (key.black ? 4 : 0);
      mark[3 * i + 1] = notes.finger[i]!;
      mark[3 * i + 2] = isMissed(notes, i) ? 1 : 0;
    }
    this.quads.setQuads(
      {
        span: new InstancedBufferAttribute(span, 4),
        mark: new InstancedBufferAttribute(mark, 3),
      },
      count,
    );
  }

  update(time: number, numbers: boolean): void {
    this.uniforms.time.value = time;
    this.uniforms.numbers.value = numbers ? 1 : 0;
  }
}
