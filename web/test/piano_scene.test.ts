import { MeshBasicMaterial, Raycaster, Vector3 } from "three";
import { describe, expect, it } from "vitest";

import type { Geom, SceneContent, Triple } from "../src/format";
import { Kinematics } from "../src/kinematics";
import { PianoScene } from "../src/piano_scene";
import { body } from "./made_up";

const HALF: Triple = [0.07, 0.011, 0.01];
const PLACES: Triple[] = [
  [0, -0.02, 0],
  [0, 0.02, 0],
];

/** A piano of two keys, each a body of its own; behind the second there is a lamp. */
function piano(): PianoScene {
  const shape = { type: "box", quat: [1, 0, 0, 0], material: 0, mesh: -1 } as const;
  const key = (body: number, more: Partial<Geom>): Geom => ({
    body,
    size: HALF,
    pos: [0, 0, 0],
    key: -1,
    lamp: -1,
    ...shape,
    quat: [...shape.quat],
    ...more,
  });
  const scene: SceneContent = {
    bodies: [body(0, [0, 0, 0]), ...PLACES.map((place) => body(0, place))],
    materials: [{ name: "key", color: [1, 1, 1], specular: 0, shininess: 0 }],
    meshes: [],
    geoms: [
      key(1, { key: 5 }),
      key(2, { key: 6 }),
      key(0, { lamp: 6, pos: [-0.2, 0.02, 0], size: [0.01, 0.01, 0.01] }),
    ],
    keys: Array.from({ length: 7 }, () => ({ black: false, top: [0, 0, 0], half: HALF })),
    fingertips: [],
    cameras: {},
    light: { pos: [0, 0, 1], target: [0, 0, 0] },
  };
  const made = new PianoScene(scene, new MeshBasicMaterial());
  const kinematics = new Kinematics(scene.bodies);
  kinematics.update(new Float64Array(0));
  made.move(kinematics);
  return made;
}

describe("PianoScene", () => {
  it("tells which key a ray meets", () => {
    const made = piano();
    const from = (x: number, y: number): number =>
      made.keyAt(new Raycaster(new Vector3(x, y, 1), new Vector3(0, 0, -1)));
    expect(PLACES.map(([x, y]) => from(x, y))).toEqual([5, 6]);
    expect(from(-0.2, 0.02)).toBe(6);
    expect(from(0, 0)).toBe(-1);
    // Along the keys the nearer one hides the other.
    const along = new Raycaster(new Vector3(0, 1, 0), new Vector3(0, -1, 0));
    expect(made.keyAt(along)).toBe(6);
  });
});
