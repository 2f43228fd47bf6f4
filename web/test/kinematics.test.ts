import { describe, expect, it } from "vitest";

import { Kinematics } from "../src/kinematics";
import { body } from "./made_up";

function at(kinematics: Kinematics, place: number): number[] {
  return [...kinematics.pos.subarray(3 * place, 3 * place + 3)];
}

function expectClose(found: number[], wanted: number[]): void {
  found.forEach((value, i) => {
    expect(value).toBeCloseTo(wanted[i]!, 9);
  });
}

describe("Kinematics", () => {
  it("turns a body by a hinge about the hinge's own point", () => {
    const kinematics = new Kinematics([
      body(0, [0, 0, 0]),
      body(0, [1, 0, 0], [
        { type: "hinge", axis: [0, 0, 1], pos: [-1, 0, 0], index: 0, rest: 0.5 },
      ]),
      body(1, [1, 0, 0]),
    ]);
    kinematics.update(new Float64Array([0.5]));
    expectClose(at(kinematics, 1), [1, 0, 0]);
    kinematics.update(new Float64Array([0.5 + Math.PI / 2]));
    expectClose(at(kinematics, 1), [0, 1, 0]);
    expectClose(at(kinematics, 2), [0, 2, 0]);
  });

  it("slides along an axis that a joint before has turned", () => {
    const kinematics = new Kinematics([
      body(0, [0, 0, 0]),
      body(0, [0, 0, 1], [
        { type: "hinge", axis: [0, 0, 2], pos: [0, 0, 0], index: 1, rest: 0 },
        { type: "slide", axis: [1, 0, 0], pos: [0, 0, 0], index: 0, rest: 0.25 },
      ]),
    ]);
    kinematics.update(new Float64Array([0.75, Math.PI / 2]));
    expectClose(at(kinematics, 1), [0, 0.5, 1]);
    const point = new Float64Array(4);
    kinematics.point(1, [1, 0, 0], point, 1);
    expectClose([...point], [0, 0, 1.5, 1]);
  });

  it("keeps quaternions at length 1 along a chain, and order of the format: w first", () => {
    const hinge = (index: number) =>
      ({ type: "hinge", axis: [1, 2, -1], pos: [0.1, 0, 0.3], index, rest: 0 }) as const;
    const bodies = [body(0, [0, 0, 0])];
    for (let i = 0; i < 6; i++) {
      bodies.push(body(i, [0, 0.1, 0], [{ ...hinge(i), axis: [1, 2, -1], pos: [0.1, 0, 0.3] }]));
    }
    const kinematics = new Kinematics(bodies);
    kinematics.update(new Float64Array(6).fill(0.3));
    const [w, x, y, z] = kinematics.quat.subarray(24, 28);
    const length = Math.hypot(1, 2, -1);
    expect(w).toBeCloseTo(Math.cos(0.9), 9);
    expectClose([x!, y!, z!], [1, 2, -1].map((a) => (a / length) * Math.sin(0.9)));
  });
});
