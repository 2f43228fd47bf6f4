/** Which of two values of a measure is better. */

import type { Measure } from "./api";

const LESS_IS_BETTER = /phantom|spread|overlap|crossed|rad\/s|rail|never struck|at end|at limit/;
/** Of these no single number is best. */
const NEITHER = /error/;

/**
 * Compare two values.
 *
 * @returns 0 or 1 for the better one, -1 for neither.
 */
export function better(label: string, one: string, other: string): -1 | 0 | 1 {
  const [a, b] = [parseFloat(one), parseFloat(other)];
  if (NEITHER.test(label) || !Number.isFinite(a) || !Number.isFinite(b) || a === b) return -1;
  return a > b === LESS_IS_BETTER.test(label) ? 1 : 0;
}

/** Rows of a table of both: label, one value, the other; "-" where one has none. */
export function side(
  one: readonly Measure[],
  other: readonly Measure[],
): (readonly [string, string, string])[] {
  const values = new Map(other);
  return one.map(([label, value]) => [label, value, values.get(label) ?? "-"] as const);
}
