/** Gives what was dropped to the server, and says what became of it. */

import * as api from "./api";
import type { Dropped } from "./dropped";

/** Names that a line tells one by one. */
const MOST_NAMED = 4;

export interface Uploads {
  songs: api.Song[];
  /** A line for each thing that is no song. */
  failures: string[];
}

/**
 * Upload one file after the other.
 *
 * @param limit that the server has for a file [bytes].
 * @throws Lost if the server is gone.
 */
export async function uploadAll({ files, folders }: Dropped, limit: number): Promise<Uploads> {
  const songs: api.Song[] = [];
  const failures = folders.map((name) => `${name} is a folder: drop the MIDI files in it.`);
  for (const file of files) {
    try {
      if (file.size > limit) {
        throw new api.Refused(
          `${file.name} is larger than ${Math.round(limit / 1e6)} MB: no MIDI file is. ` +
            "For a recording, make MIDI of it first.",
        );
      }
      songs.push(await api.upload(file));
    } catch (error) {
      if (!(error instanceof api.Refused)) throw error;
      failures.push(error.message);
    }
  }
  return { songs, failures };
}

/** What there is to say of uploads, of which the first is played; null where one simply went well. */
export function uploadsText({ songs, failures }: Uploads): string | null {
  const told = [...failures];
  if (songs.length > 1 || (songs.length > 0 && told.length > 0)) {
    told.unshift(`Taken: ${listed(songs.map(({ title }) => title))}. ${songs[0]!.title} is played.`);
  }
  return told.length > 0 ? told.join(" ") : null;
}

function listed(names: readonly string[]): string {
  const more = names.length - MOST_NAMED;
  return [...names.slice(0, MOST_NAMED), ...(more > 0 ? [`${more} more`] : [])].join(", ");
}
