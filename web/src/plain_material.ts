/**
 * A dull surface whose light is found at vertices, not at each pixel: where the processor draws, that
 * takes a fraction of the time.
 */

import { ShaderMaterial, Vector3 } from "three";

const VERTEX = /* glsl */ `
  uniform vec3 sun;
  uniform float sunlight;
  uniform float skylight;
  varying vec3 tone;
  void main() {
    vec3 facing = normalize(mat3(modelMatrix) * normal);
    float light = sunlight * max(dot(facing, sun), 0.0) + skylight * (0.64 + 0.36 * facing.z);
    // To the screen's scale here, which is a power, too slow for each pixel.
    tone = pow(min(color * light, 1.0), vec3(1.0 / 2.2));
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }
`;

const FRAGMENT = /* glsl */ `
  varying vec3 tone;
  void main() {
    gl_FragColor = vec4(tone, 1.0);
  }
`;

/** Make one; it lights like three's own materials under a sun and a sky. */
export function plainMaterial() {
  return new ShaderMaterial({
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    vertexColors: true,
    uniforms: {
      sun: { value: new Vector3(0, 0, 1) },
      sunlight: { value: 0.5 },
      skylight: { value: 0.4 },
    },
  });
}

/**
 * Light it.
 *
 * @param sun direction towards the sun.
 * @param sunlight,skylight intensities as of three's lights.
 */
export function lightPlain(
  material: ShaderMaterial,
  sun: Vector3,
  sunlight: number,
  skylight: number,
): void {
  const { uniforms } = material;
  (uniforms["sun"]!.value as Vector3).copy(sun).normalize();
  uniforms["sunlight"]!.value = sunlight / Math.PI;
  uniforms["skylight"]!.value = skylight / Math.PI;
}
