/** Where the bytes of a replay come from. */

/** Bytes from an address, as they arrive. */
export async function fromAddress(
  address: string,
  signal: AbortSignal,
): Promise<ReadableStream<Uint8Array<ArrayBuffer>>> {
  const answer = await fetch(address, { signal });
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
  const letters = atob(script.textContent.trim());
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return new ReadableStream({
    start(controller) {
      controller.enqueue(bytes);
      controller.close();
    },
  });
}
