/** The page's functions against the vectors of the Python library. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import arrivals from "../../tests/vectors/arrivals.json";
import energy from "../../tests/vectors/energy.json";
import interpolation from "../../tests/vectors/interpolation.json";
import planned from "../../tests/vectors/links.json";
import trace from "../../tests/vectors/profile.json";
import units from "../../tests/vectors/units.json";
import type { ChargingPlan, Forecast, Link, Stop } from "../src/api/documents";
import {
  arrivalBand,
  chanceOf,
  DOTS,
  emptyAfterM,
  equallyLikely,
  hundredthsOf,
  innerShare,
  likelihoodOf,
  socFromEnergy,
  verdictOf,
} from "../src/model/arrival";
import { waterfall } from "../src/model/causes";
import { energySoFarWh, naiveArrival, samplesUntil } from "../src/model/gauge";
import { interpolate } from "../src/model/interpolate";
import { atMotorwaySpeed, hasMotorway } from "../src/model/links";
import { climbsOf, profileFromSamples, withElevationOf } from "../src/model/profile";
import { ROADS } from "../generated/roads";
import { linksOfDistance, KINDS, type RoadType, sharesOver, sufficing } from "../src/model/distance";
import { linksOf, SAMPLE } from "../src/model/sections";
import { slowed, type Ways } from "../src/model/slow-way";
import { ENERGY, PERCENT, type System, type Units, systemOf, unitsOf } from "../src/model/units";
import { allNear, near } from "./near";

const UNNAMED = { trip: "", given: "", battery_loss_wh: 0, flags: [] };

function forecastFrom(vector: { forecast: object }): Forecast {
  return { ...UNNAMED, ...vector.forecast } as unknown as Forecast;
}

describe("a charge beside the one that is needed", () => {
  test("counts the reserve in the verdict and in what is missing", () => {
    // 60 % are needed, of which 10 % are the reserve; 32 % are expected to be used
    const NEED = { soc_needed: 0.6, reserve: 0.1, energy_wh: 8000, energy_quantile_wh: 12_500 };
    const [full, short, empty] = [0.68, 0.55, 0.45].map((soc) => sufficing(soc, NEED));
    assert.deepEqual(
      [full, short, empty].map((one) => one?.verdict),
      ["good", "open", "bad"],
    );
    // 95 of 100 arrive, and most of them below the reserve
    const below = sufficing(0.3, {
      soc_needed: 0.38,
      reserve: 0.1,
      energy_wh: 5000,
      energy_quantile_wh: 6100,
    });
    assert.deepEqual([below.verdict, below.left > 0, below.arrival < 0.1], ["bad", true, true]);
    near(full?.left ?? 0, 0.18);
    near(short?.lacking ?? 0, 0.05);
    near(full?.arrival ?? 0, 0.36);
  });
});

describe("units", () => {
  for (const { system, quantity, si, shown } of units) {
    test(`${quantity}, ${system}, ${si}`, () => {
      const { from, to } = unitsOf(system as System)[quantity as keyof Units];
      near(from(si), shown);
      near(to(shown), si);
    });
  }

  test("the systems have the same quantities, and every one is in a vector or a fixed scale", () => {
    const names = Object.keys(unitsOf("metric"));
    for (const system of ["british", "imperial"] as const) {
      assert.deepEqual(Object.keys(unitsOf(system)).sort(), [...names].sort());
    }
    assert.deepEqual([...new Set(units.map(({ quantity }) => quantity))].sort(), [...names].sort());
  });

  test("Britain has miles and degrees Celsius, the United States miles and degrees Fahrenheit", () => {
    const shown = (locale: string) => {
      const { distance, speed, height, temperature, mass, consumption } = unitsOf(systemOf(locale));
      return [distance, speed, height, temperature, mass, consumption].map(({ unit }) => unit).join(" ");
    };
    assert.equal(shown("en-GB"), "mi mph m °C kg mi/kWh");
    assert.equal(shown("cy-Latn-GB"), "mi mph m °C kg mi/kWh");
    for (const locale of ["en-US", "es-US", "en-LR", "es-PR"]) {
      assert.equal(shown(locale), "mi mph ft °F lb mi/kWh");
    }
    for (const locale of ["en", "de-DE", "en-IE", "en-CA", "gb"]) {
      assert.equal(shown(locale), "km km/h m °C kg kWh/100 km");
    }
  });

  test("percent, kilowatt-hours, miles from a kilowatt-hour", () => {
    assert.equal(PERCENT.from(0.42), 42);
    assert.equal(ENERGY.from(1234), 1.234);
    const { from, to } = unitsOf("imperial").consumption;
    near(from(1000 / 1609.344 / 4), 4);
    near(to(from(0.163)), 0.163);
  });
});

test("interpolation is numpy's", () => {
  const { xs, ys, at, found } = interpolation;
  allNear(
    at.map((x) => interpolate(x, xs, ys)),
    found,
  );
  assert.ok(Number.isNaN(interpolate(1, [], [])));
});

describe("energy so far", () => {
  for (const [k, { observed, energy_wh }] of energy.entries()) {
    test(`vector ${k}`, () => {
      const found = energySoFarWh(observed);
      assert.ok(found);
      allNear(found, energy_wh);
    });
  }

  test("none without voltage and current, or with neither measured", () => {
    assert.equal(energySoFarWh({ time_s: [0, 1], soc: [0.5, 0.5] }), null);
    assert.equal(energySoFarWh({ time_s: [0, 1], voltage_v: [null, 360], current_a: [1, null] }), null);
  });

  test("samples until a time", () => {
    const observed = { time_s: [0, 1, 2, 3], soc: [0.5, 0.4, null, 0.3] };
    assert.deepEqual(samplesUntil(observed, 2), { time_s: [0, 1, 2], soc: [0.5, 0.4, null] });
  });
});

test("distance along a speed trace", () => {
  const { distanceM, elevationM } = profileFromSamples(trace.samples);
  allNear(distanceM, trace.distance_m);
  assert.equal(elevationM, null);
});

test("a road climbs by all its steps up, and descends by all its steps down", () => {
  assert.deepEqual(climbsOf(Float64Array.of(0, 10, 4, 4, 6)), [12, 6]);
});

test("the elevation of a position does not depend on the speed", () => {
  const slow = profileFromSamples({
    time_s: [0, 10, 20],
    speed_m_s: [10, 10, 10],
    elevation_m: [500, 520, 500],
  });
  const fast = profileFromSamples({ time_s: [0, 2.5, 5, 10], speed_m_s: [20, 20, 20, 20] });
  allNear(withElevationOf(slow, fast).elevationM ?? [], [500, 510, 520, 500]);
});

for (const [moment, vector] of Object.entries({
  departure: arrivals.departure,
  "half way": arrivals.half_way,
})) {
  describe(`arrival, ${moment}`, () => {
    const forecast = forecastFrom(vector);

    test("charge from energy", () => {
      allNear(
        vector.energies_wh.map((wh) => socFromEnergy(forecast, wh)),
        vector.charges,
        1e-7,
      );
    });

    test("band of 9 in 10, and the inner one", () => {
      allNear(arrivalBand(forecast), vector.band);
      near(innerShare(forecast), vector.inner_share);
    });

    test("equally likely charges", () => {
      assert.equal(DOTS, vector.dots.length);
      allNear(equallyLikely(forecast), vector.dots, 1e-7);
    });

    test("chance to keep the reserve", () => {
      assert.equal(chanceOf(forecast, vector.reserve), vector.chance);
      assert.equal(chanceOf(forecast, 0.123), null);
    });

    test("causes follow each other and end at the total", () => {
      const all = new Set(Object.keys(forecast.by_cause_wh));
      const steps = waterfall(forecast.by_cause_wh, all);
      assert.deepEqual(new Set(steps.map(({ key }) => key)), all);
      for (const [k, { startWh }] of steps.entries()) {
        const before = steps[k - 1];
        near(startWh, before ? before.startWh + before.energyWh : 0);
      }
      const last = steps.at(-1);
      near((last?.startWh ?? 0) + (last?.energyWh ?? 0), forecast.energy_wh, 1e-6);
    });
  });
}

test("naive gauge half way", () => {
  const forecast = forecastFrom(arrivals.half_way);
  const wh = energySoFarWh(arrivals.samples);
  const clock = Float64Array.from(arrivals.samples.time_s);
  const road = profileFromSamples(arrivals.samples);
  assert.ok(wh);
  near(naiveArrival(forecast, road, clock, wh) ?? Number.NaN, arrivals.naive_charge, 1e-7);
  assert.equal(naiveArrival({ ...forecast, measured_until_s: 1 }, road, clock, wh), null);
});

test("a battery that does not last ends between two points", () => {
  const empty_at_m = { early: 120, expected: 150, late: null };
  near(emptyAfterM({ ...forecastFrom(arrivals.departure), empty_at_m }) ?? Number.NaN, 150);
  assert.equal(emptyAfterM(forecastFrom(arrivals.departure)), null);
});

test("words and figures of a chance", () => {
  const words = [1, 0.99, 0.95, 0.7, 0.5, 0.2, 0.05, 0].map(likelihoodOf);
  assert.deepEqual(words, [
    "almostCertain",
    "almostCertain",
    "veryLikely",
    "likely",
    "open",
    "unlikely",
    "veryUnlikely",
    "almostImpossible",
  ]);
  assert.deepEqual([0.95, 0.5, 0.49].map(verdictOf), ["good", "open", "bad"]);
  assert.deepEqual(hundredthsOf(0.995), { side: "above", count: 99 });
  assert.deepEqual(hundredthsOf(0.005), { side: "below", count: 1 });
  assert.deepEqual(hundredthsOf(0.974), { side: "near", count: 97 });
});

test("another speed on the motorway alone", () => {
  const { links, travel_time_s } = planned;
  assert.ok(hasMotorway(links));
  assert.equal(atMotorwaySpeed(links, null), links);
  const changed = atMotorwaySpeed(links, 25);
  assert.deepEqual(changed.slice(0, 1), links.slice(0, 1));
  const slow = changed.map((link) => link.travel_time_s ?? link.length_m / (link.speed_m_s ?? Number.NaN));
  near(slow[0] as number, travel_time_s[0] as number);
  near(slow[1] as number, 1200 / 25 + 2);
  near(slow[2] as number, 3000 / 25);
  const gentle = atMotorwaySpeed(links, 5, 5).map((link) => link.length_m / (link.travel_time_s as number));
  assert.ok(gentle.every((speed) => speed <= 5 + 1e-9));
});

test("the sample of links has a motorway and is joined up", () => {
  const links = linksOf(SAMPLE, unitsOf("metric")) as unknown as Link[];
  assert.ok(hasMotorway(links));
  assert.deepEqual([links[0]?.start_elevation_m, links.at(-1)?.end_elevation_m], [510, 490]);
  for (const [k, link] of links.slice(1).entries()) {
    assert.equal(link.start_elevation_m, links[k]?.end_elevation_m);
  }
});

describe("a trip by distance and kind of road", () => {
  const metres = (links: { length_m: number }[]) => links.reduce((sum, { length_m }) => sum + length_m, 0);

  test("the shares of a kind add up, and so do its links", () => {
    for (const kind of KINDS) {
      const { town, country, motorway } = sharesOver(12345, kind);
      near(town + country + motorway, 1);
      near(metres(linksOfDistance(12345, kind)), 12345);
    }
  });

  test("180 km, mostly motorway: town as of 15 km, and the rest as the kind has it", () => {
    const links = linksOfDistance(180_000, "motorway");
    const at = (type: RoadType) =>
      links.filter(({ speed_m_s }) => Math.abs((speed_m_s ?? 0) - ROADS.speeds_m_s[type]) < 1e-9);
    const { town, country, motorway } = ROADS.shares.motorway;
    near(metres(at("town")), town * ROADS.town_m);
    near(metres(at("country")) / metres(at("motorway")), country / motorway);
    near(metres(links), 180_000);
    assert.ok(links.every(({ length_m }) => length_m > 500 && length_m <= 1000));
    assert.deepEqual(
      [links[0], links.at(-1)].map((link) => link?.stop_s),
      [undefined, undefined],
    );
    assert.ok([...at("country"), ...at("motorway")].every(({ stop_s }) => stop_s === 0));
    const speeds = links.map(({ speed_m_s }) => speed_m_s);
    assert.deepEqual(speeds, [...speeds].reverse());
  });

  test("in town there are no other roads", () => {
    assert.equal(linksOfDistance(2500, "city").length, 4); // two halves of 1250 m, in two links each
    assert.ok(hasMotorway(linksOfDistance(5000, "mixed")));
    assert.ok(!hasMotorway(linksOfDistance(5000, "country")));
  });
});

describe("sections of a road that are typed", () => {
  const read = (typed: string) => linksOf(typed, unitsOf("metric"));

  test("a slow one may have a stop, a fast one has none", () => {
    assert.deepEqual(read("0.5 36\n0.9; 90\n\n1,5 72"), [
      { length_m: 500, speed_m_s: 10 },
      { length_m: 900, speed_m_s: 25, stop_s: 0 },
      { length_m: 1500, speed_m_s: 20, stop_s: 0 },
    ]);
    assert.deepEqual(read("1, 36, 20"), [{ ...read("1 36")[0], start_elevation_m: 20, end_elevation_m: 20 }]);
  });

  test("what is missing is left to the service to name", () => {
    assert.deepEqual(JSON.parse(JSON.stringify(read("x 36 5")))[0].length_m, null);
    assert.deepEqual(read(""), []);
  });

  test("an end without a height is level", () => {
    const heights = (typed: string) =>
      read(typed).map(({ start_elevation_m, end_elevation_m }) => [start_elevation_m, end_elevation_m]);
    assert.deepEqual(heights("5\n1 36\n1 36 20\n1 36"), [
      [5, 5],
      [5, 20],
      [20, 20],
    ]);
    assert.deepEqual(heights("1 36\n1 36 20"), [
      [20, 20],
      [20, 20],
    ]);
    assert.deepEqual(heights("0\n1 36"), [[0, 0]]);
  });
});

describe("a plan whose first stop is reached slowly", () => {
  const series = (soc: number[], time_s: number[]) => ({
    distance_m: [0, 1000],
    time_s,
    displayed_soc: soc,
    displayed_soc_low: soc.map((one) => one - 0.01),
    displayed_soc_high: soc.map((one) => one + 0.01),
  });
  const wayOf = (energy_wh: number, soc: number, s: number, chance: number) => ({
    energy_wh,
    soc_arrival: soc,
    by_cause_wh: { climate: energy_wh - 900, rolling: 900 },
    p_arrive_by_soc: { "0": chance, "0.1": 0.3 },
    series: series([0.1, soc], [0, s]),
  });
  const ways = { usual: wayOf(1400, 0.02, 60, 0.8), slow: wayOf(1000, 0.04, 90, 0.98) } as unknown as Ways;
  const stop = { position_m: 1000, soc_arrival: 0.02, p_reach: 0.8, energy_wh: 5000, arrives_after_s: 60 };
  const plan = {
    p_arrive: 0.78,
    p_reserve: 0.76,
    energy_wh: 3000,
    by_cause_wh: { climate: 1000, rolling: 2000 },
    driving_s: 200,
    stops: [stop, { ...stop, position_m: 2000, arrives_after_s: 500 }],
    course: {
      position_m: [0, 500, 1000, 1000, 2000],
      time_s: [0, 30, 60, 400, 540],
      displayed_soc: [0.1, 0.06, 0.02, 0.5, 0.4],
      low: [0.1, 0.05, 0, 0.5, 0.3],
      high: [0.1, 0.07, 0.04, 0.5, 0.5],
    },
  } as unknown as ChargingPlan;

  test("has the chance, the charge and the time of the slow way, and what it saves is charged less", () => {
    const slow = slowed(plan, ways, 0);
    near(slow.p_arrive, (0.78 * 0.98) / 0.8);
    near(slowed(plan, ways, 0.1).p_reserve, (0.76 * 0.3) / 0.8); // with the reserve of who leaves with more
    near(slow.p_reserve, (0.76 * 0.98) / 0.8);
    const { soc_arrival, p_reach, energy_wh, arrives_after_s } = slow.stops[0] as Stop;
    assert.deepEqual([soc_arrival, p_reach, energy_wh, arrives_after_s], [0.04, 0.98, 4600, 90]);
    assert.equal(slow.stops[1]?.arrives_after_s, 530);
    assert.deepEqual([slow.energy_wh, slow.driving_s], [2600, 230]);
    assert.deepEqual(slow.by_cause_wh, { climate: 600, rolling: 2000 });
  });

  test("has the course of the slow way before the stop, and that of the plan from there on", () => {
    const { time_s, displayed_soc, low } = slowed(plan, ways, 0).course;
    allNear(time_s, [0, 45, 90, 430, 570]);
    allNear(displayed_soc, [0.1, 0.07, 0.04, 0.5, 0.4]);
    allNear(low, [0.09, 0.06, 0.03, 0.5, 0.3]);
  });
});
