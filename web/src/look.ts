/** The colours of the page around the element, which three.js and canvases need as values. */

import type { Heard, Notes } from "./format";

export interface Look {
  page: string;
  paper: string;
  text: string;
  faint: string;
  line: string;
  wrong: string;
  /** Of the light behind the picture, which fades into that of the page. */
  glow: string;
  /** Of the left hand, the right hand, and no hand. */
  hands: [string, string, string];
  dark: boolean;
}

/**
 * Read the colours that hold at an element.
 *
 * @param host the element, whose style sheet gives each a default.
 */
export function lookOf(host: Element): Look {
  const style = getComputedStyle(host);
  const colour = (name: string): string => style.getPropertyValue(`--_${name}`).trim();
  return {
    page: colour("page"),
    paper: colour("paper"),
    text: colour("text"),
    faint: colour("faint"),
    line: colour("line"),
    wrong: colour("wrong"),
    glow: colour("glow"),
    hands: [colour("left"), colour("right"), colour("nobody")],
    dark: colour("dark") === "1",
  };
}

/** Place of a note's colour: 0 left, 1 right, 2 no hand, 3 wrong. */
export type Paint = 0 | 1 | 2 | 3;

export function handPaint(hand: number): Paint {
  return hand === 0 || hand === 1 ? hand : 2;
}

export function heardPaint(heard: Heard, place: number): Paint {
  return heard.verdict[place] === "wrong" ? 3 : handPaint(heard.hand[place]!);
}

export function isMissed(notes: Notes, place: number): boolean {
  return notes.verdict[place] === "missed";
}

/** The colours in the order of `Paint`. */
export function paints(look: Look): [string, string, string, string] {
  return [...look.hands, look.wrong];
}
