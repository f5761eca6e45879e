/** Which place a text names. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import type { Vehicle } from "../src/api/documents";
import { withBeginning } from "../src/model/cars";
import type { Place } from "../src/api/documents";
import { isCalled, placeCalled } from "../src/model/places";

function place(name: string, kind: string): Place {
  return { name, kind, context: "", also_called: "", latitude_deg: 47, longitude_deg: 9 };
}

const CALLED: [string, string, boolean][] = [
  ["Vaduz", "Vaduz", true],
  [" vaduz ", "Vaduz, Liechtenstein", true],
  ["Liechtenstein", "Vaduz, Liechtenstein", false],
  ["Feldkirch", "Feldkircherstrasse, Nendeln", false],
  ["Vaduz", "Vaduz VP Bank, Vaduz", false],
  ["Landstrasse Schaan", "Landstrasse, Schaan", true],
  ["hauptstrasse", "Hauptstraße, Gänsdorf", true],
  ["Zuerich", "Zürich", true],
  ["Zurich", "Zürich", true],
  ["", "", false],
];

describe("the whole name of a place", () => {
  for (const [words, name, expected] of CALLED) {
    test(`${words} for ${name}`, () => {
      assert.equal(isCalled(name, words), expected);
    });
  }
  test("a part of a name, and a name of several, is no place", () => {
    assert.equal(placeCalled("Feldkirch", [place("Feldkircherstrasse, Nendeln", "street")]), null);
    const streets = [place("Landstrasse, Balzers", "street"), place("Landstrasse, Schaan", "street")];
    assert.equal(placeCalled("Landstrasse", streets), null);
    assert.equal(placeCalled("Landstrasse Schaan", streets), streets[1]);
  });
});

test("cars with a word that begins so follow those that were found", () => {
  const all = ["BMW i3 60 Ah", "BMW i3s 120 Ah", "Jaguar I-Pace", "Renault Zoe"].map(
    (title) => ({ title, name: title.toLowerCase().replaceAll(" ", "_") }) as Vehicle,
  );
  const titles = (words: string, found: Vehicle[]) =>
    withBeginning(words, found, all).map(({ title }) => title);
  assert.deepEqual(titles("i3", all.slice(0, 1)), ["BMW i3 60 Ah", "BMW i3s 120 Ah"]);
  assert.deepEqual(titles("i", all.slice(2, 3)), ["Jaguar I-Pace", "BMW i3 60 Ah", "BMW i3s 120 Ah"]);
  assert.deepEqual(titles("bmw 120", []), ["BMW i3s 120 Ah"]);
});
