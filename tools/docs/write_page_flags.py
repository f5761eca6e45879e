"""Write web/src/api/flags.ts, the words of flags on the page: ``python -m tools.docs.write_page_flags``, a part of `make types`."""

import json
from collections.abc import Mapping
from typing import Any, Final

from tools import ROOT
from tripwatt.trips.messages import catalogue

FILE: Final = ROOT / "web" / "src" / "api" / "flags.ts"
LANGUAGES: Final = ("en", "de")
HEAD: Final = """/** Words of flags, written by `tools/docs/write_page_flags.py` from `trips/flags.toml`. Do not edit. */

import type { FieldName } from "../model/fields";

/** One text, or texts by subject, unit, step or plural of a flag. */
export type Words = string | Readonly<Record<string, string>>;

interface Rule {
  severity?: Words;
  steps?: Readonly<Record<string, number>>;
  with?: string;
}
"""


def render(known: Mapping[str, Any]) -> str:
    """The module for a catalogue: rules of the flags in their order, then words and names of fields by language."""
    shown = {code: entry for code, entry in known["flags"].items() if "en" in entry}
    rules = {
        code: {key: entry[key] for key in ("severity", "steps", "with") if key in entry}
        for code, entry in shown.items()
    }
    words = {x: {code: _shared(e[x], known["shared"][x]) for code, e in shown.items()} for x in LANGUAGES}
    names = {x: {field: name[x] for field, name in known["names"].items()} for x in LANGUAGES}
    tables = {
        "FLAGS: Readonly<Record<string, Rule>>": rules,
        "WORDS: Readonly<Record<Language, Readonly<Record<string, Readonly<Record<string, Words>>>>>>": words,
        "NAMES: Readonly<Record<Language, Readonly<Record<FieldName, string> & Record<string, string>>>>": names,
    }
    language = f"type Language = {' | '.join(map(json.dumps, LANGUAGES))};\n"
    return "\n".join(
        [HEAD, language, *(f"export const {name} = {_text(t)};\n" for name, t in tables.items())]
    )


def _text(table: Mapping[str, Any]) -> str:
    return json.dumps(table, ensure_ascii=False, indent=2)


def _shared(words: Mapping[str, Any], shared: Mapping[str, str]) -> dict[str, Any]:
    """Words of a flag with those that flags share put in."""
    return {key: shared.get(str(value)[1:-1], value) for key, value in words.items()}


if __name__ == "__main__":
    FILE.write_text(render(catalogue()))
