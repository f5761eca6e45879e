"""Tables of Markdown pages, written between markers from a `results.json` and never by hand.

The README holds one short table, that of the forecast. The wide tables of every protocol stand in `docs/results.md`, each
between markers of its own.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from tripwatt.errors import Fault, InvalidInput
from tripwatt.report import forecast, planned, sentences
from tripwatt.report.tables import markdown, results_table, sets_table, short_table
from tripwatt.report.view import View

BEGIN: Final = "<!-- results:begin -->"
END: Final = "<!-- results:end -->"
"""Around the short table of the README."""
PAPER_BEGIN: Final = "<!-- paper:begin -->"
PAPER_END: Final = "<!-- paper:end -->"
FORECAST_BEGIN: Final = "<!-- forecast:begin -->"
FORECAST_END: Final = "<!-- forecast:end -->"
"""Around the wide tables of `docs/results.md`, as are `planned.BEGIN` and `planned.END`."""
README_PROTOCOL: Final = "forecast"
"""The protocol whose short table the README shows."""


def render_short(results: Mapping[str, Any]) -> str:
    """The short table as Markdown: title, mean error with its interval, and how often a forecast's interval holds.

    Parameters
    ----------
    results : mapping
        The contract of `results.json`.
    """
    view = View(results)
    parts = [_SYNTHETIC] if view.synthetic else []
    parts.append(markdown(short_table(view)))
    parts.append(
        "The best model of each kind, on trips that it was not fitted on, given the driven speed trace."
    )
    return "\n\n".join(parts)


_SYNTHETIC: Final = (
    "**These trips are synthetic: they show that the pipeline works, not how good it is on a road.**"
)


def render_paper(results: Mapping[str, Any]) -> str:
    """Results of the protocol `paper` as Markdown: headline, main table, the other trip sets, what to know.

    Parameters
    ----------
    results : mapping
        The contract of `results.json`.
    """
    view = View(results)
    said = [sentences.on_main_table(view), sentences.on_paper(view)]
    if view.synthetic:
        said.insert(0, _SYNTHETIC)
    parts = [" ".join(said), markdown(results_table(view, view.main)), markdown(sets_table(view))]
    if missing := sentences.without_days(view):
        parts.append(missing)
    if citation := str(results.get("citation") or ""):
        parts.append(f"Data: {citation}")
    parts.append(
        f"Protocol `{results.get('protocol', '?')}`, seed {results.get('seed', '?')}; "
        "written from `results.json` by `tripwatt.report.update_results_page`."
    )
    return "\n\n".join(parts)


def render_forecast(results: Mapping[str, Any]) -> str:
    """The forecast's figures as Markdown: what is said of them, every model, the other scheme, and the way there.

    Parameters
    ----------
    results : mapping
        The contract of `results.json`, protocol `forecast`.
    """
    view = View(results)
    parts = [" ".join(forecast.forecast_sentences(results)), markdown(results_table(view, view.main))]
    if forecast.has_forecast(view):
        parts.append(markdown(forecast.updates_table(view)))
    parts.append(markdown(sets_table(view)))
    parts.append(
        f"Protocol `forecast`, seed {results.get('seed', '?')}; "
        "written from `results.json` by `tripwatt.report.update_results_page`."
    )
    return "\n\n".join(parts)


def update_readme(results: Mapping[str, Any], readme_path: Path) -> None:
    """Replace what stands between the markers of a README by the short table. The rest stays as it is.

    Parameters
    ----------
    results : mapping
        The contract of `results.json`. Only the protocol `README_PROTOCOL` changes the README.
    readme_path : Path
        A file that holds `<!-- results:begin -->` and `<!-- results:end -->`, once each and in this order.

    Raises
    ------
    InvalidInput
        When the markers are not there.
    """
    if results.get("protocol") == README_PROTOCOL:
        _between(readme_path, BEGIN, END, render_short(results))


def update_results_page(results: Mapping[str, Any], page_path: Path) -> None:
    """Replace what stands between the markers of a protocol by its wide tables. The rest of the page stays as it is.

    Parameters
    ----------
    results : mapping
        The contract of `results.json`, or what `benchmarks.planned` writes (protocol `links`).
    page_path : Path
        A file that holds `<!-- paper:begin -->` and `<!-- paper:end -->`, once each and in this order; for the protocol
        `forecast` the same with `forecast`, for planned routes with `links`.

    Raises
    ------
    InvalidInput
        When the markers are not there.
    """
    if results.get("protocol") == "forecast":
        _between(page_path, FORECAST_BEGIN, FORECAST_END, render_forecast(results))
    elif results.get("protocol") == "links":
        _between(page_path, planned.BEGIN, planned.END, planned.render_links(results))
    else:
        _between(page_path, PAPER_BEGIN, PAPER_END, render_paper(results))


def _between(path: Path, opening: str, closing: str, shown: str) -> None:
    """Put `shown` between two markers of a file; the file appears whole or stays as it was."""
    text = path.read_text(encoding="utf-8")
    before, begin, rest = text.partition(opening)
    _, end, after = rest.partition(closing)
    if not begin or not end or text.count(opening) != 1 or text.count(closing) != 1:
        got = f"{text.count(opening)} times begin, {text.count(closing)} times end"
        allowed = f"one {opening} and, after it, one {closing}"
        raise InvalidInput(Fault("no place for the results", str(path), got, allowed))
    partial = path.with_name(f"{path.name}.partial")
    partial.write_text(f"{before}{opening}\n{shown}\n{closing}{after}", encoding="utf-8")
    os.replace(partial, path)
