/** The piano and the hands as three.js objects, few of them, moved by forward kinematics. */

import {
  Color,
  DynamicDrawUsage,
  Group,
  InstancedMesh,
  Matrix4,
  Mesh,
  MeshLambertMaterial,
  MeshPhongMaterial,
  PlaneGeometry,
  Quaternion,
  ShaderMaterial,
  ShadowMaterial,
  Vector3,
} from "three";

import type { Geom, SceneContent } from "./format";
import { KEYS } from "./format";
import type { Kinematics } from "./kinematics";
import type { Look, Paint } from "./look";
import { paints } from "./look";
import { joined, keyShape, materialColor, placeOf } from "./shapes";

const ONE = new Vector3(1, 1, 1);
/** How far a key that sounds takes on the colour of its hand. */
const LIT = 0.9;

/** [m] Half sizes of the darkness around the piano's foot, which shows where the floor is. */
const SOFT_SHADOW: readonly [number, number] = [0.42, 0.95];

const SOFT_VERTEX = /* glsl */ `
  varying vec2 corner;
  void main() {
    corner = 2.0 * uv - 1.0;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }
`;
const SOFT_FRAGMENT = /* glsl */ `
  uniform float depth;
  varying vec2 corner;
  void main() {
    vec2 near = clamp((1.0 - abs(corner)) * vec2(1.3, 2.2), 0.0, 1.0);
    near *= near * (3.0 - 2.0 * near);
    gl_FragColor = vec4(0.0, 0.0, 0.0, depth * near.x * near.y);
  }
`;

interface MovingBody {
  mesh: Mesh;
  body: number;
}

/** The parts of one kind that the keys have, such as all visible white keys. */
interface KeyParts {
  mesh: InstancedMesh;
  keys: Int32Array;
  bodies: Int32Array;
  places: Matrix4[];
  colors: Color[];
}

export class PianoScene {
  readonly group = new Group();
  /** Height of the floor [m]. */
  readonly floor: number;

  private readonly moving: MovingBody[] = [];
  private readonly parts: KeyParts[] = [];
  private readonly lamps: KeyParts | null;
  private readonly softness = { depth: { value: 0 } };
  private readonly floorShadow = new ShadowMaterial();
  private readonly lit = new Int8Array(KEYS).fill(-1);
  private readonly paints = [new Color(), new Color(), new Color(), new Color()];
  private readonly matrix = new Matrix4();
  private readonly position = new Vector3();
  private readonly rotation = new Quaternion();
  private readonly color = new Color();
  private readonly lastPose: Float64Array;

  /**
   * @param scene what there is to be seen.
   * @param plain whether to leave out what shines, which takes a processor long to draw.
   */
  constructor(
    scene: SceneContent,
    private readonly plain: boolean,
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
    const white = scene.geoms.filter((geom) => geom.key >= 0 && !scene.keys[geom.key]!.black);
    const black = scene.geoms.filter((geom) => geom.key >= 0 && scene.keys[geom.key]!.black);
    for (const geoms of [white, black]) {
      if (geoms.length > 0) {
        this.parts.push(this.addKeys(geoms, scene, this.material(geoms[0]!, scene, false), true));
      }
    }
    const lamps = scene.geoms.filter((geom) => geom.lamp >= 0);
    this.lamps =
      lamps.length > 0
        ? this.addKeys(lamps, scene, this.material(lamps[0]!, scene, false), false)
        : null;
    this.addFloor();
  }

  /** Show shadows, where they are drawn at all. */
  setShadows(shadows: boolean): void {
    this.floorShadow.visible = shadows;
  }

  setLook(look: Look): void {
    paints(look).forEach((paint, i) => this.paints[i]!.set(paint));
    this.floorShadow.opacity = look.dark ? 0.45 : 0.22;
    this.softness.depth.value = look.dark ? 0.5 : 0.26;
    this.lit.fill(-1);
    for (const part of [...this.parts, ...(this.lamps ? [this.lamps] : [])]) {
      for (let i = 0; i < part.keys.length; i++) part.mesh.setColorAt(i, part.colors[i]!);
      part.mesh.instanceColor!.needsUpdate = true;
    }
  }

