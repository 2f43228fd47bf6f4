/** The picture in 3D: renderer, lights, camera, and what to leave out where it is drawn slowly. */

import {
  DirectionalLight,
  HemisphereLight,
  PCFShadowMap,
  PerspectiveCamera,
  Raycaster,
  Scene,
  Vector2,
  WebGLRenderer,
} from "three";
import type { ShaderMaterial } from "three";

import { Badges } from "./badges";
import { CameraRig } from "./cameras";
import { CROSS, signTexture } from "./digits";
import { FallingNotes } from "./falling_notes";
import type { Notes, SceneContent } from "./format";
import { KEYS } from "./format";
import { Kinematics } from "./kinematics";
import type { Look, Paint } from "./look";
import { handPaint, heardPaint, isMissed } from "./look";
import { PianoScene } from "./piano_scene";
import { lightPlain, plainMaterial } from "./plain_material";
import type { ReplayData } from "./replay_data";

/** What is drawn, from the best to the quickest: pixels for each of the page's, and shadows. */
const QUALITIES = [
  { ratio: 2, shadows: true },
  { ratio: 1, shadows: true },
  { ratio: 1, shadows: false },
  { ratio: 0.75, shadows: false },
  { ratio: 0.5, shadows: false },
];
const SOFTWARE = 2;
/** [ms] Frames that take longer than this, for so long in all, are reason to draw less. */
const SLOW = 45;
const PATIENCE = 900;
/** [s] How long at least a missed note is marked at its key. */
export const MARKED = 0.5;
/** [m] A finger's number hovers so far above its tip. */
const ABOVE_TIP = 0.014;

export interface Shown {
  falling: boolean;
  numbers: boolean;
}

/** A renderer, and whether it is the processor that draws. */
export interface Drawing {
  renderer: WebGLRenderer;
  software: boolean;
}

/** Make a renderer for a canvas; null where there is no WebGL. */
export function drawingOn(canvas: HTMLCanvasElement): Drawing | null {
  const software = drawsInSoftware();
  if (software === null) return null;
  try {
    const renderer = new WebGLRenderer({ canvas, antialias: !software, alpha: true });
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.type = PCFShadowMap;
    // Asking the driver about errors makes it wait for each shader in turn.
    renderer.debug.checkShaderErrors = false;
    return { renderer, software };
  } catch {
    return null;
  }
}

export class View3D {
  readonly rig: CameraRig;
  /** Whether all shaders are made, so that drawing keeps nobody waiting. */
  isPrepared = false;
  private readonly renderer: WebGLRenderer;
  private readonly plain: ShaderMaterial | null;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera();
  private readonly piano: PianoScene;
  private readonly falling: FallingNotes;
  private readonly badges: Badges;
  private readonly kinematics: Kinematics;
  private readonly sun = new DirectionalLight(0xffffff, 1.75);
  private readonly sky = new HemisphereLight(0xffffff, 0x8890a0, 1.25);
  private readonly fill = new DirectionalLight(0xffffff, 0.35);
  private readonly signs = signTexture();
  private readonly pose: Float64Array;
  private readonly tips: Float64Array;
  private readonly wrists = new Float64Array(6);
  private readonly wristBodies: [number, number];
  private readonly raycaster = new Raycaster();
  private readonly pointer = new Vector2();
  private readonly sounding = new Int8Array(KEYS);
  private quality: number;
  private slowFor = 0;
  private width = 16;
  private height = 9;
  private movingRatio = 1;
  private notes: Notes | null = null;

  constructor(
    drawing: Drawing,
    private readonly content: SceneContent,
    positions: number,
  ) {
    this.renderer = drawing.renderer;
    this.plain = drawing.software ? plainMaterial() : null;
    this.pose = new Float64Array(positions);
    this.tips = new Float64Array(3 * content.fingertips.length);
    this.kinematics = new Kinematics(content.bodies);
    this.piano = new PianoScene(content, this.plain);
    this.falling = new FallingNotes(content, this.signs);
    this.badges = new Badges(this.signs);
    this.rig = new CameraRig(this.camera, content);
    this.wristBodies = [wristOf(content, 0), wristOf(content, 1)];
    this.scene.add(this.piano.group, this.falling.mesh, this.badges.mesh, this.sky);
    this.addLights();
    this.quality = this.plain ? SOFTWARE : 0;
    this.applyQuality();
    this.rig.show("player", this.wrists, true);
  }

