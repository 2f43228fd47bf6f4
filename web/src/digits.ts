/** A small picture of the signs that stand on notes and fingertips: 1 to 5, and a cross. */

import { CanvasTexture, LinearFilter } from "three";

/** Signs side by side in the picture. */
export const SIGNS = 6;
/** Place of the cross, which marks a note that was missed. */
export const CROSS = 5;

const SIZE = 64;

/** Draw the signs, white on nothing. */
export function signTexture(): CanvasTexture {
  const canvas = document.createElement("canvas");
  canvas.width = SIZE * SIGNS;
  canvas.height = SIZE;
  const draw = canvas.getContext("2d")!;
  draw.fillStyle = draw.strokeStyle = "#fff";
  draw.font = `600 ${SIZE * 0.78}px system-ui, sans-serif`;
  draw.textAlign = "center";
  draw.textBaseline = "middle";
  for (let digit = 1; digit <= 5; digit++) {
    draw.fillText(String(digit), (digit - 0.5) * SIZE, SIZE * 0.54);
  }
  draw.lineWidth = SIZE * 0.13;
  draw.lineCap = "round";
  const [left, top, far] = [(CROSS + 0.27) * SIZE, 0.27 * SIZE, 0.46 * SIZE];
  draw.moveTo(left, top);
  draw.lineTo(left + far, top + far);
  draw.moveTo(left + far, top);
  draw.lineTo(left, top + far);
  draw.stroke();
  const texture = new CanvasTexture(canvas);
  texture.minFilter = LinearFilter;
  texture.generateMipmaps = false;
  return texture;
}
