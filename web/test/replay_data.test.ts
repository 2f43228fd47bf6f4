import { describe, expect, it } from "vitest";

import { BlockParser } from "../src/blocks";
import { ReplayData } from "../src/replay_data";
import { block, head, joined, jsonBlock, moveContent } from "./made_up";

function taken(...parts: Uint8Array[]): ReplayData {
  const data = new ReplayData();
  for (const each of new BlockParser().push(joined(...parts))) data.take(each);
  return data;
}

function heard(from: number, keys: number[]): Uint8Array {
  const same = <T>(value: T): T[] => keys.map(() => value);
  return jsonBlock("HEAR", {
    from,
    key: keys,
    on: keys.map((key) => key / 10),
    off: keys.map((key) => key / 10 + 0.3),
    velocity: same(60),
    hand: same(0),
    finger: same(1),
    verdict: same(null),
    cause: same(null),
  });
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
    const data = taken(head(), heard(0, [1, 2, 3]), heard(2, [4, 5]));
    expect(data.heard.key).toEqual([1, 2, 4, 5]);
    const found: number[] = [];
    data.heardSpans.visit(0.45, 0.45, (place) => found.push(data.heard.key[place]!));
    expect(found).toEqual([2, 4]);
  });

  it("has another revision with each change, and than any other replay", () => {
    const [one, other] = [taken(head(), heard(0, [1])), taken(head(), heard(0, [2]))];
    const seen = [one.revision, other.revision, new ReplayData().revision];
    for (const block of new BlockParser().push(joined(heard(1, [3])))) one.take(block);
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
