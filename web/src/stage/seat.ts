/** A place in which one performance is shown. */

import { make } from "../dom";
import type { ReplayElement } from "../replay_element";
import * as api from "./api";

const DOWNLOADS = [
  ["MIDI", "performance.mid"],
  ["sound", "performance.wav"],
  ["arrays", "performance.npz"],
  ["report", "report.html"],
] as const;

export class Seat {
  readonly root = make("div", { class: "seat" });
  readonly replay: ReplayElement;
  private readonly message = make("p", { class: "message", role: "alert", hidden: "" });
  private readonly downloads = make("p", { class: "downloads", hidden: "" });
  private job: string | null = null;

  /**
   * @param number of the seat in the page.
   * @param changed called when what it shows has changed.
   */
  constructor(
    private readonly number: number,
    private readonly changed: () => void,
  ) {
    this.replay = make("pianomime-replay" as "div") as unknown as ReplayElement;
    this.replay.addEventListener("statechange", () => {
      this.takeState();
    });
    this.root.append(this.message, this.replay, this.downloads);
  }

  /** Whether something is being played for it. */
  get busy(): boolean {
    return this.job !== null && ["loading", "planning", "growing"].includes(this.replay.state);
  }

  /** Play a song, or show a saved performance, in place of what was there. */
  async show(asked: Parameters<typeof api.start>[1]): Promise<void> {
    this.tell(null);
    this.downloads.hidden = true;
    const job = await api.start(this.number, asked);
    this.job = job;
    this.replay.currentTime = 0;
    // Of a saved performance the sound is there in the end.
    this.replay.sound = "song" in asked ? `jobs/${job}/sound` : null;
    this.replay.wanted = null;
    this.replay.src = `jobs/${job}/replay`;
    // It waits for what is to come. Asked for by a click, so that the browser lets it sound.
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) this.replay.play();
    this.changed();
  }

  async stop(): Promise<void> {
    if (this.job !== null && this.busy) await api.stop(this.job);
  }

  /** One line for the user, or none. */
  tell(line: string | null): void {
    this.message.textContent = line ?? "";
    this.message.hidden = line === null;
  }

  private takeState(): void {
    const { job, replay } = this;
    if (job !== null && replay.state === "done") {
      // Only the finished sound can be entered anywhere.
      replay.sound = `jobs/${job}/sound?whole`;
      replay.wanted = `jobs/${job}/wanted`;
      this.downloads.replaceChildren(
        "Download: ",
        ...DOWNLOADS.flatMap(([label, name]) => {
          const link = make("a", { href: `jobs/${job}/files/${name}` }, label);
          if (name === "report.html") link.target = "_blank";
          else link.download = "";
          return [link, " "];
        }),
      );
      this.downloads.hidden = false;
    }
    this.changed();
  }
}
