/** Languages, formats and the sentences of flags. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import type { Flag } from "../src/api/documents";
import { FLAGS } from "../generated/flags";
import { warningsOf, type Wording } from "../src/model/flags";
import { formatFor } from "../src/model/format";
import { ENERGY, PERCENT, type System, unitsOf } from "../src/model/units";
import { LANGUAGES, type Language, languageOf, load, localeOf } from "../src/text";
import { pluralOf } from "../src/text/plural";

const TEXTS = { en: (await load("en")).text, de: (await load("de")).text };

function wording(language: Language, system: System = "metric"): Wording {
  return { text: TEXTS[language], format: formatFor(language), units: unitsOf(system) };
}

function flag(code: string, subject: string, value: number | null = null, unit = ""): Flag {
  return { code, subject, value, unit, message: `message of ${code}` };
}

/** The sentences with ordinary spaces. */
function sentencesOf(flags: Flag[], language: Language = "en", system: System = "metric"): string[] {
  return warningsOf(flags, wording(language, system)).map(({ text, effect }) =>
    `${text} ${effect}`.trim().replaceAll("\u00a0", " "),
  );
}

/** Every text of a catalogue by its place; functions are called with twos. */
function leaves(node: unknown, where = ""): Map<string, string> {
  if (typeof node === "string") return new Map([[where, node]]);
  if (typeof node === "function") {
    const call = node as (...values: unknown[]) => string;
    return new Map([[where, call(...Array.from({ length: call.length }, () => 2))]]);
  }
  return new Map(
    Object.entries(node as object).flatMap(([key, part]) => [...leaves(part, `${where}/${key}`)]),
  );
}

describe("languages", () => {
  test("the chosen one, else the first of the browser's that the page has, else English", () => {
    assert.equal(languageOf("de", ["en-GB"]), "de");
    assert.equal(languageOf(null, ["fr-FR", "de-AT", "en"]), "de");
    assert.equal(languageOf(null, ["fr-FR"]), "en");
    assert.equal(languageOf("fr", ["de"]), "de");
    assert.equal(localeOf("de", ["en-GB", "de-CH"]), "de-CH");
    assert.equal(localeOf("en", ["de-CH"]), "en");
  });

  test("every catalogue has the same entries, and none is empty", () => {
    const english = leaves(TEXTS.en);
    for (const language of Object.keys(LANGUAGES) as Language[]) {
      const own = leaves(TEXTS[language]);
      assert.deepEqual([...own.keys()].sort(), [...english.keys()].sort());
      for (const [where, text] of own) assert.notEqual(text.trim(), "", `${language}${where}`);
    }
  });

  test("German is not English", () => {
    const english = leaves(TEXTS.en);
    const same = [...leaves(TEXTS.de)].filter(
      ([where, text]) => english.get(where) === text && !/^\{\w+\}( \(\{\w+\}\))?$/.test(text),
    );
    assert.deepEqual(
      same.map(([where]) => where),
      ALIKE,
    );
  });

  test("the count decides the form", () => {
    const count = pluralOf("en");
    const forms = { one: "# trip", other: "# trips" };
    assert.deepEqual(
      [0, 1, 2, 1200].map((n) => count(n, forms)),
      ["0 trips", "1 trip", "2 trips", "1,200 trips"],
    );
    assert.equal(pluralOf("de")(1200, forms), "1.200 trips");
  });
});

/** Texts that are the same in both languages. */
const ALIKE = [
  "/journey/plugs/type2_combo",
  "/journey/plugs/chademo",
  "/journey/road",
  "/conditions/fields/wind_speed_m_s",
  "/conditions/garage",
  "/result/reserve",
  "/drive/start",
  "/drive/pause",
  "/ownCars/name",
  "/token/label",
  "/problems/status",
];

describe("formats", () => {
  const en = formatFor("en");
  const de = formatFor("de");

  test("decimal signs, minus, no negative zero", () => {
    assert.equal(en.figure(-1.25, 1), "−1.3");
    assert.equal(de.figure(1234.5, 1), "1.234,5");
    assert.equal(en.figure(-0.04, 1), "0.0");
    assert.equal(de.plain(2.5, 2), "2,5");
    assert.equal(en.plain(3, 2), "3");
  });

  test("differences have their sign", () => {
    assert.deepEqual(
      [0.5, -0.5, 0.001].map((x) => de.signed(x, 1)),
      ["+0,5", "−0,5", "0,0"],
    );
  });

  test("quantities", () => {
    assert.equal(en.shown(13.8889, unitsOf("metric").speed), "50\u00a0km/h");
    assert.equal(en.shown(13.8889, unitsOf("imperial").speed), "31\u00a0mph");
    assert.equal(de.shown(4321, ENERGY), "4,32\u00a0kWh");
    assert.equal(de.shown(0.8, PERCENT), "80\u00a0%");
  });

  test("durations", () => {
    assert.equal(en.duration(3540), "59\u00a0min");
    assert.equal(en.duration(3900), "1\u00a0h\u00a005\u00a0min");
    assert.equal(en.duration(28_800), "8\u00a0h");
    assert.deepEqual([0.2, 40, 89, 91].map(en.span), ["1\u00a0s", "40\u00a0s", "89\u00a0s", "2\u00a0min"]);
  });
});