  /** Make the shaders, while the page stays usable. */
  async prepare(): Promise<void> {
    this.moveCamera(0);
    if (this.renderer.extensions.has("KHR_parallel_shader_compile")) {
      await this.renderer.compileAsync(this.scene, this.camera);
    }
    this.isPrepared = true;
  }

  setLook(look: Look): void {
    this.piano.setLook(look);
    this.falling.setLook(look);
    this.badges.setLook(look);
    this.sky.intensity = look.dark ? 0.95 : 1.35;
    if (this.plain) {
      const towards = this.sun.position.clone().sub(this.sun.target.position);
      lightPlain(this.plain, towards, this.sun.intensity, this.sky.intensity);
    }
  }

  show(name: Parameters<CameraRig["show"]>[0], shown: Shown): void {
    this.rig.show(name, this.wrists, shown.falling);
  }

  /** Bring everything to a moment of a performance. */
  update(data: ReplayData, time: number, shown: Shown): void {
    if (data.motion) data.motion.sample(time, this.pose);
    this.kinematics.update(this.pose);
    this.piano.move(this.kinematics);
    for (let hand = 0; hand < 2; hand++) {
      for (let i = 0; i < 3; i++) {
        this.wrists[3 * hand + i] = this.kinematics.pos[3 * this.wristBodies[hand]! + i]!;
      }
    }
    if (data.notes !== this.notes) {
      this.notes = data.notes;
      this.falling.setNotes(data.notes);
    }
    this.falling.mesh.visible = shown.falling;
    this.falling.update(time, shown.numbers);
    this.lightKeys(data, time);
    this.addBadges(data, time, shown);
  }

  /** Move the camera; says whether it moved. */
  moveCamera(passed: number): boolean {
    return this.rig.update(passed, this.width / this.height, this.wrists);
  }

  /** The key that is seen at a place of the picture [px], hands left out; -1 for none. */
  keyAt(x: number, y: number): number {
    this.pointer.set((2 * x) / this.width - 1, 1 - (2 * y) / this.height);
    this.raycaster.setFromCamera(this.pointer, this.camera);
    return this.piano.keyAt(this.raycaster);
  }

  /** Draw in a given size [px], and as well as can be, until `resize` is called again. */
  beginFilm(width: number, height: number): void {
    this.renderer.setPixelRatio(1);
    this.renderer.setSize(width, height, false);
    [this.width, this.height] = [width, height];
  }

  /** Draw a film's frame, and hand over the canvas that it is on. */
  drawFilm(): HTMLCanvasElement {
    this.renderer.render(this.scene, this.camera);
    return this.renderer.domElement;
  }

  /** Draw a picture that stands still at its best; says whether that is still to be done. */
  rest(): boolean {
    const ratio = Math.min(devicePixelRatio, QUALITIES[0]!.ratio);
    if (this.renderer.getPixelRatio() >= Math.min(ratio, 1)) return false;
    this.renderer.setPixelRatio(Math.min(ratio, 1));
    return true;
  }

  /** Take up a size of the page's canvas [px]; says whether that changes anything. */
  resize(width: number, height: number): boolean {
    if (width === this.width && height === this.height) return false;
    [this.width, this.height] = [width, height];
    this.renderer.setSize(width, height, false);
    return true;
  }

  /**
   * @param moving whether the next picture comes at once, and this one may be coarse.
   */
  draw(moving: boolean): void {
    if (moving && this.renderer.getPixelRatio() !== this.movingRatio) {
      this.renderer.setPixelRatio(this.movingRatio);
    }
    this.renderer.render(this.scene, this.camera);
  }

