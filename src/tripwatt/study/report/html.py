"""Write the report as one self-contained HTML file, with its figures as separate files."""

from __future__ import annotations

import base64
import io
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from matplotlib.figure import Figure

from tripwatt.files import write_bytes
from tripwatt.study.report.panel import Panel
from tripwatt.study.report.panels import build_sections
from tripwatt.study.report.style import style_context
from tripwatt.study.report.view import TESTED, View, printable

if TYPE_CHECKING:
    from tripwatt.study.evaluation.results import EvaluationRun

Sections: TypeAlias = Mapping[str, Sequence[Panel]]
PNG_DPI: Final = 160
"""Resolution of PNG files: a choice, sharp at the width of a page on a screen of two pixels for each point."""


def render_report(run: EvaluationRun) -> str:
    """Render the whole report as HTML text.

    Parameters
    ----------
    run : EvaluationRun
        Run to report; parts that it does not have get no panel.

    Returns
    -------
    str
        One document without a reference to any other file or host.

    Examples
    --------
    >>> import tripwatt as tw
    >>> html = render_report(tw.evaluate(tw.read_logs("logs")))  # doctest: +SKIP
    """
    view = View(run.results, run.folds, run.gamm)
    return page_text("report.html.jinja", build_sections(view), **_head(view))


def write_report(run: EvaluationRun, out: Path) -> None:
    """Write `report.html` and `figures/*.png`, `figures/*.svg` into a folder. Each file appears whole or not at all.

    Parameters
    ----------
    run : EvaluationRun
        As for `render_report`.
    out : Path
        The folder; created if missing.

    Examples
    --------
    >>> import tripwatt as tw
    >>> write_report(tw.evaluate(tw.read_logs("logs")), Path("out"))  # doctest: +SKIP
    """
    view = View(run.results, run.folds, run.gamm)
    write_page(out, "report.html.jinja", build_sections(view), **_head(view))


def write_page(out: Path, template: str, sections: Sections, **context: Any) -> None:
    """Write the figures of panels, and then the page from a template, into a folder.

    Parameters
    ----------
    out : Path
        The folder; created if missing.
    template : str
        Name of a file in `templates/`.
    sections : mapping of str to sequence of Panel
        Panels by heading; an empty heading is not shown.
    **context : object
        Further values for the template.
    """
    figures, folder = _figures(sections), out / "figures"
    drawn = {key: svg_text(figure) for key, figure in figures.items()}
    page = _render(template, sections, drawn, context)
    folder.mkdir(parents=True, exist_ok=True)
    for key, figure in figures.items():
        write_bytes(folder / f"{key}.svg", drawn[key].encode("utf-8"))
        write_bytes(folder / f"{key}.png", png_bytes(figure))
    write_bytes(out / "report.html", page.encode("utf-8"))


def page_text(template: str, sections: Sections, **context: Any) -> str:
    """Render a page with panels as HTML text; the parameters are those of `write_page`."""
    drawn = {key: svg_text(figure) for key, figure in _figures(sections).items()}
    return _render(template, sections, drawn, context)


def _figures(sections: Sections) -> dict[str, Figure]:
    panels = (panel for section in sections.values() for panel in section)
    return {panel.key: panel.figure for panel in panels if panel.figure is not None}


def svg_text(figure: Figure) -> str:
    """Render a figure as SVG, with the same bytes for the same data."""
    unset = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    return _saved(figure, format="svg", metadata=unset).decode("utf-8")


def png_bytes(figure: Figure) -> bytes:
    """Render a figure as PNG."""
    return _saved(figure, format="png", dpi=PNG_DPI, metadata={"Software": None})


def _saved(figure: Figure, **settings: Any) -> bytes:
    """Save a figure in the style of the reports; its layout is fixed from then on."""
    buffer = io.BytesIO()
    with style_context(), warnings.catch_warnings():
        # a trip's name may hold any character; the page shows it, but a figure may show a box instead
        warnings.filterwarnings("ignore", "Glyph .* missing from font", UserWarning)
        figure.savefig(buffer, **settings)
        figure.set_layout_engine("none")  # the layout that was found also holds for another format
    return buffer.getvalue()


def _render(template: str, sections: Sections, drawn: Mapping[str, str], context: Mapping[str, Any]) -> str:
    """Render a template; figures are embedded as pictures, so that no text in them can act on the page."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("tripwatt.study.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    pictures = {key: base64.b64encode(svg.encode("utf-8")).decode("ascii") for key, svg in drawn.items()}
    return environment.get_template(template).render(sections=sections, pictures=pictures, **context)


def _head(view: View) -> dict[str, Any]:
    """Return the facts for the head and the foot of the page."""
    results = view.results
    facts = {
        "Data": view.dataset or "not named",
        "Protocol": view.protocol.name,
        "Folds and trips": view.note,
        "Seed": results.get("seed"),
    }
    return {
        "title": f"Evaluation on {'synthetic trips' if view.synthetic else printable(view.dataset)}",
        "synthetic": view.synthetic,
        "sample": view.dataset.endswith("sample"),
        "tested": TESTED.get(view.main.get("scheme"), ""),
        "facts": [(name, printable(value, 200)) for name, value in facts.items()],
        "versions": ", ".join(f"{name} {version}" for name, version in results["versions"].items()),
        "citation": results["citation"],
        "notes": [printable(note, 600) for note in results["notes"]],
    }