describe("flags", () => {
  test("conditions outside of the training range share a sentence without figures", () => {
    const flags = [
      flag("outside_training", "ambient_temperature_degc", 4.2, "sd"),
      flag("outside_training", "payload_mass_kg", 0.3, "sd"),
    ];
    assert.deepEqual(sentencesOf(flags), [
      "The outside temperature and the load are far outside the range of the measured trips. How far the forecast errs there is not known.",
    ]);
    assert.deepEqual(sentencesOf(flags.slice(0, 1), "de"), [
      "Die Außentemperatur liegt weit außerhalb des Bereichs der gemessenen Fahrten. Wie groß der Fehler der Prognose dort ist, ist nicht bekannt.",
    ]);
    assert.equal(warningsOf(flags, wording("en"))[0]?.serious, true);
    assert.equal(warningsOf(flags.slice(1), wording("en"))[0]?.serious, false);
  });

  test("limits of the car are given with their duration", () => {
    const flags = [
      flag("motor_power_limit", "motor", 40, "s"),
      flag("battery_voltage_floor", "battery", 150, "s"),
      flag("battery_empty", "battery", 1234, "wh"),
      flag("battery_full", "battery", 1300, "wh"),
    ];
    assert.deepEqual(sentencesOf(flags), [
      "The car does not reach all speeds of the trip: power limit of the motor for 40 s and lowest battery voltage for 3 min. The forecast assumes the highest speed that the car reaches.",
      "The trip takes 1.23 kWh more than you have in the battery. The battery is empty before the end.",
      "The battery is too full to recover 1.30 kWh. The friction brakes take it.",
    ]);
    assert.equal(warningsOf(flags.slice(2, 3), wording("en"))[0]?.serious, true);
  });

  test("speeds and temperatures are in the reader's units", () => {
    const speed = [flag("speed_assumed", "track", 13.8889, "m/s")];
    assert.deepEqual(sentencesOf(speed), ["Parts of the track have no speed; 50 km/h is assumed."]);
    assert.deepEqual(sentencesOf(speed, "en", "imperial"), [
      "Parts of the track have no speed; 31 mph is assumed.",
    ]);
    const kept = [flag("file_value_kept", "ambient_temperature_degc", 20, "degC")];
    assert.deepEqual(sentencesOf(kept, "en", "imperial"), [
      "The value in the file is used for the outside temperature: 68 °F.",
    ]);
    assert.deepEqual(sentencesOf([flag("links_too_long", "links", 2345, "m")], "de"), [
      "Benachbarte Straßenabschnitte mit gleicher Geschwindigkeit gelten als einer: Sie sind im Mittel 2,3 km lang und damit länger als die, für die die Genauigkeit bekannt ist. Der Bereich ist vielleicht zu schmal.",
    ]);
  });

  test("counts have their form", () => {
    assert.deepEqual(sentencesOf([flag("geometries_skipped", "geometries", 1)]), [
      "1 geometry is not a line and is left out.",
    ]);
    assert.deepEqual(sentencesOf([flag("first_of_several", "routes", 3)], "de"), [
      "Die Datei enthält 3 Routen; verwendet wird die erste.",
    ]);
  });

  test("a car without trips is named with the car of the training trips", () => {
    const [warning] = warningsOf([flag("no_trips_of_car", "BMW i3 60 Ah (2014)")], wording("en"));
    assert.ok(warning?.serious);
    assert.match(warning.text, /BMW i3 60 Ah \(2014\)/);
  });

  test("an unknown code is shown by its message, and so is a value that is missing", () => {
    const flags = [
      flag("something_new", "road"),
      flag("speed_assumed", "track"),
      flag("no_elevation", "road"),
    ];
    const warnings = warningsOf(flags, wording("de"));
    assert.deepEqual(
      warnings.map(({ text, isRaw }) => [text, isRaw]),
      [
        ["Die Höhen der Route sind unbekannt.", false],
        ["message of something_new", true],
        ["message of speed_assumed", true],
      ],
    );
  });

  test("every code has a sentence in every language, without a standard deviation or a count of samples", () => {
    for (const language of Object.keys(LANGUAGES) as Language[]) {
      for (const code of Object.keys(FLAGS)) {
        const [warning] = warningsOf([flag(code, "soc", 2, "")], wording(language));
        assert.equal(warning?.isRaw, false, code);
        assert.doesNotMatch(warning?.text ?? "", /undefined|NaN|standard dev|Standardabw|\bsd\b|samples/i);
      }
    }
  });
});
