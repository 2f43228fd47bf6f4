/** What keys do. */

import type { ViewName } from "./cameras";
import { VIEWS } from "./cameras";
import type { Actions } from "./player_bar";
import { SPEEDS } from "./player_bar";

/** [s] The arrow keys go so far. */
const JUMP = 2;

export interface KeyActions extends Actions {
  readonly time: number;
  readonly rate: number;
  showView(view: ViewName): void;
  loopFrom(): void;
  loopTo(): void;
  endLoop(): void;
  mute(): void;
  zoomRoll(factor: number): void;
  steer(event: KeyboardEvent): boolean;
}

/** Do what a key asks for; says whether it asked for anything. */
export function act(event: KeyboardEvent, actions: KeyActions): boolean {
  if (event.ctrlKey || event.metaKey || event.altKey) return false;
  const target = event.composedPath()[0];
  if (target instanceof HTMLSelectElement || target instanceof HTMLDialogElement) return false;
  // The browser itself presses a button that has the focus.
  if (target instanceof HTMLButtonElement && /^( |Enter)$/.test(event.key)) return false;
  const speed = (step: number): void => {
    const at = SPEEDS.indexOf(actions.rate);
    actions.setRate(SPEEDS[Math.min(Math.max(at + step, 0), SPEEDS.length - 1)]!);
  };
  switch (event.key) {
    case " ":
      actions.togglePlay();
      return true;
    case "ArrowLeft":
      actions.seek(actions.time - JUMP);
      return true;
    case "ArrowRight":
      actions.seek(actions.time + JUMP);
      return true;
    case "Home":
      actions.seek(0);
      return true;
    case ",":
      actions.frame(-1);
      return true;
    case ".":
      actions.frame(1);
      return true;
    case "[":
      actions.loopFrom();
      return true;
    case "]":
      actions.loopTo();
      return true;
    case "l":
      actions.endLoop();
      return true;
    case "+":
    case "=":
      speed(1);
      return true;
    case "-":
      speed(-1);
      return true;
    case "f":
      actions.toggleFalling();
      return true;
    case "n":
      actions.toggleNumbers();
      return true;
    case "m":
      actions.mute();
      return true;
    case "x":
      actions.nextFault(1);
      return true;
    case "X":
      actions.nextFault(-1);
      return true;
    case "z":
      actions.zoomRoll(1.25);
      return true;
    case "Z":
      actions.zoomRoll(0.8);
      return true;
    case "?":
      actions.help();
      return true;
  }
  const view = VIEWS[Number(event.key) - 1];
  if (view) {
    actions.showView(view);
    return true;
  }
  return actions.steer(event);
}
