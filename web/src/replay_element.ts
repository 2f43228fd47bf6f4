/** The custom element `<pianomime-replay>`: brings clock, data, picture, roll and controls together. */

import type { Block } from "./blocks";
import { readBlocks } from "./blocks";
import type { ViewName } from "./cameras";
import type { Showing } from "./clock";
import { Clock } from "./clock";
import { make } from "./dom";
import { Fallback } from "./fallback";
import { film } from "./film";
import type { Head, Quad, Triple } from "./format";
import { helpDialog } from "./help";
import type { Hit } from "./hits";
import { KeyTip } from "./key_tip";
import { Kinematics } from "./kinematics";
import style from "./look.css?inline";
import type { Look } from "./look";
import { isMissed, lookOf } from "./look";
import { Overlay } from "./overlay";
import type { SoundName } from "./player_bar";
import { PlayerBar } from "./player_bar";
import { ReplayData } from "./replay_data";
import { Roll } from "./roll";
import type { KeyActions } from "./shortcuts";
import { act } from "./shortcuts";
import { fromAddress, fromPage } from "./sources";
import { steerByKey, steerByPointer } from "./steering";
import type { Drawing, Shown } from "./view3d";
import { drawingOn, View3D } from "./view3d";

const FRAMES_PER_SECOND = 60;
/** Frames whose own work `stepCost` is the median of. */
const COSTS = 240;
/** [ms] A picture that has not changed for so long is drawn again at its best. */
const REST = 300;
/** [px] */
const FILM_WIDTH = 1280;
const FILM_HEIGHT = 720;

type State = "empty" | "loading" | "planning" | "growing" | "done" | "failed";

interface Fault extends Hit {
  time: number;
}

/** The elements of the page, in the order in which they came; the first has the page's keys. */
const connected = new Set<ReplayElement>();

export class ReplayElement extends HTMLElement implements Showing {
  static readonly observedAttributes = ["src", "data-from", "sound", "wanted"];

  /** Settles when the first picture is drawn, or with what went wrong. */
  ready: Promise<void> = Promise.resolve();

  private data = new ReplayData();
  private readonly ownClock = new Clock(new Audio());
  private clock = this.ownClock;
  /** What the user wants to hear; where that is not there, it is the first that is. */
  private wish: SoundName = "played";
  private playsSound: string | null = null;
  private readonly shown: Shown = { falling: true, numbers: true };
  private faults: Fault[] = [];
  private faultsRevision = -1;
  /** The one that was shown last. */
  private fault: Fault | null = null;

  private readonly bar: PlayerBar;
  private readonly overlay: Overlay;
  private readonly roll: Roll;
  private readonly viewBox = make("div", { class: "view" });
  private readonly help = helpDialog();
  private drawing: Drawing | null = null;
  private view: View3D | null = null;
  private keyTip: KeyTip | null = null;
  private fallback: Fallback | null = null;
  private probe: { kinematics: Kinematics; pose: Float64Array } | null = null;

  private loading: AbortController | null = null;
  private settle: { resolve: () => void; reject: (reason: Error) => void } | null = null;
  private filming: AbortController | null = null;
  private lastState: State = "empty";
  private request = 0;
  private lastNow = 0;
  private lastTime = -1;
  private lastRevision = -1;
  private isStale = true;
  private isVisible = true;
  private isUntouched = true;
  private readonly costs = new Float64Array(COSTS);
  private frames = 0;
  private drawnAt = 0;

  private readonly calm = matchMedia("(prefers-reduced-motion: reduce)");
  private readonly darkness = matchMedia("(prefers-color-scheme: dark)");
  private readonly watcher = new IntersectionObserver((entries) => {
    this.isVisible = entries.at(-1)?.isIntersecting ?? true;
  });

  // Asked for within a frame, a size would make the browser lay out the page anew.
  private readonly measure = new ResizeObserver(([entry]) => {
    if (!entry) return;
    this.width = Math.max(Math.round(entry.contentRect.width), 1);
    this.height = Math.max(Math.round(entry.contentRect.height), 1);
  });
  private width = 16;
  private height = 9;

