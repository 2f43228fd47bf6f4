/** Lets a mouse, fingers and the keyboard steer the camera. */

import type { CameraRig } from "./cameras";

/** [rad] for a drag over the picture's height. */
const TURN = 2.6;
const WHEEL = 0.0012;
const KEY_TURN = 0.09;
const KEY_ZOOM = 1.1;
const KEY_PAN = 0.05;

export function steerByPointer(view: HTMLElement, rig: () => CameraRig | null): void {
  const down = new Map<number, { x: number; y: number }>();
  view.addEventListener("pointerdown", (event) => {
    down.set(event.pointerId, { x: event.clientX, y: event.clientY });
    view.setPointerCapture(event.pointerId);
  });
  for (const end of ["pointerup", "pointercancel"] as const) {
    view.addEventListener(end, (event) => down.delete(event.pointerId));
  }
  view.addEventListener("pointermove", (event) => {
    const at = down.get(event.pointerId);
    const camera = rig();
    if (!at || !camera) return;
    const height = view.clientHeight;
    const x = (event.clientX - at.x) / height;
    const y = (event.clientY - at.y) / height;
    if (down.size === 2) {
      // Each of two fingers moves half of what they move together.
      const other = [...down].find(([id]) => id !== event.pointerId)![1];
      const before = Math.hypot(at.x - other.x, at.y - other.y);
      const after = Math.hypot(event.clientX - other.x, event.clientY - other.y);
      if (before > 0 && after > 0) camera.zoom(before / after);
      camera.pan(-x / 2, y / 2);
    } else if (event.shiftKey || (event.buttons & 6) !== 0) {
      camera.pan(-x, y);
    } else {
      camera.orbit(-x * TURN, -y * TURN);
    }
    at.x = event.clientX;
    at.y = event.clientY;
  });
  view.addEventListener("contextmenu", (event) => {
    event.preventDefault();
  });
  view.addEventListener(
    "wheel",
    (event) => {
      // A page that is scrolled past the picture goes on scrolling.
      if (!view.matches(":focus") && !event.ctrlKey) return;
      event.preventDefault();
      const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 24 : 1;
      rig()?.zoom(Math.exp(event.deltaY * lines * WHEEL));
    },
    { passive: false },
  );
}

/** Steer by the keys W A S D, with shift sideways, and Q E; says whether the key was one of them. */
export function steerByKey(event: KeyboardEvent, rig: CameraRig): boolean {
  const move = event.shiftKey
    ? (x: number, y: number): void => {
        rig.pan(x * KEY_PAN, y * KEY_PAN);
      }
    : (x: number, y: number): void => {
        rig.orbit(x * KEY_TURN, -y * KEY_TURN);
      };
  switch (event.code) {
    case "KeyA":
      move(-1, 0);
      return true;
    case "KeyD":
      move(1, 0);
      return true;
    case "KeyW":
      move(0, 1);
      return true;
    case "KeyS":
      move(0, -1);
      return true;
    case "KeyQ":
      rig.zoom(KEY_ZOOM);
      return true;
    case "KeyE":
      rig.zoom(1 / KEY_ZOOM);
      return true;
    default:
      return false;
  }
}
