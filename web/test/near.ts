/** Comparisons of numbers. */

import assert from "node:assert/strict";

/** Equal to `tolerance` relative to the larger of 1 and the expected value. */
export function near(found: number, expected: number, tolerance = 1e-9): void {
  const most = tolerance * Math.max(Math.abs(expected), 1);
  assert.ok(Math.abs(found - expected) <= most, `${found} is not within ${most} of ${expected}`);
}

export function allNear(found: ArrayLike<number>, expected: ArrayLike<number>, tolerance?: number): void {
  assert.equal(found.length, expected.length);
  for (let k = 0; k < found.length; k++) near(found[k] as number, expected[k] as number, tolerance);
}
