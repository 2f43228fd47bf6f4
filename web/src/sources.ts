/** Where the bytes of a replay come from. */

const NOT_FROM_DISK =
  "A page opened from a disk may not read the replay beside it. Run `python -m http.server --bind " +
  "127.0.0.1` in its folder, and open the address that it prints.";

/** Bytes from an address, as they arrive. */
export async function fromAddress(
  address: string,
  signal: AbortSignal,
): Promise<ReadableStream<Uint8Array<ArrayBuffer>>> {
  const isOnDisk = new URL(address, document.baseURI).protocol === "file:";
  const answer = await fetch(address, { signal }).catch((reason: unknown) => {
    throw isOnDisk && !signal.aborted ? new Error(NOT_FROM_DISK) : reason;
  });
  if (!answer.ok || !answer.body) throw new Error(`The replay is not there (${answer.status}).`);
  return answer.body;
}

/**
 * Bytes that the page itself holds, since a page that was opened from a disk may fetch nothing.
 *
 * @param id of the `<script type="application/octet-stream">` that holds them as base64.
 */
export function fromPage(id: string): ReadableStream<Uint8Array<ArrayBuffer>> {
  const script = document.getElementById(id);
  if (!script) throw new Error(`The page holds no replay "${id}".`);
  const bytes = fromBase64(script.textContent.trim());
  return new ReadableStream({
    start(controller) {
      controller.enqueue(bytes);
      controller.close();
    },
  });
}

/** The bytes that an address of the kind `data:TYPE;base64,...` itself holds. */
export function bytesOfDataUrl(address: string): Uint8Array<ArrayBuffer> {
  return fromBase64(address.slice(address.indexOf(",") + 1));
}

function fromBase64(text: string): Uint8Array<ArrayBuffer> {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes;
}
