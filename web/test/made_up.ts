/** Small replays that tests are made of. */

import { BlockParser } from "../src/blocks";
import type { Body, Heard, Notes, Quad, Triple } from "../src/format";
import { ReplayData } from "../src/replay_data";

const encoder = new TextEncoder();

export function block(tag: string, content: Uint8Array): Uint8Array {
  const bytes = new Uint8Array(8 + content.length);
  bytes.set(encoder.encode(tag));
  new DataView(bytes.buffer).setUint32(4, content.length, true);
  bytes.set(content, 8);
  return bytes;
}

export function jsonBlock(tag: string, value: unknown): Uint8Array {
  return block(tag, encoder.encode(JSON.stringify(value)));
}

/** The content of a `MOVE` block, from whole numbers pose by pose. */
export function moveContent(first: number, poses: number[][]): Uint8Array<ArrayBuffer> {
  const positions = poses[0]?.length ?? 0;
  const content = new Uint8Array(8 + 2 * poses.length * positions);
  const view = new DataView(content.buffer);
  view.setUint32(0, first, true);
  view.setUint32(4, poses.length, true);
  for (let joint = 0; joint < positions; joint++) {
    for (let pose = 0; pose < poses.length; pose++) {
      const change = poses[pose]![joint]! - (pose > 0 ? poses[pose - 1]![joint]! : 0);
      view.setInt16(8 + 2 * (joint * poses.length + pose), change, true);
    }
  }
  return content;
}

export function head(more: object = {}): Uint8Array {
  return jsonBlock("HEAD", {
    format: "pianomime-replay",
    version: 1,
    title: "<b>A song</b>",
    player: "somebody",
    effort: 0,
    seconds: 2,
    rate: 100,
    positions: 2,
    remarks: [],
    ...more,
  });
}

export function joined(...parts: Uint8Array[]): Uint8Array<ArrayBuffer> {
  const bytes = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let from = 0;
  for (const part of parts) {
    bytes.set(part, from);
    from += part.length;
  }
  return bytes;
}

export function body(parent: number, pos: Triple, joints: Body["joints"] = []): Body {
  const quat: Quad = [1, 0, 0, 0];
  return { name: `body ${parent}`, parent, pos, quat, joints };
}

/** What a reader knows after some blocks. */
export function taken(...parts: Uint8Array[]): ReplayData {
  const data = new ReplayData();
  for (const each of new BlockParser().push(joined(...parts))) data.take(each);
  return data;
}

/** A note of the score: key, onset, offset, and why it was missed, if it was. */
export function notes(...given: [number, number, number, string?][]): Uint8Array {
  return jsonBlock("NOTE", {
    key: given.map(([key]) => key),
    onset: given.map(([, onset]) => onset),
    offset: given.map(([, , offset]) => offset),
    velocity: given.map(() => 64),
    hand: given.map(() => 1),
    finger: given.map(() => 0),
    verdict: given.map(([, , , cause]) => (cause === undefined ? "played" : "missed")),
    cause: given.map(([, , , cause]) => cause ?? null),
  } satisfies Notes);
}

/** A note that sounded: key, from, to, and why it is wrong, if it is. */
export function heard(from: number, ...given: [number, number, number, string?][]): Uint8Array {
  return jsonBlock("HEAR", {
    from,
    key: given.map(([key]) => key),
    on: given.map(([, on]) => on),
    off: given.map(([, , off]) => off),
    velocity: given.map(() => 60),
    hand: given.map(() => 0),
    finger: given.map(() => 1),
    verdict: given.map(([, , , cause]) => (cause === undefined ? "right" : "wrong")),
    cause: given.map(([, , , cause]) => cause ?? null),
  } satisfies Heard & { from: number });
}
