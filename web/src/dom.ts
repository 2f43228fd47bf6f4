/** Makes elements. Text goes in as text: what a file says can never become markup. */

type Child = Node | string;

/**
 * Make an element.
 *
 * @param tag its name.
 * @param attributes such as `class` and `aria-label`.
 * @param children elements and text.
 */
export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Record<string, string> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** Outlines of the controls' signs, in a square of 24. */
const SIGNS = {
  play: "M7 4.5v15l12-7.5z",
  pause: "M7 5h3.5v14H7zM13.5 5H17v14h-3.5z",
  back: "M15.5 5v14L8 12zM6 5h1.8v14H6z",
  on: "M8.5 5v14l7.5-7zM16.2 5H18v14h-1.8z",
  loop: "M7 7h9.5V4l4 4-4 4V9H9v4H7zM17 17H7.5v3l-4-4 4-4v3H15v-4h2z",
  whole: "M4 4h6v2H6v4H4zM14 4h6v6h-2V6h-4zM4 14h2v4h4v2H4zM18 14h2v6h-6v-2h4z",
  falling: "M5 3h3v9H5zM10.5 8h3v6h-3zM16 3h3v5h-3zM4 17h16v4H4z",
  numbers: "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18zm1.5 13.5h-2.2v-6.2l-1.8.6V9l3.2-1.5h.8z",
  film: "M4 6h11v12H4zM16.5 10.5 21 7.5v9l-4.5-3z",
  fault: "M6.4 5 12 10.6 17.6 5 19 6.4 13.4 12l5.6 5.6-1.4 1.4L12 13.4 6.4 19 5 17.6 10.6 12 5 6.4z",
} as const;

export type Sign = keyof typeof SIGNS;

export function sign(name: Sign): SVGSVGElement {
  const space = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(space, "svg");
  svg.setAttribute("viewBox", "0 0 24 24");
  svg.setAttribute("aria-hidden", "true");
  const path = document.createElementNS(space, "path");
  path.setAttribute("d", SIGNS[name]);
  svg.append(path);
  return svg;
}
