/** The module that a page loads: it registers `<pianomime-replay>`. */

import { ReplayElement } from "./replay_element";

customElements.define("pianomime-replay", ReplayElement);

declare global {
  interface HTMLElementTagNameMap {
    "pianomime-replay": ReplayElement;
  }
}