  /** Move all bodies to where forward kinematics has them. */
  move(kinematics: Kinematics): void {
    for (const { mesh, body } of this.moving) {
      if (this.moved(kinematics, body)) this.pose(kinematics, body, mesh.matrixWorld);
    }
    for (const part of this.parts) {
      for (let i = 0; i < part.keys.length; i++) {
        if (!this.moved(kinematics, part.bodies[i]!)) continue;
        this.pose(kinematics, part.bodies[i]!, this.matrix);
        part.mesh.setMatrixAt(i, this.matrix.multiply(part.places[i]!));
        part.mesh.instanceMatrix.needsUpdate = true;
      }
    }
  }

  /**
   * Light up keys.
   *
   * @param sounding for each key its `Paint`, or -1 where it is silent.
   */
  light(sounding: ArrayLike<number>): void {
    for (const part of this.parts) this.paint(part, sounding, LIT);
    if (this.lamps) this.paint(this.lamps, sounding, 1);
    for (let key = 0; key < KEYS; key++) this.lit[key] = sounding[key]!;
  }

  private paint(part: KeyParts, sounding: ArrayLike<number>, amount: number): void {
    for (let i = 0; i < part.keys.length; i++) {
      const key = part.keys[i]!;
      if (sounding[key] === this.lit[key]) continue;
      this.color.copy(part.colors[i]!);
      if (sounding[key]! >= 0) {
        this.color.lerp(this.paints[sounding[key] as Paint]!, amount);
      }
      part.mesh.setColorAt(i, this.color);
      part.mesh.instanceColor!.needsUpdate = true;
    }
  }

  private addStatic(geoms: Geom[], scene: SceneContent): void {
    for (const material of new Set(geoms.map((geom) => geom.material))) {
      const those = geoms.filter((geom) => geom.material === material);
      // The world's own frame is that of all bodies that never move: the format's piano has no
      // place of its own.
      const mesh = new Mesh(joined(those, scene), this.material(those[0]!, scene, true));
      mesh.castShadow = mesh.receiveShadow = true;
      this.group.add(mesh);
    }
  }

  private addBodies(geoms: Geom[], scene: SceneContent): void {
    const shells = geoms.find((geom) => scene.materials[geom.material]?.name === "shell");
    const first = shells ?? geoms[0];
    if (!first) return;
    const material = this.material(first, scene, true);
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

  private addKeys(
    geoms: Geom[],
    scene: SceneContent,
    material: MeshPhongMaterial | MeshLambertMaterial,
    shadows: boolean,
  ): KeyParts {
    const size = geoms[0]!.size;
    const mesh = new InstancedMesh(keyShape(size), material, geoms.length);
    const part: KeyParts = {
      mesh,
      keys: Int32Array.from(geoms, (geom) => Math.max(geom.key, geom.lamp)),
      bodies: Int32Array.from(geoms, (geom) => geom.body),
      places: geoms.map((geom) =>
        placeOf(geom).scale(
          new Vector3(geom.size[0] / size[0], geom.size[1] / size[1], geom.size[2] / size[2]),
        ),
      ),
      colors: geoms.map((geom) => materialColor(geom, scene)),
    };
    part.places.forEach((place, i) => {
      mesh.setMatrixAt(i, place);
      mesh.setColorAt(i, part.colors[i]!);
    });
    mesh.instanceMatrix.setUsage(DynamicDrawUsage);
    mesh.castShadow = mesh.receiveShadow = shadows;
    mesh.frustumCulled = false;
    this.group.add(mesh);
    return part;
  }

  private addFloor(): void {
    const soft = new Mesh(
      new PlaneGeometry(2 * SOFT_SHADOW[0], 2 * SOFT_SHADOW[1]),
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

  /** The look of a geom's material; its color is that of vertices or of instances. */
  private material(
    geom: Geom,
    scene: SceneContent,
    vertexColors: boolean,
  ): MeshPhongMaterial | MeshLambertMaterial {
    if (this.plain) return new MeshLambertMaterial({ vertexColors });
    const material = scene.materials[geom.material];
    const specular = 0.35 * (material?.specular ?? 0);
    return new MeshPhongMaterial({
      vertexColors,
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
