"""The report as one self-contained HTML file, and its figures beside it."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from matplotlib.figure import Figure

from tripwatt.files import write_bytes
from tripwatt.report.model_styles import model_style
from tripwatt.report.panel import Panel
from tripwatt.report.panels import build_sections, figure_keys
from tripwatt.report.short_table import short_list
from tripwatt.report.style import INK, PAPER_COLOUR, RULE, style_context
from tripwatt.report.tables import number
from tripwatt.report.view import SCHEMES, TESTED, View, of_evaluation, plain
from tripwatt.report.words import interval, label, percent

PNG_DPI: Final = 160


def render_report(run: object) -> str:
    """The whole report as HTML text.

    Parameters
    ----------
    run : object
        An evaluation run: `results` as in `results.json`, `folds`, and, where there are any, `series`, `signals`,
        `learning_curves`, `importances`, `gamm`. A missing part makes an empty panel that gives the reason.

    Returns
    -------
    str
        One document without a reference to any other file or host.

    Examples
    --------
    >>> import tripwatt as tw
    >>> html = render_report(tw.evaluate(tw.read_logs("logs")))  # doctest: +SKIP
    """
    panels, context = _evaluation_page(View.from_run(run))
    return page_text("report.html.jinja", panels, **context)


def page_text(template: str, panels: Sequence[Panel], **context: Any) -> str:
    """A page with panels as HTML text."""
    return _render(template, panels, _drawings(panels), context)


def write_report(run: object, out: Path, lead: str = "") -> None:
    """Write `report.html` and `figures/*.png`, `figures/*.svg` into a folder. Each file appears whole or not at all.

    Parameters
    ----------
    run : object
        As for `render_report`.
    out : Path
        The folder; made when it is not there. Figures that an earlier report left and this one lacks are removed.
    lead : str
        A forecast in words, with which the page begins. By default it is that of the trip with the median error.

    Examples
    --------
    >>> import tripwatt as tw
    >>> write_report(tw.evaluate(tw.read_logs("logs")), Path("out"))  # doctest: +SKIP
    """
    panels, context = _evaluation_page(View.from_run(run), lead)
    write_page(out, "report.html.jinja", panels, **context)
    for key in set(figure_keys()) - {panel.key for panel in panels if panel.figure is not None}:
        for suffix in ("png", "svg"):
            (out / "figures" / f"{key}.{suffix}").unlink(missing_ok=True)


def write_page(out: Path, template: str, panels: Sequence[Panel], **context: Any) -> None:
    """Write the figures of panels and the page from a template into a folder, the page last.

    Parameters
    ----------
    out : Path
        Made when it is not there.
    template : str
        Name of a file in `templates/`.
    panels : sequence of Panel
    **context : object
        What else the template needs.
    """
    svgs, folder = _drawings(panels), out / "figures"
    page = _render(template, panels, svgs, context)
    folder.mkdir(parents=True, exist_ok=True)
    for panel in panels:
        if panel.figure is not None:
            write_bytes(folder / f"{panel.key}.svg", svgs[panel.key].encode("utf-8"))
            write_bytes(folder / f"{panel.key}.png", png_bytes(panel.figure))
    write_bytes(out / "report.html", page.encode("utf-8"))


def _drawings(panels: Iterable[Panel]) -> dict[str, str]:
    """SVG text of every figure."""
    return {panel.key: svg_text(panel.figure) for panel in panels if panel.figure is not None}


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
    for colour, name in ((INK, "currentColor"), (RULE, "var(--rule)"), (PAPER_COLOUR, "var(--paper)")):
        text = text.replace(colour, name)
    head, _, body = text.partition(">")
    head = re.sub(r'\s(width|height)="[^"]*"', "", head)
    return f'{head} role="img" aria-label="{html.escape(description, quote=True)}">{body}'


def _render(
    template: str, panels: Sequence[Panel], svgs: Mapping[str, str], context: Mapping[str, Any]
) -> str:
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("tripwatt.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    drawn = {
        # our own SVG, in which matplotlib has escaped every name
        panel.key: Markup(inline_svg(svgs[panel.key], panel.key, f"{panel.title}. {panel.sentence}"))
        for panel in panels
        if panel.key in svgs
    }
    return environment.get_template(template).render(panels=panels, drawn=drawn, **context)


def _evaluation_page(view: View, lead: str = "") -> tuple[list[Panel], dict[str, Any]]:
    """The panels of an evaluation's page, and what else its template needs."""
    sections = build_sections(view)
    panels = [panel for section in sections for panel in section.panels]
    shown = [section for section in sections if any(panel.shown for panel in section.panels)]
    absent = [panel for panel in panels if not panel.shown]
    return panels, {
        "head": {**_head(view), "lead": lead or _median_trip(view)},
        "sections": shown,
        "absent": absent,
    }


def _median_trip(view: View) -> str:
    """The held-out forecast of the trip with the median error in words; empty where no predictions were kept."""
    best_and_median = view.selected_trips()[:2]
    for _, trip, ape in best_and_median[-1:]:
        rows = view.main_folds
        row = rows[(rows["model"] == view.best) & (rows["trip"].astype(str) == trip)].iloc[0]
        energy, measured = (number(row[f"{name}_energy_wh"], 1e-3, 1) for name in ("predicted", "observed"))
        return (
            f"Trip {plain(trip)}: {energy} kWh by {label(view.best or '')}, which was fitted without it. "
            f"Measured: {measured} kWh, an error of {percent(ape)}."
        )
    return ""


def _numbers(view: View) -> list[tuple[str, str, str, str]]:
    """Mean error, name, meaning and interval of the model that the report describes, of a constant and of the simulation."""
    others = [
        m for m in short_list(view) if m != view.best and model_style(m).kind in ("constant", "physics")
    ]
    names = [m for m in (view.best, *others[:2]) if m is not None]
    scores = [(m, view.scores[m]) for m in names]
    return [
        (percent(s.get("mape")), label(m), model_style(m).meaning, interval(s).strip(" ()"))
        for m, s in scores
    ]


def _head(view: View) -> dict[str, Any]:
    """Facts for the head and the foot of the page."""
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
        "tested": TESTED.get(str(view.main.get("scheme")), ""),
        "scheme": SCHEMES.get(str(view.main.get("scheme")), ""),
        "numbers": _numbers(view),
        "dataset": plain(view.dataset),
        "facts": [(name, plain(value, 200)) for name, value in facts if value is not None],
        "versions": ", ".join(f"{name} {version}" for name, version in versions.items()),
        "citation": str(results.get("citation") or ""),
        "notes": [plain(note, 600) for note in results.get("notes") or ()],
    }