  constructor() {
    super();
    const actions = this.actions();
    this.bar = new PlayerBar(actions);
    this.overlay = new Overlay(
      (view) => {
        actions.showView(view);
      },
      () => {
        this.play();
      },
    );
    this.roll = new Roll(
      () => this.data,
      () => this.clock,
    );
    this.keyActions = actions;
    const root = this.attachShadow({ mode: "open" });
    const sheet = new CSSStyleSheet();
    sheet.replaceSync(style);
    root.adoptedStyleSheets = [sheet];
    this.viewBox.append(this.overlay.root);
    root.append(this.viewBox, this.bar.root, this.roll.root, this.help);
  }

  private readonly keyActions: KeyActions;

  /** Address of the replay. Setting it, also to the same, loads it anew and keeps the time. */
  get src(): string | null {
    return this.getAttribute("src");
  }

  set src(address: string | null) {
    this.reflect("src", address);
  }

  /** Address of the sound of what was played. Another one goes on at the same time. */
  get sound(): string | null {
    return this.getAttribute("sound") ?? this.inside("sound", "audio");
  }

  set sound(address: string | null) {
    this.reflect("sound", address);
  }

  /** Address of the sound of the score. */
  get wanted(): string | null {
    return this.getAttribute("wanted") ?? this.inside("wanted", "audio");
  }

  set wanted(address: string | null) {
    this.reflect("wanted", address);
  }

  /** Seconds from the beginning. */
  get currentTime(): number {
    return this.clock.currentTime;
  }

  set currentTime(time: number) {
    this.clock.seek(time);
    this.roll.follow();
    this.isUntouched = false;
  }

  /** Length in seconds; that of the song while it is still being played. */
  get duration(): number {
    return this.data.duration;
  }

  /** Up to which time there is motion. */
  get available(): number {
    return this.data.motion?.end ?? -1;
  }

  /** Whether more motion may arrive. */
  get growing(): boolean {
    return this.loading !== null && !this.data.ended;
  }

  get playing(): boolean {
    return this.clock.playing;
  }

  get rate(): number {
    return this.clock.rate;
  }

  set rate(rate: number) {
    this.clock.rate = rate;
  }

  /** What the replay's head says, when it has arrived. */
  get head(): Head | null {
    return this.data.head;
  }

  /** Labels and values of the metrics, when the performance has ended. */
  get metrics(): readonly (readonly [string, string])[] | null {
    return this.data.metrics;
  }

  get state(): State {
    const { data } = this;
    if (data.failure !== null) return "failed";
    if (data.metrics) return "done";
    if (data.motion && data.motion.poses > 0) return "growing";
    if (data.plan) return "planning";
    return this.loading ? "loading" : "empty";
  }

  play(): void {
    this.isUntouched = false;
    this.roll.follow();
    this.clock.play();
  }

  pause(): void {
    this.clock.pause();
  }

  /** Show the time of another element, which then has the sound; null ends that. */
  follow(other: ReplayElement | null): void {
    const { currentTime } = this;
    this.clock.leave(this);
    this.ownClock.pause();
    this.clock = other ? other.clock : this.ownClock;
    this.clock.join(this);
    if (!other) this.clock.seek(currentTime);
    this.isUntouched = false;
  }

  /**
   * Where a body is at a time, by the page's own forward kinematics.
   *
   * @throws Error if there is no such body, or no scene yet.
   */
  bodyPose(name: string, time: number): { pos: Triple; quat: Quad } {
    const { scene, motion } = this.data;
    const body = scene?.bodies.findIndex((each) => each.name === name) ?? -1;
    if (!scene || !motion || body < 0) throw new Error(`There is no body "${name}".`);
    this.probe ??= {
      kinematics: new Kinematics(scene.bodies),
      pose: new Float64Array(motion.positions),
    };
    const { kinematics, pose } = this.probe;
    motion.sample(time, pose);
    kinematics.update(pose);
    return {
      pos: [...kinematics.pos.subarray(3 * body, 3 * body + 3)] as Triple,
      quat: [...kinematics.quat.subarray(4 * body, 4 * body + 4)] as Quad,
    };
  }

