/** Where the picture is looked at from: presets, and what the user makes of them. */

import type { PerspectiveCamera } from "three";
import { Vector3 } from "three";

import type { SceneContent, Triple, View } from "./format";
import { HEIGHT } from "./falling_notes";

export const VIEWS = ["player", "audience", "top", "keys", "left", "right"] as const;
export type ViewName = (typeof VIEWS)[number];

/** The presets are composed for pictures of this shape; in narrower ones the eye sees wider. */
const ASPECT = 16 / 9;
const PLAYER: View = { pos: [1.22, 0, 1.5], target: [0.075, 0, 0], fovy: 17.5 };
const TOP: View = { pos: [0.1, 0, 2.2], target: [0.0999, 0, 0], fovy: 16 };
/** The keyboard takes up this part of a picture's width at most. */
const FILLED = 0.94;
const NEAREST = 0.06;
const FARTHEST = 6;
/** [1/s] How fast the eye goes where it is meant to be. */
const EASE = 7;
/** [1/s] How fast it follows a hand. */
const FOLLOW = 4;

/** The eye looks at `target` from `distance`, turned by `turn` about z and `tilt` from above. */
interface Eye {
  target: Vector3;
  turn: number;
  tilt: number;
  distance: number;
  fovy: number;
}

export class CameraRig {
  /** Which preset the eye is at, or null where the user has moved it elsewhere. */
  view: ViewName | null = "player";
  /** Whether the eye goes to a preset at once. */
  still = false;

  private readonly eye = blank();
  private readonly goal = blank();
  private readonly followed = new Vector3();
  private readonly step = new Vector3();
  private following = -1;
  private withNotes = true;
  private arrived = false;

  constructor(
    private readonly camera: PerspectiveCamera,
    private readonly scene: SceneContent,
  ) {
    camera.up.set(0, 0, 1);
  }

  /**
   * Go to a preset.
   *
   * @param name of the preset.
   * @param wrists x, y, z of the left and the right wrist [m].
   * @param withNotes whether there are falling notes to be seen above the keys.
   */
  show(name: ViewName, wrists: Float64Array, withNotes: boolean): void {
    this.withNotes = withNotes;
    const from = this.compose(name, wrists);
    this.view = name;
    this.goal.target.set(...from.target);
    this.step.set(...from.pos).sub(this.goal.target);
    this.goal.distance = this.step.length();
    this.goal.tilt = Math.acos(this.step.z / this.goal.distance);
    const turn = Math.atan2(this.step.y, this.step.x);
    this.goal.turn =
      this.eye.turn + Math.atan2(Math.sin(turn - this.eye.turn), Math.cos(turn - this.eye.turn));
    this.goal.fovy = from.fovy;
    this.following = name === "left" ? 0 : name === "right" ? 1 : -1;
    if (this.following >= 0) this.followed.fromArray(wrists, 3 * this.following);
    this.arrived = false;
  }

  /** Turn about the target [rad]. */
  orbit(turn: number, tilt: number): void {
    this.goal.turn += turn;
    this.goal.tilt = Math.min(Math.max(this.goal.tilt + tilt, 0.01), Math.PI * 0.52);
    this.moveByHand();
  }

  /** Come nearer (< 1) or go away (> 1). */
  zoom(factor: number): void {
    this.goal.distance = Math.min(Math.max(this.goal.distance * factor, NEAREST), FARTHEST);
    this.moveByHand();
  }

  /** Move the target sideways and up, in parts of the picture's height. */
  pan(right: number, up: number): void {
    const height = 2 * this.goal.distance * Math.tan((this.goal.fovy * Math.PI) / 360);
    const { elements } = this.camera.matrixWorld;
    this.goal.target.addScaledVector(this.step.fromArray(elements, 0), right * height);
    this.goal.target.addScaledVector(this.step.fromArray(elements, 4), up * height);
    this.moveByHand();
  }

