import { describe, expect, it } from "vitest";

import type { Block } from "../src/blocks";
import { BlockParser, readBlocks } from "../src/blocks";
import { block, head, joined, jsonBlock } from "./made_up";

const bytes = joined(head(), block("XYZW", new Uint8Array(70_000).fill(7)), jsonBlock("DONE", {}));

function inPieces(size: number, whole: Uint8Array<ArrayBuffer>) {
  return new ReadableStream<Uint8Array<ArrayBuffer>>({
    start(controller) {
      for (let i = 0; i < whole.length; i += size) controller.enqueue(whole.slice(i, i + size));
      controller.close();
    },
  });
}

async function tagsOf(stream: ReadableStream<Uint8Array<ArrayBuffer>>): Promise<string[]> {
  const tags: string[] = [];
  await readBlocks(stream, (each) => tags.push(each.tag));
  return tags;
}

describe("BlockParser", () => {
  it.each([1, 7, 4096, bytes.length])("finds the same blocks in pieces of %i bytes", (size) => {
    const parser = new BlockParser();
    const blocks: Block[] = [];
    for (let i = 0; i < bytes.length; i += size) {
      blocks.push(...parser.push(bytes.subarray(i, i + size)));
    }
    expect(blocks.map((each) => [each.tag, each.content.length])).toEqual([
      ["HEAD", head().length - 8],
      ["XYZW", 70_000],
      ["DONE", 2],
    ]);
    expect(blocks[1]!.content.every((value) => value === 7)).toBe(true);
    expect(parser.whole).toBe(true);
  });

  it("hands over a block as soon as it is whole", () => {
    const parser = new BlockParser();
    expect(parser.push(head().subarray(0, -1))).toEqual([]);
    expect(parser.whole).toBe(false);
    expect(parser.push(head().subarray(-1))).toHaveLength(1);
  });

  it("refuses what is no replay", () => {
    const page = new TextEncoder().encode("<!doctype html><title>Not found</title>");
    expect(() => new BlockParser().push(page)).toThrow("not a replay");
  });
});

describe("readBlocks", () => {
  it("reads plain and compressed replays, even byte by byte", async () => {
    const short = joined(head(), jsonBlock("DONE", {}));
    const packed = new Uint8Array(
      await new Response(
        inPieces(99, short).pipeThrough(new CompressionStream("gzip")),
      ).arrayBuffer(),
    );
    for (const whole of [short, packed]) {
      for (const size of [1, 5000]) {
        expect(await tagsOf(inPieces(size, whole))).toEqual(["HEAD", "DONE"]);
      }
    }
  });

  it("says when a replay breaks off", async () => {
    await expect(tagsOf(inPieces(100, bytes.slice(0, -1)))).rejects.toThrow("breaks off");
  });
});
