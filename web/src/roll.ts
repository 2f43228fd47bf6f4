/** The piano roll below the picture, which is also the timeline. */

import { Color } from "three";

import type { Clock } from "./clock";
import { inkOn } from "./contrast";
import { make } from "./dom";
import type { Heard } from "./format";
import { KEYS } from "./format";
import type { Hit } from "./hits";
import { hitAt, hitText, hitTime } from "./hits";
import type { Look, Paint } from "./look";
import { handPaint, heardPaint, isMissed, paints } from "./look";
import { DRAG } from "./pointing";
import type { ReplayData } from "./replay_data";
import type { Spans } from "./spans";
import { Tip } from "./tip";
import { clockTime } from "./wording";

const PEDAL_HEIGHT = 9;
const AXIS_HEIGHT = 18;
/** [s] What is seen at once. */
const USUAL_SPAN = 14;
const SHORTEST = 1;
/** Where the playhead stands while the roll moves under it. */
const HEAD_AT = 0.3;
/** [px] A pointer that is nearer to a note than this means it. */
const REACH = 4;
const MARGIN_KEYS = 2;
const BAR_ALPHA = 0.85;
/** [px] A finger's number is to be read, and not to shout. */
const SMALLEST_NUMBER = 7;
const LARGEST_NUMBER = 12;
/** [ms] The note at a playhead that was brought there is told of for so long. */
const TOLD = 4000;

export class Roll {
  readonly root: HTMLElement;
  private readonly canvas = make("canvas", {
    tabindex: "0",
    role: "img",
    "aria-label": "Piano roll. Click for a time, drag to move, hold shift and drag to loop.",
  });
  private readonly tip = new Tip();
  private readonly draw2d: CanvasRenderingContext2D;
  private readonly pointers = new Map<number, number>();
  private from = 0;
  private span = USUAL_SPAN;
  private follows = true;
  private lowest = 27;
  private highest = 63;
  private revision = -1;
  private colors: string[] = [];
  /** Of numbers on bars of each colour. */
  private inks: string[] = [];
  private look: Look | null = null;
  private readonly drawn = new Float64Array(10);
  private isStale = true;
  private tipUntil = 0;
  private width = 1;
  private height = 1;

  constructor(
    private readonly data: () => ReplayData,
    private readonly clock: () => Clock,
  ) {
    this.root = make("div", { class: "roll" }, this.canvas, this.tip.root);
    this.draw2d = this.canvas.getContext("2d")!;
    this.listen();
    new ResizeObserver(([entry]) => {
      this.width = entry!.contentRect.width || 1;
      this.height = entry!.contentRect.height || 1;
    }).observe(this.canvas);
  }

  setLook(look: Look): void {
    this.look = look;
    this.colors = paints(look);
    // A canvas mixes colors as a screen shows them.
    const paper = new Color(look.paper).convertLinearToSRGB();
    this.inks = this.colors.map((color) => {
      const bar = new Color(color).convertLinearToSRGB().lerp(paper, 1 - BAR_ALPHA);
      return inkOn(bar.convertSRGBToLinear(), [look.text, look.paper]);
    });
    this.isStale = true;
  }

  /** Show the playhead's surroundings again, after the user has looked elsewhere. */
  follow(): void {
    this.follows = true;
  }

  /** Make the stretch that is seen longer (> 1) or shorter, around a place 0..1 of it. */
  zoom(factor: number, around = HEAD_AT): void {
    const longest = Math.max(this.clock().duration, SHORTEST) * 1.02;
    const span = Math.min(Math.max(this.span * factor, SHORTEST), longest);
    this.from += around * (this.span - span);
    this.span = span;
  }

  /** Tell about a note: where the pointer rests on it, or for a while at the playhead. */
  tell(hit: Hit | null, x?: number): void {
    if (!hit) {
      this.tip.hide();
      return;
    }
    this.tip.show(hitText(this.data(), hit), x ?? this.x(this.clock().currentTime), this.width);
    this.tipUntil = x === undefined ? performance.now() + TOLD : Infinity;
  }

