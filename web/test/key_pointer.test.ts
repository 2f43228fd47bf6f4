import { describe, expect, it } from "vitest";

import { readBlocks } from "../src/blocks";
import { keyText } from "../src/key_pointer";
import { ReplayData } from "../src/replay_data";
import { head, joined, jsonBlock } from "./made_up";

const NOTES = {
  key: [39, 41],
  onset: [1, 2],
  offset: [1.1, 3],
  velocity: [64, 64],
  hand: [1, 1],
  finger: [0, 1],
  verdict: ["missed", "played"],
  cause: ["out of reach", null],
};
const HEARD = {
  first: 0,
  key: [41, 40],
  on: [2, 2.5],
  off: [3, 2.6],
  velocity: [60, 30],
  hand: [1, 1],
  finger: [1, 2],
  verdict: ["right", "wrong"],
  cause: [null, "a neighbour's finger"],
};

async function replay(): Promise<ReplayData> {
  const data = new ReplayData();
  const bytes = joined(head({ seconds: 4 }), jsonBlock("NOTE", NOTES), jsonBlock("HEAR", HEARD));
  const stream = new Response(bytes).body!;
  await readBlocks(stream, (block) => {
    data.take(block);
  });
  return data;
}

describe("the key under the pointer", () => {
  it("tells why a note was missed, as long as it is marked", async () => {
    const data = await replay();
    expect(keyText(data, 39, 0.9)).toBe("C4");
    expect(keyText(data, 39, 1.05)).toContain("missed: out of reach");
    expect(keyText(data, 39, 1.4)).toContain("missed: out of reach");
    expect(keyText(data, 39, 1.6)).toBe("C4");
  });

  it("tells what sounds, and what is wrong with it", async () => {
    const data = await replay();
    expect(keyText(data, 41, 2.5)).toContain("D4 at 0:02.0, right index finger");
    expect(keyText(data, 40, 2.55)).toContain("wrong: a neighbour's finger");
    expect(keyText(data, 40, 2.7)).toBe("C♯4");
  });
});