  /**
   * Look whether frames come too slowly, and draw less if so.
   *
   * @param passed since the frame before, while something moves [ms].
   */
  watchSpeed(passed: number): void {
    // A page that was hidden is not slow.
    if (passed > 1000) return;
    this.slowFor = passed > SLOW ? this.slowFor + passed : Math.max(this.slowFor - passed, 0);
    if (this.slowFor > PATIENCE && this.quality < QUALITIES.length - 1) {
      this.quality++;
      this.slowFor = 0;
      this.applyQuality();
    }
  }

  dispose(): void {
    this.scene.traverse((object) => {
      if ("geometry" in object) (object.geometry as { dispose(): void }).dispose();
      if ("material" in object) (object.material as { dispose(): void }).dispose();
    });
    this.signs.dispose();
  }

  private applyQuality(): void {
    const { ratio, shadows } = QUALITIES[this.quality]!;
    this.renderer.setPixelRatio(ratio < 1 ? ratio : Math.min(devicePixelRatio, ratio));
    this.movingRatio = this.renderer.getPixelRatio();
    this.sun.castShadow = shadows;
    this.piano.setShadows(shadows);
  }

  private addLights(): void {
    const { pos, target } = this.content.light;
    this.sun.position.set(...pos);
    this.sun.target.position.set(...target);
    const { shadow } = this.sun;
    shadow.mapSize.set(2048, 2048);
    Object.assign(shadow.camera, { left: -0.85, right: 0.85, top: 0.85, bottom: -0.85 });
    shadow.camera.near = 1;
    shadow.camera.far = 5;
    shadow.bias = -0.0004;
    shadow.normalBias = 0.0015;
    shadow.radius = 3;
    this.sky.position.set(0, 0, 1);
    this.fill.position.set(pos[0], -pos[1], 0.6 * pos[2]);
    this.scene.add(this.sun, this.sun.target);
    if (!this.plain) this.scene.add(this.fill);
  }

  private lightKeys(data: ReplayData, time: number): void {
    const { heard } = data;
    this.sounding.fill(-1);
    data.heardSpans.visit(time, time, (place) => {
      if (heard.off[place]! > time) {
        this.sounding[heard.key[place]!] = heardPaint(heard, place);
      }
    });
    this.piano.light(this.sounding);
  }

  private addBadges(data: ReplayData, time: number, shown: Shown): void {
    const { badges, kinematics, tips } = this;
    const { fingertips, keys } = this.content;
    badges.clear();
    if (shown.numbers) {
      for (let i = 0; i < fingertips.length; i++) {
        const { body, pos, finger, hand } = fingertips[i]!;
        kinematics.point(body, pos, tips, 3 * i);
        const z = tips[3 * i + 2]! + ABOVE_TIP;
        badges.add(tips[3 * i]!, tips[3 * i + 1]!, z, finger, handPaint(hand));
      }
    }
    const { notes } = data;
    data.noteSpans.visit(time - MARKED, time, (place) => {
      if (!isMissed(notes, place)) return;
      if (Math.max(notes.offset[place]!, notes.onset[place]! + MARKED) < time) return;
      const { top, half } = keys[notes.key[place]!]!;
      const wrong: Paint = 3;
      badges.add(top[0] + 0.6 * half[0], top[1], top[2] + 0.006, CROSS, wrong);
    });
  }
}

/** Whether WebGL here is drawn by the processor; null where there is none. */
function drawsInSoftware(): boolean | null {
  const probe = document.createElement("canvas").getContext("webgl2");
  if (!probe) return null;
  const info = probe.getExtension("WEBGL_debug_renderer_info");
  const name = info ? String(probe.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

/** The body that carries the fingers of a hand: the last that all of them hang on. */
function wristOf(content: SceneContent, hand: number): number {
  const chains = content.fingertips
    .filter((tip) => tip.hand === hand)
    .map((tip) => {
      const chain: number[] = [];
      for (let body = tip.body; body > 0; body = content.bodies[body]!.parent) chain.push(body);
      return chain;
    });
  return chains[0]?.find((body) => chains.every((chain) => chain.includes(body))) ?? 0;
}
