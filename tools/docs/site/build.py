"""Build the documentation's site: ``python -m tools.docs.site.build [FOLDER]`` (`make docs`).

The pages of `docs` stay as a code host shows them. A copy of them is staged with the project's pages (how to contribute,
changes, licences), with one generated page for each public package, and with the long tables of commands and cars at the end of their
pages. Sphinx makes the site of the copy. A warning is an error.
"""

from __future__ import annotations

import ast
import gc
import importlib
import inspect
import io
import os
import re
import shutil
import sys
import tempfile
import tomllib
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Final

from benchmarks import anchors, steady
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.docutils import docutils_namespace, patch_docutils

from tools import DOCS, ROOT
from tools.docs import gallery, write_cli

HERE: Final = Path(__file__).resolve().parent

PROJECT: Final = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "project/contributing.md",
    "CHANGELOG.md": "project/changes.md",
    "SECURITY.md": "project/security.md",
    "NOTICE": "project/notice.md",
    "LICENSE": "project/licence.md",
}
"""File of the repository -> its page of the site. The README is the first page of a code host, the index that of the site."""

PACKAGES: Final = (
    "tripwatt",
    "tripwatt.trips",
    "tripwatt.vehicles",
    "tripwatt.physics",
    "tripwatt.routes",
    "tripwatt.roads.routers",
    "tripwatt.sources",
    "tripwatt.auditing",
    "tripwatt.certification",
    "tripwatt.hybrid",
    "tripwatt.forecasting",
    "tripwatt.uncertainty",
    "tripwatt.population",
    "tripwatt.roads.journey",
    "tripwatt.server.cars.car",
    "tripwatt.server.cars.folder",
    "tripwatt.server.cars.telemetry",
    "tripwatt.roads.advice",
    "tripwatt.fleet.store",
    "tripwatt.fleet.model",
    "tripwatt.study.evaluation",
    "tripwatt.study.report",
    "tripwatt.study.paper",
    "tripwatt_gamm",
    "tripwatt.learners.boosting",
    "tripwatt.learners.forest",
    "tripwatt.learners.gp",
    "tripwatt.study.synthetic",
    "tripwatt.export",
    "tripwatt.errors",
)
"""Packages and modules with a page of the reference, in its order."""

WORDS: Final[dict[str, list[str]]] = tomllib.loads((HERE / "words.toml").read_text("utf-8"))
"""Page -> words that people search it by, which become entries of its index."""

LONGEST_VALUE: Final = 100
"""Characters of a constant's value that are shown."""

_LINK = re.compile(r"(?<=\]\()([^):#\s]+)(?=[#)])")
_TARGET = re.compile(r'^<a id="([\w-]+)"></a>$', re.MULTILINE)
_DIRECTIVE: Final = {"class": "autoclass", "exception": "autoexception", "function": "autofunction"}


def stage(folder: Path) -> None:
    """Write everything that Sphinx reads into an empty folder."""
    for page in sorted(DOCS.rglob("*.md")):
        _write(folder / page.relative_to(DOCS), _relinked(page, page.relative_to(DOCS)))
    for name, place in PROJECT.items():
        if place == "index.md":
            continue
        text = _relinked(ROOT / name, Path(place)) if name.endswith(".md") else _verbatim(ROOT / name)
        _write(folder / place, text)
    for name in PACKAGES:
        _write(folder / "api" / f"{name}.md", package_page(importlib.import_module(name)))
    for name, text in appended():
        with (folder / name).open("a", encoding="utf-8") as file:
            file.write(f"\n{text}\n")
    for name in gallery.NAMES:
        _write(folder / "gallery" / f"{name}.md", gallery.page_of(name))
    for name, words in WORDS.items():
        _write(folder / name, with_words((folder / name).read_text("utf-8"), words))
    for name in ("examples", "images", "reference/openapi"):
        shutil.copytree(DOCS / name, folder / name)


def appended() -> Iterator[tuple[str, str]]:
    """Page and what the site has at its end: the pages of packages, what `--help` shows, and the tables of all cars."""
    packages = (f"../api/{name}" for name in PACKAGES)
    tree = ["## Every public name", "", "```{toctree}", ":titlesonly:", "", *packages, "```"]
    yield "reference/python.md", "\n".join(tree)
    yield "reference/cli.md", write_cli.render()
    yield (
        "reference/library.md",
        f"## Every car and its certification\n\n{anchors.render_cars(anchors.committed())}",
    )
    yield "reference/library.md", f"## Every car at steady speed\n\n{steady.render_cars()}"


def with_words(text: str, words: Sequence[str]) -> str:
    """Add entries of the index below the title of a page: the search lists a page first if the words are one of its entries."""
    title, _, rest = text.partition("\n")
    entries = [f"   ! {word}" for word in words]
    return "\n".join([title, "", "```{eval-rst}", ".. index::", *entries, "", "```", rest])


def _write(place: Path, text: str) -> None:
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text(text, encoding="utf-8")


