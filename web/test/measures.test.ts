import { expect, test } from "vitest";
import { better, side } from "../src/stage/measures";

test("more is better for scores, less for faults", () => {
  expect(better("note F1, 50 ms", "0.970", "0.950")).toBe(0);
  expect(better("note F1, 50 ms", "0.950", "0.970")).toBe(1);
  expect(better("phantom notes a minute", "4.0", "8.0")).toBe(0);
  expect(better("hands overlap", "4.0%", "0.1%")).toBe(1);
});

test("nothing is better where nothing can be told", () => {
  expect(better("note F1, 50 ms", "0.970", "0.970")).toBe(-1);
  expect(better("note F1, 50 ms", "-", "0.970")).toBe(-1);
  expect(better("onset error, p5, p50, p95 [ms]", "-1, +5, +11", "-6, +2, +13")).toBe(-1);
});

test("rows are those of the first", () => {
  expect(side([["a", "1"], ["b", "2"]], [["b", "3"], ["c", "4"]])).toEqual([
    ["a", "1", "-"],
    ["b", "2", "3"],
  ]);
});
