/** Joint positions over time, kept in the small whole numbers in which they arrive. */

const UNIT = 1e-4;
const HEADER = 8;

interface Chunk {
  first: number;
  count: number;
  /** Pose after pose, so that the poses around a moment lie side by side. */
  values: Int16Array;
}

export class Motion {
  private readonly chunks: Chunk[] = [];
  private last = 0;
  private readonly near: Int16Array[] = [];
  private readonly offsets = new Int32Array(4);

  /**
   * @param rate poses per second.
   * @param positions number of joint positions in a pose.
   */
  constructor(
    readonly rate: number,
    readonly positions: number,
  ) {}

  /** How many poses have arrived. */
  get poses(): number {
    const chunk = this.chunks.at(-1);
    return chunk ? chunk.first + chunk.count : 0;
  }

  /** Time of the last pose that has arrived [s]; -1 where there is none. */
  get end(): number {
    return this.poses > 0 ? (this.poses - 1) / this.rate : -1;
  }

  /** Take the content of a `MOVE` block. */
  add(content: Uint8Array<ArrayBuffer>): void {
    const header = new DataView(content.buffer, content.byteOffset, HEADER);
    const first = header.getUint32(0, true);
    const count = header.getUint32(4, true);
    const changes = new Int16Array(content.buffer, content.byteOffset + HEADER);
    if (first !== this.poses || changes.length !== count * this.positions) {
      throw new Error("The poses of this replay do not fit together.");
    }
    if (count === 0) return;
    const values = new Int16Array(count * this.positions);
    for (let joint = 0; joint < this.positions; joint++) {
      let value = 0;
      for (let pose = 0; pose < count; pose++) {
        // Storing to 16 bits wraps around as the differences did.
        value += changes[joint * count + pose]!;
        values[pose * this.positions + joint] = value;
      }
    }
    this.chunks.push({ first, count, values });
  }

  /**
   * The joint positions at a moment, between poses by a cubic through the four around it (linear
   * motion would show its kinks in slow motion).
   *
   * @param time seconds; before the first and after the last pose these are meant.
   * @param into receives the positions [rad, m].
   */
  sample(time: number, into: Float64Array): void {
    const poses = this.poses;
    if (poses === 0) {
      into.fill(0);
      return;
    }
    const place = Math.min(Math.max(time * this.rate, 0), poses - 1);
    const before = Math.min(Math.floor(place), Math.max(poses - 2, 0));
    const t = place - before;
    for (let k = 0; k < 4; k++) this.locate(Math.min(Math.max(before + k - 1, 0), poses - 1), k);
    const w0 = UNIT * (((-0.5 * t + 1) * t - 0.5) * t);
    const w1 = UNIT * ((1.5 * t - 2.5) * t * t + 1);
    const w2 = UNIT * (((-1.5 * t + 2) * t + 0.5) * t);
    const w3 = UNIT * ((0.5 * t - 0.5) * t * t);
    const [v0, v1, v2, v3] = this.near;
    const [o0, o1, o2, o3] = this.offsets;
    for (let joint = 0; joint < this.positions; joint++) {
      into[joint] =
        w0 * v0![o0! + joint]! +
        w1 * v1![o1! + joint]! +
        w2 * v2![o2! + joint]! +
        w3 * v3![o3! + joint]!;
    }
  }

  private locate(pose: number, k: number): void {
    let chunk = this.chunks[this.last]!;
    if (pose < chunk.first || pose >= chunk.first + chunk.count) {
      let low = 0;
      let high = this.chunks.length - 1;
      while (low < high) {
        const middle = (low + high + 1) >> 1;
        if (this.chunks[middle]!.first <= pose) low = middle;
        else high = middle - 1;
      }
      this.last = low;
      chunk = this.chunks[low]!;
    }
    this.near[k] = chunk.values;
    this.offsets[k] = (pose - chunk.first) * this.positions;
  }
}
