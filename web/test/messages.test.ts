import assert from "node:assert/strict";
import { test } from "node:test";
import { Translator } from "../src/model/messages";
import german from "../src/text/messages-de.json";

const translator = new Translator(german);
const said = (text: string) => translator.message(text);

test("a message keeps its values, with the decimal mark of the language", () => {
  assert.equal(said("at most 12.5 kWh"), "höchstens 12,5 kWh");
  assert.equal(said("folder in use"), "Ordner wird bereits verwendet");
  assert.equal(said("a new or empty folder"), "ein neuer oder leerer Ordner");
});

test("values that are messages of their own are said in the language too", () => {
  assert.equal(
    said("did you mean 'Ruggell' (village) or 'Ruggeller Strasse' (street)?"),
    "ist 'Ruggell' (Dorf) oder 'Ruggeller Strasse' (Straße) gemeint?",
  );
  assert.equal(
    said("elevation stays at 455 m over 12.5 km: the road is treated as flat"),
    "die Höhe bleibt über 12,5 km bei 455 m: Die Strecke gilt als flach",
  );
});

test("a reason of several parts is said part by part", () => {
  assert.equal(
    said("name matches; values of 0 to 31.2 are km/h rather than m/s"),
    "Name passt; Werte von 0 bis 31,2 sind km/h statt m/s",
  );
  assert.equal(
    said("name matches; values of 3 to 9: CHECK: m/s or km/h"),
    "Name passt; Werte von 3 bis 9: BITTE PRÜFEN: m/s oder km/h",
  );
});

test("an unknown message is none", () => {
  assert.equal(said("Balzers"), null);
});

test("places in an input", () => {
  assert.equal(translator.place("drive.csv row 12 column 'speed'"), "drive.csv Zeile 12 Spalte 'speed'");
  assert.equal(translator.place("links, link 3, length_m"), "Links, Link 3, length_m");
  assert.equal(translator.place("trip.csv"), "trip.csv");
});

test("kinds of places of OpenStreetMap", () => {
  assert.equal(translator.kind("place_of_worship"), "Gotteshaus");
  assert.equal(translator.kind("of_no_map"), "");
});
