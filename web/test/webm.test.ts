import { describe, expect, it } from "vitest";

import type { Packet } from "../src/webm";
import { webm } from "../src/webm";

const SEGMENT = 0x18538067;
const CLUSTER = 0x1f43b675;
const MASTERS = new Set([SEGMENT, 0x1c53bb6b, 0xbb, 0xb7]);

interface Element {
  name: number;
  start: number;
  content: Uint8Array;
  inside: Element[];
}

/** Read elements as a player would, from their lengths alone. */
function elements(bytes: Uint8Array, offset = 0): Element[] {
  const found: Element[] = [];
  let at = 0;
  while (at < bytes.length) {
    const start = offset + at;
    const idLength = Math.clz32(bytes[at]!) - 23;
    let name = 0;
    for (let i = 0; i < idLength; i++) name = name * 256 + bytes[at + i]!;
    at += idLength;
    const view = new DataView(bytes.buffer, bytes.byteOffset + at, 8);
    const length = Number(view.getBigUint64(0) & 0x00ffffffffffffffn);
    at += 8;
    const content = bytes.subarray(at, at + length);
    expect(content.length).toBe(length);
    const inside = MASTERS.has(name) ? elements(content, offset + at) : [];
    found.push({ name, start, content, inside });
    at += length;
  }
  return found;
}

function number(element: Element): number {
  return Number(new DataView(element.content.buffer, element.content.byteOffset).getBigUint64(0));
}

describe("webm", () => {
  it("makes a file whose cues point at its clusters", async () => {
    const packets: Packet[] = Array.from({ length: 10 }, (_, i) => ({
      track: "video",
      time: i * 500,
      isKey: i % 4 === 0,
      data: new Uint8Array(10 + i),
    }));
    const film = webm({ codec: "V_VP9", width: 64, height: 36 }, null, packets, 5000);
    const whole = elements(new Uint8Array(await film.arrayBuffer()));
    const segment = whole.find(({ name }) => name === SEGMENT)!;
    const clusters = segment.inside.filter(({ name }) => name === CLUSTER);
    expect(clusters).toHaveLength(3);
    const first = segment.inside[0]!.start;
    const cues = segment.inside.find(({ name }) => name === 0x1c53bb6b)!;
    expect(
      cues.inside.map(({ inside }) => [number(inside[0]!), number(inside[1]!.inside[1]!) + first]),
    ).toEqual(clusters.map(({ start }, i) => [i * 2000, start]));
  });
});
