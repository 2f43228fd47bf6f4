import { describe, expect, it } from "vitest";

import { clockTime, keyName } from "../src/wording";

describe("wording", () => {
  it("tells times with minutes and tenths", () => {
    expect([0, 59.96, 64.2, 600].map(clockTime)).toEqual(["0:00.0", "0:59.9", "1:04.2", "10:00.0"]);
  });

  it("names keys", () => {
    expect([0, 1, 39, 87].map(keyName)).toEqual(["A0", "A♯0", "C4", "C8"]);
  });
});