def _relinked(page: Path, place: Path) -> str:
    """A page with links that lead to the same files from its place in the site."""

    def moved(match: re.Match[str]) -> str:
        target = (page.parent / match[1]).resolve()
        if target.is_relative_to(DOCS):
            page_of_site = (
                target.relative_to(DOCS).as_posix().replace(".py", ".md")
            )  # a script of the gallery is a page
        else:
            page_of_site = PROJECT.get(target.relative_to(ROOT).as_posix(), "")
        if not page_of_site:
            return match[1]  # Sphinx warns of it
        return os.path.relpath(page_of_site, place.parent).replace(os.sep, "/")

    fences = re.split(r"(^ *```.*?^ *```)", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    text = "".join(part if k % 2 else _LINK.sub(moved, part) for k, part in enumerate(fences))
    return _TARGET.sub(r"(\1)=", text)


def _verbatim(file: Path) -> str:
    return f"# {file.name.capitalize()}\n\n````text\n{file.read_text('utf-8').rstrip()}\n````\n"


def package_page(module: ModuleType) -> str:
    """The page of a package: its description, a table of its public names, and each of them from its docstring.

    Parameters
    ----------
    module : module
        A package with `__all__`.

    Returns
    -------
    str
        Markdown with directives of `sphinx.ext.autodoc`. A name of the door is described on the page of `tripwatt` only.
    """
    door = set(importlib.import_module("tripwatt").__all__) if module.__name__ != "tripwatt" else set()
    names = public_names(module)
    described_here = [name for name in names if name not in door]
    lines = [
        f"# {module.__name__}",
        "",
        "```{eval-rst}",
        f".. automodule:: {module.__name__}",
        "   :no-members:",
    ]
    if shared := [name for name in names if name in door]:
        links = ", ".join(f":py:obj:`~tripwatt.{name}`" for name in shared)
        lines += ["", f"Described with :doc:`the front door <tripwatt>`: {links}."]
    lines += ["```", "", "| name | what it is |", "|---|---|"]
    lines += [
        f"| [`{name}`](#{module.__name__}.{name}) | {_first_line(module, name)} |" for name in described_here
    ]
    for name in described_here:
        lines += ["", f"## {name}", "", *_described(module, name)]
    return "\n".join([*lines, ""])


def public_names(module: ModuleType) -> list[str]:
    """The names of `__all__`, or what a module without it defines.

    Parameters
    ----------
    module : module
        A package or a module.

    Returns
    -------
    list of str
        Names without a leading underscore.
    """
    defined_here = [
        name for name, thing in vars(module).items() if getattr(thing, "__module__", "") == module.__name__
    ]
    return [name for name in getattr(module, "__all__", defined_here) if not name.startswith("_")]


def _described(module: ModuleType, name: str) -> list[str]:
    """The directives that describe a name; a constant is described where it is assigned, so its text is copied."""
    thing = getattr(module, name)
    if _kind(thing) == "data":
        shown = repr(thing)
        value = [f"   :value: {shown}"] if len(shown) <= LONGEST_VALUE and " at 0x" not in shown else []
        text = constant_text(module, name).splitlines() or ["No description."]
        lines = [f".. py:data:: {module.__name__}.{name}", *value, "", *(f"   {line}" for line in text)]
    else:
        options = [] if inspect.isroutine(thing) else ["   :members:"]
        lines = [f".. {_DIRECTIVE[_kind(thing)]}:: {module.__name__}.{name}", *options]
    return ["```{eval-rst}", *lines, "```"]


def _first_line(module: ModuleType, name: str) -> str:
    """The first line of a description: of its docstring, or of the text below a constant."""
    thing = getattr(module, name)
    if _kind(thing) != "data":
        return _cell(inspect.getdoc(thing) or "")
    return _cell(constant_text(module, name))


def _cell(text: str) -> str:
    return text.partition("\n\n")[0].replace("\n", " ").replace("|", "\\|").replace("``", "`")


def constant_text(module: ModuleType, name: str) -> str:
    """The text below a constant in the module that a package takes it from; empty where there is none.

    Parameters
    ----------
    module : module
        The module or package that exports the name.
    name : str
        A constant.

    Returns
    -------
    str
        The docstring of the constant.
    """
    analyzer = ModuleAnalyzer.for_module(_home(module, name))
    return "\n".join(analyzer.find_attr_docs().get(("", name), []))


def _home(module: ModuleType, name: str) -> str:
    """The name of the module below a package that assigns a constant which the package exports."""
    source = ast.parse(inspect.getsource(module))
    for node in source.body:
        if isinstance(node, ast.ImportFrom) and any(alias.name == name for alias in node.names):
            return str(node.module)
    return module.__name__


def _kind(thing: object) -> str:
    if inspect.isclass(thing):
        return "exception" if issubclass(thing, BaseException) else "class"
    return "function" if inspect.isroutine(thing) else "data"


def build(out: Path) -> str:
    """Build the site.

    Parameters
    ----------
    out : Path
        Folder of the site. A site that was there is replaced, if the new one has no warning.

    Returns
    -------
    str
        The warnings; empty when there are none.
    """
    with tempfile.TemporaryDirectory() as folder:
        pages, trees, fresh = (Path(folder, name) for name in ("pages", "trees", "site"))
        stage(pages)
        warnings_text = io.StringIO()
        with patch_docutils(HERE), docutils_namespace(), warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of Sphinx's extensions among themselves
            warnings.simplefilter("ignore", PendingDeprecationWarning)
            app = Sphinx(pages, HERE, fresh, trees, "html", status=None, warning=warnings_text)
            app.build()
        faults = re.sub(r"\x1b\[[0-9;]*m", "", warnings_text.getvalue()).replace(f"{pages}/", "")
        if not faults:
            shutil.rmtree(out, ignore_errors=True)
            shutil.copytree(fresh, out, ignore=shutil.ignore_patterns(".buildinfo", "_sources"))
    return faults


if __name__ == "__main__":
    gc.freeze()
    gc.set_threshold(100_000, 20)  # a site is a million nodes that stay
    sys.exit(build(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "site") or None)
