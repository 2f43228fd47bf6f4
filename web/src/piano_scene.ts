/** The piano and the hands as three.js objects, few of them, moved by forward kinematics. */

import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DynamicDrawUsage,
  Group,
  Matrix4,
  Mesh,
  MeshPhongMaterial,
  PlaneGeometry,
  Quaternion,
  ShaderMaterial,
  ShadowMaterial,
  Vector3,
} from "three";
import type { Material, Raycaster } from "three";

import type { Geom, SceneContent } from "./format";
import { KEYS } from "./format";
import type { Kinematics } from "./kinematics";
import type { Look, Paint } from "./look";
import { PaintColors } from "./paint_colors";
import { joined, keyShape, materialColor, placeOf } from "./shapes";

const ONE = new Vector3(1, 1, 1);
/** How far a key that sounds takes on the colour of its hand. */
const LIT = 0.9;

/** [m] Half sizes of the darkness around the piano's foot, which shows where the floor is. */
const SOFT_SHADOW: readonly [number, number] = [0.42, 0.95];

const SOFT_VERTEX = /* glsl */ `
  uniform float depth;
  varying float dark;
  void main() {
    vec2 near = clamp((1.0 - abs(2.0 * uv - 1.0)) * vec2(1.3, 2.2), 0.0, 1.0);
    near *= near * (3.0 - 2.0 * near);
    dark = depth * near.x * near.y;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }
`;
const SOFT_FRAGMENT = /* glsl */ `
  varying float dark;
  void main() {
    gl_FragColor = vec4(0.0, 0.0, 0.0, dark);
  }
`;

interface MovingBody {
  mesh: Mesh;
  body: number;
}

/**
 * The keys and the lamps behind them, as one mesh whose vertices are moved here: a key has few, and
 * drawing in software takes as long for each of 176 instances as for a whole mesh.
 */
interface Keys {
  mesh: Mesh;
  position: BufferAttribute;
  color: BufferAttribute;
  keys: Int32Array;
  /** Body that carries each part, or -1 where it stands still. */
  bodies: Int32Array;
  /** The parts' vertices, each in the frame of its body. */
  local: Float32Array;
  colors: Color[];
  /** Vertices of a part. */
  count: number;
  lamps: boolean[];
}

export class PianoScene {
  readonly group = new Group();
  /** Height of the floor [m]. */
  readonly floor: number;

  private readonly moving: MovingBody[] = [];
  private readonly keys: Keys;
  private readonly softness = { depth: { value: 0 } };
  private readonly floorShadow = new ShadowMaterial();
  private readonly lit = new Int8Array(KEYS).fill(-1);
  private readonly paints = new PaintColors();
  private readonly matrix = new Matrix4();
  private readonly position = new Vector3();
  private readonly rotation = new Quaternion();
  private readonly color = new Color();
  private readonly lastPose: Float64Array;

  /**
   * @param scene what there is to be seen.
   * @param plain what all surfaces are made of, where those that shine take too long to draw.
   */
  constructor(
    scene: SceneContent,
    private readonly plain: Material | null,
  ) {
    const isStatic = staticBodies(scene);
    this.lastPose = new Float64Array(7 * scene.bodies.length).fill(NaN);
    const others = scene.geoms.filter((geom) => geom.key < 0 && geom.lamp < 0);
    const ground = others.find((geom) => geom.type === "plane");
    this.floor = ground ? ground.pos[2] : -0.05;
    this.addStatic(
      others.filter((geom) => isStatic[geom.body] && geom !== ground),
      scene,
    );
    this.addBodies(
      others.filter((geom) => !isStatic[geom.body]),
      scene,
    );
    this.keys = this.addKeys(
      scene.geoms.filter((geom) => geom.key >= 0 || geom.lamp >= 0),
      scene,
      isStatic,
    );
    this.addFloor();
  }

  /** Show shadows, where they are drawn at all. */
  setShadows(shadows: boolean): void {
    this.floorShadow.visible = shadows;
  }

