"""Every message of the service that the page may show has its German."""

from __future__ import annotations

import ast
import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

from tools.docs.page_messages import messages

import tripwatt
from tripwatt.server.http.problems import TITLES

TEXTS = Path(__file__).resolve().parents[3] / "web" / "src" / "text"
NAMES = re.compile(r"\{[^}]*\}|'[^']*'|\w*_\w*|\w+\.\w+|\[\w+[^\]]*\]")
"""What stands for a value, and names of fields and keys: the same in every language."""

KEYS = {"unit", "ele", "lat", "lon", "licence", "licences", "heater", "anchor", "extends", "scaled", "units", "metadata", "query",
        "tlm", "utc", "pyvalhalla", "toml", "json", "model", "fitted", "preset", "base", "buckets", "evaluation", "label", "models", "options", "others",
        "overrides", "provenance", "seed", "stops"}  # fmt: skip


def table(name: str) -> dict[str, str]:
    table: dict[str, str] = json.loads((TEXTS / "messages-de.json").read_text())[name]
    return table


def test_every_message_has_its_german() -> None:
    known = table("templates")
    raised = messages()
    assert len(raised) > 500
    assert [f"{text} ({place})" for text, place in raised.items() if text not in known] == []


def texts() -> Iterator[str]:
    """Every text of the package, but for docstrings."""
    package = Path(tripwatt.__file__).parent
    for file in package.rglob("*.py"):
        nodes = [*ast.walk(ast.parse(file.read_text()))]
        docs = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
        yield from (f"{n.value}" for n in nodes if isinstance(n, ast.Constant) and id(n) not in docs)
    yield from (file.read_text() for file in package.rglob("*.toml"))


def test_german_is_of_a_message_that_the_package_has() -> None:
    """The walk does not find every one, such as names of relations; their words stand in a text."""
    raised, said = messages(), "\n".join(texts())
    unused = [m for m in table("templates") if m not in raised and any(p not in said for p in m.split("{}"))]
    assert unused == []


def test_german_has_the_values_of_the_message() -> None:
    for english, german in table("templates").items():
        holes, given = re.findall(r"\{(\d*)\}", german), english.count("{}")
        if any(holes):
            assert all(1 <= int(place) <= given for place in holes if place), english
        assert len(holes) <= given, english
        assert german.strip(), english


def test_every_place_in_an_input_has_its_german() -> None:
    known = table("places")
    for where in messages("where"):
        left = NAMES.sub(" ", where)
        for words in sorted(known, key=len, reverse=True):
            left = re.sub(rf"\b{re.escape(words)}\b", " ", left)
        assert set(re.findall(r"[a-z]{3,}", left)) <= KEYS, where


def test_every_kind_of_problem_has_its_title_on_the_page() -> None:
    for language in ("en", "de"):
        titles = re.findall(r"titles: \{\n(.*?)\n    \},", (TEXTS / f"{language}.ts").read_text(), re.DOTALL)
        known = set(re.findall(r'^      "?([\w-]+)"?:', titles[0], re.MULTILINE))
        assert known == TITLES.keys() - {"no-live"} or known == set(TITLES), language


def test_german_has_one_word_for_one_thing_and_one_form_of_address() -> None:
    """A forecast, a car, a trip; sentences that ask say "Sie", labels have the infinitive."""
    texts = [(TEXTS / "de.ts").read_text(), json.dumps(table("templates"), ensure_ascii=False)]
    flags = tomllib.loads((Path(tripwatt.__file__).parent / "trips" / "flags.toml").read_text())["flags"]
    texts += [json.dumps([flag.get("de", "") for flag in flags.values()], ensure_ascii=False)]
    for words in texts:
        assert (
            re.findall(r"Vorhersage\w*|\bFahrzeug\w*|\bReise\w*|Ausrüstung|\b[Dd]eine?\b|\b[Dd]u\b", words)
            == []
        )
