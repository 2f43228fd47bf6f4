/** Makes a film, frame by frame, as slowly as this computer needs to leave none out. */

import { bytesOfDataUrl } from "./sources";
import type { AudioTrack, Packet, VideoTrack } from "./webm";
import { webm } from "./webm";

const CODECS: [string, VideoTrack["codec"]][] = [
  ["vp09.00.41.08", "V_VP9"],
  ["vp8", "V_VP8"],
];
const VIDEO_BITS = 6_000_000;
const AUDIO_BITS = 128_000;
const RATE = 48_000;
const CHANNELS = 2;
/** Frames that may wait for the encoder: each holds a whole picture. */
const WAITING = 4;
/** [s] A player can begin at every so manyth second. */
const KEY_EVERY = 2;
/** [frames] Of sound that is encoded at once. */
const PIECE = 9600;

export interface Filmed {
  width: number;
  height: number;
  /** Frames per second. */
  fps: number;
  /** Where the film begins and ends in the performance [s]. */
  from: number;
  to: number;
  /** Address of the sound, or null. */
  sound: string | null;
  /** Draw the picture at a time [s]. */
  draw(time: number): CanvasImageSource;
  /** Is told which part is done, 0..1. */
  progress(part: number): void;
  signal: AbortSignal;
}

/**
 * Make a film.
 *
 * @throws Error if the browser cannot encode one.
 */
export async function film(filmed: Filmed): Promise<Blob> {
  if (!("VideoEncoder" in globalThis)) throw new Error("This browser makes no films (WebCodecs).");
  const packets: Packet[] = [];
  const codec = await encodePictures(filmed, packets);
  const audio = filmed.sound === null ? null : await encodeSound(filmed, packets);
  packets.sort((a, b) => a.time - b.time);
  const { width, height, from, to } = filmed;
  return webm({ codec, width, height }, audio, packets, (to - from) * 1000);
}

async function encodePictures(filmed: Filmed, packets: Packet[]): Promise<VideoTrack["codec"]> {
  const { width, height, fps, from, to, signal } = filmed;
  const common = { width, height, bitrate: VIDEO_BITS, framerate: fps };
  let chosen: [VideoEncoderConfig, VideoTrack["codec"]] | null = null;
  for (const [codec, name] of CODECS) {
    const config = { ...common, codec };
    if ((await VideoEncoder.isConfigSupported(config)).supported) {
      chosen = [config, name];
      break;
    }
  }
  if (!chosen) throw new Error("This browser encodes neither VP9 nor VP8.");
  const trouble: { reason?: Error } = {};
  const encoder = new VideoEncoder({
    output: (chunk) => packets.push(packet("video", chunk)),
    error: (reason) => {
      trouble.reason = reason;
    },
  });
  encoder.configure(chosen[0]);
  await encoding(encoder, trouble, async () => {
    const frames = Math.max(Math.round((to - from) * fps), 1);
    for (let i = 0; i < frames; i++) {
      signal.throwIfAborted();
      const timestamp = Math.round((i * 1e6) / fps);
      const frame = new VideoFrame(filmed.draw(from + i / fps), {
        timestamp,
        duration: Math.round(1e6 / fps),
      });
      encoder.encode(frame, { keyFrame: i % (KEY_EVERY * fps) === 0 });
      frame.close();
      filmed.progress(i / frames);
      // The page stays usable, and the encoder keeps up.
      do await new Promise((resolve) => setTimeout(resolve));
      while (encoder.encodeQueueSize > WAITING);
      if (trouble.reason) throw trouble.reason;
    }
  });
  return chosen[1];
}

async function encodeSound(filmed: Filmed, packets: Packet[]): Promise<AudioTrack | null> {
  const bytes = filmed.sound!.startsWith("data:")
    ? bytesOfDataUrl(filmed.sound!).buffer
    : await (await fetch(filmed.sound!, { signal: filmed.signal })).arrayBuffer();
  const sound = await new OfflineAudioContext(CHANNELS, 1, RATE).decodeAudioData(bytes);
  const found: { head?: Uint8Array<ArrayBuffer> } = {};
  const trouble: { reason?: Error } = {};
  const encoder = new AudioEncoder({
    output: (chunk, metadata) => {
      const description = metadata?.decoderConfig?.description;
      if (description) found.head = copied(description);
      packets.push(packet("audio", chunk));
    },
    error: (reason) => {
      trouble.reason = reason;
    },
  });
  encoder.configure({
    codec: "opus",
    sampleRate: RATE,
    numberOfChannels: CHANNELS,
    bitrate: AUDIO_BITS,
  });
  await encoding(encoder, trouble, () => {
    const first = Math.round(filmed.from * RATE);
    const last = Math.min(Math.round(filmed.to * RATE), sound.length);
    for (let at = first; at < last; at += PIECE) {
      const count = Math.min(PIECE, last - at);
      const data = new Float32Array(CHANNELS * count);
      for (let channel = 0; channel < CHANNELS; channel++) {
        // A sound of one channel is heard on both sides.
        const samples = sound.getChannelData(Math.min(channel, sound.numberOfChannels - 1));
        data.set(samples.subarray(at, at + count), channel * count);
      }
      const piece = new AudioData({
        format: "f32-planar",
        sampleRate: RATE,
        numberOfFrames: count,
        numberOfChannels: CHANNELS,
        timestamp: Math.round(((at - first) * 1e6) / RATE),
        data,
      });
      encoder.encode(piece);
      piece.close();
    }
  });
  return found.head ? { rate: RATE, channels: CHANNELS, head: found.head } : null;
}

/** Feed an encoder until it has encoded all, and close it in any case. */
async function encoding(
  encoder: VideoEncoder | AudioEncoder,
  trouble: { reason?: Error },
  feed: () => Promise<void> | void,
): Promise<void> {
  try {
    await feed();
    await encoder.flush();
    if (trouble.reason) throw trouble.reason;
  } finally {
    if (encoder.state !== "closed") encoder.close();
  }
}

function packet(track: Packet["track"], chunk: EncodedVideoChunk | EncodedAudioChunk): Packet {
  const data = new Uint8Array(chunk.byteLength);
  chunk.copyTo(data);
  return { track, time: chunk.timestamp / 1000, isKey: chunk.type === "key", data };
}

function copied(source: AllowSharedBufferSource): Uint8Array<ArrayBuffer> {
  const view = ArrayBuffer.isView(source)
    ? new Uint8Array(source.buffer, source.byteOffset, source.byteLength)
    : new Uint8Array(source);
  return Uint8Array.from(view);
}
