/** The bar of controls between the picture and the roll. */

import type { Sign } from "./dom";
import { make, sign } from "./dom";
import { clockTime } from "./wording";

export const SPEEDS = [0.25, 0.5, 0.75, 1, 1.25, 1.5, 2];

export const SOUNDS = ["played", "wanted", "none"] as const;
export type SoundName = (typeof SOUNDS)[number];
const SOUND_LABELS: Record<SoundName, string> = {
  played: "Played",
  wanted: "Score",
  none: "Silent",
};

/** What the bar lets people do. */
export interface Actions {
  togglePlay(): void;
  seek(time: number): void;
  frame(count: number): void;
  setRate(rate: number): void;
  setSound(sound: SoundName): void;
  toggleLoop(): void;
  toggleFalling(): void;
  toggleNumbers(): void;
  nextFault(direction: 1 | -1): void;
  toggleWhole(): void;
  film(): void;
  help(): void;
}

export interface BarState {
  time: number;
  duration: number;
  available: number;
  playing: boolean;
  rate: number;
  sound: SoundName;
  sounds: readonly SoundName[];
  looping: boolean;
  falling: boolean;
  numbers: boolean;
  pictured: boolean;
  faults: number;
}

/** Steps of the scrub bar; one is well below a pixel. */
const STEPS = 10000;

export class PlayerBar {
  readonly root = make("div", { class: "bar", role: "group", "aria-label": "Playing" });
  private readonly play: HTMLButtonElement;
  private readonly loop: HTMLButtonElement;
  private readonly falling: HTMLButtonElement;
  private readonly numbers: HTMLButtonElement;
  private readonly faults: HTMLButtonElement;
  private readonly film: HTMLButtonElement;
  private readonly time = make("output", { class: "time" });
  private readonly scrub = make("input", {
    type: "range",
    min: "0",
    max: String(STEPS),
    step: "1",
    value: "0",
    "aria-label": "Time",
  });
  private readonly speed = make("select", {
    class: "speed",
    "aria-label": "Speed",
    title: "Speed (+ and -)",
  });
  private readonly sound = make("select", { "aria-label": "Sound", title: "Sound (m: silent)" });
  private tenths = "";
  private place = -1;
  private reach = -1;
  private offered = "";
  private isPlaying: boolean | null = null;

  constructor(actions: Actions) {
    const button = (name: Sign, label: string, key: string, act: () => void): HTMLButtonElement => {
      const made = make(
        "button",
        { type: "button", "aria-label": label, title: `${label} (${key})` },
        sign(name),
      );
      made.addEventListener("click", act);
      return made;
    };
    this.play = button("play", "Play", "space", () => {
      actions.togglePlay();
    });
    this.play.classList.add("play");
    const back = button("back", "One frame back", ",", () => {
      actions.frame(-1);
    });
    const on = button("on", "One frame on", ".", () => {
      actions.frame(1);
    });
    back.classList.add("step");
    on.classList.add("step");
    this.loop = button("loop", "Loop a stretch", "[ and ]", () => {
      actions.toggleLoop();
    });
    this.falling = button("falling", "Falling notes", "f", () => {
      actions.toggleFalling();
    });
    this.numbers = button("numbers", "Finger numbers", "n", () => {
      actions.toggleNumbers();
    });
    this.faults = button("fault", "Next mistake", "x", () => {
      actions.nextFault(1);
    });
    this.faults.classList.add("faults");
    this.film = button("film", "Save a film", "WebM", () => {
      actions.film();
    });
    const whole = button("whole", "Whole screen", "Esc to leave", () => {
      actions.toggleWhole();
    });
    const help = make(
      "button",
      {
        type: "button",
        class: "help",
        "aria-label": "Keyboard shortcuts",
        title: "Keyboard shortcuts (?)",
      },
      "?",
    );
    help.addEventListener("click", () => {
      actions.help();
    });
    for (const rate of SPEEDS) this.speed.append(make("option", { value: String(rate) }, `${rate}×`));
    this.speed.addEventListener("change", () => {
      actions.setRate(Number(this.speed.value));
    });
    this.sound.addEventListener("change", () => {
      actions.setSound(this.sound.value as SoundName);
    });
    this.scrub.addEventListener("input", () => {
      actions.seek((Number(this.scrub.value) / STEPS) * this.duration);
    });
    this.root.append(
      this.play,
      back,
      on,
      this.time,
      this.scrub,
      this.speed,
      this.sound,
      this.loop,
      this.falling,
      this.numbers,
      this.faults,
      this.film,
      whole,
      help,
    );
  }

  private duration = 0;

  /** Bring the controls up to date; what has not changed is left alone. */
  update(state: BarState): void {
    const { time, duration } = state;
    this.duration = duration;
    const text = `${clockTime(time)} / ${clockTime(duration)}`;
    if (text !== this.tenths) {
      this.tenths = text;
      this.time.textContent = text;
      this.scrub.setAttribute("aria-valuetext", text);
    }
    const place = duration > 0 ? Math.round((time / duration) * STEPS) : 0;
    if (place !== this.place) {
      this.place = place;
      this.scrub.value = String(place);
      this.scrub.style.setProperty("--at", `${place / (STEPS / 100)}%`);
    }
    const reach = duration > 0 ? Math.round((state.available / duration) * 1000) / 10 : 0;
    if (reach !== this.reach) {
      this.reach = reach;
      this.scrub.style.setProperty("--reach", `${reach}%`);
    }
    if (state.playing !== this.isPlaying) {
      this.isPlaying = state.playing;
      const label = state.playing ? "Pause" : "Play";
      this.play.replaceChildren(sign(state.playing ? "pause" : "play"));
      this.play.setAttribute("aria-label", label);
      this.play.title = `${label} (space)`;
    }
    this.offer(state.sounds);
    if (this.speed.value !== String(state.rate)) this.speed.value = String(state.rate);
    if (this.sound.value !== state.sound) this.sound.value = state.sound;
    press(this.loop, state.looping);
    press(this.falling, state.falling);
    press(this.numbers, state.numbers);
    for (const needsPicture of [this.falling, this.film]) {
      if (needsPicture.hidden === state.pictured) needsPicture.hidden = !state.pictured;
    }
    const none = state.faults === 0;
    if (this.faults.hidden !== none) this.faults.hidden = none;
    const count = String(state.faults);
    if (this.faults.dataset["count"] !== count) this.faults.dataset["count"] = count;
  }

  private offer(sounds: readonly SoundName[]): void {
    const names = sounds.join();
    if (names === this.offered) return;
    this.offered = names;
    this.sound.replaceChildren(
      ...sounds.map((name) => make("option", { value: name }, SOUND_LABELS[name])),
    );
    this.sound.hidden = sounds.length < 2;
  }
}

function press(button: HTMLButtonElement, pressed: boolean): void {
  const value = String(pressed);
  if (button.getAttribute("aria-pressed") !== value) button.setAttribute("aria-pressed", value);
}
