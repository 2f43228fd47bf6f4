/** What the page asks the server of the stage for. Addresses are relative to the page's own. */

export interface Song {
  id: string;
  title: string;
  seconds: number;
  notes: number;
}

/** Label and value, as text. */
export type Measure = readonly [string, string];

export interface Performance {
  id: string;
  title: string;
  player: string;
  effort: number;
  world: string;
  seconds: number;
  measures: Measure[];
}

export interface Player {
  name: string;
  why_not: string | null;
}

export interface Library {
  songs: Song[];
  performances: Performance[];
  unreadable: string[];
  players: Player[];
  worlds: string[];
  /** [bytes] of a file that is dropped. */
  limit: number;
}

export interface Settings {
  player: string;
  effort: number;
  world: string | null;
  /** Length at most, null for all. */
  seconds: number | null;
}

/** What was asked for was refused; the message is for the user. */
export class Refused extends Error {}

/** The server does not answer. */
export class Lost extends Error {}

/** Of this page, as long as it is open. */
const page = crypto.randomUUID();

async function ask(path: string, options: RequestInit = {}): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(path, options);
  } catch {
    throw new Lost();
  }
  if (!answer.ok) throw new Refused((await answer.text()).trim() || `It failed (${answer.status}).`);
  return answer;
}

async function json<T>(path: string, options?: RequestInit): Promise<T> {
  return (await (await ask(path, options)).json()) as T;
}

export function library(): Promise<Library> {
  return json("library");
}

/** Give a file to the server, which says what song it is. */
export async function upload(file: File): Promise<Song> {
  // Sent as it is, one that cannot be read would look like a server that is gone.
  const body = await file.arrayBuffer().catch(() => {
    throw new Refused(`${file.name} cannot be read.`);
  });
  const headers = { "X-File-Name": encodeURIComponent(file.name) };
  return json("songs", { method: "POST", headers, body });
}

/**
 * Have a song played, or a saved performance shown.
 *
 * @param seat of the page: what it had before is stopped.
 * @returns what the job is called.
 */
export async function start(
  seat: number,
  asked: ({ song: string } & Settings) | { performance: string },
): Promise<string> {
  const headers = { "Content-Type": "application/json", "X-Page": `${page}-${seat}` };
  const body = JSON.stringify(asked);
  return (await json<{ id: string }>("jobs", { method: "POST", headers, body })).id;
}

export async function stop(job: string): Promise<void> {
  await ask(`jobs/${job}`, { method: "DELETE" });
}
