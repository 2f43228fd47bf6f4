/** Reads the blocks of a replay while its bytes arrive. */

export interface Block {
  tag: string;
  content: Uint8Array<ArrayBuffer>;
}

const HEADER = 8;
/** No block of a replay comes near it; a larger one means that these bytes are something else. */
const LARGEST = 1 << 28;
const TAG = /^[A-Z]{4}$/;

/** Cuts bytes, which come in pieces of any length, into blocks. */
export class BlockParser {
  private buffer = new Uint8Array(1 << 16);
  private from = 0;
  private to = 0;

  /** Whether the bytes so far end where a block ends. */
  get whole(): boolean {
    return this.from === this.to;
  }

  /** Take the next bytes, and return the blocks that they complete. */
  push(bytes: Uint8Array): Block[] {
    this.append(bytes);
    const blocks: Block[] = [];
    while (this.to - this.from >= HEADER) {
      const tag = String.fromCharCode(...this.buffer.subarray(this.from, this.from + 4));
      const size = new DataView(this.buffer.buffer, this.from + 4, 4).getUint32(0, true);
      if (!TAG.test(tag) || size > LARGEST) throw new Error("This is not a replay.");
      if (this.to - this.from < HEADER + size) break;
      const start = this.from + HEADER;
      blocks.push({ tag, content: this.buffer.slice(start, start + size) });
      this.from = start + size;
    }
    return blocks;
  }

  private append(bytes: Uint8Array): void {
    const kept = this.to - this.from;
    if (this.to + bytes.length > this.buffer.length) {
      let size = this.buffer.length;
      while (size < kept + bytes.length) size *= 2;
      const larger = size > this.buffer.length ? new Uint8Array(size) : this.buffer;
      larger.set(this.buffer.subarray(this.from, this.to));
      this.buffer = larger;
      this.from = 0;
      this.to = kept;
    }
    this.buffer.set(bytes, this.to);
    this.to += bytes.length;
  }
}

/**
 * Read a whole replay, which may be compressed, and hand over block by block.
 *
 * @param stream the bytes, as they arrive.
 * @param take is called with each block as soon as it is there.
 */
export async function readBlocks(
  stream: ReadableStream<Uint8Array<ArrayBuffer>>,
  take: (block: Block) => void,
): Promise<void> {
  const parser = new BlockParser();
  const reader = (await unpacked(stream)).getReader();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    for (const block of parser.push(value)) take(block);
  }
  if (!parser.whole) throw new Error("The replay breaks off in the middle of a block.");
}

async function unpacked(
  stream: ReadableStream<Uint8Array<ArrayBuffer>>,
): Promise<ReadableStream<Uint8Array<ArrayBuffer>>> {
  const reader = stream.getReader();
  let start = new Uint8Array(0);
  let ended = false;
  while (start.length < 2 && !ended) {
    const { done, value } = await reader.read();
    ended = done;
    if (value) {
      const joined = new Uint8Array(start.length + value.length);
      joined.set(start);
      joined.set(value, start.length);
      start = joined;
    }
  }
  const again = new ReadableStream<Uint8Array<ArrayBuffer>>({
    start(controller) {
      if (start.length > 0) controller.enqueue(start);
      if (ended) controller.close();
    },
    async pull(controller) {
      const { done, value } = await reader.read();
      if (done) controller.close();
      else controller.enqueue(value);
    },
    cancel: (reason) => reader.cancel(reason),
  });
  const gzipped = start[0] === 0x1f && start[1] === 0x8b;
  return gzipped ? again.pipeThrough(new DecompressionStream("gzip")) : again;
}
