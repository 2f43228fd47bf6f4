/** Shapes of the scene as triangles, and many of them joined into one. */

import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  CapsuleGeometry,
  Color,
  CylinderGeometry,
  Matrix4,
  PlaneGeometry,
  Quaternion,
  SphereGeometry,
  Vector3,
} from "three";

import type { Geom, SceneContent } from "./format";

/** [cosine] Faces that meet at less than 40 degrees share a rounded edge; others keep a sharp one. */
const CREASE = Math.cos((40 / 180) * Math.PI);
const UPRIGHT = new Matrix4().makeRotationX(Math.PI / 2);

/** The shape of a geom in its own frame. */
export function shapeOf(geom: Geom, scene: SceneContent): BufferGeometry {
  const [a, b, c] = geom.size;
  switch (geom.type) {
    case "plane":
      return new PlaneGeometry(2 * a, 2 * b);
    case "box":
      return new BoxGeometry(2 * a, 2 * b, 2 * c);
    case "sphere":
      return new SphereGeometry(a, 20, 14);
    case "ellipsoid":
      return new SphereGeometry(1, 20, 14).scale(a, b, c);
    case "capsule":
      return new CapsuleGeometry(a, 2 * b, 6, 18).applyMatrix4(UPRIGHT);
    case "cylinder":
      return new CylinderGeometry(a, a, 2 * b, 24).applyMatrix4(UPRIGHT);
    case "mesh":
      return meshShape(scene.meshes[geom.mesh]!);
  }
}

/** A box whose upper edges are rounded off a little, as those of a key are. */
export function keyShape([a, b, c]: readonly number[]): BufferGeometry {
  const round = Math.min(0.0012, b! / 3);
  const vertices: number[] = [];
  // From the bottom up: two rings for the sides, one drawn in for the edge.
  for (const [inset, z] of [
    [0, -c!],
    [0, c! - round],
    [round, c!],
  ]) {
    const x = a! - inset!;
    const y = b! - inset!;
    vertices.push(-x, -y, z!, x, -y, z!, x, y, z!, -x, y, z!);
  }
  const faces: number[] = [8, 9, 10, 8, 10, 11];
  for (const ring of [0, 4]) {
    for (let i = 0; i < 4; i++) {
      const j = (i + 1) % 4;
      faces.push(ring + i, ring + j, ring + 4 + j, ring + i, ring + 4 + j, ring + 4 + i);
    }
  }
  return meshShape({ vertices, faces });
}

function meshShape(mesh: { vertices: number[]; faces: number[] }): BufferGeometry {
  const { vertices, faces } = mesh;
  const corners = faces.length;
  const position = new Float32Array(3 * corners);
  for (let corner = 0; corner < corners; corner++) {
    for (let i = 0; i < 3; i++) position[3 * corner + i] = vertices[3 * faces[corner]! + i]!;
  }
  const faceNormals = new Float32Array(corners);
  const around = new Map<string, number[]>();
  const a = new Vector3();
  const b = new Vector3();
  const c = new Vector3();
  for (let face = 0; face < corners / 3; face++) {
    a.fromArray(position, 9 * face);
    b.fromArray(position, 9 * face + 3).sub(a);
    c.fromArray(position, 9 * face + 6).sub(a);
    // Longer for larger faces, which then count for more where faces meet.
    b.cross(c).toArray(faceNormals, 3 * face);
  }
  // Meshes repeat vertices where their texture has seams: the same point is the same corner.
  const point = (corner: number): string =>
    `${position[3 * corner]!},${position[3 * corner + 1]!},${position[3 * corner + 2]!}`;
  for (let corner = 0; corner < corners; corner++) {
    const faceList = around.get(point(corner));
    const face = Math.floor(corner / 3);
    if (faceList) faceList.push(face);
    else around.set(point(corner), [face]);
  }
  const normal = new Float32Array(3 * corners);
  for (let corner = 0; corner < corners; corner++) {
    a.fromArray(faceNormals, 3 * Math.floor(corner / 3));
    c.set(0, 0, 0);
    for (const face of around.get(point(corner))!) {
      b.fromArray(faceNormals, 3 * face);
      if (a.dot(b) >= CREASE * a.length() * b.length()) c.add(b);
    }
    c.normalize().toArray(normal, 3 * corner);
  }
  return new BufferGeometry()
    .setAttribute("position", new BufferAttribute(position, 3))
    .setAttribute("normal", new BufferAttribute(normal, 3));
}

/** Where a geom is in the frame of its body. */
export function placeOf(geom: Geom): Matrix4 {
  const [w, x, y, z] = geom.quat;
  return new Matrix4().compose(
    new Vector3(...geom.pos),
    new Quaternion(x, y, z, w).normalize(),
    new Vector3(1, 1, 1),
  );
}

/** Join the shapes of geoms into one, with the colours of their materials. */
export function joined(geoms: readonly Geom[], scene: SceneContent): BufferGeometry {
  const shapes = geoms.map((geom) => shapeOf(geom, scene).applyMatrix4(placeOf(geom)));
  const count = shapes.reduce((sum, shape) => sum + shape.getAttribute("position").count, 0);
  const position = new Float32Array(3 * count);
  const normal = new Float32Array(3 * count);
  const color = new Float32Array(3 * count);
  const corners: number[] = [];
  let from = 0;
  shapes.forEach((shape, place) => {
    const vertices = shape.getAttribute("position");
    position.set(vertices.array, 3 * from);
    normal.set(shape.getAttribute("normal").array, 3 * from);
    const paint = materialColor(geoms[place]!, scene);
    for (let i = 0; i < vertices.count; i++) paint.toArray(color, 3 * (from + i));
    const length = shape.index?.count ?? vertices.count;
    for (let i = 0; i < length; i++) corners.push(from + (shape.index?.getX(i) ?? i));
    from += vertices.count;
  });
  return new BufferGeometry()
    .setAttribute("position", new BufferAttribute(position, 3))
    .setAttribute("normal", new BufferAttribute(normal, 3))
    .setAttribute("color", new BufferAttribute(color, 3))
    .setIndex(corners);
}

/** The color of a geom's material. Colors in a scene are meant as a screen shows them. */
export function materialColor(geom: Geom, scene: SceneContent): Color {
  const material = scene.materials[geom.material];
  const [r, g, b] = material ? material.color : [0.5, 0.5, 0.5];
  return new Color().setRGB(r, g, b, "srgb");
}