  setLook(look: Look): void {
    this.paints.setLook(look);
    this.floorShadow.opacity = look.dark ? 0.45 : 0.22;
    this.softness.depth.value = look.dark ? 0.5 : 0.26;
    this.lit.fill(-1);
    for (let i = 0; i < this.keys.keys.length; i++) this.paint(i, this.keys.colors[i]!);
  }

  /** Move all bodies to where forward kinematics has them. */
  move(kinematics: Kinematics): void {
    for (const { mesh, body } of this.moving) {
      if (this.moved(kinematics, body)) this.pose(kinematics, body, mesh.matrixWorld);
    }
    const { bodies } = this.keys;
    for (let i = 0; i < bodies.length; i++) {
      if (bodies[i]! < 0 || !this.moved(kinematics, bodies[i]!)) continue;
      this.pose(kinematics, bodies[i]!, this.matrix);
      this.placeKey(i, this.matrix);
    }
  }

  /**
   * Light up keys.
   *
   * @param sounding for each key its `Paint`, or -1 where it is silent.
   */
  light(sounding: ArrayLike<number>): void {
    const { keys, colors, lamps } = this.keys;
    for (let i = 0; i < keys.length; i++) {
      const sound = sounding[keys[i]!]!;
      if (sound === this.lit[keys[i]!]) continue;
      this.color.copy(colors[i]!);
      if (sound >= 0) this.color.lerp(this.paints.list[sound as Paint], lamps[i] ? 1 : LIT);
      this.paint(i, this.color);
    }
    for (let key = 0; key < KEYS; key++) this.lit[key] = sounding[key]!;
  }

  /** The key that a ray meets, or the lamp of which it meets; -1 for none. */
  keyAt(raycaster: Raycaster): number {
    const { mesh, keys, count } = this.keys;
    const [first] = raycaster.intersectObject(mesh, false);
    return first?.faceIndex == null ? -1 : keys[Math.floor((3 * first.faceIndex) / count)]!;
  }

  private paint(part: number, paint: Color): void {
    const { color, count } = this.keys;
    for (let i = part * count; i < (part + 1) * count; i++) color.setXYZ(i, paint.r, paint.g, paint.b);
    color.needsUpdate = true;
  }

  private placeKey(part: number, pose: Matrix4): void {
    const { position, local, count } = this.keys;
    for (let i = part * count; i < (part + 1) * count; i++) {
      this.position.fromArray(local, 3 * i).applyMatrix4(pose);
      position.setXYZ(i, this.position.x, this.position.y, this.position.z);
    }
    position.needsUpdate = true;
  }

  private addStatic(geoms: Geom[], scene: SceneContent): void {
    for (const material of new Set(geoms.map((geom) => geom.material))) {
      const those = geoms.filter((geom) => geom.material === material);
      // The world's own frame is that of all bodies that never move: the format's piano has no
      // place of its own.
      const mesh = new Mesh(joined(those, scene), this.material(those[0]!, scene));
      mesh.castShadow = mesh.receiveShadow = true;
      this.group.add(mesh);
    }
  }

  private addBodies(geoms: Geom[], scene: SceneContent): void {
    const shells = geoms.find((geom) => scene.materials[geom.material]?.name === "shell");
    const first = shells ?? geoms[0];
    if (!first) return;
    const material = this.material(first, scene);
    for (const body of new Set(geoms.map((geom) => geom.body))) {
      const shape = joined(
        geoms.filter((geom) => geom.body === body),
        scene,
      );
      const mesh = new Mesh(shape, material);
      mesh.castShadow = mesh.receiveShadow = true;
      mesh.matrixWorldAutoUpdate = false;
      this.group.add(mesh);
      this.moving.push({ mesh, body });
    }
  }

