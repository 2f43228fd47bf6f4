/** Where somebody points, without meaning to drag: a mouse at rest, or a finger that tapped. */

/** [px] A pointer that moves farther drags. */
export const DRAG = 5;

export class Pointing {
  /** Place in the element [px]; null where nobody points. */
  at: { x: number; y: number } | null = null;
  private hasMoved = false;

  constructor(element: HTMLElement) {
    let start = { x: 0, y: 0 };
    const point = (at: { x: number; y: number } | null): void => {
      this.at = at;
      this.hasMoved = true;
    };
    const here = ({ offsetX: x, offsetY: y }: PointerEvent): { x: number; y: number } => ({ x, y });
    element.addEventListener("pointerdown", (event) => {
      start = here(event);
      point(null);
    });
    element.addEventListener("pointermove", (event) => {
      if (event.buttons === 0) point(here(event));
    });
    element.addEventListener("pointerup", (event) => {
      const at = here(event);
      if (event.isPrimary && Math.hypot(at.x - start.x, at.y - start.y) < DRAG) point(at);
    });
    element.addEventListener("pointerleave", (event) => {
      // A finger leaves as soon as it has tapped.
      if (event.pointerType !== "touch") point(null);
    });
    element.addEventListener("pointercancel", () => {
      point(null);
    });
  }

  /** Whether somebody has pointed elsewhere since this was asked for. */
  takeMove(): boolean {
    const moved = this.hasMoved;
    this.hasMoved = false;
    return moved;
  }
}
