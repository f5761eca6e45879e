"""Build the documentation's site: ``python -m tools.docs.site.build [FOLDER] [--release]`` (`make docs`).

The pages of `docs` stay as a code host shows them. A copy of them is staged with the project's pages (how to contribute,
changes, licences) and with one generated page for each public package, and Sphinx makes the site of the copy. A warning is
an error. With `--release` the site is kept under `versions`, beside those of the releases before.
"""

from __future__ import annotations

import ast
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
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Final

from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.docutils import docutils_namespace, patch_docutils

from tools import DOCS, ROOT
from tools.docs import gallery
from tools.docs import pages as parts

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
    "tripwatt.routes.routers",
    "tripwatt.sources",
    "tripwatt.auditing",
    "tripwatt.certification",
    "tripwatt.hybrid",
    "tripwatt.forecasting",
    "tripwatt.uncertainty",
    "tripwatt.population",
    "tripwatt.journey",
    "tripwatt.live",
    "tripwatt.advice",
    "tripwatt.store",
    "tripwatt.fleet.model",
    "tripwatt.evaluation",
    "tripwatt.report",
    "tripwatt.paper",
    "tripwatt.gam",
    "tripwatt.learners.boosting",
    "tripwatt.learners.forest",
    "tripwatt.learners.gp",
    "tripwatt.synthetic",
    "tripwatt.export",
    "tripwatt.errors",
)
"""Packages and modules with a page of the reference, in its order."""

WORDS: Final[dict[str, list[str]]] = tomllib.loads((HERE / "words.toml").read_text("utf-8"))
"""Page -> words that people search it by, which become entries of its index."""

VERSIONS: Final = "versions"
"""Folder of the site with the sites of releases, which a new build keeps."""

LONGEST_VALUE: Final = 100
"""Characters of a constant's value that are shown."""

FOLDERS: Final = ("howto", "explanation", "reference")
"""Folders of pages that were once beside the first page, those with new pages first."""
RENAMED: Final = {"car": "own-car", "model": "car-model"}
REDIRECT: Final = '<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url={0}"><a href="{0}">{0}</a>\n'

_LINK = re.compile(r"(?<=\]\()([^):#\s]+)(?=[#)])")
_TARGET = re.compile(r'^<a id="([\w-]+)"></a>$', re.MULTILINE)
_DIRECTIVE: Final = {"class": "autoclass", "exception": "autoexception", "function": "autofunction"}


def stage(folder: Path, kept: Sequence[str] = ()) -> None:
    """Write everything that Sphinx reads.

    Parameters
    ----------
    folder : Path
        An empty folder.
    kept : sequence of str
        Releases whose sites stand beside the new one.
    """
    for page in sorted(DOCS.rglob("*.md")):
        _write(folder / page.relative_to(DOCS), _relinked(page, page.relative_to(DOCS)))
    for name, place in PROJECT.items():
        if place == "index.md":
            continue
        text = _relinked(ROOT / name, Path(place)) if name.endswith(".md") else _verbatim(ROOT / name)
        _write(folder / place, text)
    for name in PACKAGES:
        _write(folder / "api" / f"{name}.md", package_page(importlib.import_module(name)))
    with (folder / "reference" / "python.md").open("a", encoding="utf-8") as file:
        file.write("\n".join(["", "## Every public name", "", "```{toctree}", ":titlesonly:", "", ""]))
        file.write("\n".join([*(f"../api/{name}" for name in PACKAGES), "```", ""]))
    for name in gallery.NAMES:
        _write(folder / "gallery" / f"{name}.md", gallery.page_of(name))
    with (folder / "whatsnew" / "index.md").open("a", encoding="utf-8") as file:
        file.write(f"\n{versions_table(kept)}")
    index, readme = folder / "index.md", (ROOT / "README.md").read_text("utf-8")
    _write(index, parts.with_part(index.read_text("utf-8"), "results", parts.part(readme, "results")))
    for name, words in WORDS.items():
        _write(folder / name, with_words((folder / name).read_text("utf-8"), words))
    for name in ("images", "reference/openapi"):
        shutil.copytree(DOCS / name, folder / name)


def with_words(text: str, words: Sequence[str]) -> str:
    """A page with entries of the index below its title: the search puts a page first that has what is typed as an entry."""
    title, _, rest = text.partition("\n")
    entries = [f"   ! {word}" for word in words]
    return "\n".join([title, "", "```{eval-rst}", ".. index::", *entries, "", "```", rest])


