"""The report as one self-contained HTML file, and its figures beside it."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from matplotlib.figure import Figure

from tripwatt.files import write_bytes
from tripwatt.study.report.panel import Panel
from tripwatt.study.report.panels import build_sections
from tripwatt.study.report.style import BLACK, INK, PAPER_COLOUR, RULE, style_context
from tripwatt.study.report.view import TESTED, View, plain

if TYPE_CHECKING:
    from tripwatt.study.evaluation.results import EvaluationRun

Sections: TypeAlias = Mapping[str, Sequence[Panel]]
PNG_DPI: Final = 160


def render_report(run: EvaluationRun) -> str:
    """The whole report as HTML text.

    Parameters
    ----------
    run : EvaluationRun
        What the run lacks has no panel.

    Returns
    -------
    str
        One document without a reference to any other file or host.

    Examples
    --------
    >>> import tripwatt as tw
    >>> html = render_report(tw.evaluate(tw.read_logs("logs")))  # doctest: +SKIP
    """
    view = View.from_run(run)
    return page_text("report.html.jinja", build_sections(view), **_head(view))


def write_report(run: EvaluationRun, out: Path) -> None:
    """Write `report.html` and `figures/*.png`, `figures/*.svg` into a folder. Each file appears whole or not at all.

    Parameters
    ----------
    run : EvaluationRun
        As for `render_report`.
    out : Path
        The folder; made when it is not there.

    Examples
    --------
    >>> import tripwatt as tw
    >>> write_report(tw.evaluate(tw.read_logs("logs")), Path("out"))  # doctest: +SKIP
    """
    view = View.from_run(run)
    write_page(out, "report.html.jinja", build_sections(view), **_head(view))


def write_page(out: Path, template: str, sections: Sections, **context: Any) -> None:
    """Write the figures of panels and the page from a template into a folder, the page last.

    Parameters
    ----------
    out : Path
        Made when it is not there.
    template : str
        Name of a file in `templates/`.
    sections : mapping of str to sequence of Panel
        Panels under each heading; one without words has none.
    **context : object
        What else the template needs.
    """
    figures, folder = _figures(sections), out / "figures"
    svgs = {key: svg_text(figure) for key, figure in figures.items()}
    page = _render(template, sections, svgs, context)
    folder.mkdir(parents=True, exist_ok=True)
    for key, figure in figures.items():
        write_bytes(folder / f"{key}.svg", svgs[key].encode("utf-8"))
        write_bytes(folder / f"{key}.png", png_bytes(figure))
    write_bytes(out / "report.html", page.encode("utf-8"))


def page_text(template: str, sections: Sections, **context: Any) -> str:
    """A page with panels as HTML text; the parameters are those of `write_page`."""
    svgs = {key: svg_text(figure) for key, figure in _figures(sections).items()}
    return _render(template, sections, svgs, context)


def _figures(sections: Sections) -> dict[str, Figure]:
    panels = (panel for section in sections.values() for panel in section)
    return {panel.key: panel.figure for panel in panels if panel.figure is not None}


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
        figure.set_layout_engine("none")  # the layout that was found also holds for another format
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
    text = _IDS.sub(lambda match: f"{match.group(1)}{key}-", text)
    for colour, name in (
        (INK, "currentColor"),
        (BLACK, "currentColor"),
        (RULE, "var(--rule)"),
        (PAPER_COLOUR, "var(--paper)"),
    ):
        text = text.replace(colour, name)
    head, _, body = text.partition(">")
    head = re.sub(r'\s(width|height)="[^"]*"', "", head)
    return f'{head} role="img" aria-label="{html.escape(description, quote=True)}">{body}'


def _render(template: str, sections: Sections, svgs: Mapping[str, str], context: Mapping[str, Any]) -> str:
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("tripwatt.study.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    drawn = {
        # our own SVG, in which matplotlib has escaped every name
        panel.key: Markup(inline_svg(svgs[panel.key], panel.key, f"{panel.title}. {panel.caption}"))
        for section in sections.values()
        for panel in section
        if panel.key in svgs
    }
    return environment.get_template(template).render(sections=sections, drawn=drawn, **context)


def _head(view: View) -> dict[str, Any]:
    """Facts for the head and the foot of the page."""
    results = view.results
    facts = {
        "Data": view.dataset or "not named",
        "Protocol": view.protocol.name,
        "Folds and trips": view.note,
        "Seed": results.get("seed"),
    }
    return {
        "title": f"Evaluation on {'synthetic trips' if view.synthetic else plain(view.dataset)}",
        "synthetic": view.synthetic,
        "tested": TESTED.get(view.main.get("scheme"), ""),
        "facts": [(name, plain(value, 200)) for name, value in facts.items()],
        "versions": ", ".join(f"{name} {version}" for name, version in results["versions"].items()),
        "citation": results["citation"],
        "notes": [plain(note, 600) for note in results["notes"]],
    }
