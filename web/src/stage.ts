/** The module of the stage's page: songs are dropped, played, watched and compared. */

import { ReplayElement } from "./replay_element";
import { App } from "./stage/app";

customElements.define("pianomime-replay", ReplayElement);

document.querySelector("main")!.append(new App().root);
