/** One line for the user, which stays until it is dismissed or another takes its place. */

import { make } from "../dom";

export class Notice {
  readonly root = make("div", { class: "message", role: "alert", hidden: "" });
  private readonly line = make("span");

  constructor() {
    const dismiss = make("button", { type: "button", "aria-label": "Dismiss" }, "×");
    dismiss.addEventListener("click", () => {
      this.tell(null);
    });
    this.root.append(this.line, dismiss);
  }

  tell(line: string | null): void {
    this.line.textContent = line ?? "";
    this.root.hidden = line === null;
  }
}
