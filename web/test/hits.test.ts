import { describe, expect, it } from "vitest";

import { hitAt, hitText, hitTime } from "../src/hits";
import { head, heard, notes, taken } from "./made_up";

const data = taken(
  head(),
  notes([40, 0.5, 1, "the finger was late"], [41, 0.5, 1], [42, 0.5, 1, "out of reach"]),
  heard(0, [41, 0.5, 1], [40, 0.6, 0.7], [42, 0.8, 0.9, "a neighbour's finger"]),
);

function text(key: number, from: number, to: number): string | null {
  const hit = hitAt(data, key, from, to);
  return hit && hitText(data, hit);
}

describe("hitAt", () => {
  it("finds the note that says most", () => {
    expect(text(41, 0.7, 0.7)).toBe("D4 at 0:00.5, left index finger, velocity 60");
    expect(text(40, 0.65, 0.65)).toContain("missed: the finger was late");
    expect(text(42, 0.85, 0.85)).toContain("wrong: a neighbour's finger");
    expect(hitTime(data, hitAt(data, 42, 0.85, 0.85)!)).toBe(0.8);
  });

  it("finds nothing on other keys and at other times", () => {
    expect(text(43, 0.5, 1)).toBeNull();
    expect(text(41, 1.1, 2)).toBeNull();
  });
});
