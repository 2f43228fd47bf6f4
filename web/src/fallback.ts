/** What is shown in place of the picture where a browser has no WebGL. */

import { make } from "./dom";

const WHY = "This browser shows no 3D (WebGL is missing or turned off).";
/** [s] A film that is farther from the clock is moved to it. */
const TOLERANCE = 0.15;

export class Fallback {
  readonly root: HTMLElement;
  private readonly video: HTMLVideoElement | null = null;

  /**
   * @param picture address of one, or null.
   * @param film address of one, or null; it follows the clock, which has the sound.
   */
  constructor(picture: string | null, film: string | null) {
    const shown: Node[] = [];
    let line = WHY;
    if (film !== null) {
      this.video = make("video", { src: film, playsinline: "", tabindex: "-1" });
      this.video.muted = true;
      if (picture !== null) this.video.poster = picture;
      shown.push(this.video);
      line += " This is the film.";
    } else if (picture !== null) {
      shown.push(make("img", { src: picture, alt: "A picture of the performance" }));
      line += " This is a picture.";
    }
    this.root = make("div", { class: "fallback" }, ...shown, make("p", { role: "note" }, line));
  }

  update(time: number, playing: boolean, rate: number): void {
    const { video } = this;
    if (!video) return;
    if (Math.abs(video.currentTime - time) > (playing ? TOLERANCE : 0.02) && !video.seeking) {
      video.currentTime = time;
    }
    if (video.playbackRate !== rate) video.playbackRate = rate;
    if (playing && video.paused) void video.play().catch(() => undefined);
    else if (!playing && !video.paused) video.pause();
  }
}