  /**
   * Time of the page's own work in a frame [ms], without that of drawing in 3D: the median, since
   * on a busy computer a few frames are interrupted.
   */
  stepCost(): number {
    const costs = this.costs.slice(0, Math.min(this.frames, COSTS)).sort();
    return costs[costs.length >> 1] ?? 0;
  }

  /**
   * Make a film of the picture and the sound: of the loop, or else of the whole.
   *
   * @param fps frames per second.
   * @returns the film as WebM.
   * @throws Error if there is no picture, or the browser encodes no films.
   */
  async record(fps: number): Promise<Blob> {
    const { view, data } = this;
    if (!view?.isPrepared || this.filming) throw new Error("There is no picture to film.");
    const filming = new AbortController();
    this.filming = filming;
    this.pause();
    const [from, to] = this.clock.loop ?? [0, Math.max(this.available, 0)];
    const canvas = make("canvas", { width: String(FILM_WIDTH), height: String(FILM_HEIGHT) });
    const background = canvas.getContext("2d")!;
    view.beginFilm(FILM_WIDTH, FILM_HEIGHT);
    try {
      return await film({
        width: FILM_WIDTH,
        height: FILM_HEIGHT,
        fps,
        from,
        to,
        sound: this.soundName === "none" ? null : this.playsSound,
        draw: (time) => {
          view.update(data, time, this.shown);
          view.moveCamera(1 / fps);
          paintBackdrop(background, lookOf(this));
          background.drawImage(view.drawFilm(), 0, 0);
          return canvas;
        },
        progress: (part) => {
          this.overlay.setFilming(part);
        },
        signal: filming.signal,
      });
    } finally {
      this.filming = null;
      this.overlay.setFilming(null);
      this.isStale = true;
    }
  }

  connectedCallback(): void {
    if (connected.has(this)) return;
    connected.add(this);
    this.clock.join(this);
    this.openPicture();
    this.darkness.addEventListener("change", this.takeLook);
    addEventListener("keydown", this.onKey);
    this.watcher.observe(this);
    this.measure.observe(this.viewBox);
    this.takeLook();
    this.load();
    this.takeSound();
    this.request = requestAnimationFrame(this.frame);
  }

  disconnectedCallback(): void {
    // An element that is only moved is connected again at once.
    queueMicrotask(() => {
      if (!this.isConnected) this.close();
    });
  }

  attributeChangedCallback(name: string): void {
    if (!connected.has(this)) return;
    if (name === "sound" || name === "wanted") this.takeSound();
    else this.load();
  }

  /**
   * Address of what the page has put into the element, to be shown where this script does not run;
   * said once, a long address is in the page once.
   */
  private inside(slot: string, tag: "audio" | "img" | "video"): string | null {
    const found = this.querySelector<HTMLMediaElement | HTMLImageElement>(
      `${tag}[slot=${slot}], [slot=${slot}] ${tag}`,
    );
    return found ? found.currentSrc || found.src : null;
  }

  private reflect(name: string, value: string | null): void {
    if (value === null) this.removeAttribute(name);
    else this.setAttribute(name, value);
  }

  private close(): void {
    connected.delete(this);
    cancelAnimationFrame(this.request);
    this.loading?.abort();
    this.loading = null;
    this.filming?.abort();
    this.clock.leave(this);
    this.ownClock.pause();
    this.darkness.removeEventListener("change", this.takeLook);
    removeEventListener("keydown", this.onKey);
    this.watcher.disconnect();
    this.measure.disconnect();
    this.view?.dispose();
    this.view = null;
    if (this.drawing) {
      // Browsers allow a page few contexts, and collect them late.
      this.drawing.renderer.dispose();
      this.drawing.renderer.forceContextLoss();
      this.drawing.renderer.domElement.remove();
      this.drawing = null;
    }
    this.keyTip?.root.remove();
    this.keyTip = null;
    this.fallback?.root.remove();
    this.fallback = null;
  }

