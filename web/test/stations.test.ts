/** Which charging stations a driver wants, and marks on the map that do not hide each other. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import type { Stop } from "../src/api/documents";
import { groupsOf, type Lean, leansOf, numbersText, type Pixel, PIN_PX } from "../src/model/pins";
import { riskyStop } from "../src/model/answer";
import { bestPlace, fits, isPreferred, isSame, networkOf } from "../src/model/stations";

function at(longitude_deg: number, latitude_deg = 0) {
  return { latitude_deg, longitude_deg };
}

describe("stations", () => {
  test("are the same within 30 m", () => {
    assert.ok(isSame(at(0), at(0.00026)));
    assert.ok(!isSame(at(0), at(0.00028)));
  });

  test("are put where they lengthen the journey least, never before the start nor after the end", () => {
    const places = [at(0), at(1), at(2)];
    assert.deepEqual(
      [-1, 0.4, 1.6, 3].map((x) => bestPlace(places, at(x))),
      [1, 1, 2, 2],
    );
  });

  test("fit a car with one of their plugs; what is not known fits", () => {
    const of = (...kinds: string[]) => ({
      plugs: kinds.map((kind) => ({ kind, power_w: 1, power_known: true })),
    });
    assert.deepEqual(
      [of("type2", "chademo"), of("type2_combo"), of()].map((one) => fits(one, ["type2", "schuko"])),
      [true, false, true],
    );
    assert.ok(fits(of("type2_combo"), []));
  });

  test("hold the risk of a plan where they have at least half of it, the first one first", () => {
    const riskOf = (p_reserve: number, ...chances: number[]) => {
      const stops = chances.map((p_reach) => ({ p_reach })) as Stop[];
      return stops.indexOf(riskyStop({ stops, p_reserve }) as Stop);
    };
    assert.equal(riskOf(0.94, 0.94, 0.99), 0);
    assert.equal(riskOf(0.43, 0.99, 0.45), 1);
    assert.equal(riskOf(0.8, 0.9, 0.85), 0);
    assert.equal(riskOf(0.8, 0.98), -1); // the end has it
    assert.equal(riskOf(0.96, 0.96), -1); // the plan keeps the reserve
  });

  test("have a network where another one begins with the same words", () => {
    const names = ["Netz A 1", "Netz A 12", "Netz Nord", "Bahnhof", "Ionic", "Ionic", "24 Laden", "24 Strom"];
    assert.equal(networkOf("Netz A 1", names), "Netz A");
    assert.equal(networkOf("Netz Nord", names), "Netz");
    assert.equal(networkOf("Bahnhof", names), "");
    assert.equal(networkOf("Ionic", names), "Ionic");
    assert.equal(networkOf("24 Laden", names), "");
    for (const name of names) {
      const network = networkOf(name, names);
      if (network) assert.ok(isPreferred(name, [network]));
    }
  });
});

function bodyOf([x, y]: Pixel, [right, down]: Lean) {
  return [x + (right * PIN_PX) / 2, y + (down * PIN_PX) / 2] as const;
}

describe("marks", () => {
  test("four pins at one point hide nothing of each other", () => {
    const tips: Pixel[] = [0, 1, 2, 3].map(() => [100, 100]);
    const bodies = leansOf(tips, []).map((lean, k) => bodyOf(tips[k] as Pixel, lean));
    for (const [k, [x, y]] of bodies.entries()) {
      for (const [otherX, otherY] of bodies.slice(k + 1)) {
        assert.ok(Math.max(Math.abs(x - otherX), Math.abs(y - otherY)) >= PIN_PX);
      }
    }
  });

  test("a pin leans away from a stop, and else to the right above its tip", () => {
    assert.deepEqual(leansOf([[100, 100]], []), [[1, -1]]);
    assert.deepEqual(leansOf([[100, 100]], [[112, 92]]), [[-1, -1]]);
  });

  test("stops share a mark where they are near", () => {
    assert.deepEqual(
      groupsOf([
        [0, 0],
        [30, 0],
        [50, 0],
        [0, 10],
      ]),
      [
        [0, 3],
        [1, 2],
      ],
    );
    assert.deepEqual([[3], [2, 3, 4], [1, 7], [1, 2, 7]].map(numbersText), ["3", "2–4", "1+7", "1–2+7"]);
  });
});