  private addKeys(geoms: Geom[], scene: SceneContent, isStatic: boolean[]): Keys {
    const shapes = geoms.map((geom) => keyShape(geom.size).applyMatrix4(placeOf(geom)));
    const count = shapes[0]?.getAttribute("position").count ?? 0;
    const local = new Float32Array(3 * count * geoms.length);
    // Keys turn so little that light falls on them as if they did not.
    const normal = new Float32Array(local.length);
    shapes.forEach((shape, i) => {
      local.set(shape.getAttribute("position").array, 3 * count * i);
      normal.set(shape.getAttribute("normal").array, 3 * count * i);
    });
    const position = new BufferAttribute(local.slice(), 3).setUsage(DynamicDrawUsage);
    const color = new BufferAttribute(new Float32Array(local.length), 3).setUsage(DynamicDrawUsage);
    const shape = new BufferGeometry()
      .setAttribute("position", position)
      .setAttribute("normal", new BufferAttribute(normal, 3))
      .setAttribute("color", color);
    const black = geoms.find((geom) => geom.key >= 0 && scene.keys[geom.key]!.black) ?? geoms[0];
    const mesh = new Mesh(shape, black && this.material(black, scene));
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.frustumCulled = false;
    this.group.add(mesh);
    return {
      mesh,
      position,
      color,
      keys: Int32Array.from(geoms, (geom) => Math.max(geom.key, geom.lamp)),
      bodies: Int32Array.from(geoms, (geom) => (isStatic[geom.body] ? -1 : geom.body)),
      local,
      colors: geoms.map((geom) => materialColor(geom, scene)),
      count,
      lamps: geoms.map((geom) => geom.lamp >= 0),
    };
  }

  private addFloor(): void {
    const soft = new Mesh(
      new PlaneGeometry(2 * SOFT_SHADOW[0], 2 * SOFT_SHADOW[1], 20, 30),
      new ShaderMaterial({
        vertexShader: SOFT_VERTEX,
        fragmentShader: SOFT_FRAGMENT,
        uniforms: this.softness,
        transparent: true,
        depthWrite: false,
      }),
    );
    soft.position.set(-0.03, 0, this.floor + 0.001);
    this.group.add(soft);
    const mesh = new Mesh(new PlaneGeometry(6, 6), this.floorShadow);
    mesh.position.z = this.floor + 0.002;
    mesh.material.depthWrite = false;
    mesh.receiveShadow = true;
    this.group.add(mesh);
  }

  /** The look of a geom's material; its color is that of the vertices. */
  private material(geom: Geom, scene: SceneContent): Material {
    if (this.plain) return this.plain;
    const material = scene.materials[geom.material];
    const specular = 0.35 * (material?.specular ?? 0);
    return new MeshPhongMaterial({
      vertexColors: true,
      specular: new Color(specular, specular, specular),
      shininess: 77 * (material?.shininess ?? 0.5),
    });
  }

  private moved(kinematics: Kinematics, body: number): boolean {
    const { pos, quat } = kinematics;
    const last = this.lastPose;
    let moved = false;
    for (let i = 0; i < 7; i++) {
      const value = i < 3 ? pos[3 * body + i]! : quat[4 * body + i - 3]!;
      if (last[7 * body + i] !== value) moved = true;
      last[7 * body + i] = value;
    }
    return moved;
  }

  private pose(kinematics: Kinematics, body: number, into: Matrix4): void {
    const { pos, quat } = kinematics;
    this.position.fromArray(pos, 3 * body);
    this.rotation.set(
      quat[4 * body + 1]!,
      quat[4 * body + 2]!,
      quat[4 * body + 3]!,
      quat[4 * body]!,
    );
    into.compose(this.position, this.rotation, ONE);
  }
}

/** For each body whether it, and what carries it, stands still at the world's own place. */
function staticBodies(scene: SceneContent): boolean[] {
  const still: boolean[] = [];
  scene.bodies.forEach((body, i) => {
    const placed = body.pos.some((value) => value !== 0) || body.quat[0] !== 1;
    still.push(i === 0 || (still[body.parent]! && body.joints.length === 0 && !placed));
  });
  return still;
}
