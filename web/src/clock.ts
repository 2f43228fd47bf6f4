/**
 * The time that picture and sound share.
 *
 * The sound leads, since an ear hears every correction that an eye would not see. Where there is no
 * sound, or none any more, the computer's own clock does.
 */

/** What the clock needs of an audio element. */
export type Sound = Pick<
  HTMLMediaElement,
  | "currentTime"
  | "playbackRate"
  | "preservesPitch"
  | "paused"
  | "seeking"
  | "ended"
  | "duration"
  | "readyState"
  | "error"
  | "src"
  | "play"
  | "pause"
  | "load"
  | "removeAttribute"
>;

/** One of those who show what happens at the clock's time. */
export interface Showing {
  /** Up to where it can show [s]. */
  readonly available: number;
  /** Where it ends [s]. */
  readonly duration: number;
  /** Whether more may become available. */
  readonly growing: boolean;
}

const HAVE_CURRENT_DATA = 2;
/** [s] A browser tells the time of a sound in steps of up to this; larger steps are real. */
const STEP = 0.03;
/** Part of the difference to the sound's time that is made up for in each frame. */
const GAIN = 0.1;
/** [s] What has to be there beyond the present moment before playing goes on after a wait. */
const AHEAD = 0.5;
/** [s] A sound nearer to its end than this has nothing more to give. */
const SOUND_END = 0.05;

export class Clock {
  /** Where to start again, and from where [s]. */
  loop: [number, number] | null = null;
  /** Whether the browser refused to play a sound that nobody had asked for by a click. */
  blocked = false;

  private readonly showings = new Set<Showing>();
  private time = 0;
  private lastTick = -1;
  private wantsToPlay = false;
  private isWaiting = false;
  private speed = 1;
  private hasSound = false;

  constructor(readonly sound: Sound) {}

  get playing(): boolean {
    return this.wantsToPlay;
  }

  /** Whether playing halts until something has arrived. */
  get waiting(): boolean {
    return this.wantsToPlay && this.isWaiting;
  }

  get currentTime(): number {
    return this.time;
  }

  get duration(): number {
    let duration = 0;
    for (const showing of this.showings) duration = Math.max(duration, showing.duration);
    return duration;
  }

  get rate(): number {
    return this.speed;
  }

  set rate(rate: number) {
    this.speed = rate;
    this.sound.playbackRate = rate;
  }

  join(showing: Showing): void {
    this.showings.add(showing);
  }

  leave(showing: Showing): void {
    this.showings.delete(showing);
  }

  /** Go on with another sound, or none, at the same time. */
  setSound(address: string | null): void {
    this.hasSound = address !== null;
    if (address === null) {
      this.sound.pause();
      this.sound.removeAttribute("src");
      this.sound.load();
    } else {
      this.sound.src = address;
      this.sound.playbackRate = this.speed;
      this.sound.preservesPitch = true;
    }
  }

  play(): void {
    if (this.time >= this.duration - 1e-3 && !this.growing) this.seek(this.loop?.[0] ?? 0);
    this.wantsToPlay = true;
    this.blocked = false;
    this.lastTick = -1;
  }

  pause(): void {
    this.wantsToPlay = false;
    this.isWaiting = false;
    this.sound.pause();
  }

  seek(time: number): void {
    this.time = Math.min(Math.max(time, 0), this.duration);
    if (this.hasSound && !this.sound.paused) this.moveSound();
  }

  /**
   * Find the time of a frame. Those who share a clock may all ask for the same frame.
   *
   * @param now of the frame [ms], as of `requestAnimationFrame`.
   * @returns seconds from the performance's beginning.
   */
  tick(now: number): number {
    if (now === this.lastTick || !this.wantsToPlay) return this.time;
    const passed = this.lastTick < 0 ? 0 : ((now - this.lastTick) / 1000) * this.speed;
    this.lastTick = now;
    if (this.mustWait()) {
      this.sound.pause();
      return this.time;
    }
    if (this.soundLeads()) this.followSound(passed);
    else this.time += passed;
    if (this.loop && this.time >= this.loop[1]) {
      this.seek(this.loop[0]);
    } else if (this.time >= this.duration && !this.growing) {
      this.time = this.duration;
      this.pause();
    }
    return this.time;
  }

  private get growing(): boolean {
    for (const showing of this.showings) if (showing.growing) return true;
    return false;
  }

  private mustWait(): boolean {
    let available = Infinity;
    for (const showing of this.showings) {
      if (showing.growing) available = Math.min(available, showing.available);
    }
    const needed = this.isWaiting ? Math.min(this.time + AHEAD, this.duration) : this.time;
    this.isWaiting = available < needed || available < 0;
    return this.isWaiting;
  }

  private soundLeads(): boolean {
    const { sound } = this;
    if (!this.hasSound || sound.error || sound.ended) {
      // A sound that has ended leads again when somebody goes back in time.
      return this.hasSound && sound.ended && this.time < sound.duration - SOUND_END;
    }
    return !(this.time >= sound.duration - SOUND_END);
  }

  private followSound(passed: number): void {
    const { sound } = this;
    if (sound.paused || sound.ended) {
      this.moveSound();
      sound.play().catch((reason: unknown) => {
        if (reason instanceof DOMException && reason.name === "NotAllowedError") {
          this.pause();
          this.blocked = true;
        }
      });
    }
    if (sound.seeking || sound.readyState <= HAVE_CURRENT_DATA) {
      this.isWaiting = sound.readyState <= HAVE_CURRENT_DATA;
      return;
    }
    const expected = this.time + passed;
    const off = sound.currentTime - expected;
    this.time = Math.abs(off) > STEP ? sound.currentTime : expected + GAIN * off;
  }

  private moveSound(): void {
    if (Math.abs(this.sound.currentTime - this.time) > 0.02) this.sound.currentTime = this.time;
  }
}
