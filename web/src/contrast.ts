/** Which of two inks is easier to read on a colour. */

import { Color } from "three";

/** The one of most contrast, as the Web Content Accessibility Guidelines have it. */
export function inkOn<Ink extends string>(ground: Color, inks: readonly [Ink, Ink]): Ink {
  const [one, other] = inks;
  return contrast(ground, new Color(one)) >= contrast(ground, new Color(other)) ? one : other;
}

/** From 1, of equal colours, to 21. */
export function contrast(one: Color, other: Color): number {
  const [darker, lighter] = [luminance(one), luminance(other)].sort((a, b) => a - b);
  return (lighter! + 0.05) / (darker! + 0.05);
}

/** Of a color as three.js has it, with linear parts. */
function luminance({ r, g, b }: Color): number {
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}