  /**
   * Draw, if there is anything new to be seen.
   *
   * @param numbers whether with the fingers' numbers.
   */
  draw(time: number, numbers: boolean): void {
    if (!this.look) return;
    const data = this.data();
    if (this.revision !== data.revision) this.fitKeys(data);
    const { playing, loop, duration } = this.clock();
    if (this.follows || (playing && time > this.from + this.span)) this.scroll(time, duration);
    if (performance.now() > this.tipUntil) this.tell(null);
    const known = data.ended ? duration : Math.max(data.motion?.end ?? 0, 0);
    const { drawn } = this;
    let changed = this.isStale;
    const see = (place: number, value: number): void => {
      if (drawn[place] !== value) changed = true;
      drawn[place] = value;
    };
    see(0, time);
    see(1, this.from);
    see(2, this.span);
    see(3, this.width);
    see(4, this.height);
    see(5, this.revision);
    see(6, loop ? loop[0] : -1);
    see(7, loop ? loop[1] : -1);
    see(8, known);
    see(9, numbers ? 1 : 0);
    if (!changed) return;
    this.isStale = false;
    this.paint(data, time, known, loop, numbers);
  }

  private paint(
    data: ReplayData,
    time: number,
    known: number,
    loop: [number, number] | null,
    numbers: boolean,
  ): void {
    const { draw2d: draw, width, height } = this;
    const look = this.look!;
    const ratio = Math.min(devicePixelRatio, 2);
    if (this.canvas.width !== Math.round(width * ratio)) this.canvas.width = width * ratio;
    if (this.canvas.height !== Math.round(height * ratio)) this.canvas.height = height * ratio;
    draw.setTransform(ratio, 0, 0, ratio, 0, 0);
    draw.fillStyle = look.paper;
    draw.fillRect(0, 0, width, height);
    this.paintGrid();
    if (loop) {
      draw.globalAlpha = 0.16;
      draw.fillStyle = look.text;
      draw.fillRect(this.x(loop[0]), 0, this.x(loop[1]) - this.x(loop[0]), height - AXIS_HEIGHT);
      draw.globalAlpha = 1;
    }
    for (let paint = 0; paint < 4; paint++) this.paintNotes(data, paint as Paint);
    if (numbers) this.paintNumbers(data);
    this.paintPedal(data);
    draw.globalAlpha = 0.35;
    draw.fillStyle = look.line;
    // What has not been played yet, and what is beyond the end.
    draw.fillRect(this.x(known), 0, width, height - AXIS_HEIGHT);
    draw.globalAlpha = 1;
    draw.fillStyle = look.text;
    draw.fillRect(this.x(time) - 0.75, 0, 1.5, height - AXIS_HEIGHT + 3);
  }

