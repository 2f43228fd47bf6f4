/** Flat pieces in the colours of hands, drawn at once, each a quad that a shader places. */

import { InstancedBufferGeometry, Mesh, PlaneGeometry, ShaderMaterial } from "three";
import type { IUniform, InstancedBufferAttribute } from "three";

import { PaintColors } from "./paint_colors";

export class PaintedQuads {
  readonly mesh: Mesh<InstancedBufferGeometry, ShaderMaterial>;
  readonly colors = new PaintColors();

  /**
   * @param order in which it is drawn over what is behind.
   * @param varyings what the shaders share, as declarations.
   * @param vertex,fragment the shaders; they find the colours as `paints`.
   * @param uniforms others of theirs.
   */
  constructor(
    order: number,
    varyings: string,
    vertex: string,
    fragment: string,
    uniforms: Record<string, IUniform>,
  ) {
    const shared = `uniform vec3 paints[4];\n${varyings}`;
    this.mesh = new Mesh(
      new InstancedBufferGeometry(),
      new ShaderMaterial({
        vertexShader: shared + vertex,
        fragmentShader: shared + fragment,
        uniforms: { ...uniforms, paints: { value: this.colors.list } },
        transparent: true,
        depthWrite: false,
        side: 2,
      }),
    );
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = order;
  }

  /** Draw so many quads, whose corners are at -1 and 1, with attributes of their own. */
  setQuads(attributes: Record<string, InstancedBufferAttribute>, count: number): void {
    const quad = new PlaneGeometry(2, 2);
    const shape = new InstancedBufferGeometry();
    shape.index = quad.index;
    shape.setAttribute("position", quad.getAttribute("position"));
    for (const [name, attribute] of Object.entries(attributes)) shape.setAttribute(name, attribute);
    shape.instanceCount = count;
    this.mesh.geometry.dispose();
    this.mesh.geometry = shape;
  }
}
