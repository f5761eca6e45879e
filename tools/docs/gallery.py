"""The gallery: run its scripts, write their pictures and its first page: ``python -m tools.docs.gallery [NAME ...]``.

An example is a script in docs/gallery that makes `figure`; its docstring is its title and its text. `SECTIONS` has the examples in the order of
the page. On the site each is a page of its own, which `tools/docs/site/build.py` takes from here.
"""

from __future__ import annotations

import ast
import io
import runpy
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import matplotlib as mpl
from matplotlib import pyplot
from matplotlib.figure import Figure
from PIL import Image
from typer import Argument

from tools import DOCS, command

FOLDER: Final = DOCS / "gallery"
PAGE: Final = FOLDER / "index.md"
IMAGES: Final = DOCS / "images" / "gallery"
SECTIONS: Final[Mapping[str, tuple[str, ...]]] = {
    "Cars and trips": ("speed_and_cold", "cold_start", "cars_by_cause", "mass_and_tyres"),
    "Uncertainty": ("on_the_way", "known_road", "few_trips", "coverage_by_regime"),
    "Models": ("residuals_left", "own_corrector", "gamm_smooths", "fleet_posterior"),
}
NAMES: Final = tuple(name for names in SECTIONS.values() for name in names)
DPI: Final = 140
COLOURS: Final = 256
"""Of a picture's palette."""
THUMBNAIL_PX: Final = 360

HEAD: Final = """# Gallery

<!-- written by tools/docs/gallery.py from the scripts beside it; do not edit -->

Each example is one script that runs as it stands, on the sample of real trips, on synthetic trips and on cars of the library: `python -i docs/gallery/cold_start.py` in a
clone, then `figure.savefig("figure.png")`; a notebook shows `figure` by itself. Where trips are synthetic, no figure describes a real car.
"""


class Example(NamedTuple):
    """A script's title, its text in Markdown, and its code without both."""

    title: str
    text: str
    code: str


def example(name: str) -> Example:
    """The parts of a script of the gallery."""
    source = (FOLDER / f"{name}.py").read_text("utf-8")
    tree = ast.parse(source)
    title, _, text = (ast.get_docstring(tree) or "").partition("\n\n")
    code = "\n".join(source.splitlines()[tree.body[0].end_lineno :]).strip()
    return Example(title.rstrip("."), text, code)


def drawn(name: str) -> Figure:
    """Run a script and take its figure."""
    with mpl.rc_context():
        pyplot.switch_backend("agg")
        figure = runpy.run_path(str(FOLDER / f"{name}.py"))["figure"]
        pyplot.close("all")
    assert isinstance(figure, Figure)
    return figure


def write_picture(figure: Figure, path: Path) -> None:
    """Write a figure as a PNG with a palette."""
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=DPI)
    picture = Image.open(buffer).convert("RGB")
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)


def first_page() -> str:
    """The page with a thumbnail, the title and the first sentence of each example."""
    parts = [HEAD]
    for section, names in SECTIONS.items():
        parts.append(f"## {section}\n")
        for name in names:
            title, text, _ = example(name)
            sentence = " ".join(text.partition(". ")[0].split())
            image = f'<img src="../images/gallery/{name}.png" alt="{title}" width="{THUMBNAIL_PX}">'
            parts.append(f"- [{image}]({name}.py)\n  **[{title}]({name}.py)**. {sentence}.")
        parts.append("")
    return "\n".join(parts)


def page_of(name: str) -> str:
    """The page of an example on the site: its text, its picture and its code."""
    title, text, code = example(name)
    picture = f"![{title}](../images/gallery/{name}.png)"
    return f"# {title}\n\n{text}\n\n{picture}\n\n```python\n{code}\n```\n"


def main(names: Annotated[list[str] | None, Argument()] = None) -> None:
    """Draw the pictures, or those that are named, and write the first page."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    for name in names or NAMES:
        write_picture(drawn(name), IMAGES / f"{name}.png")
    PAGE.write_text(first_page(), "utf-8")


if __name__ == "__main__":
    command.run(main)