def versions_table(kept: Sequence[str]) -> str:
    """The table of versions: when each was released, what it changed, and its site.

    Parameters
    ----------
    kept : sequence of str
        Releases whose sites stand beside the new one.

    Returns
    -------
    str
        Markdown with a row for each release of `docs/whatsnew`, newest first.
    """
    lines = [
        f"This site is of {version('tripwatt')} and the changes since.",
        "",
        "| version | released | changes | documentation |",
        "|---|---|---|---|",
    ]
    pages = {tuple(map(int, p.stem.split("."))): p for p in DOCS.glob("whatsnew/[0-9]*.md")}
    for _, page in sorted(pages.items(), reverse=True):
        day = re.search(r"[Rr]eleased on ([\d-]+)", page.read_text("utf-8"))
        site = f'<a href="../{VERSIONS}/{page.stem}/index.html">its site</a>' if page.stem in kept else "–"
        lines.append(f"| {page.stem} | {day[1] if day else '–'} | [what is new]({page.name}) | {site} |")
    return "\n".join([*lines, ""])


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
    own = [name for name in names if name not in door]
    lines = [
        f"# {module.__name__}",
        "",
        "```{eval-rst}",
        f".. automodule:: {module.__name__}",
        "   :no-members:",
    ]
    if shared := [name for name in names if name in door]:
        told = ", ".join(f":py:obj:`~tripwatt.{name}`" for name in shared)
        lines += ["", f"Described with :doc:`the front door <tripwatt>`: {told}."]
    lines += ["```", "", "| name | what it is |", "|---|---|"]
    lines += [f"| [`{name}`](#{module.__name__}.{name}) | {_first_line(module, name)} |" for name in own]
    for name in own:
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
    own = [
        name for name, thing in vars(module).items() if getattr(thing, "__module__", "") == module.__name__
    ]
    return [name for name in getattr(module, "__all__", own) if not name.startswith("_")]


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


def redirect(site: Path) -> None:
    """Lead from the addresses of the pages before they were in folders to those that they have."""
    pages = {p.stem: p for folder in FOLDERS for p in sorted((site / folder).glob("*.html"))}
    for name, page in (pages | {old: pages[new] for old, new in RENAMED.items()}).items():
        place = page.relative_to(site).as_posix()
        (site / f"{name}.html").write_text(REDIRECT.format(place), "utf-8")


def build(out: Path, *, release: bool = False) -> str:
    """Build the site.

    Parameters
    ----------
    out : Path
        Folder of the site. A site that was there is replaced, if the new one has no warning; those of releases in it stay.
    release : bool
        Whether to keep it as the site of its version.

    Returns
    -------
    str
        The warnings; empty when there are none.
    """
    with tempfile.TemporaryDirectory() as folder:
        pages, trees, fresh = (Path(folder, name) for name in ("pages", "trees", "site"))
        own = {version("tripwatt")} if release else set()
        stage(pages, sorted(own | {p.name for p in out.glob(f"{VERSIONS}/*")}))
        said = io.StringIO()
        with patch_docutils(HERE), docutils_namespace(), warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of Sphinx's extensions among themselves
            warnings.simplefilter("ignore", PendingDeprecationWarning)
            app = Sphinx(pages, HERE, fresh, trees, "html", status=None, warning=said)
            app.build()
        faults = re.sub(r"\x1b\[[0-9;]*m", "", said.getvalue()).replace(f"{pages}/", "")
        if not faults:
            redirect(fresh)
            if (out / VERSIONS).is_dir():
                shutil.copytree(out / VERSIONS, fresh / VERSIONS)
            for name in own:
                shutil.rmtree(fresh / VERSIONS / name, ignore_errors=True)
                shutil.copytree(fresh, fresh / VERSIONS / name, ignore=shutil.ignore_patterns(VERSIONS))
                table = fresh / VERSIONS / name / "whatsnew" / "index.html"  # the others stand beside it
                table.write_text(table.read_text("utf-8").replace(f"../{VERSIONS}/", "../../"), "utf-8")
            shutil.rmtree(out, ignore_errors=True)
            shutil.copytree(fresh, out, ignore=shutil.ignore_patterns(".buildinfo", "_sources"))
    return faults


if __name__ == "__main__":
    places = [word for word in sys.argv[1:] if word != "--release"]
    sys.exit(build(Path(*places) if places else ROOT / "site", release="--release" in sys.argv) or None)
