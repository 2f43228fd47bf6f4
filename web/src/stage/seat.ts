/** A place in which one performance is shown. */

import { make } from "../dom";
import type { ReplayElement } from "../replay_element";
import * as api from "./api";
import { Notice } from "./notice";

const DOWNLOADS = [
  ["MIDI", "performance.mid"],
  ["sound", "performance.wav"],
  ["arrays", "performance.npz"],
  ["report", "report.html"],
] as const;

export class Seat {
  readonly root = make("div", { class: "seat" });
  readonly replay: ReplayElement;
  readonly notice = new Notice();
  private readonly remarks = make("p", { class: "remarks", hidden: "" });
  private readonly downloads = make("p", { class: "downloads", hidden: "" });
  private job: string | null = null;
  /** Counts what was asked for, of which only the last is shown. */
  private asked = 0;

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
    this.root.append(this.notice.root, this.replay, this.remarks, this.downloads);
  }

  /** Whether something is being played for it. */
  get busy(): boolean {
    return this.job !== null && ["loading", "planning", "growing"].includes(this.replay.state);
  }

  /** Play a song, or show a saved performance, in place of what was there. */
  async show(asked: Parameters<typeof api.start>[1]): Promise<void> {
    this.notice.tell(null);
    this.downloads.hidden = true;
    const mine = ++this.asked;
    const job = await api.start(this.number, asked);
    if (mine !== this.asked) {
      // Something else was asked for meanwhile, or nothing any more.
      await api.stop(job);
      return;
    }
    this.job = job;
    this.replay.currentTime = 0;
    // Of a saved performance the sound is there in the end.
    this.replay.sound = "song" in asked ? `jobs/${job}/sound` : null;
    this.replay.wanted = null;
    this.replay.src = `jobs/${job}/replay`;
    this.changed();
  }

  async stop(): Promise<void> {
    if (this.job !== null && this.busy) await api.stop(this.job);
  }

  /** Show nothing, and end what is being played for it. */
  async clear(): Promise<void> {
    this.asked++;
    // Whether there is anything to stop, the replay says as long as it is there.
    const stopped = this.stop();
    const { replay } = this;
    this.job = null;
    this.notice.tell(null);
    this.downloads.hidden = true;
    replay.follow(null);
    replay.src = replay.sound = replay.wanted = null;
    await stopped;
  }

  private takeState(): void {
    const { job, replay } = this;
    const remarks = replay.head?.remarks ?? [];
    this.remarks.textContent = `While the score was read: ${remarks.join("; ")}.`;
    this.remarks.hidden = remarks.length === 0;
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
