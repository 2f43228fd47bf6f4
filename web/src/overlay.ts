/** What lies over the picture: cameras to choose, and messages while there is nothing to see. */

import type { ViewName } from "./cameras";
import { VIEWS } from "./cameras";
import { make, sign } from "./dom";
import type { ReplayData } from "./replay_data";

const LABELS: Record<ViewName, string> = {
  player: "Player",
  audience: "Audience",
  top: "Top",
  keys: "Along keys",
  left: "Left hand",
  right: "Right hand",
};

export class Overlay {
  readonly root = make("div", { class: "overlay" });
  private readonly cameras = make("div", {
    class: "cameras",
    role: "group",
    "aria-label": "Cameras",
  });
  private readonly buttons = new Map<ViewName, HTMLButtonElement>();
  private readonly caption = make("div", { class: "caption" });
  private readonly start = make(
    "button",
    { class: "start", type: "button", "aria-label": "Play" },
    sign("play"),
  );
  private readonly spinner = make("div", { class: "spinner", role: "status" });
  private readonly progress = make("progress", { max: "1" });
  private readonly phase = make("span");
  private readonly planning = make("div", { class: "planning", role: "status" });
  private readonly message = make("div", { class: "message", role: "alert" });
  private view: ViewName | null | undefined;

  constructor(choose: (view: ViewName) => void, play: () => void) {
    VIEWS.forEach((view, i) => {
      const button = make(
        "button",
        { type: "button", "aria-pressed": "false", title: `${LABELS[view]} (${i + 1})` },
        LABELS[view],
      );
      button.addEventListener("click", () => {
        choose(view);
      });
      this.buttons.set(view, button);
      this.cameras.append(button);
    });
    this.start.addEventListener("click", play);
    this.planning.append(this.phase, this.progress);
    this.spinner.setAttribute("aria-label", "Waiting");
    this.root.append(
      this.cameras,
      this.caption,
      this.start,
      this.spinner,
      this.planning,
      this.message,
    );
    for (const hidden of [this.cameras, this.start, this.spinner, this.planning, this.message]) {
      hidden.hidden = true;
    }
  }

  /** Show which preset the eye is at. */
  setView(view: ViewName | null): void {
    if (view === this.view) return;
    this.view = view;
    for (const [name, button] of this.buttons) {
      button.setAttribute("aria-pressed", String(name === view));
    }
  }

  setMessage(message: string | null): void {
    setText(this.message, message ?? "");
    show(this.message, message !== null);
  }

  /** Show how much of a film is made; null where none is. */
  setFilming(part: number | null): void {
    show(this.planning, part !== null);
    if (part === null) return;
    setText(this.phase, "Making the film");
    this.progress.value = part;
  }

  /**
   * Show what there is to wait for.
   *
   * @param loading whether a replay was asked for.
   * @param untouched whether nobody has played anything yet.
   */
  update(
    data: ReplayData,
    state: {
      loading: boolean;
      playing: boolean;
      waiting: boolean;
      untouched: boolean;
      pictured: boolean;
    },
  ): void {
    const { head, plan, motion } = data;
    if (head) setText(this.caption, `${head.title} — ${head.player}, effort ${head.effort}`);
    const begun = (motion?.poses ?? 0) > 0;
    show(this.cameras, state.pictured);
    show(this.caption, state.pictured);
    show(this.start, begun && state.untouched && !state.playing);
    show(this.planning, !begun && plan !== null && !data.ended);
    show(
      this.spinner,
      state.loading &&
        !data.ended &&
        ((!begun && plan === null) || (begun && state.waiting)) &&
        !this.hasMessage,
    );
    if (plan && !begun) {
      setText(this.phase, plan.phase);
      if (plan.total > 0) this.progress.value = plan.done / plan.total;
      else this.progress.removeAttribute("value");
    }
  }

  private get hasMessage(): boolean {
    return !this.message.hidden;
  }
}

function setText(element: HTMLElement, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

function show(element: HTMLElement, shown: boolean): void {
  if (element.hidden === shown) element.hidden = !shown;
}
