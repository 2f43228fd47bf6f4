import { describe, expect, it } from "vitest";

import { BlockParser } from "../src/blocks";
import { ReplayData } from "../src/replay_data";
import { block, head, heard, joined, jsonBlock, moveContent, taken } from "./made_up";

/** Notes that sounded, told by their keys. */
function sounded(from: number, keys: number[]): Uint8Array {
  return heard(from, ...keys.map((key): [number, number, number] => [key, key / 10, key / 10 + 0.3]));
}

describe("ReplayData", () => {
  it("grows while blocks arrive, and ends with the motion", () => {
    const move = block("MOVE", moveContent(0, Array.from({ length: 151 }, () => [0, 0])));
    const growing = taken(head(), move);
    expect(growing.duration).toBe(2);
    expect(growing.ended).toBe(false);
    const done = taken(head(), move, jsonBlock("DONE", { metrics: [["F1", "0.9"]] }));
    expect(done.duration).toBeCloseTo(1.5);
    expect(done.metrics).toEqual([["F1", "0.9"]]);
  });

  it("replaces what was heard from a given note on", () => {
    const data = taken(head(), sounded(0, [1, 2, 3]), sounded(2, [4, 5]));
    expect(data.heard.key).toEqual([1, 2, 4, 5]);
    const found: number[] = [];
    data.heardSpans.visit(0.45, 0.45, (place) => found.push(data.heard.key[place]!));
    expect(found).toEqual([2, 4]);
  });

  it("has another revision with each change, and than any other replay", () => {
    const [one, other] = [taken(head(), sounded(0, [1])), taken(head(), sounded(0, [2]))];
    const seen = [one.revision, other.revision, new ReplayData().revision];
    for (const block of new BlockParser().push(joined(sounded(1, [3])))) one.take(block);
    seen.push(one.revision);
    expect(new Set(seen).size).toBe(seen.length);
  });

  it("skips tags that it does not know", () => {
    expect(taken(head(), block("NEWS", new Uint8Array(3))).head?.title).toBe("<b>A song</b>");
  });

  it("says why it cannot show a replay", () => {
    expect(() => taken(head({ version: 2 }))).toThrow("version 1, not 2");
    expect(() => taken(block("MOVE", moveContent(0, [[0, 0]])))).toThrow("before its head");
    expect(taken(head(), jsonBlock("FAIL", { message: "stopped" })).failure).toBe("stopped");
  });
});
