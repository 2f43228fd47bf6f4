/** The app: a library beside the performance that is watched, or beside two that are compared. */

import { make } from "../dom";
import { clockTime } from "../wording";
import * as api from "./api";
import type { Dropped } from "./dropped";
import { droppedWith } from "./dropped";
import { better, side } from "./measures";
import { Notice } from "./notice";
import { Seat } from "./seat";
import style from "./stage.css?inline";
import { uploadAll, uploadsText } from "./uploads";

const EFFORTS = ["0: at once", "1: better", "2: slow", "3: best, slowest"];
const LENGTHS: readonly (readonly [string, number | null])[] = [
  ["first 30 s", 30],
  ["first 2 min", 120],
  ["all of it", null],
];
const ASKS_AGAIN = 2000; // [ms]
const SHOWN_MEASURES = 12;
const LOST = "The stage does not answer. Start `pianomime stage` again, and open the address it prints.";

type Asked = Parameters<typeof api.start>[1];

export class App {
  readonly root = make("div", { class: "stage" });
  private library: api.Library | null = null;
  private last: Asked | null = null;
  private readonly seats: [Seat, Seat];
  private comparing = false;
  private readonly calm = matchMedia("(prefers-reduced-motion: reduce)");
  private waiting = 0;

  private readonly player = make("select", { "aria-label": "Player" });
  private readonly effort = make("select", { "aria-label": "Effort" });
  private readonly world = make("select", { "aria-label": "World" });
  private readonly length = make("select", { "aria-label": "Length" });
  private readonly stopButton = this.button("Stop", () => this.active.stop());
  private readonly againButton = this.button("Try again", () => this.again());
  private readonly compareButton = this.button("Compare", () => {
    this.compare(!this.comparing);
  });
  private readonly find = make("input", { type: "search", placeholder: "Find", "aria-label": "Find" });
  private readonly songs = make("ul");
  private readonly performances = make("ul");
  private readonly unreadable = make("details", { hidden: "" });
  private readonly notHere = make("details", { hidden: "" });
  private readonly notice = new Notice();
  private readonly lost = make("p", { class: "message", role: "alert", hidden: "" }, LOST);
  private readonly chooser = make("input", { type: "file", hidden: "", multiple: "" });
  private readonly measures = make("table", { hidden: "" });
  private readonly seating = make("div", { class: "seats" });
  private readonly empty = make("div", { class: "empty" });

  constructor() {
    document.head.append(make("style", {}, style));
    const changed = (): void => {
      this.takeChange();
    };
    this.seats = [new Seat(0, changed), new Seat(1, changed)];
    this.seats[1].root.hidden = true;
    this.seats[0].root.hidden = true;
    this.effort.append(...EFFORTS.map((text, i) => make("option", { value: `${i}` }, text)));
    this.length.append(...LENGTHS.map(([text], i) => make("option", { value: `${i}` }, text)));
    const drop = this.button("Drop a MIDI file anywhere, or choose one", () => {
      this.chooser.click();
    });
    drop.className = "drop";
    this.empty.append(make("p", {}, "Drop a MIDI file here, and two hands play it."), make("p", {}, "Or choose a song on the left."));
    this.chooser.accept = ".mid,.midi,.kar,.rmi,.rmid,.smf";
    this.chooser.addEventListener("change", () => {
      void this.take({ files: [...(this.chooser.files ?? [])], folders: [] });
      this.chooser.value = "";
    });
    this.find.addEventListener("input", () => {
      this.list();
    });
    this.compareButton.setAttribute("aria-pressed", "false");
    this.seating.append(this.empty, ...this.seats.map((seat) => seat.root));
    this.root.append(
      make("header", {}, make("h1", {}, "The stage"), drop, this.chooser),
      this.lost,
      this.notice.root,
      make(
        "div",
        { class: "settings", role: "group", "aria-label": "How it is played" },
        this.player,
        this.effort,
        this.world,
        this.length,
        this.againButton,
        this.stopButton,
        this.compareButton,
      ),
      make("div", { class: "show" }, this.seating, this.measures),
      make(
        "nav",
        { "aria-label": "Library" },
        this.find,
        make("h2", {}, "Songs"),
        this.songs,
        make("h2", {}, "Performances"),
        this.performances,
        this.unreadable,
        this.notHere,
      ),
    );
    for (const kind of ["dragenter", "dragover"] as const) {
      addEventListener(kind, (event) => {
        event.preventDefault();
        this.root.classList.add("dragged");
      });
    }
    for (const kind of ["dragleave", "drop"] as const) {
      addEventListener(kind, (event) => {
        event.preventDefault();
        if (kind === "drop" || event.relatedTarget === null) this.root.classList.remove("dragged");
      });
    }
    addEventListener("drop", (event) => {
      if (event.dataTransfer) void this.take(droppedWith(event.dataTransfer));
    });
    this.takeChange();
    void this.load();
  }

  private get active(): Seat {
    return this.seats[this.comparing ? 1 : 0];
  }

  private get settings(): api.Settings {
    return {
      player: this.player.value,
      effort: Number(this.effort.value),
      world: this.world.value || null,
      seconds: LENGTHS[Number(this.length.value)]![1],
    };
  }

  private button(text: string, act: () => unknown): HTMLButtonElement {
    const button = make("button", { type: "button" }, text);
    button.addEventListener("click", () => {
      void this.answer(act);
    });
    return button;
  }

  /** Do what the user asks for, who has read by now what was told before. */
  private async answer(act: () => unknown): Promise<void> {
    this.notice.tell(null);
    await this.attempt(act);
  }

