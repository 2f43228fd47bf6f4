/** How times and notes are put into words. */

import type { Heard, Notes } from "./format";

const NAMES = ["C", "C♯", "D", "D♯", "E", "F", "F♯", "G", "G♯", "A", "A♯", "B"];
const FINGERS = ["thumb", "index finger", "middle finger", "ring finger", "little finger"];

/** Minutes, seconds and tenths, such as 1:04.2. */
export function clockTime(seconds: number): string {
  const tenths = Math.floor(seconds * 10 + 1e-6);
  const minutes = Math.floor(tenths / 600);
  const rest = ((tenths % 600) / 10).toFixed(1).padStart(4, "0");
  return `${minutes}:${rest}`;
}

/** Name of a key, 0 (A0) to 87 (C8). */
export function keyName(key: number): string {
  const midi = key + 21;
  return `${NAMES[midi % 12]!}${Math.floor(midi / 12) - 1}`;
}

/** What there is to say of a note of the score. */
export function wantedText(notes: Notes, i: number): string {
  const parts = [`${keyName(notes.key[i]!)} at ${clockTime(notes.onset[i]!)}`];
  parts.push(...who(notes.hand[i]!, notes.finger[i]!));
  if (notes.verdict[i] === "missed") parts.push(blame("missed", notes.cause[i]!));
  return parts.join(", ");
}

/** What there is to say of a note that sounded. */
export function heardText(heard: Heard, i: number): string {
  const parts = [`${keyName(heard.key[i]!)} at ${clockTime(heard.on[i]!)}`];
  parts.push(...who(heard.hand[i]!, heard.finger[i]!));
  parts.push(`velocity ${heard.velocity[i]!}`);
  if (heard.verdict[i] === "wrong") parts.push(blame("wrong", heard.cause[i]!));
  return parts.join(", ");
}

function who(hand: number, finger: number): string[] {
  const parts: string[] = [];
  if (hand >= 0) parts.push(hand === 0 ? "left" : "right");
  if (finger >= 0) parts.push(FINGERS[finger]!);
  return parts.length > 0 ? [parts.join(" ")] : [];
}

function blame(verdict: string, cause: string | null): string {
  return cause === null ? verdict : `${verdict}: ${cause}`;
}
