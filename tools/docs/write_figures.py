"""Fill the figures in the prose of README and docs from the published results: ``python -m tools.docs.write_figures``.

A figure stands between two comments, ``<!-- fig: PLACE | FORM -->6.2<!-- /fig -->``. PLACE is a file of docs/results and the keys
in it, parted by slashes; ``[key=value;key=value]`` chooses from a list. FORM is one of `FORMS`. The paired
difference of two models, ``forecast/paired[a=physics;b=hybrid]/diff``, is a minus b, as it stands in the file.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from tools import DOCS, ROOT
from tripwatt.study.report.tables import number, span

RESULTS: Final = DOCS / "results"
FIGURE: Final = re.compile(r"(<!-- fig: ([^|>]+?) \| ([^|>]+?) -->).*?(<!-- /fig -->)", re.S)

FORMS: Final[Mapping[str, Callable[[Any], str]]] = MappingProxyType(
    {
        "%": lambda x: number(x, 100, 1),
        "% whole": lambda x: number(x, 100, 0),
        "points": lambda x: number(x, 100, 1),
        "minus points": lambda x: number(-x, 100, 1),
        "span": lambda x: span(x).replace("\u00a0", " "),
        "minus span": lambda x: span([-x[1], -x[0]]).replace("\u00a0", " "),
        "number": lambda x: number(x, 1, 0),
        "times": lambda x: number(x, 1, 2),
    }
)
"""How a value of a file is written."""


def value(place: str, results: Path = RESULTS) -> Any:
    """A value of a published file; raises KeyError with the place where there is none."""
    name, *steps = place.split("/")
    node = json.loads((results / f"{name}.json").read_text(encoding="utf-8"))
    for step in steps:
        key, _, chosen = step.rstrip("]").partition("[")
        try:
            node = node[int(key)] if isinstance(node, list) else node[key]
            if chosen:
                conditions = dict(pair.split("=", 1) for pair in chosen.split(";"))
                (node,) = (row for row in node if all(str(row[k]) == v for k, v in conditions.items()))
        except (KeyError, IndexError, TypeError, ValueError) as error:
            raise KeyError(f"{place}: no single {step}") from error
    return node


def filled(page: str, results: Path = RESULTS) -> str:
    """A page with its figures as the results have them."""

    def figure(match: re.Match[str]) -> str:
        opening, place, form, closing = match.groups()
        return f"{opening}{FORMS[form](value(place, results))}{closing}"

    return FIGURE.sub(figure, page)


def pages() -> list[Path]:
    """README and every page of the docs but decisions, which keep the figures of their time."""
    docs = (page for page in DOCS.rglob("*.md") if page.parent.name != "decisions")
    return [ROOT / "README.md", *sorted(docs)]


if __name__ == "__main__":
    for page in pages():
        text = page.read_text(encoding="utf-8")
        if filled(text) != text:
            page.write_text(filled(text), encoding="utf-8")