  /**
   * Move the camera.
   *
   * @param passed since the last frame [s].
   * @param aspect of the picture.
   * @param wrists as of `show`.
   * @returns whether the camera has moved.
   */
  update(passed: number, aspect: number, wrists: Float64Array): boolean {
    const { eye, goal } = this;
    if (this.following >= 0) {
      this.step.fromArray(wrists, 3 * this.following).sub(this.followed);
      if (this.step.lengthSq() > 1e-10) {
        this.step.multiplyScalar(this.still ? 1 : 1 - Math.exp(-FOLLOW * passed));
        this.followed.add(this.step);
        goal.target.add(this.step);
        eye.target.add(this.step);
        this.arrived = false;
      }
    }
    const changed = this.camera.aspect !== aspect;
    if (this.arrived && !changed) return false;
    const part = this.still || eye.distance === 0 ? 1 : 1 - Math.exp(-EASE * Math.min(passed, 0.1));
    eye.target.lerp(goal.target, part);
    eye.turn += part * (goal.turn - eye.turn);
    eye.tilt += part * (goal.tilt - eye.tilt);
    eye.distance += part * (goal.distance - eye.distance);
    eye.fovy += part * (goal.fovy - eye.fovy);
    this.arrived =
      Math.abs(goal.turn - eye.turn) +
        Math.abs(goal.tilt - eye.tilt) +
        Math.abs(goal.distance / eye.distance - 1) +
        eye.target.distanceTo(goal.target) +
        Math.abs(goal.fovy - eye.fovy) * 0.01 <
      2e-4;
    this.place(aspect);
    return true;
  }

  private moveByHand(): void {
    this.view = null;
    this.arrived = false;
  }

  private place(aspect: number): void {
    const { camera, eye } = this;
    const across = eye.distance * Math.sin(eye.tilt);
    camera.position.set(
      eye.target.x + across * Math.cos(eye.turn),
      eye.target.y + across * Math.sin(eye.turn),
      eye.target.z + eye.distance * Math.cos(eye.tilt),
    );
    camera.lookAt(eye.target);
    const wider = Math.max(ASPECT / aspect, 1);
    camera.fov = (Math.atan(Math.tan((eye.fovy * Math.PI) / 360) * wider) * 360) / Math.PI;
    camera.aspect = aspect;
    camera.near = Math.max(eye.distance / 50, 0.01);
    camera.far = eye.distance + 8;
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
  }

  /** A film's camera, which may leave out keys that nobody plays, made to see all of them. */
  private fitted(view: View): View {
    const half = Math.max(...this.scene.keys.map(({ top, half }) => Math.abs(top[1]) + half[1]));
    const away = Math.hypot(...view.pos.map((x, i) => x - view.target[i]!));
    const needed = (Math.atan(half / FILLED / ASPECT / away) * 360) / Math.PI;
    return { ...view, fovy: Math.max(view.fovy, needed) };
  }

  private compose(name: ViewName, wrists: Float64Array): View {
    const lift = this.withNotes ? HEIGHT : 0;
    const { cameras } = this.scene;
    const at = (x: number, y: number, z: number): Triple => [x, y, z];
    switch (name) {
      case "player":
        return lift > 0
          ? { pos: at(1.75, 0, 1.06), target: at(0.02, 0, 0.165), fovy: 23 }
          : this.fitted(cameras["player"] ?? PLAYER);
      case "audience":
        return { pos: at(1.15, 1.15, 0.62), target: at(0.04, 0.05, 0.06 + lift / 4), fovy: 30 };
      case "top":
        return this.fitted(cameras["top"] ?? TOP);
      case "keys":
        return { pos: at(0.16, -0.98, 0.2), target: at(0.03, 0.1, 0.05), fovy: 32 };
      case "left":
      case "right": {
        const i = name === "left" ? 0 : 3;
        const side = name === "left" ? -1 : 1;
        const [x, y, z] = [wrists[i]!, wrists[i + 1]!, wrists[i + 2]!];
        return {
          pos: at(x + 0.02, y + side * 0.36, z + 0.2),
          target: at(x - 0.09, y, z - 0.03),
          fovy: 34,
        };
      }
    }
  }
}

function blank(): Eye {
  return { target: new Vector3(), turn: 0, tilt: 1, distance: 0, fovy: 30 };
}
