/** What is read of a replay's blocks, which docs/reference/replay-format.md describes. */

export type Triple = [number, number, number];
export type Quad = [number, number, number, number];

export interface Head {
  format: string;
  version: number;
  title: string;
  player: string;
  effort: number;
  seconds: number;
  rate: number;
  positions: number;
  remarks: string[];
}

export interface Joint {
  type: "hinge" | "slide";
  axis: Triple;
  pos: Triple;
  index: number;
  rest: number;
}

export interface Body {
  name: string;
  parent: number;
  pos: Triple;
  quat: Quad;
  joints: Joint[];
}

export interface Material {
  name: string;
  color: Triple;
  specular: number;
  shininess: number;
}

export interface Geom {
  body: number;
  type: "plane" | "box" | "sphere" | "capsule" | "ellipsoid" | "cylinder" | "mesh";
  size: Triple;
  pos: Triple;
  quat: Quad;
  material: number;
  mesh: number;
  key: number;
  lamp: number;
}

export interface View {
  pos: Triple;
  target: Triple;
  fovy: number;
}

export interface SceneContent {
  bodies: Body[];
  materials: Material[];
  meshes: { vertices: number[]; faces: number[] }[];
  geoms: Geom[];
  keys: { black: boolean; top: Triple; half: Triple }[];
  fingertips: { hand: number; finger: number; body: number; pos: Triple }[];
  cameras: Record<string, View>;
  light: { pos: Triple; target: Triple };
}

export interface Notes {
  key: number[];
  onset: number[];
  offset: number[];
  velocity: number[];
  hand: number[];
  finger: number[];
  verdict: ("played" | "missed" | null)[];
  cause: (string | null)[];
}

export interface Heard {
  key: number[];
  on: number[];
  off: number[];
  velocity: number[];
  hand: number[];
  finger: number[];
  verdict: ("right" | "wrong" | null)[];
  cause: (string | null)[];
}

export interface Plan {
  phase: string;
  done: number;
  total: number;
}

export const KEYS = 88;
