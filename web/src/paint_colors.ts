/** The colours of `Paint`, as three.js has them. */

import { Color } from "three";

import type { Look } from "./look";
import { paints } from "./look";

export class PaintColors {
  /** In the order of `Paint`; what holds the list sees it change. */
  readonly list = [new Color(), new Color(), new Color(), new Color()] as const;

  setLook(look: Look): void {
    paints(look).forEach((paint, i) => this.list[i]!.set(paint));
  }
}
