"""Tables of Markdown pages, written between markers from a `results.json` and never by hand.

The wide tables of every protocol stand in `docs/explanation/results.md`, each between markers of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from tools.docs.links_page import render_links
from tools.docs.paper_page import render_paper_page
from tools.docs.tables import CELLS_NOTE, intervals_side_by_side, markdown, on_names
from tripwatt.errors import InvalidInput
from tripwatt.files import write_bytes
from tripwatt.study.evaluation import DEFAULT_PROTOCOL
from tripwatt.study.report.intervals import STAR, intervals_table
from tripwatt.study.report.panels.paired import SIGNIFICANCE_NOTE
from tripwatt.study.report.panels.results_table import results_table, sets_table
from tripwatt.study.report.panels.uncertainty import coverage_by_set, scored_sets, updates_table
from tripwatt.study.report.view import View
from tripwatt.study.report.words import listed
from tripwatt.vehicles import load_vehicle


def _significant() -> str:
    return SIGNIFICANCE_NOTE.replace("*", r"\*")


def render_paper(results: Mapping[str, Any]) -> str:
    """Results of the protocol `paper` as Markdown: main table and the other sets of trips.

    Parameters
    ----------
    results : mapping
        The contract of `results.json`.
    """
    view = View(results)
    sentence = f"{_significant()} {on_names(view)}"
    tables = markdown(results_table(view)), markdown(sets_table(view))
    return "\n\n".join([sentence, *tables, f"Data: {results['citation']}", _origin(results)])


def render_forecast(results: Mapping[str, Any]) -> str:
    """The forecast's figures as Markdown: every model, the re-forecasts, the intervals, and the other sets of trips.

    Parameters
    ----------
    results : mapping
        The contract of `results.json`, protocol `forecast`.
    """
    view = View(results)
    parts = [
        f"{_significant()} {on_names(view)}",
        markdown(results_table(view)),
        markdown(updates_table(view)),
        markdown(intervals_side_by_side(coverage_by_set(view))),
        CELLS_NOTE,
        markdown(sets_table(view)),
    ]
    return "\n\n".join([*parts, _origin(results)])


def on_sets(view: View) -> str:
    """What the intervals of energy of 50 and 90 % hold over all sets of held-out trips, and where a share of energy or charge is off its level."""
    scored, off = scored_sets(view), []
    spans = []
    for key in ("0.5", "0.9"):
        shares = [100.0 * score["coverage"][key] for _, score, _ in scored]
        spans.append(f"{100.0 * float(key):g} % interval holds {min(shares):.0f} to {max(shares):.0f} %")
    for name, score, trips in scored:
        rows = intervals_table("", [(name, score, trips)]).rows
        off += [
            f"{of} in {name}: {share.removesuffix(STAR)} % ({ci95})"
            for _, of, _, share, ci95, *_ in rows
            if share.endswith(STAR)
        ]
    return (
        f"Over {len(scored)} sets of held-out trips the {' and the '.join(spans)} of the trips' energies. Levels from which the share "
        f"differs significantly (Clopper-Pearson, 95 %): {listed(off)}."
    )


def _origin(results: Mapping[str, Any]) -> str:
    return (
        f"Protocol `{results.get('protocol', '?')}`, seed {results.get('seed', '?')}; "
        "written from `results.json` by `tools.docs.publish_results`."
    )


Render = Callable[[Mapping[str, Any]], str]

PAGE: Final[Mapping[str, Render]] = MappingProxyType(
    {"paper": render_paper, "forecast": render_forecast, "links": render_links}
)
"""Protocol, and key of its markers -> what `docs/explanation/results.md` shows of its results."""


def markers(key: str) -> tuple[str, str]:
    """Begin and end of what is written into a page.

    Examples
    --------
    >>> markers("paper")
    ('<!-- paper:begin -->', '<!-- paper:end -->')
    """
    return f"<!-- {key}:begin -->", f"<!-- {key}:end -->"


def update_results_page(results: Mapping[str, Any], page_path: Path) -> None:
    """Replace what stands between the markers of a protocol by its wide tables, also for what `benchmarks.planned` writes.

    This and the other writers take the contract of `results.json` and a page that holds its markers, once each and in this order; they
    raise `InvalidInput` where the markers are not there.
    """
    name = str(results.get("protocol"))
    key = name if name in PAGE else DEFAULT_PROTOCOL
    _between(page_path, key, PAGE[key](results))


def update_coverage(results: Mapping[str, Any], page_path: Path) -> None:
    """Replace what stands between the markers `coverage` of a page by what the intervals of the forecast held, and of which car."""
    cut = f"All sets divide the same trips of one car, a {load_vehicle(results['vehicle']).title}."
    _between(page_path, "coverage", f"{on_sets(View(results))} {cut}")


def update_paper_page(
    results: Mapping[str, Any], page_path: Path, transfer: Mapping[str, Any], claims: Mapping[str, Any]
) -> None:
    """Replace what stands between the markers `paper-page` by the table of the paper's claims.

    `results` are those of the protocol `paper`, `transfer` those of `benchmarks.transfer`, `claims` those of `benchmarks.paper_claims`.
    """
    _between(page_path, "paper-page", render_paper_page(results, transfer, claims))


def _between(path: Path, key: str, shown: str) -> None:
    """Put `shown` between two markers of a file; the file appears whole or stays as it was."""
    opening, closing = markers(key)
    text = path.read_text(encoding="utf-8")
    before, begin, rest = text.partition(opening)
    _, end, after = rest.partition(closing)
    if not begin or not end or text.count(opening) != 1 or text.count(closing) != 1:
        got = f"{text.count(opening)} times begin, {text.count(closing)} times end"
        allowed = f"one {opening} and, after it, one {closing}"
        raise InvalidInput.of("no place for the results", str(path), got, allowed)
    write_bytes(path, f"{before}{opening}\n{shown}\n{closing}{after}".encode())
