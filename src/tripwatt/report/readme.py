"""The results table of the README, written between two markers from a `results.json` and never by hand."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from tripwatt.errors import Fault, InvalidInput
from tripwatt.report import forecast, planned, sentences
from tripwatt.report.tables import markdown, results_table, sets_table
from tripwatt.report.view import View

BEGIN: Final = "<!-- results:begin -->"
END: Final = "<!-- results:end -->"
FORECAST_BEGIN: Final = "<!-- forecast:begin -->"
FORECAST_END: Final = "<!-- forecast:end -->"


def render_readme_results(results: Mapping[str, Any]) -> str:
    """The README's results as Markdown: headline, main table, the other trip sets, what to know.

    Parameters
    ----------
    results : mapping
        The contract of `results.json`.
    """
    view = View(results)
    said = [sentences.on_main_table(view), sentences.on_paper(view)]
    if view.synthetic:
        said.insert(
            0,
            "**These trips are synthetic: they show that the pipeline works, not how good it is on a road.**",
        )
    parts = [" ".join(said), markdown(results_table(view, view.main)), markdown(sets_table(view))]
    if missing := sentences.without_days(view):
        parts.append(missing)
    if citation := str(results.get("citation") or ""):
        parts.append(f"Data: {citation}")
    parts.append(
        f"Protocol `{results.get('protocol', '?')}`, seed {results.get('seed', '?')}; "
        "written from `results.json` by `tripwatt.report.update_readme`."
    )
    return "\n\n".join(parts)


def render_readme_forecast(results: Mapping[str, Any]) -> str:
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
        "written from `results.json` by `tripwatt.report.update_readme`."
    )
    return "\n\n".join(parts)


def update_readme(results: Mapping[str, Any], readme_path: Path) -> None:
    """Replace what stands between the markers of a README by the results. The rest stays as it is.

    Parameters
    ----------
    results : mapping
        The contract of `results.json`, or what `benchmarks.planned` writes.
    readme_path : Path
        A file that holds `<!-- results:begin -->` and `<!-- results:end -->`, once each and in this order; for the
        protocol `forecast` the same with `forecast`, for planned routes with `links`.

    Raises
    ------
    InvalidInput
        When the markers are not there.
    """
    if results.get("protocol") == "forecast":
        opening, closing, shown = FORECAST_BEGIN, FORECAST_END, render_readme_forecast(results)
    elif results.get("protocol") == "links":
        opening, closing, shown = planned.BEGIN, planned.END, planned.render_links(results)
    else:
        opening, closing, shown = BEGIN, END, render_readme_results(results)
    text = readme_path.read_text(encoding="utf-8")
    before, begin, rest = text.partition(opening)
    _, end, after = rest.partition(closing)
    if not begin or not end or text.count(opening) != 1 or text.count(closing) != 1:
        got = f"{text.count(opening)} times begin, {text.count(closing)} times end"
        allowed = f"one {opening} and, after it, one {closing}"
        raise InvalidInput(Fault("no place for the results", str(readme_path), got, allowed))
    partial = readme_path.with_name(f"{readme_path.name}.partial")
    partial.write_text(f"{before}{opening}\n{shown}\n{closing}{after}", encoding="utf-8")
    os.replace(partial, readme_path)
