/** Puts encoded pictures and sound into a WebM file (Matroska with VP8 or VP9, and Opus). */

/** An encoded picture or piece of sound. */
export interface Packet {
  track: "video" | "audio";
  /** [ms] from the film's beginning. */
  time: number;
  isKey: boolean;
  data: Uint8Array<ArrayBuffer>;
}

export interface VideoTrack {
  codec: "V_VP8" | "V_VP9";
  width: number;
  height: number;
}

export interface AudioTrack {
  rate: number;
  channels: number;
  /** The `OpusHead` that a decoder begins with. */
  head: Uint8Array<ArrayBuffer>;
}

type Bytes = Uint8Array<ArrayBuffer>;

const VIDEO = 1;
const AUDIO = 2;
/** [ns] Opus has to be decoded from so far before a place to sound right there. */
const SEEK_PRE_ROLL = 80_000_000;
/** Block times are 16-bit differences to their cluster's [ms]. */
const LONGEST_CLUSTER = 30_000;
const OPUS_RATE = 48_000;
const text = new TextEncoder();

/**
 * Make a film.
 *
 * @param packets in the order of their times.
 * @param duration [ms]
 */
export function webm(
  video: VideoTrack,
  audio: AudioTrack | null,
  packets: readonly Packet[],
  duration: number,
): Blob {
  const info = element(
    0x1549a966,
    element(0x2ad7b1, whole(1_000_000)),
    element(0x4489, real(duration)),
    element(0x4d80, text.encode("PianoMime")),
    element(0x5741, text.encode("PianoMime")),
  );
  const tracks = element(0x1654ae6b, videoEntry(video), ...(audio ? [audioEntry(audio)] : []));
  const clusters = clustersOf(packets);
  // Places take 8 bytes whatever they are, so that the length of the list is known before them.
  const start = info.length + tracks.length + cues(clusters, 0).length;
  const parts = [info, tracks, cues(clusters, start), ...clusters.map(({ bytes }) => bytes)];
  const length = parts.reduce((sum, part) => sum + part.length, 0);
  return new Blob([ebmlHead(), id(0x18538067), size(length), ...parts], { type: "video/webm" });
}

interface Cluster {
  time: number;
  bytes: Bytes;
}

/** Clusters begin with a picture that needs no other, so that a player can begin there. */
function clustersOf(packets: readonly Packet[]): Cluster[] {
  const clusters: Cluster[] = [];
  let blocks: Bytes[] = [];
  let time = 0;
  const close = (): void => {
    if (blocks.length === 0) return;
    clusters.push({ time, bytes: element(0x1f43b675, element(0xe7, whole(time)), ...blocks) });
    blocks = [];
  };
  for (const packet of packets) {
    const at = Math.round(packet.time);
    if ((packet.track === "video" && packet.isKey) || at - time > LONGEST_CLUSTER) close();
    if (blocks.length === 0) time = at;
    const head = new Uint8Array(4);
    head[0] = 0x80 | (packet.track === "video" ? VIDEO : AUDIO);
    new DataView(head.buffer).setInt16(1, at - time);
    head[3] = packet.isKey ? 0x80 : 0;
    blocks.push(element(0xa3, head, packet.data));
  }
  close();
  return clusters;
}

function cues(clusters: readonly Cluster[], start: number): Bytes {
  let place = start;
  const points = clusters.map(({ time, bytes }) => {
    const positions = element(0xb7, element(0xf7, whole(VIDEO)), element(0xf1, whole(place)));
    place += bytes.length;
    return element(0xbb, element(0xb3, whole(time)), positions);
  });
  return element(0x1c53bb6b, ...points);
}

function ebmlHead(): Bytes {
  return element(
    0x1a45dfa3,
    element(0x4286, whole(1)),
    element(0x42f7, whole(1)),
    element(0x42f2, whole(4)),
    element(0x42f3, whole(8)),
    element(0x4282, text.encode("webm")),
    element(0x4287, whole(4)),
    element(0x4285, whole(2)),
  );
}

function videoEntry({ codec, width, height }: VideoTrack): Bytes {
  return element(
    0xae,
    element(0xd7, whole(VIDEO)),
    element(0x73c5, whole(VIDEO)),
    element(0x83, whole(1)),
    element(0x9c, whole(0)),
    element(0x86, text.encode(codec)),
    element(0xe0, element(0xb0, whole(width)), element(0xba, whole(height))),
  );
}

function audioEntry({ rate, channels, head }: AudioTrack): Bytes {
  const preSkip = new DataView(head.buffer, head.byteOffset).getUint16(10, true);
  return element(
    0xae,
    element(0xd7, whole(AUDIO)),
    element(0x73c5, whole(AUDIO)),
    element(0x83, whole(2)),
    element(0x9c, whole(0)),
    element(0x86, text.encode("A_OPUS")),
    element(0x63a2, head),
    element(0x56aa, whole(Math.round((preSkip / OPUS_RATE) * 1e9))),
    element(0x56bb, whole(SEEK_PRE_ROLL)),
    element(0xe1, element(0xb5, real(rate)), element(0x9f, whole(channels))),
  );
}

function element(name: number, ...content: Bytes[]): Bytes {
  const length = content.reduce((sum, part) => sum + part.length, 0);
  const parts = [id(name), size(length), ...content];
  const bytes = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let from = 0;
  for (const part of parts) {
    bytes.set(part, from);
    from += part.length;
  }
  return bytes;
}

function id(name: number): Bytes {
  const bytes: number[] = [];
  for (let rest = name; rest > 0; rest = Math.floor(rest / 256)) bytes.unshift(rest % 256);
  return Uint8Array.from(bytes);
}

/** A length in 8 bytes, of which the first says that they are 8. */
function size(length: number): Bytes {
  const bytes = whole(length);
  bytes[0] = 0x01;
  return bytes;
}

function whole(value: number): Bytes {
  const bytes = new Uint8Array(8);
  new DataView(bytes.buffer).setBigUint64(0, BigInt(value));
  return bytes;
}

function real(value: number): Bytes {
  const bytes = new Uint8Array(8);
  new DataView(bytes.buffer).setFloat64(0, value);
  return bytes;
}
