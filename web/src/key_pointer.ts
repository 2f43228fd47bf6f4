/** Tells of the key under the pointer: what sounds there, what was missed, and why. */

import { make } from "./dom";
import { MARKED, missedAt } from "./missed";
import type { ReplayData } from "./replay_data";
import type { View3D } from "./view3d";
import { heardText, keyName, wantedText } from "./wording";

/** [px] A pointer that moves farther between down and up steers the camera. */
const DRAG = 5;
/** [ms] After a tap the key is told of for so long. */
const TOLD = 4000;

export class KeyPointer {
  readonly tip = make("div", { class: "tip", role: "status" });
  private at: { x: number; y: number } | null = null;
  private until = Infinity;
  private isNew = false;

  listen(canvas: HTMLCanvasElement): void {
    let down: { x: number; y: number } | null = null;
    const point = (event: PointerEvent, until: number): void => {
      this.at = { x: event.offsetX, y: event.offsetY };
      this.until = until;
      this.isNew = true;
    };
    const leave = (): void => {
      this.at = null;
      this.isNew = true;
    };
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons !== 0) leave();
      else if (event.pointerType === "mouse") point(event, Infinity);
    });
    canvas.addEventListener("pointerdown", (event) => {
      down = { x: event.offsetX, y: event.offsetY };
    });
    canvas.addEventListener("pointerup", (event) => {
      if (down && Math.hypot(event.offsetX - down.x, event.offsetY - down.y) < DRAG) {
        point(event, event.pointerType === "mouse" ? Infinity : performance.now() + TOLD);
      }
    });
    canvas.addEventListener("pointerleave", (event) => {
      // A finger leaves as soon as it is lifted.
      if (event.pointerType === "mouse") leave();
    });
  }

  /**
   * Tell of the key, where anything has changed.
   *
   * @param changed whether the picture has, since the frame before.
   */
  update(view: View3D, data: ReplayData, time: number, changed: boolean): void {
    if (this.at && performance.now() > this.until) {
      this.at = null;
      this.isNew = true;
    }
    if (!this.isNew && !(changed && this.at)) return;
    this.isNew = false;
    const key = this.at ? view.keyAt(this.at.x, this.at.y) : null;
    this.tip.classList.toggle("seen", key !== null);
    if (key === null || !this.at) return;
    const text = keyText(data, key, time);
    if (this.tip.textContent !== text) this.tip.textContent = text;
    this.tip.style.left = `${this.at.x}px`;
  }
}

/** What there is to say of a key at a time: of a fault rather than of what is right. */
export function keyText(data: ReplayData, key: number, time: number): string {
  const { notes, heard } = data;
  let text = keyName(key);
  data.heardSpans.visit(time, time, (place) => {
    if (heard.key[place] === key && heard.off[place]! > time) text = heardText(heard, place);
  });
  data.noteSpans.visit(time - MARKED, time, (place) => {
    if (notes.key[place] === key && missedAt(notes, place, time)) text = wantedText(notes, place);
  });
  return text;
}
