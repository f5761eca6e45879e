/** The line of a road on the map. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import type { ChargingPlan, Road } from "../src/api/documents";
import {
  distanceNear,
  energyAtWh,
  piecesOf,
  piecesOfPlan,
  pointAt,
  pointsOf,
  positionNear,
  readCoordinates,
} from "../src/model/road";
import { allNear, near } from "./near";

/** A road of 12 km to the east along 60 °N, with a point a kilometre; energy at both ends of four stretches of 3 km. */
function road(energyWh: number[], scale = 1): Road {
  const at = Array.from({ length: 13 }, (_, k) => k);
  return {
    distance_m: 12000,
    line: {
      latitude_deg: at.map(() => 60),
      longitude_deg: at.map((k) => 10 + k / 100),
      position_m: at.map((k) => 1000 * k),
    },
    forecast: {
      series: { distance_m: [0, 3000, 6000, 9000, 12000].map((m) => m * scale), energy_wh: energyWh },
    },
  } as unknown as Road;
}

describe("pieces by consumption", () => {
  test("a quarter above or below the mean is high or low; neighbours of one level are one piece", () => {
    // mean 1/6 Wh/m; stretches: 0.3 = 1.8 times the mean, 0.1 = 0.6, and 2/15 = 0.8 twice
    const pieces = piecesOf(road([0, 900, 1200, 1600, 2000]));
    assert.deepEqual(
      pieces.map(({ level, line }) => [level, line.length]),
      [
        ["high", 4],
        ["low", 4],
        ["usual", 7],
      ],
    );
    assert.deepEqual(pieces[1]?.line[0], pieces[0]?.line.at(-1));
    assert.deepEqual(pieces[2]?.line.at(-1), [10.12, 60]);
  });

  test("within a quarter it is usual", () => {
    const levels = (energyWh: number[]) => piecesOf(road(energyWh)).map(({ level }) => level);
    // mean 0.1 Wh/m; the first stretches have 1.24 and 0.76 of it, then 1.26 and 0.74
    assert.deepEqual(levels([0, 372, 600, 900, 1200]), ["usual"]);
    assert.deepEqual(levels([0, 378, 600, 900, 1200]), ["high", "low", "usual"]);
  });

  test("of a plan, what a stop gives does not count", () => {
    const { line } = road([]);
    // 0.03 on each of four stretches of 3 km, the last one with 0.09; a stop halfway gives 0.4
    const course = {
      position_m: [0, 3000, 6000, 6000, 9000, 12000],
      displayed_soc: [0.5, 0.47, 0.44, 0.84, 0.81, 0.72],
    };
    const pieces = piecesOfPlan({ line, course } as unknown as ChargingPlan);
    assert.deepEqual(
      pieces.map(({ level, line: { length } }) => [level, length]),
      [
        ["low", 10],
        ["high", 4],
      ],
    );
  });

  test("points closer than a sixtieth of the road share a piece", () => {
    const dense = road([0, 900, 1200, 1600, 2000]);
    dense.line.longitude_deg = Array.from({ length: 1201 }, (_, k) => 10 + k / 10000);
    dense.line.latitude_deg = dense.line.longitude_deg.map(() => 60);
    dense.line.position_m = Array.from({ length: 1201 }, (_, k) => 10 * k);
    const points = piecesOf(dense).reduce((sum, { line }) => sum + line.length - 1, 1);
    assert.equal(points, 1201);
    assert.equal(piecesOf(dense).length, 3);
  });

  test("a forecast on another scale of distance has the same pieces", () => {
    const levels = (of: Road) => piecesOf(of).map(({ level }) => level);
    assert.deepEqual(levels(road([0, 900, 1200, 1600, 2000], 1.01)), ["high", "low", "usual"]);
    near(energyAtWh(road([0, 900, 1200, 1600, 2000], 1.01), 6000), 1200);
    near(energyAtWh(road([0, 900, 1200, 1600, 2000]), 1500), 450);
  });
});

test("points are longitude and latitude", () => {
  assert.deepEqual(pointsOf(road([0, 1, 2, 3, 4]))[1], [10.01, 60]);
});

describe("places along the road", () => {
  const straight = road([0, 1, 2, 3, 4], 2);

  test("the point at a distance of the forecast", () => {
    allNear(pointAt(straight, 0), [10, 60]);
    allNear(pointAt(straight, 3000), [10.015, 60]); // 3 km of 24 on the scale of the forecast
    allNear(pointAt(straight, 24000), [10.12, 60]);
  });

  test("the distance of the nearest place", () => {
    near(distanceNear(straight, [10.015, 60.2]), 3000, 1e-6);
    near(distanceNear(straight, [9, 60]), 0);
    near(distanceNear(straight, [11, 59]), 24000, 1e-6);
  });

  test("of a way out and back it is the one on the way out", () => {
    const { line } = road([]);
    const back = line.position_m.map((m) => 24000 - m).reverse();
    const turns = (ofLine: number[]) => [...ofLine, ...[...ofLine].reverse()];
    const both = {
      latitude_deg: turns(line.latitude_deg),
      longitude_deg: turns(line.longitude_deg),
      position_m: [...line.position_m, ...back],
    };
    near(positionNear({ line: both }, [10.05, 60.1]), 5000, 1e-6);
    near(positionNear({ line: both }, [11, 60]), 12000, 1e-6);
  });

  test("a degree of longitude is half as long at 60 °N", () => {
    const bend = road([0, 1, 2, 3, 4]);
    bend.distance_m = 2000;
    bend.line = {
      longitude_deg: [10, 10, 10.1],
      latitude_deg: [60, 60.1, 60.1],
      position_m: [0, 1000, 2000],
    };
    bend.forecast.series.distance_m = [0, 2000];
    // 0.06 ° east of the first leg are 0.03 ° of latitude; the second leg is 0.04 ° to the north
    near(distanceNear(bend, [10.06, 60.06]), 600, 1e-6);
  });
});

test("coordinates as people write them", () => {
  assert.deepEqual(readCoordinates("47.141, 9.5209"), { latitude_deg: 47.141, longitude_deg: 9.5209 });
  assert.deepEqual(readCoordinates(" -33 ; 151.2 "), { latitude_deg: -33, longitude_deg: 151.2 });
  assert.deepEqual(readCoordinates("90 -180"), { latitude_deg: 90, longitude_deg: -180 });
  for (const text of ["Vaduz", "47.1", "91, 0", "0, 181", "-90.1, 0", "47,1, 9,5", "1, 2, 3", ""]) {
    assert.equal(readCoordinates(text), null, text);
  }
});