  /** Do something, and tell the user if it fails. */
  private async attempt(act: () => unknown): Promise<void> {
    try {
      await act();
    } catch (error) {
      if (error instanceof api.Lost) this.lose();
      else this.notice.tell(error instanceof Error ? error.message : String(error));
    }
  }

  /** The server is gone: ask again, until it is there or the page is closed. */
  private lose(): void {
    this.lost.hidden = false;
    clearTimeout(this.waiting);
    this.waiting = window.setTimeout(() => {
      void this.load();
    }, ASKS_AGAIN);
  }

  private async load(): Promise<void> {
    await this.attempt(async () => {
      this.library = await api.library();
      this.lost.hidden = true;
      this.list();
      if (this.player.options.length === 0) this.offer(this.library);
    });
  }

  /** Fill in what can be chosen, once. */
  private offer({ players, worlds }: api.Library): void {
    for (const { name, why_not: whyNot } of players) {
      const option = make("option", { value: name }, whyNot === null ? name : `${name} (not here)`);
      option.disabled = whyNot !== null;
      this.player.append(option);
    }
    this.world.append(make("option", { value: "" }, "its own world"));
    this.world.append(...worlds.map((name) => make("option", { value: name }, `world ${name}`)));
    const missing = players.filter((player) => player.why_not !== null);
    this.notHere.hidden = missing.length === 0;
    this.notHere.replaceChildren(
      make("summary", {}, `${missing.length} players are not here`),
      ...missing.map(({ name, why_not: whyNot }) => make("p", {}, `${name}: ${whyNot!}`)),
    );
  }

  private list(): void {
    if (this.library === null) return;
    const sought = this.find.value.trim().toLowerCase();
    const entry = (title: string, under: string, asked: () => Asked): HTMLLIElement[] => {
      if (!`${title} ${under}`.toLowerCase().includes(sought)) return [];
      const button = this.button("", () => this.show(asked()));
      button.append(make("b", {}, title), make("small", {}, under));
      return [make("li", {}, button)];
    };
    this.songs.replaceChildren(
      ...this.library.songs.flatMap(({ id, title, seconds, notes }) =>
        entry(title, `${clockTime(seconds)}, ${notes} notes`, () => ({ song: id, ...this.settings })),
      ),
    );
    this.performances.replaceChildren(
      ...this.library.performances.flatMap(({ id, title, player, effort, world, measures }) => {
        const f1 = measures[0] ? `, note F1 ${measures[0][1]}` : "";
        return entry(title, `${player}, effort ${effort}, ${world}${f1}`, () => ({ performance: id }));
      }),
    );
    const { unreadable } = this.library;
    this.unreadable.hidden = unreadable.length === 0;
    this.unreadable.replaceChildren(
      make("summary", {}, `${unreadable.length} files cannot be read`),
      ...unreadable.map((line) => make("p", {}, line)),
    );
  }

  /** Take what was dropped, and play the first that can be. */
  private async take(dropped: Dropped): Promise<void> {
    await this.answer(async () => {
      const uploads = await uploadAll(dropped, this.library?.limit ?? Infinity);
      const line = uploadsText(uploads);
      // Of another drop, something may have been told in the meantime.
      if (line !== null) this.notice.tell(line);
      const [first] = uploads.songs;
      if (first) await this.show({ song: first.id, ...this.settings });
      await this.load();
    });
  }

  private async show(asked: Asked): Promise<void> {
    this.last = asked;
    this.empty.hidden = true;
    const seat = this.active;
    seat.root.hidden = false;
    await seat.show(asked);
    // Two that are compared begin together; the clock waits for the slower one.
    const leader = this.seats[0].replay;
    if (this.comparing) seat.replay.follow(leader);
    leader.currentTime = 0;
    // Asked for by a click, so that the browser lets it sound.
    if (!this.calm.matches) leader.play();
  }

  private async again(): Promise<void> {
    if (this.last === null) return;
    await this.show("song" in this.last ? { ...this.last, ...this.settings } : this.last);
  }

  /** Show what is chosen next beside what is there, or only that again. */
  private compare(on: boolean): void {
    this.comparing = on;
    this.compareButton.setAttribute("aria-pressed", String(on));
    const second = this.seats[1];
    if (on) second.notice.tell("Choose a song or a performance, or try again with other settings.");
    else void this.attempt(() => second.clear());
    second.root.hidden = !on;
    this.takeChange();
  }

  private takeChange(): void {
    const [first, second] = this.seats;
    this.root.classList.toggle("two", this.comparing);
    this.stopButton.disabled = !this.active.busy;
    this.againButton.disabled = this.last === null;
    this.compareButton.disabled = first.replay.state === "empty";
    for (const seat of this.seats) {
      if (seat.replay.state === "failed" && this.lost.hidden) void this.load();
    }
    if (this.active.replay.state === "done") void this.load();
    const [one, other] = [first.replay.metrics, this.comparing ? second.replay.metrics : null];
    this.measures.hidden = one === null;
    if (one === null) return;
    this.measures.replaceChildren(
      ...side(one.slice(0, SHOWN_MEASURES), other ?? []).map(([label, a, b]) => {
        const best = other === null ? -1 : better(label, a, b);
        const cells = [a, ...(other === null ? [] : [b])].map((value, i) =>
          make("td", best === i ? { class: "better" } : {}, value),
        );
        return make("tr", {}, make("th", { scope: "row" }, label), ...cells);
      }),
    );
  }
}
