/** When a missed note is marked at its key. */

import type { Notes } from "./format";
import { isMissed } from "./look";

/** [s] How long at least. */
export const MARKED = 0.5;

/** Whether a note is marked as missed at a time; it is at its latest `MARKED` after its end. */
export function missedAt(notes: Notes, place: number, time: number): boolean {
  return (
    isMissed(notes, place) &&
    notes.onset[place]! <= time &&
    Math.max(notes.offset[place]!, notes.onset[place]! + MARKED) >= time
  );
}
