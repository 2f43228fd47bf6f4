/** Forward kinematics: where the bodies are, given the joint positions. */

import type { Body } from "./format";

const HINGE = 1;

export class Kinematics {
  /** World positions, 3 numbers a body [m]. */
  readonly pos: Float64Array;
  /** World orientations w, x, y, z, 4 numbers a body. */
  readonly quat: Float64Array;

  private readonly parent: Int32Array;
  private readonly ownPos: Float64Array;
  private readonly ownQuat: Float64Array;
  private readonly firstJoint: Int32Array;
  private readonly kind: Uint8Array;
  private readonly index: Int32Array;
  private readonly rest: Float64Array;
  private readonly axis: Float64Array;
  private readonly anchor: Float64Array;

  constructor(bodies: readonly Body[]) {
    const joints = bodies.flatMap((body) => body.joints);
    this.pos = new Float64Array(3 * bodies.length);
    this.quat = new Float64Array(4 * bodies.length);
    this.parent = Int32Array.from(bodies, (body) => body.parent);
    this.ownPos = Float64Array.from(bodies.flatMap((body) => body.pos));
    this.ownQuat = Float64Array.from(bodies.flatMap((body) => unit(body.quat)));
    this.firstJoint = new Int32Array(bodies.length + 1);
    bodies.forEach((body, i) => {
      this.firstJoint[i + 1] = this.firstJoint[i]! + body.joints.length;
    });
    this.kind = Uint8Array.from(joints, (joint) => (joint.type === "hinge" ? HINGE : 0));
    this.index = Int32Array.from(joints, (joint) => joint.index);
    this.rest = Float64Array.from(joints, (joint) => joint.rest);
    this.axis = Float64Array.from(joints.flatMap((joint) => unit(joint.axis)));
    this.anchor = Float64Array.from(joints.flatMap((joint) => joint.pos));
  }

  /**
   * Move all bodies.
   *
   * @param positions of the joints [rad, m].
   */
  update(positions: Float64Array): void {
    const { pos, quat, ownPos, ownQuat, axis, anchor } = this;
    quat[0] = 1;
    for (let body = 1; body < this.parent.length; body++) {
      const p = this.parent[body]!;
      const qw = quat[4 * p]!;
      const qx = quat[4 * p + 1]!;
      const qy = quat[4 * p + 2]!;
      const qz = quat[4 * p + 3]!;
      const ow = ownQuat[4 * body]!;
      const ox = ownQuat[4 * body + 1]!;
      const oy = ownQuat[4 * body + 2]!;
      const oz = ownQuat[4 * body + 3]!;
      let w = qw * ow - qx * ox - qy * oy - qz * oz;
      let x = qw * ox + qx * ow + qy * oz - qz * oy;
      let y = qw * oy - qx * oz + qy * ow + qz * ox;
      let z = qw * oz + qx * oy - qy * ox + qz * ow;
      rotate(qw, qx, qy, qz, ownPos[3 * body]!, ownPos[3 * body + 1]!, ownPos[3 * body + 2]!);
      let px = pos[3 * p]! + turned[0]!;
      let py = pos[3 * p + 1]! + turned[1]!;
      let pz = pos[3 * p + 2]! + turned[2]!;
      for (let j = this.firstJoint[body]!; j < this.firstJoint[body + 1]!; j++) {
        const q = positions[this.index[j]!]! - this.rest[j]!;
        const ax = axis[3 * j]!;
        const ay = axis[3 * j + 1]!;
        const az = axis[3 * j + 2]!;
        if (this.kind[j] === HINGE) {
          const rx = anchor[3 * j]!;
          const ry = anchor[3 * j + 1]!;
          const rz = anchor[3 * j + 2]!;
          rotate(w, x, y, z, rx, ry, rz);
          px += turned[0]!;
          py += turned[1]!;
          pz += turned[2]!;
          const c = Math.cos(q / 2);
          const s = Math.sin(q / 2);
          const nw = w * c - (x * ax + y * ay + z * az) * s;
          const nx = x * c + (w * ax + y * az - z * ay) * s;
          const ny = y * c + (w * ay - x * az + z * ax) * s;
          const nz = z * c + (w * az + x * ay - y * ax) * s;
          w = nw;
          x = nx;
          y = ny;
          z = nz;
          rotate(w, x, y, z, rx, ry, rz);
          px -= turned[0]!;
          py -= turned[1]!;
          pz -= turned[2]!;
        } else {
          rotate(w, x, y, z, ax * q, ay * q, az * q);
          px += turned[0]!;
          py += turned[1]!;
          pz += turned[2]!;
        }
      }
      pos[3 * body] = px;
      pos[3 * body + 1] = py;
      pos[3 * body + 2] = pz;
      quat[4 * body] = w;
      quat[4 * body + 1] = x;
      quat[4 * body + 2] = y;
      quat[4 * body + 3] = z;
    }
  }

  /**
   * Where a point of a body is in the world.
   *
   * @param into receives x, y, z [m] at `offset`.
   */
  point(body: number, local: ArrayLike<number>, into: Float64Array, offset: number): void {
    const { pos, quat } = this;
    rotate(
      quat[4 * body]!,
      quat[4 * body + 1]!,
      quat[4 * body + 2]!,
      quat[4 * body + 3]!,
      local[0]!,
      local[1]!,
      local[2]!,
    );
    for (let i = 0; i < 3; i++) into[offset + i] = pos[3 * body + i]! + turned[i]!;
  }
}

/** What `rotate` found; one place for all calls, so that a frame allocates nothing. */
const turned = new Float64Array(3);

function rotate(
  w: number,
  x: number,
  y: number,
  z: number,
  vx: number,
  vy: number,
  vz: number,
): void {
  const tx = 2 * (y * vz - z * vy);
  const ty = 2 * (z * vx - x * vz);
  const tz = 2 * (x * vy - y * vx);
  turned[0] = vx + w * tx + y * tz - z * ty;
  turned[1] = vy + w * ty + z * tx - x * tz;
  turned[2] = vz + w * tz + x * ty - y * tx;
}

function unit(vector: readonly number[]): number[] {
  const length = Math.hypot(...vector);
  return vector.map((value) => value / length);
}
