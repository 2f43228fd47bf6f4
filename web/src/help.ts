/** The list of keyboard shortcuts. */

import { make } from "./dom";

const SHORTCUTS: [string, string][] = [
  ["space", "play, pause"],
  ["← →", "two seconds back, on"],
  [", .", "one frame back, on"],
  ["[ ]", "loop from here, to here"],
  ["l", "no loop any more"],
  ["+ −", "faster, slower"],
  ["1 to 6", "cameras"],
  ["W A S D", "turn the camera; with shift, move it"],
  ["Q E", "go away, come nearer"],
  ["f", "falling notes"],
  ["n", "finger numbers"],
  ["x", "next mistake; with shift, the one before"],
  ["z", "longer stretch of the roll; with shift, a shorter one"],
  ["m", "sound off, on"],
  ["?", "this list"],
];
const POINTERS =
  "Drag the picture to turn it, with shift or the right button to move it; the wheel or two fingers " +
  "come nearer. Drag the roll to look elsewhere, with shift to loop a stretch; click a note to be there. " +
  "Point at a key or a note, or tap it, to read what became of it.";

export function helpDialog(): HTMLDialogElement {
  const rows = SHORTCUTS.map(([keys, what]) =>
    make("tr", {}, make("th", { scope: "row" }, keys), make("td", {}, what)),
  );
  const close = make("button", { type: "button" }, "Close");
  const dialog = make(
    "dialog",
    { "aria-label": "Keyboard shortcuts" },
    make("table", {}, make("tbody", {}, ...rows)),
    make("p", {}, POINTERS),
    close,
  );
  close.addEventListener("click", () => {
    dialog.close();
  });
  return dialog;
}