  private openPicture(): void {
    const canvas = make("canvas", {
      tabindex: "0",
      role: "img",
      "aria-label": "The hands at the piano. W, A, S, D, Q and E move the camera; 1 to 6 choose one.",
    });
    this.drawing = drawingOn(canvas);
    if (this.drawing) {
      this.keyTip = new KeyTip(canvas);
      this.viewBox.prepend(canvas);
      this.viewBox.append(this.keyTip.root);
      steerByPointer(canvas, () => this.view?.rig ?? null);
      canvas.addEventListener("webglcontextrestored", () => {
        this.isStale = true;
      });
    } else {
      this.fallback = new Fallback(this.inside("picture", "img"), this.inside("film", "video"));
      this.viewBox.prepend(this.fallback.root);
    }
  }

  /** Show nothing of what was there. */
  private empty(): void {
    this.loading?.abort();
    this.loading = null;
    this.view?.dispose();
    this.view = null;
    // A canvas keeps its last picture until something else is drawn.
    this.drawing?.renderer.clear();
    this.probe = null;
    this.data = new ReplayData();
    this.overlay.setMessage(null);
    this.roll.tell(null);
    this.keyTip?.hide();
    this.ready = Promise.resolve();
    this.settle = null;
  }

  private load(): void {
    this.empty();
    const { src } = this;
    const from = this.getAttribute("data-from");
    if (src === null && from === null) return;
    const loading = new AbortController();
    this.loading = loading;
    this.ready = new Promise((resolve, reject) => {
      this.settle = { resolve, reject };
    });
    // Who does not wait for `ready` reads the message on the page.
    this.ready.catch(() => undefined);
    const { data } = this;
    const read = async (): Promise<void> => {
      const bytes = src === null ? fromPage(from!) : await fromAddress(src, loading.signal);
      await readBlocks(bytes, (block) => {
        if (this.data === data) this.take(block);
      });
      if (!data.ended) throw new TypeError("The replay ended too early.");
    };
    read().catch((reason: unknown) => {
      if (this.data !== data || loading.signal.aborted) return;
      data.failure = failureText(reason);
      this.overlay.setMessage(data.failure);
      this.settle?.reject(new Error(data.failure));
    });
  }

  private take(block: Block): void {
    const { data } = this;
    data.take(block);
    if (block.tag === "SCEN" && data.scene && data.motion && this.drawing) {
      this.view = new View3D(this.drawing, data.scene, data.motion.positions);
      this.view.rig.still = true;
      this.view.setLook(lookOf(this));
      void this.view.prepare().then(() => {
        this.isStale = true;
      });
    }
    if (data.failure !== null) {
      this.overlay.setMessage(data.failure);
      this.settle?.reject(new Error(data.failure));
    }
    // How far the planning is changes nothing in the picture.
    if (block.tag !== "PLAN") this.isStale = true;
  }

  private takeSound(): void {
    const address = this.soundName === "wanted" ? this.wanted : (this.sound ?? this.wanted);
    if (address !== this.playsSound) {
      this.playsSound = address;
      this.ownClock.setSound(address);
    }
    (this.ownClock.sound as HTMLAudioElement).muted = this.soundName === "none";
  }

  private get soundName(): SoundName {
    const { sounds, wish } = this;
    return sounds.includes(wish) ? wish : sounds[0]!;
  }

  private get sounds(): SoundName[] {
    const sounds: SoundName[] = [];
    if (this.clock === this.ownClock) {
      if (this.sound !== null) sounds.push("played");
      if (this.wanted !== null) sounds.push("wanted");
    }
    return [...sounds, "none"];
  }

  private readonly takeLook = (): void => {
    const look = lookOf(this);
    this.view?.setLook(look);
    this.roll.setLook(look);
    this.isStale = true;
  };

  private readonly onKey = (event: KeyboardEvent): void => {
    const path = event.composedPath();
    const isOurs = path.includes(this);
    const isPages = event.target === document.body && connected.values().next().value === this;
    if (event.defaultPrevented || (!isOurs && !isPages) || this.help.open) return;
    if (act(event, this.keyActions)) event.preventDefault();
  };

