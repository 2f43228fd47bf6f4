/** What is known of a performance so far: it grows while blocks arrive. */

import type { Block } from "./blocks";
import type { Head, Heard, Notes, Plan, SceneContent } from "./format";
import { Motion } from "./motion";
import { Spans } from "./spans";

const FORMAT = "pianomime-replay";
const VERSION = 1;
const text = new TextDecoder();

const NO_NOTES: Notes = {
  key: [],
  onset: [],
  offset: [],
  velocity: [],
  hand: [],
  finger: [],
  verdict: [],
  cause: [],
};

let revisions = 0;

/** No two replays share a number either: who has drawn one sees that the next is another. */
function nextRevision(): number {
  return ++revisions;
}

export class ReplayData {
  head: Head | null = null;
  scene: SceneContent | null = null;
  notes: Notes = NO_NOTES;
  noteSpans = new Spans([], []);
  heard: Heard = {
    key: [],
    on: [],
    off: [],
    velocity: [],
    hand: [],
    finger: [],
    verdict: [],
    cause: [],
  };
  heardSpans = new Spans([], []);
  pedal: [number, number][] = [];
  motion: Motion | null = null;
  plan: Plan | null = null;
  metrics: [string, string][] | null = null;
  failure: string | null = null;
  /** Another number with every change to the notes, what was heard, or the pedal. */
  revision = nextRevision();

  /** Whether all has arrived that will. */
  get ended(): boolean {
    return this.metrics !== null || this.failure !== null;
  }

  /** Length of what there is to see and hear, or will be [s]. */
  get duration(): number {
    const reached = this.motion?.end ?? 0;
    return this.ended ? Math.max(reached, 0) : Math.max(this.head?.seconds ?? 0, reached);
  }

  take(block: Block): void {
    switch (block.tag) {
      case "HEAD":
        this.takeHead(json(block) as Head);
        break;
      case "SCEN":
        this.scene = json(block) as SceneContent;
        break;
      case "NOTE":
        this.notes = json(block) as Notes;
        this.noteSpans = new Spans(this.notes.onset, this.notes.offset);
        this.revision = nextRevision();
        break;
      case "HEAR":
        this.takeHeard(json(block) as Heard & { from: number });
        break;
      case "PEDL":
        this.pedal = (json(block) as { down: [number, number][] }).down;
        this.revision = nextRevision();
        break;
      case "MOVE":
        if (!this.motion) throw new Error("The replay has poses before its head.");
        this.motion.add(block.content);
        break;
      case "PLAN":
        this.plan = json(block) as Plan;
        break;
      case "DONE":
        this.metrics = (json(block) as { metrics: [string, string][] }).metrics;
        break;
      case "FAIL":
        this.failure = (json(block) as { message: string }).message;
        break;
    }
  }

  private takeHead(head: Head): void {
    if (head.format !== FORMAT) throw new Error("This is not a replay.");
    if (head.version !== VERSION) {
      throw new Error(`This page shows replays of version ${VERSION}, not ${head.version}.`);
    }
    this.head = head;
    this.motion = new Motion(head.rate, head.positions);
  }

  private takeHeard(more: Heard & { from: number }): void {
    const { from } = more;
    const join = <T>(known: T[], added: T[]): T[] => known.slice(0, from).concat(added);
    const { heard } = this;
    this.heard = {
      key: join(heard.key, more.key),
      on: join(heard.on, more.on),
      off: join(heard.off, more.off),
      velocity: join(heard.velocity, more.velocity),
      hand: join(heard.hand, more.hand),
      finger: join(heard.finger, more.finger),
      verdict: join(heard.verdict, more.verdict),
      cause: join(heard.cause, more.cause),
    };
    this.heardSpans = new Spans(this.heard.on, this.heard.off);
    this.revision = nextRevision();
  }
}

function json(block: Block): unknown {
  return JSON.parse(text.decode(block.content));
}
