import { describe, expect, it } from "vitest";

import { Motion } from "../src/motion";
import { moveContent } from "./made_up";

const POSES = Array.from({ length: 23 }, (_, i) => [
  i * 100,
  Math.round(30_000 * Math.sin(i)),
  i % 2 ? -32_768 : 32_767,
]);

/** The poses in blocks of different lengths. */
function motion(): Motion {
  const made = new Motion(100, 3);
  made.add(moveContent(0, POSES.slice(0, 1)));
  made.add(moveContent(1, POSES.slice(1, 9)));
  made.add(moveContent(9, POSES.slice(9)));
  return made;
}

describe("Motion", () => {
  it("gives back each pose, in any order, also where differences wrap around", () => {
    const made = motion();
    const pose = new Float64Array(3);
    for (const i of [22, 0, 9, 8, 1, 17, 3]) {
      made.sample(i / 100, pose);
      POSES[i]!.forEach((value, joint) => {
        expect(pose[joint]).toBeCloseTo(value * 1e-4, 8);
      });
    }
  });

  it("moves evenly between poses of even motion", () => {
    const made = motion();
    const pose = new Float64Array(3);
    for (const place of [1.5, 8.25, 8.9, 15.01]) {
      made.sample(place / 100, pose);
      expect(pose[0]).toBeCloseTo(place * 0.01, 8);
    }
  });

  it("stays at its ends", () => {
    const made = motion();
    const pose = new Float64Array(3);
    made.sample(-1, pose);
    expect(pose[0]).toBe(0);
    made.sample(99, pose);
    expect(pose[0]).toBeCloseTo(0.22, 8);
    expect(made.end).toBeCloseTo(0.22);
  });

  it("knows nothing at first, and one pose is enough", () => {
    const made = new Motion(100, 1);
    const pose = new Float64Array([5]);
    expect(made.end).toBe(-1);
    made.sample(0, pose);
    expect(pose[0]).toBe(0);
    made.add(moveContent(0, [[1000]]));
    made.sample(0.5, pose);
    expect(pose[0]).toBeCloseTo(0.1);
  });

  it("refuses poses that leave a gap, or have another number of joints", () => {
    const made = motion();
    expect(() => {
      made.add(moveContent(24, [[0, 0, 0]]));
    }).toThrow("fit together");
    expect(() => {
      made.add(moveContent(23, [[0, 0]]));
    }).toThrow("fit together");
  });
});