  private paintGrid(): void {
    const { draw2d: draw, height, width } = this;
    const look = this.look!;
    draw.fillStyle = look.line;
    draw.globalAlpha = 0.35;
    for (let key = this.lowest; key <= this.highest; key++) {
      if (isBlack(key)) draw.fillRect(0, this.y(key), width, this.row());
    }
    draw.globalAlpha = 1;
    const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 30, 60, 300].find((s) => s / this.span > 0.075) ?? 600;
    draw.font = "11px system-ui, sans-serif";
    draw.textBaseline = "middle";
    draw.textAlign = "left";
    for (let time = Math.max(Math.ceil(this.from / step), 0) * step; ; time += step) {
      const x = this.x(time);
      if (x > width) break;
      draw.fillStyle = look.line;
      draw.fillRect(x, 0, 1, height - AXIS_HEIGHT + 3);
      draw.fillStyle = look.faint;
      draw.fillText(step < 1 ? clockTime(time) : clockTime(time).slice(0, -2), x + 4, height - 8);
    }
  }

  private paintNotes(data: ReplayData, paint: Paint): void {
    const { draw2d: draw } = this;
    const { notes, heard } = data;
    const row = this.row();
    const inset = Math.min(1, row / 5);
    const to = this.from + this.span;
    draw.fillStyle = draw.strokeStyle = this.colors[paint]!;
    draw.beginPath();
    data.heardSpans.visit(this.from, to, (i) => {
      if (heardPaint(heard, i) !== paint) return;
      const x = this.x(heard.on[i]!);
      const length = Math.max(this.x(heard.off[i]!) - x, 2);
      draw.rect(x, this.y(heard.key[i]!) + inset, length, row - 2 * inset);
    });
    draw.globalAlpha = BAR_ALPHA;
    draw.fill();
    draw.globalAlpha = 1;
    draw.beginPath();
    data.noteSpans.visit(this.from, to, (i) => {
      const missed = isMissed(notes, i);
      if ((missed ? 3 : handPaint(notes.hand[i]!)) !== paint) return;
      const x = this.x(notes.onset[i]!);
      const y = this.y(notes.key[i]!);
      const length = Math.max(this.x(notes.offset[i]!) - x, 2);
      draw.rect(x + 0.5, y + 0.5, length - 1, row - 1);
    });
    if (paint === 3) {
      draw.globalAlpha = 0.2;
      draw.fill();
      draw.globalAlpha = 1;
    }
    draw.lineWidth = paint === 3 ? 1.5 : 1;
    draw.stroke();
  }

  /** Fingers, at the beginnings of notes that have room for them. */
  private paintNumbers(data: ReplayData): void {
    const { draw2d: draw } = this;
    const { notes, heard } = data;
    const row = this.row();
    const size = Math.min(Math.floor(row), LARGEST_NUMBER);
    if (size < SMALLEST_NUMBER) return;
    draw.font = `600 ${size}px system-ui, sans-serif`;
    draw.textAlign = "center";
    const to = this.from + this.span;
    const number = (key: number, from: number, to: number, finger: number, ink: string): void => {
      const x = this.x(from);
      if (finger < 0 || this.x(to) - x < size) return;
      draw.fillStyle = ink;
      draw.fillText(String(finger + 1), x + size / 2, this.y(key) + row * 0.55);
    };
    data.noteSpans.visit(this.from, to, (i) => {
      // A note that was played has its number on the bar of what sounded.
      if (notes.verdict[i] === "played") return;
      const [key, onset] = [notes.key[i]!, notes.onset[i]!];
      const ink = this.inkAt(heard, data.heardSpans, key, onset, size);
      if (ink !== null) number(key, onset, notes.offset[i]!, notes.finger[i]!, ink);
    });
    data.heardSpans.visit(this.from, to, (i) => {
      const ink = this.inks[heardPaint(heard, i)]!;
      number(heard.key[i]!, heard.on[i]!, heard.off[i]!, heard.finger[i]!, ink);
    });
  }

  /** What is read where the number of a note of the score would be; null where another is. */
  private inkAt(heard: Heard, spans: Spans, key: number, time: number, size: number): string | null {
    let ink: string | null = this.look!.text;
    spans.visit(time, time + (size / this.width) * this.span, (i) => {
      if (heard.key[i] !== key) return;
      const hasNumber = heard.finger[i]! >= 0 && heard.on[i]! > time;
      ink = hasNumber ? null : this.inks[heardPaint(heard, i)]!;
    });
    return ink;
  }

  private paintPedal(data: ReplayData): void {
    const { draw2d: draw, height, width } = this;
    const y = height - AXIS_HEIGHT - PEDAL_HEIGHT;
    draw.fillStyle = this.look!.faint;
    for (const [from, to] of data.pedal) {
      if (to < this.from || from > this.from + this.span) continue;
      const x = Math.max(this.x(from), 0);
      draw.fillRect(x, y + 2, Math.min(this.x(to), width) - x, PEDAL_HEIGHT - 4);
    }
    draw.fillStyle = this.look!.line;
    draw.fillRect(0, y, width, 1);
    draw.fillRect(0, y + PEDAL_HEIGHT, width, 1);
  }

  private scroll(time: number, duration: number): void {
    if (duration > 0) this.span = Math.min(this.span, Math.max(duration, SHORTEST) * 1.02);
    const latest = Math.max(duration * 1.02 - this.span, 0);
    this.from = Math.min(Math.max(time - HEAD_AT * this.span, 0), latest);
    if (time > this.from + this.span || time < this.from) this.from = time;
    this.follows = true;
  }

  private fitKeys(data: ReplayData): void {
    this.revision = data.revision;
    let [low, high] = [KEYS, 0];
    for (const keys of [data.notes.key, data.heard.key]) {
      for (const key of keys) {
        low = Math.min(low, key);
        high = Math.max(high, key);
      }
    }
    if (low > high) return;
    // Two octaves at least, or few notes would be as tall as a hand.
    const more = Math.max(Math.ceil((24 - (high - low)) / 2), MARGIN_KEYS);
    this.lowest = Math.max(low - more, 0);
    this.highest = Math.min(high + more, KEYS - 1);
    this.root.style.setProperty("--rows", String(this.highest - this.lowest + 1));
  }

  private row(): number {
    const height = this.height - PEDAL_HEIGHT - AXIS_HEIGHT;
    return height / (this.highest - this.lowest + 1);
  }

  private x(time: number): number {
    return ((time - this.from) / this.span) * this.width;
  }

  private y(key: number): number {
    return (this.highest - key) * this.row();
  }

  private time(x: number): number {
    return this.from + (x / this.width) * this.span;
  }

  private hit(x: number, y: number): Hit | null {
    const slack = (REACH / this.width) * this.span;
    const key = this.highest - Math.floor(y / this.row());
    const time = this.time(x);
    return hitAt(this.data(), key, time - slack, time + slack);
  }

  private listen(): void {
    const { canvas, pointers } = this;
    let start = { x: 0, y: 0, from: 0 };
    let dragging = false;
    const at = (event: PointerEvent | WheelEvent): { x: number; y: number } => {
      const box = canvas.getBoundingClientRect();
      return { x: event.clientX - box.left, y: event.clientY - box.top };
    };
    canvas.addEventListener("pointerdown", (event) => {
      const { x, y } = at(event);
      pointers.set(event.pointerId, x);
      canvas.setPointerCapture(event.pointerId);
      start = { x, y, from: this.from };
      dragging = false;
    });
    canvas.addEventListener("pointermove", (event) => {
      const { x, y } = at(event);
      const before = pointers.get(event.pointerId);
      if (before === undefined) {
        const hit = this.hit(x, y);
        canvas.style.cursor = hit ? "pointer" : "";
        this.tell(hit, x);
        return;
      }
      pointers.set(event.pointerId, x);
      if (pointers.size === 2) {
        const other = [...pointers].find(([id]) => id !== event.pointerId)![1];
        if (x !== other) this.zoom(Math.abs((before - other) / (x - other)), other / this.width);
        dragging = true;
      } else if (dragging || Math.abs(x - start.x) > DRAG) {
        dragging = true;
        if (event.shiftKey) {
          const [a, b] = [this.time(start.x), this.time(x)];
          this.clock().loop = [Math.max(Math.min(a, b), 0), Math.max(a, b)];
        } else {
          this.follows = false;
          this.from = start.from - ((x - start.x) / this.width) * this.span;
        }
      }
    });
    canvas.addEventListener("pointerup", (event) => {
      const { x, y } = at(event);
      if (!dragging) {
        const hit = this.hit(x, y);
        this.follows = true;
        this.clock().seek(hit ? hitTime(this.data(), hit) : this.time(x));
        // A finger does not rest on the note.
        if (hit) this.tell(hit, event.pointerType === "touch" ? undefined : x);
      }
    });
    for (const end of ["pointerup", "pointercancel"] as const) {
      canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
    }
    canvas.addEventListener("pointerleave", (event) => {
      if (event.pointerType !== "touch") this.tell(null);
    });
    canvas.addEventListener(
      "wheel",
      (event) => {
        if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
          this.follows = false;
          this.from += (event.deltaX / this.width) * this.span;
        } else if (canvas.matches(":focus") || event.ctrlKey) {
          this.zoom(Math.exp(event.deltaY * 0.0015), at(event).x / this.width);
        } else {
          return;
        }
        event.preventDefault();
      },
      { passive: false },
    );
  }
}

function isBlack(key: number): boolean {
  return [1, 4, 6, 9, 11].includes(key % 12);
}
