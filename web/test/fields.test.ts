/** The form of a departure, from the table of its fields. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import { FIELDS } from "../generated/fields";
import { CHOICES, type FieldName, NUMBERS, SEVERAL, valuesIn } from "../src/model/fields";
import { quantityIn, unitsOf } from "../src/model/units";
import { ASKED, conditionsFrom, fieldsOf, USUAL } from "../src/state/conditions";
import { near } from "./near";

describe("fields of a departure", () => {
  test("each is a number, a choice, or several", () => {
    const names = [...NUMBERS, ...CHOICES, ...SEVERAL].sort();
    assert.deepEqual(names, Object.keys(FIELDS).sort());
    assert.deepEqual([CHOICES, SEVERAL], [["climate", "terrain"], ["extras"]]);
  });

  test("the usual conditions are within the bounds, and every unit has its quantity", () => {
    for (const name of NUMBERS) {
      const { unit, minimum, maximum } = FIELDS[name];
      const usual = name in USUAL ? USUAL[name as keyof typeof USUAL] : null;
      if (typeof usual === "number") assert.ok(minimum <= usual && usual <= maximum, name);
      const quantity = quantityIn(unit, unitsOf("metric"));
      near(quantity.to(quantity.from(maximum)), maximum);
      assert.notEqual(quantity.unit, "", name);
    }
    assert.equal(quantityIn("Hz", unitsOf("metric")).unit, "Hz");
  });

  test("a value of another kind is no value", () => {
    const known = {
      soc: 0.5,
      climate: 3,
      extras: ["trailer"],
      rain_mm_h: null,
      samples: {},
      terrain: "flat",
    };
    assert.deepEqual(valuesIn(known), { soc: 0.5, terrain: "flat", extras: ["trailer"] });
  });

  test("a request has what is known", () => {
    const asked = fieldsOf(USUAL, {});
    const always: FieldName[] = ["soc", "ambient_temperature_degc", "climate", "terrain"];
    for (const name of always) assert.equal(asked[name as keyof typeof asked], USUAL[name as "soc"]);
    assert.ok(!("wind_speed_m_s" in asked) && !("extras" in asked) && !("motorwayMS" in asked));
    assert.equal(asked.cabin_temperature_degc, USUAL.ambient_temperature_degc);
    const windy = fieldsOf(
      { ...USUAL, wind_speed_m_s: 8, extras: ["roof_box"], beforeDeparture: "unknown" },
      {},
    );
    assert.deepEqual([windy.wind_speed_m_s, windy.extras], [8, ["roof_box"]]);
    assert.ok(!("cabin_temperature_degc" in windy));
  });

  test("conditions of a log are taken as far as it has them", () => {
    const at = conditionsFrom({ soc: 0.4, cabin_temperature_degc: 5, rain_mm_h: 2 }, USUAL);
    assert.deepEqual([at.soc, at.rain_mm_h, at.beforeDeparture], [0.4, 2, "logged"]);
    assert.equal(at.payload_mass_kg, USUAL.payload_mass_kg);
    assert.equal(conditionsFrom({}, at).beforeDeparture, "parked");
    assert.ok(ASKED.every((name) => name in at));
  });
});
