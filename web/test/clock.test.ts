import { beforeEach, describe, expect, it } from "vitest";

import { Clock } from "../src/clock";

/** A sound that plays when the test lets time pass, and tells its time in coarse steps. */
class FakeSound {
  duration = 10;
  src = "";
  playbackRate = 1;
  preservesPitch = false;
  paused = true;
  seeking = false;
  readyState = 4;
  error: MediaError | null = null;
  refuses = false;
  private true_ = 0;

  get ended(): boolean {
    return this.true_ >= this.duration;
  }

  get currentTime(): number {
    return Math.floor(this.true_ / 0.02) * 0.02;
  }

  set currentTime(time: number) {
    this.true_ = time;
  }

  get exact(): number {
    return this.true_;
  }

  pass(seconds: number): void {
    if (this.paused || this.readyState < 3) return;
    this.true_ = Math.min(this.true_ + seconds * this.playbackRate, this.duration);
  }

  play(): Promise<void> {
    if (this.refuses) return Promise.reject(new DOMException("no", "NotAllowedError"));
    this.paused = false;
    return Promise.resolve();
  }

  pause(): void {
    this.paused = true;
  }

  load(): void {
    this.true_ = 0;
  }

  removeAttribute(): void {
    this.src = "";
  }
}

let sound: FakeSound;
let clock: Clock;
let showing: { available: number; duration: number; growing: boolean };
let now: number;

/** Let frames pass, and say where the clock then is. */
function pass(seconds: number): number {
  for (let i = 0; i < Math.round(seconds * 60); i++) {
    now += 1000 / 60;
    sound.pass(1 / 60);
    clock.tick(now);
  }
  return clock.currentTime;
}

beforeEach(() => {
  sound = new FakeSound();
  clock = new Clock(sound);
  showing = { available: 20, duration: 12, growing: false };
  clock.join(showing);
  now = 5000;
});

describe("Clock without sound", () => {
  it("passes as the computer's clock does, times the rate", () => {
    clock.play();
    expect(pass(1)).toBeCloseTo(1, 1);
    clock.rate = 0.25;
    expect(pass(2)).toBeCloseTo(1.5, 1);
    clock.pause();
    expect(pass(1)).toBeCloseTo(1.5, 1);
  });

  it("stops at the end, and begins again from there", () => {
    clock.seek(11.5);
    clock.play();
    expect(pass(1)).toBe(12);
    expect(clock.playing).toBe(false);
    clock.play();
    expect(clock.currentTime).toBe(0);
  });

  it("stays within the performance", () => {
    clock.seek(99);
    expect(clock.currentTime).toBe(12);
    clock.seek(-1);
    expect(clock.currentTime).toBe(0);
  });

  it("repeats a loop", () => {
    clock.loop = [2, 3];
    clock.seek(2.5);
    clock.play();
    expect(pass(0.75)).toBeCloseTo(2.25, 1);
  });

  it("is the same for all who ask for one frame", () => {
    clock.play();
    pass(1);
    const time = clock.tick(now);
    expect(clock.tick(now)).toBe(time);
  });
});

describe("Clock with sound", () => {
  beforeEach(() => {
    clock.setSound("song.mp3");
  });

  it("follows the sound smoothly, although that tells its time in steps", () => {
    clock.play();
    pass(0.5);
    let last = clock.currentTime;
    for (let i = 0; i < 60; i++) {
      const time = pass(1 / 60);
      expect(time - last).toBeGreaterThan(0.012);
      expect(time - last).toBeLessThan(0.021);
      expect(Math.abs(time - sound.exact)).toBeLessThan(0.04);
      last = time;
    }
  });

  it("is in step after a seek", () => {
    clock.play();
    pass(1);
    clock.seek(6);
    pass(0.1);
    expect(Math.abs(clock.currentTime - sound.exact)).toBeLessThan(0.04);
    expect(clock.currentTime).toBeGreaterThan(6);
  });

  it("waits for a sound that has not arrived", () => {
    sound.readyState = 2;
    clock.play();
    expect(pass(1)).toBe(0);
    expect(clock.waiting).toBe(true);
    sound.readyState = 4;
    expect(pass(1)).toBeGreaterThan(0.8);
    expect(clock.waiting).toBe(false);
  });

  it("goes on where the sound has ended, and gives it the lead again further back", () => {
    clock.seek(9.5);
    clock.play();
    expect(pass(1.5)).toBeCloseTo(11, 1);
    clock.seek(3);
    pass(0.5);
    expect(sound.paused).toBe(false);
    expect(Math.abs(clock.currentTime - sound.exact)).toBeLessThan(0.04);
  });

  it("keeps the time when the sound becomes another", () => {
    clock.play();
    pass(2);
    sound.paused = true;
    sound.currentTime = 0;
    clock.setSound("finished.mp3");
    expect(pass(0.5)).toBeGreaterThan(2.4);
    expect(Math.abs(clock.currentTime - sound.exact)).toBeLessThan(0.04);
  });

  it("pauses where the browser refuses to play", async () => {
    sound.refuses = true;
    clock.play();
    pass(0.1);
    await Promise.resolve();
    await Promise.resolve();
    expect(clock.playing).toBe(false);
    expect(clock.blocked).toBe(true);
  });
});

describe("Clock of a performance that still grows", () => {
  it("halts sound and time where motion has not arrived, until there is enough", () => {
    clock.setSound("live.mp3");
    showing = Object.assign(showing, { available: 1, growing: true });
    clock.play();
    expect(pass(2)).toBeCloseTo(1, 1);
    expect(clock.waiting).toBe(true);
    expect(sound.paused).toBe(true);
    showing.available = 1.2;
    expect(pass(0.5)).toBeCloseTo(1, 1);
    showing.available = 3;
    expect(pass(0.5)).toBeCloseTo(1.5, 1);
  });

  it("waits for the slowest of those who share it", () => {
    clock.join({ available: 0.5, duration: 12, growing: true });
    clock.play();
    expect(pass(2)).toBeCloseTo(0.5, 1);
  });
});
