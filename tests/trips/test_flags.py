"""The catalogue of flags: one entry gives the sentence of the command line and those of the page."""

from __future__ import annotations

import re
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from tools.docs.write_page_flags import FOLDER, LANGUAGES, render

import tripwatt
from tripwatt.trips import messages
from tripwatt.trips.departure import ASKED
from tripwatt.trips.flags import Flag
from tripwatt.trips.messages import FORMS, catalogue, message, severity_of

ENTRY = {
    "severity": {"ice": "caution", "other": "note"},
    "cli": {"text": "the road has {what} at {temperature}", "what": {"ice": "ice", "other": "snow"}},
    "en": {"text": "There is snow on the road at {temperature}.", "effect": "{wider}"},
    "de": {"text": "Auf der Straße liegt bei {temperature} Schnee.", "effect": "{wider}"},
}
ROOMS = ("forecasting", "roads", "physics", "routes", "server", "population")
"""Rooms whose flags reach the page."""


def templates(words: dict[str, Any]) -> list[str]:
    return [t for w in words.values() for t in ([w] if isinstance(w, str) else w.values())]


def test_a_new_flag_is_one_entry(monkeypatch: pytest.MonkeyPatch) -> None:
    known = deepcopy(dict(catalogue()))
    known["flags"]["snow"] = ENTRY
    monkeypatch.setattr(messages, "catalogue", lambda: known)
    flag = Flag("snow", "ice", -3.2, "degc")
    assert (message(flag), severity_of(flag)) == ("the road has ice at -3 °C", "caution")
    assert message(Flag("snow", "road", -3.2, "degc")) == "the road has snow at -3 °C"
    page = "".join(render(known).values())
    for language in LANGUAGES:
        assert f'"text": "{ENTRY[language]["text"]}"' in page
    assert '"snow"' not in "".join(render(catalogue()).values())


def test_every_flag_of_a_forecast_or_a_route_has_words_on_the_page() -> None:
    package = Path(tripwatt.__file__).parent
    sources = "".join(file.read_text() for room in ROOMS for file in sorted((package / room).rglob("*.py")))
    raised = [code for code in catalogue()["flags"] if f'"{code}"' in sources]
    assert len(raised) > 15
    assert [code for code in raised if "en" not in catalogue()["flags"][code]] == []


@pytest.mark.parametrize("code", sorted(catalogue()["flags"]))
def test_entries_are_whole(code: str) -> None:
    entry = catalogue()["flags"][code]
    assert set(entry) <= {"cli", "en", "de", "severity", "steps", "with"}
    assert entry.get("with", code) in catalogue()["flags"]
    assert ("en" in entry) == ("de" in entry)
    assert entry.get("en", {}).keys() == entry.get("de", {}).keys()
    page = (FOLDER.parent / "src" / "model" / "flags.ts").read_text()
    page_forms = set(re.findall(r"^  (\w+): \(", page, re.MULTILINE)) | {"parts"}
    for words, forms in [(entry["cli"], set(FORMS)), *((entry.get(x, {}), page_forms) for x in LANGUAGES)]:
        used = set(re.findall(r"\{(\w+)\}", " ".join(templates(words))))
        assert used <= forms | words.keys() | catalogue()["shared"]["en"].keys()
        assert all("other" in w for w in words.values() if not isinstance(w, str))


def test_every_field_of_the_form_has_a_name_on_the_page() -> None:
    assert set(ASKED) - {"departs_at"} <= catalogue()["names"].keys()
    assert all(set(LANGUAGES) <= name.keys() for name in catalogue()["names"].values())
