/** Notes that somebody points at. */

import { isMissed } from "./look";
import type { ReplayData } from "./replay_data";
import { heardText, wantedText } from "./wording";

/** A note of the score, or one that sounded, by its place in the lists. */
export interface Hit {
  kind: "wanted" | "heard";
  place: number;
}

/** The note of a key that says most of a stretch of time [s]. */
export function hitAt(data: ReplayData, key: number, from: number, to: number): Hit | null {
  const { notes, heard } = data;
  let found: Hit | null = null;
  data.noteSpans.visit(from, to, (place) => {
    if (notes.key[place] === key) found = { kind: "wanted", place };
  });
  data.heardSpans.visit(from, to, (place) => {
    if (heard.key[place] !== key) return;
    // A missed note says more than one that sounded, unless that was wrong.
    const missed = found?.kind === "wanted" && isMissed(notes, found.place);
    if (!missed || heard.verdict[place] === "wrong") found = { kind: "heard", place };
  });
  return found;
}

export function hitText({ notes, heard }: ReplayData, { kind, place }: Hit): string {
  return kind === "wanted" ? wantedText(notes, place) : heardText(heard, place);
}

/** When a note begins [s]. */
export function hitTime({ notes, heard }: ReplayData, { kind, place }: Hit): number {
  return kind === "wanted" ? notes.onset[place]! : heard.on[place]!;
}
