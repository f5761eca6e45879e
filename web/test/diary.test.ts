/** The error of a car's forecasts and its trend. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import { errorOf, reasonsOf, seenIn, trendOf } from "../src/model/diary";

/** Trips of 1 kWh whose forecasts are off by these Wh, the newest first. */
function trips(...errors: number[]) {
  return errors.map((error) => ({ energy_wh: 1000, forecast_wh: 1000 + error }));
}

describe("the diary", () => {
  test("an error is that of all energy, whatever its sign", () => {
    assert.equal(errorOf(trips(100, -100)), 0.1);
    assert.equal(errorOf([{ energy_wh: 3000, forecast_wh: 3000 }, ...trips(400)]), 0.1);
    assert.equal(errorOf([]), null);
  });

  test("the trend holds the last trips against as many before, up to twenty", () => {
    const few = trendOf(trips(10, 20));
    assert.deepEqual([few.trips, few.before], [2, null]);
    const better = trendOf(trips(10, 10, 10, 10, 50, 50, 50, 50));
    assert.deepEqual([better.trips, better.latest, better.before], [4, 0.01, 0.05]);
    assert.deepEqual([better.course[0], better.course.at(-1)], [0.05, 0.01]);
    const many = trendOf(trips(...Array.from({ length: 90 }, (_, k) => k)));
    assert.deepEqual([many.trips, many.latest, many.before], [20, 0.0095, 0.0295]);
    assert.equal(many.course.length, 71);
    assert.deepEqual(trendOf([]), { trips: 0, latest: null, before: null, course: [] });
  });

  test("only what is known to be missing is a reason", () => {
    const row = { ambient_temperature_degc: 3, has_heights: true };
    const rows = [
      row,
      { ...row, has_heights: false },
      { ...row, has_heights: null, ambient_temperature_degc: null },
    ];
    assert.deepEqual(reasonsOf(rows, 3), { flat: 1, withoutAir: 1, isYoung: true });
    assert.equal(reasonsOf(rows, 20).isYoung, false);
  });

  test("a car has seen the temperatures at which any factor was measured", () => {
    const factor = { change: 0, sd: 1, unit: "1" as const };
    const seen = (seen_degc: [number, number] | null) => ({ ...factor, seen_degc });
    assert.deepEqual(seenIn({ air: seen([5, 26]), heating: seen([1, 9]), frost: seen(null) }), [1, 26]);
    assert.equal(seenIn({ frost: seen(null) }), null);
  });
});
