import { Color } from "three";
import { describe, expect, it } from "vitest";

import { contrast, inkOn } from "../src/contrast";

describe("contrast", () => {
  it("is that of the guidelines", () => {
    expect(contrast(new Color("#000"), new Color("#fff"))).toBeCloseTo(21);
    expect(contrast(new Color("#777"), new Color("#fff"))).toBeCloseTo(4.48, 2);
    expect(contrast(new Color("#123456"), new Color("#123456"))).toBe(1);
  });

  it("finds the ink that can be read", () => {
    const inks = ["#1c2430", "#ffffff"] as const;
    expect(inkOn(new Color("#2467c9"), inks)).toBe("#ffffff");
    expect(inkOn(new Color("#e58a00"), inks)).toBe("#1c2430");
  });
});
