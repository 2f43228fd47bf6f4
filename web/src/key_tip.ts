/** Tells of the note of a key that somebody points at in the picture. */

import { hitAt, hitText } from "./hits";
import { Pointing } from "./pointing";
import type { ReplayData } from "./replay_data";
import { Tip } from "./tip";
import type { View3D } from "./view3d";
import { MARKED } from "./view3d";

/** [px] The words stand so far above the pointer, and at least so far below the picture's edge. */
const ABOVE = 14;
const LOWEST_TOP = 90;

export class KeyTip {
  private readonly tip = new Tip();
  readonly root = this.tip.root;
  private readonly pointing: Pointing;
  private key = -1;
  private text: string | null = null;

  /**
   * @param canvas of the picture.
   */
  constructor(private readonly canvas: HTMLCanvasElement) {
    this.pointing = new Pointing(canvas);
  }

  /** Tell of nothing until somebody points again. */
  hide(): void {
    this.key = -1;
    this.text = null;
    this.tip.hide();
  }

  /** Follow the pointer and the notes, once a frame. */
  update(view: View3D, data: ReplayData, time: number): void {
    const { at } = this.pointing;
    // Which key it is, is looked for only where the pointer moves: a hand passes under it often.
    const moved = this.pointing.takeMove();
    if (moved) this.key = at ? view.keyAt(at.x, at.y) : -1;
    const hit = this.key < 0 ? null : hitAt(data, this.key, time - MARKED, time);
    const text = hit && hitText(data, hit);
    if (!moved && text === this.text) return;
    this.text = text;
    if (at && text !== null) {
      this.tip.show(text, at.x, this.canvas.clientWidth, Math.max(at.y - ABOVE, LOWEST_TOP));
    } else {
      this.tip.hide();
    }
  }
}
