"""Write flags.ts and one for each other language, the words of flags on the page, and roads.ts, the kinds of road, into web/generated: a part of `make types`."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from tools import ROOT
from tripwatt.roads.journey.kinds import KINDS, TOWN_M, UNKNOWN, road_prior, shares_of
from tripwatt.trips.messages import catalogue

FOLDER: Final = ROOT / "web" / "generated"
LANGUAGES: Final = ("en", "de")
"""The first one is in the file that the page always loads."""

HEAD: Final = "/** Words of flags, written by `tools/docs/write_page_flags.py` from `trips/flags.toml`. Do not edit. */\n"
ROADS: Final = "/** Kinds of road, written by `tools/docs/write_page_flags.py` from `journey/kinds.py`. Do not edit. */\n"
TYPES: Final = """
import type { FieldName } from "../src/model/fields";

/** One text, or texts by subject, unit, step or plural of a flag. */
export type Words = string | Readonly<Record<string, string>>;
export type WordsOfFlags = Readonly<Record<string, Readonly<Record<string, Words>>>>;
export type NamesOfFields = Readonly<Record<FieldName, string> & Record<string, string>>;

interface Rule {
  severity?: Words;
  steps?: Readonly<Record<string, number>>;
  with?: string;
}
"""
IMPORTS: Final = '\nimport type { NamesOfFields, WordsOfFlags } from "./flags";\n'


def render(known: Mapping[str, Any]) -> dict[str, str]:
    """The modules for a catalogue by their names: rules of the flags in their order, words and names of fields; then those of other languages."""
    shown = {code: entry for code, entry in known["flags"].items() if "en" in entry}
    rules = {
        code: {key: entry[key] for key in ("severity", "steps", "with") if key in entry}
        for code, entry in shown.items()
    }
    parts = {"flags.ts": [TYPES, f"export const FLAGS: Readonly<Record<string, Rule>> = {_text(rules)};\n"]}
    for x in LANGUAGES:
        words = {code: _shared(entry[x], known["shared"][x]) for code, entry in shown.items()}
        names = {field: name[x] for field, name in known["names"].items()}
        name = "flags.ts" if x == LANGUAGES[0] else f"flags-{x}.ts"
        parts.setdefault(name, [IMPORTS]).extend(
            [
                f"export const WORDS: WordsOfFlags = {_text(words)};\n",
                f"export const NAMES: NamesOfFields = {_text(names)};\n",
            ]
        )
    return {name: "\n".join([HEAD.rstrip("\n"), *texts]) for name, texts in parts.items()} | {
        "roads.ts": roads()
    }


def roads() -> str:
    """The module of the kinds of road: shares of the distance, mean speeds, and the distance up to which town grows."""
    types, prior = ("town", "country", "motorway"), road_prior()
    shares = {kind: shares_of(kind) for kind in (*KINDS, UNKNOWN)}
    table = {
        "speeds_m_s": dict(zip(types, prior.speed_m_s, strict=True)),
        "shares": {kind: dict(zip(types, values, strict=True)) for kind, values in shares.items()},
        "town_m": TOWN_M,
    }
    return f"{ROADS}\nexport const ROADS = {_text(table)};\n"


def _text(table: Mapping[str, Any]) -> str:
    return json.dumps(table, ensure_ascii=False, indent=2)


def _shared(words: Mapping[str, Any], shared: Mapping[str, str]) -> dict[str, Any]:
    """Words of a flag with those that flags share put in."""
    return {key: shared.get(str(value)[1:-1], value) for key, value in words.items()}


def write(folder: Path = FOLDER) -> None:
    """Write the modules into a folder."""
    folder.mkdir(exist_ok=True)
    for name, content in render(catalogue()).items():
        (folder / name).write_text(content)


if __name__ == "__main__":
    write()
