/** A few words beside what somebody points at. */

import { make } from "./dom";

export class Tip {
  readonly root = make("div", { class: "tip", role: "status" });

  /**
   * Show a text; null hides it.
   *
   * @param x place of its middle in what it lies over [px]; towards an edge it gives way.
   * @param width of what it lies over [px].
   * @param y of its lower edge [px]; without it, where the style sheet has it.
   */
  show(text: string, x: number, width: number, y?: number): void {
    const { root } = this;
    if (root.textContent !== text) root.textContent = text;
    root.style.left = `${x}px`;
    root.style.translate = `${(-100 * x) / width}% ${y === undefined ? 0 : -100}%`;
    if (y !== undefined) root.style.top = `${y}px`;
    root.classList.add("seen");
  }

  hide(): void {
    this.root.classList.remove("seen");
  }
}
