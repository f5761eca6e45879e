"""The report as one self-contained HTML file, and its figures beside it."""

from __future__ import annotations

import io
import os
import re
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tripwatt.report.forecast import FORECAST_KEYS
from tripwatt.report.panels import Section, build_sections
from tripwatt.report.style import INK, PAPER_COLOUR, RULE, style_context
from tripwatt.report.view import View, of_evaluation, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PNG_DPI: Final = 160
FIGURE_KEYS: Final = (
    "mean-errors",
    "error-distribution",
    "error-boxes",
    "benchmark-boxes",
    "trip-energy",
    "trip-errors",
    "paired-differences",
    "importances",
    "learning-curve",
    "running-time",
    "gamm-diagnosis",
    "gamm-autocorrelation",
    "gamm-smooths",
    "gamm-surface",
    "gamm-random",
)
"""Stems of the files in `figures/` of the paper's protocol; `FORECAST_KEYS` are those of the forecast protocol alone."""


def render_report(run: object) -> str:
    """The whole report as HTML text.

    Parameters
    ----------
    run : object
        An evaluation run: `results` as in `results.json`, `folds`, and, where there are any, `series`, `signals`,
        `learning_curves`, `importances`, `gamm`. A missing part makes an empty panel that says why.

    Returns
    -------
    str
        One document without a reference to any other file or host.
    """
    view = View.from_run(run)
    sections = build_sections(view)
    return _page(view, sections, {key: svg for key, svg, _ in _drawings(sections, png=False)})


def write_report(run: object, out: Path) -> None:
    """Write `report.html` and `figures/*.png`, `figures/*.svg` into a folder. Each file appears whole or not at all.

    Parameters
    ----------
    run : object
        As for `render_report`.
    out : Path
        The folder; made when it is not there. Figures that an earlier report left and this one lacks are removed.
    """
    view = View.from_run(run)
    sections = build_sections(view)
    drawings = list(_drawings(sections, png=True))
    page = _page(view, sections, {key: svg for key, svg, _ in drawings})
    folder = out / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    for key in (*FIGURE_KEYS, *FORECAST_KEYS):
        if key not in {name for name, _, _ in drawings}:
            for suffix in ("png", "svg"):
                (folder / f"{key}.{suffix}").unlink(missing_ok=True)
    for key, svg, png in drawings:
        _write(folder / f"{key}.svg", svg.encode("utf-8"))
        _write(folder / f"{key}.png", png)
    _write(out / "report.html", page.encode("utf-8"))


def _write(path: Path, content: bytes) -> None:
    partial = path.with_name(f"{path.name}.partial")
    partial.write_bytes(content)
    os.replace(partial, path)


def _drawings(sections: Iterable[Section], *, png: bool) -> Iterable[tuple[str, str, bytes]]:
    """(key, SVG text, PNG bytes) of every figure."""
    for section in sections:
        for panel in section.panels:
            if panel.figure is not None:
                yield panel.key, svg_text(panel.figure), png_bytes(panel.figure) if png else b""


def svg_text(figure: Figure) -> str:
    """A figure as SVG, the same bytes for the same data."""
    unset = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    return _saved(figure, format="svg", metadata=unset).decode("utf-8")


def png_bytes(figure: Figure) -> bytes:
    """A figure as PNG."""
    return _saved(figure, format="png", dpi=PNG_DPI, metadata={"Software": None})


def _saved(figure: Figure, **settings: Any) -> bytes:
    buffer = io.BytesIO()
    with style_context(), warnings.catch_warnings():
        # a trip's name may hold any sign; the page shows it, a picture may show a box for it
        warnings.filterwarnings("ignore", "Glyph .* missing from font", UserWarning)
        figure.savefig(buffer, **settings)
    return buffer.getvalue()


_IDS: Final = re.compile(r'(\bid="|xlink:href="#|\bhref="#|url\(#)')


def inline_svg(svg: str, key: str, description: str) -> str:
    """An SVG file's text made part of a page: own ids, the page's colours, a description for those who listen.

    Parameters
    ----------
    svg : str
        What `svg_text` gave.
    key : str
        Prefix of all ids.
    description : str
        What the figure shows.
    """
    import html

    text = svg[svg.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = _IDS.sub(lambda found: f"{found.group(1)}{key}-", text)
    for colour, name in ((INK, "currentColor"), (RULE, "var(--rule)"), (PAPER_COLOUR, "var(--paper)")):
        text = text.replace(colour, name)
    head, _, body = text.partition(">")
    head = re.sub(r'\s(width|height)="[^"]*"', "", head)
    return f'{head} role="img" aria-label="{html.escape(description, quote=True)}">{body}'


def _page(view: View, sections: list[Section], svgs: dict[str, str]) -> str:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("tripwatt.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    drawn = {
        panel.key: inline_svg(svgs[panel.key], panel.key, f"{panel.title}. {panel.sentence}")
        for section in sections
        for panel in section.panels
        if panel.key in svgs
    }
    return environment.get_template("report.html.jinja").render(
        head=_head(view),
        sections=sections,
        # our own SVG, in which matplotlib has escaped every name
        drawn={key: _safe(svg) for key, svg in drawn.items()},
    )


def _safe(svg: str) -> Any:
    from markupsafe import Markup

    return Markup(svg)


def _head(view: View) -> dict[str, Any]:
    """What the head and the foot of the page say of the run."""
    results = view.results
    facts = [
        ("Data", view.dataset or "not named"),
        ("Protocol", results.get("protocol")),
        ("Folds and trips", of_evaluation(view.main) if view.main else None),
        ("Seed", results.get("seed")),
    ]
    versions = results.get("versions") or {}
    return {
        "synthetic": view.synthetic,
        "dataset": plain(view.dataset),
        "facts": [(name, plain(value, 200)) for name, value in facts if value is not None],
        "versions": ", ".join(f"{name} {version}" for name, version in versions.items()),
        "citation": str(results.get("citation") or ""),
        "notes": [plain(note, 600) for note in results.get("notes") or ()],
        "skipped": skipped_lines(results.get("skipped")),
    }


def skipped_lines(skipped: object) -> list[str]:
    """What was left out of a run, one line each, from a mapping, records or plain sentences.

    Examples
    --------
    >>> skipped_lines({"leave_one_day_out": "no dates"})
    ['leave one day out: no dates']
    """
    if not skipped:
        return []
    if isinstance(skipped, dict):
        return [f"{str(key).replace('_', ' ')}: {plain(value, 400)}" for key, value in skipped.items()]
    if isinstance(skipped, str):
        return [plain(skipped, 400)]
    lines = []
    for item in skipped if isinstance(skipped, list | tuple) else [skipped]:
        if isinstance(item, dict):
            lines.append(
                ", ".join(plain(value, 400).replace("_", " ") for value in item.values() if value is not None)
            )
        else:
            lines.append(plain(item, 400))
    return lines