  private readonly frame = (now: number): void => {
    this.request = requestAnimationFrame(this.frame);
    const start = performance.now();
    if (this.filming) return;
    const time = this.clock.tick(now);
    const { state } = this;
    if (state !== this.lastState) {
      this.lastState = state;
      this.dispatchEvent(new Event("statechange"));
    }
    if (!this.isVisible && !this.settle) return;
    const passed = now - this.lastNow;
    this.lastNow = now;
    const { view, data } = this;
    const changed =
      this.isStale || time !== this.lastTime || data.revision !== this.lastRevision;
    this.lastTime = time;
    this.lastRevision = data.revision;
    let draws = false;
    if (view) {
      if (changed) view.update(data, time, this.shown);
      if (this.calm.matches) view.rig.still = true;
      const resized = view.resize(this.width, this.height);
      const moved = view.moveCamera(passed / 1000);
      draws = resized || moved || changed;
      this.keyTip?.update(view, data, time);
      this.overlay.setView(view.rig.view);
    }
    this.isStale = false;
    this.fallback?.update(time, this.clock.playing && !this.clock.waiting, this.clock.rate);
    this.roll.draw(time, this.shown.numbers);
    this.updateControls(time);
    if (changed) {
      this.costs[this.frames % COSTS] = performance.now() - start;
      this.frames++;
    }
    if (view?.isPrepared && draws) {
      // Before drawing, since another number of pixels empties the canvas.
      view.watchSpeed(passed);
      view.draw(true);
      view.rig.still = false;
      this.drawnAt = now;
    } else if (view?.isPrepared && now - this.drawnAt > REST && view.rest()) {
      view.draw(false);
    }
    if (this.settle && (data.motion?.poses ?? 0) > 0 && (view?.isPrepared ?? this.fallback)) {
      this.settle.resolve();
      this.settle = null;
    }
  };

  private updateControls(time: number): void {
    const { clock, data } = this;
    if (this.faultsRevision !== data.revision) this.findFaults();
    if (clock.playing) this.isUntouched = false;
    if (clock.blocked) this.isUntouched = true;
    const pictured = this.view?.isPrepared ?? false;
    const { playing, waiting, duration, rate } = clock;
    this.overlay.update(data, {
      loading: this.loading !== null,
      playing,
      waiting,
      untouched: this.isUntouched,
      pictured,
    });
    this.bar.update({
      time,
      duration,
      available: data.ended ? duration : Math.max(this.available, 0),
      playing,
      rate,
      sound: this.soundName,
      sounds: this.sounds,
      looping: clock.loop !== null,
      falling: this.shown.falling,
      numbers: this.shown.numbers,
      pictured,
      faults: this.faults.length,
    });
  }

  private findFaults(): void {
    const { notes, heard, revision } = this.data;
    this.faultsRevision = revision;
    this.fault = null;
    const missed = [...notes.key.keys()]
      .filter((place) => isMissed(notes, place))
      .map((place): Fault => ({ time: notes.onset[place]!, kind: "wanted", place }));
    const wrong = [...heard.key.keys()]
      .filter((place) => heard.verdict[place] === "wrong")
      .map((place): Fault => ({ time: heard.on[place]!, kind: "heard", place }));
    this.faults = [...missed, ...wrong].sort((a, b) => a.time - b.time);
  }

