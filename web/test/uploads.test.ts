import { afterEach, describe, expect, it, vi } from "vitest";

import type { Song } from "../src/stage/api";
import { Lost } from "../src/stage/api";
import { uploadAll, uploadsText } from "../src/stage/uploads";

function song(title: string): Song {
  return { id: title, title, seconds: 1, notes: 1 };
}

/** A server that takes files whose content is "good". */
function serve(): void {
  vi.stubGlobal("fetch", (_: string, { body }: { body: ArrayBuffer }) => {
    const content = new TextDecoder().decode(body);
    return Promise.resolve(
      content === "good"
        ? Response.json(song("good"))
        : new Response("bad is no MIDI file\n", { status: 400 }),
    );
  });
}

afterEach(() => {
  vi.unstubAllGlobals();
});

describe("uploads", () => {
  it("tries each file, and says of each that failed why", async () => {
    serve();
    const files = ["good", "bad", "good", "far too large"].map((text) => new File([text], text));
    const uploads = await uploadAll({ files, folders: ["album"] }, 10);
    expect(uploads.songs).toHaveLength(2);
    expect(uploads.failures).toEqual([
      expect.stringContaining("album is a folder"),
      "bad is no MIDI file",
      expect.stringContaining("far too large is larger than"),
    ]);
  });

  it("does not take a file that cannot be read for a server that is gone", async () => {
    serve();
    const gone = new File([], "gone.mid");
    gone.arrayBuffer = () => Promise.reject(new DOMException("no", "NotFoundError"));
    const { failures } = await uploadAll({ files: [gone], folders: [] }, 10);
    expect(failures).toEqual(["gone.mid cannot be read."]);
    vi.stubGlobal("fetch", () => Promise.reject(new TypeError("no connection")));
    const lost = uploadAll({ files: [new File(["good"], "a.mid")], folders: [] }, 10);
    await expect(lost).rejects.toThrow(Lost);
  });

  it("are told in a line, unless one simply went well", () => {
    const titles = (count: number): Song[] => [...Array(count).keys()].map((i) => song(`s${i}`));
    expect(uploadsText({ songs: titles(1), failures: [] })).toBeNull();
    expect(uploadsText({ songs: [], failures: [] })).toBeNull();
    expect(uploadsText({ songs: titles(2), failures: ["x is a folder."] })).toBe(
      "Taken: s0, s1. s0 is played. x is a folder.",
    );
    expect(uploadsText({ songs: titles(9), failures: [] })).toContain("s3, 5 more.");
  });
});
