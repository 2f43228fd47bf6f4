/** Spans of time, of which those at a moment or in a stretch are found without looking at all. */

export class Spans {
  /** The spans' places in the lists that they were made from, by start. */
  private readonly order: Int32Array;
  private readonly starts: Float64Array;
  private readonly ends: Float64Array;
  private longest = 0;

  /**
   * @param from where each span starts [s].
   * @param to where each ends [s].
   */
  constructor(from: readonly number[], to: readonly number[]) {
    this.order = Int32Array.from(from.keys()).sort((a, b) => from[a]! - from[b]!);
    this.starts = Float64Array.from(this.order, (i) => from[i]!);
    this.ends = Float64Array.from(this.order, (i) => to[i]!);
    for (let i = 0; i < from.length; i++) {
      this.longest = Math.max(this.longest, to[i]! - from[i]!);
    }
  }

  /** Call `visit` with the place of each span that has a moment in [from, to], by start. */
  visit(from: number, to: number, visit: (place: number) => void): void {
    for (let i = this.after(from - this.longest); i < this.starts.length; i++) {
      if (this.starts[i]! > to) return;
      if (this.ends[i]! >= from) visit(this.order[i]!);
    }
  }

  private after(time: number): number {
    let low = 0;
    let high = this.starts.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.starts[middle]! < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}