  private actions(): KeyActions {
    // eslint-disable-next-line @typescript-eslint/no-this-alias -- getters have a `this` of their own
    const element = this;
    const refresh = (): void => {
      this.isStale = true;
    };
    return {
      get time() {
        return element.clock.currentTime;
      },
      get rate() {
        return element.clock.rate;
      },
      togglePlay: () => {
        if (this.clock.playing) this.pause();
        else this.play();
      },
      seek: (time) => {
        this.currentTime = time;
      },
      frame: (count) => {
        this.pause();
        const frame = Math.round(this.currentTime * FRAMES_PER_SECOND) + count;
        this.currentTime = frame / FRAMES_PER_SECOND;
      },
      setRate: (rate) => {
        this.clock.rate = rate;
      },
      setSound: (sound) => {
        this.wish = sound;
        this.takeSound();
      },
      mute: () => {
        this.wish = this.soundName === "none" ? this.sounds[0]! : "none";
        this.takeSound();
      },
      toggleLoop: () => {
        const { clock } = this;
        const from = clock.currentTime;
        // Four seconds from here, which can then be made longer or shorter.
        clock.loop = clock.loop ? null : [from, Math.min(from + 4, clock.duration)];
      },
      loopFrom: () => {
        const { clock } = this;
        const to = clock.loop?.[1] ?? clock.duration;
        clock.loop = [clock.currentTime, to > clock.currentTime ? to : clock.duration];
      },
      loopTo: () => {
        const { clock } = this;
        const from = clock.loop?.[0] ?? 0;
        if (clock.currentTime > 0) {
          clock.loop = [from < clock.currentTime ? from : 0, clock.currentTime];
        }
      },
      endLoop: () => {
        this.clock.loop = null;
      },
      toggleFalling: () => {
        this.shown.falling = !this.shown.falling;
        if (this.view?.rig.view === "player") this.view.show("player", this.shown);
        refresh();
      },
      toggleNumbers: () => {
        this.shown.numbers = !this.shown.numbers;
        refresh();
      },
      nextFault: (direction) => {
        this.showFault(direction);
      },
      toggleWhole: () => {
        if (document.fullscreenElement) void document.exitFullscreen();
        else void this.requestFullscreen();
      },
      film: () => {
        if (this.filming) this.filming.abort();
        else void this.saveFilm();
      },
      help: () => {
        this.help.showModal();
      },
      showView: (view: ViewName) => {
        this.view?.show(view, this.shown);
      },
      zoomRoll: (factor) => {
        this.roll.zoom(factor);
      },
      steer: (event) => this.view !== null && steerByKey(event, this.view.rig),
    };
  }

  private async saveFilm(): Promise<void> {
    try {
      const address = URL.createObjectURL(await this.record(FRAMES_PER_SECOND));
      const name = (this.head?.title ?? "").replace(/[^\p{L}\p{N}_-]+/gu, "-") || "performance";
      make("a", { href: address, download: `${name}.webm` }).click();
      // The browser has taken hold of the film by then.
      setTimeout(() => {
        URL.revokeObjectURL(address);
      }, 60_000);
    } catch (reason) {
      if (reason instanceof DOMException && reason.name === "AbortError") return;
      this.overlay.setMessage(reason instanceof Error ? reason.message : String(reason));
    }
  }

  private showFault(direction: 1 | -1): void {
    const { currentTime, faults } = this;
    const here = this.fault !== null && Math.abs(this.fault.time - currentTime) < 1e-3;
    // Notes of a chord are missed at one time, so that time alone does not lead from one to the next.
    const next =
      here && this.fault
        ? faults.at((faults.indexOf(this.fault) + direction) % faults.length)
        : direction > 0
          ? (faults.find(({ time }) => time > currentTime) ?? faults[0])
          : (faults.findLast(({ time }) => time < currentTime) ?? faults.at(-1));
    if (!next) return;
    this.fault = next;
    this.pause();
    this.currentTime = next.time;
    this.roll.tell(next);
  }
}

/** The soft light behind the picture, which the style sheet has for the page itself. */
function paintBackdrop(draw: CanvasRenderingContext2D, look: Look): void {
  const { width, height } = draw.canvas;
  const light = draw.createRadialGradient(
    width / 2,
    0.45 * height,
    0,
    width / 2,
    0.45 * height,
    0.55 * width,
  );
  light.addColorStop(0, look.glow);
  light.addColorStop(1, look.page);
  draw.fillStyle = light;
  draw.fillRect(0, 0, width, height);
}

function failureText(reason: unknown): string {
  // A browser says nothing more about a connection than this type of error.
  if (reason instanceof TypeError) return "The connection was lost while the replay was read.";
  return reason instanceof Error ? reason.message : String(reason);
}
