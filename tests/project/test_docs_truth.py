"""What the Markdown files name exists: modules, files, commands and their options, make targets, links."""

from __future__ import annotations

import importlib
import importlib.util
import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer.main
from tests.support import ROOT
from tools.docs import write_citation
from tools.docs.pages import of_page

from tripwatt.command import app

PAGES = sorted(
    page
    for page in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "web").rglob("*.md")]
    if "node_modules" not in page.parts
)
FENCED = re.compile(r"^ *```[^\n]*\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`([^`]+)`")
LINK = re.compile(r"\]\(([^)\s]+)\)")
MODULE = re.compile(
    r"(?<![\w./@-])(?:tripwatt|benchmarks|tools)(?!\.(?:example|correctors|plan)\b)(?:\.[A-Za-z_]\w*)+"
)  # a name of users, a group of entry points, an action of Home Assistant
MEMBER = re.compile(r"`(\w+(?:\.\w+)*)`\s+of\s+`(tripwatt(?:\.\w+)*)`")
CALL = re.compile(r'([a-z]+(?:_[a-z]+)+)\("')  # of ours with a text: others are signatures of methods
SCRIPT = re.compile(r"(?<![\w.*<])[\w-]+(?:/[\w.-]+)*\.py\b")
TARGET = re.compile(r"(?<![\w-])make ((?:[A-Z]+=\S+ )*)([a-z][a-z-]*)")
RUN_MODULE = re.compile(r"python3? -m ((?:tripwatt|benchmarks|tools)[\w.]*)")
COMMAND = re.compile(r"^ *(?:\$ )?(?:\w+=\S* )*(?:\.venv/bin/|python3? -m )?tripwatt (.+)")


def code_of(text: str) -> list[str]:
    """Inline code and the lines of code blocks, continued lines joined."""
    blocks = [block.replace("\\\n", " ") for block in FENCED.findall(text)]
    inline = INLINE.findall(FENCED.sub("", text))
    return [" ".join(span.split()) for span in inline] + [line for b in blocks for line in b.splitlines()]


def is_known(path: str) -> bool:
    """Whether the longest importable part of a dotted path has the rest as attributes."""
    names = path.split(".")
    for end in range(len(names), 0, -1):
        name = ".".join(names[:end])
        try:
            thing: Any = importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name is not None and not name.startswith(error.name):
                raise  # the module is there, what it needs is not
            continue
        for attribute in names[end:]:
            if not hasattr(thing, attribute) and attribute not in getattr(thing, "__annotations__", {}):
                return False
            thing = getattr(thing, attribute, None)
        return True
    return False


@cache
def scripts() -> tuple[str, ...]:
    folders = ("src", "gamm", "tests", "tools", "benchmarks", "web", "docs")
    files = (f for name in folders for f in (ROOT / name).rglob("*.py") if "node_modules" not in f.parts)
    return tuple("/" + f.relative_to(ROOT).as_posix() for f in files)


def dead_modules(code: list[str]) -> Iterator[str]:
    for span in code:
        yield from (f"module {p}" for p in MODULE.findall(span) if not is_known(p))
        for path in SCRIPT.findall(span):
            if not any(script.endswith("/" + path) for script in scripts()):
                yield f"file {path}"


def dead_members(text: str, spans: list[str]) -> Iterator[str]:
    """What a module is said to have and lacks, and calls of functions that nothing defines."""
    for name, module in MEMBER.findall(text):
        if not is_known(f"{module}.{name}"):
            yield f"{name} of {module}"
    for span in spans:
        if (called := CALL.match(span)) and called[1] not in functions():
            yield f"call of {called[1]}"


@cache
def functions() -> frozenset[str]:
    sources = (file.read_text("utf-8") for name in ("src", "gamm") for file in (ROOT / name).rglob("*.py"))
    return frozenset(name for text in sources for name in re.findall(r"^def (\w+)", text, re.MULTILINE))


def dead_runs(code: list[str]) -> Iterator[str]:
    """Modules that `python -m` could not run, and targets that the Makefile lacks."""
    for span in code:
        for name in RUN_MODULE.findall(span):
            spec = importlib.util.find_spec(name)
            if spec is None or (
                spec.submodule_search_locations and not importlib.util.find_spec(f"{name}.__main__")
            ):
                yield f"python -m {name}"
        yield from (f"make {target}" for _, target in TARGET.findall(span) if target not in targets())


@cache
def targets() -> frozenset[str]:
    text = (ROOT / "Makefile").read_text("utf-8")
    return frozenset(re.findall(r"^([a-z][a-z-]*):", text, re.MULTILINE))


def dead_commands(code: list[str]) -> Iterator[str]:
    for span in code:
        if found := COMMAND.match(span):
            yield from dead_words(found[1])


@cache
def tool() -> Any:
    return typer.main.get_command(app)


def dead_words(line: str) -> Iterator[str]:
    """The command and the options of one command line that `tripwatt` lacks."""
    command = tool()
    named = "tripwatt"
    lexer = shlex.shlex(line.replace("'", "\\'") if line.count("'") % 2 else line, posix=True)
    lexer.whitespace_split = True
    for word in lexer:
        if word in ("|", "||", "&&", ";", ">", ">>"):
            return
        if word == "...":  # any command
            return
        if word.startswith("["):  # what may be left out
            continue
        if re.match("--?[a-z]", word):
            option = word.partition("=")[0]
            if option not in options(command):
                yield f"{named} {option}"
        elif hasattr(command, "commands"):
            for choice in word.split("|"):  # `tripwatt export here|tomtom`
                if choice not in command.commands:
                    yield f"{named} {choice}"
                    return
            command, named = command.commands[choice], f"{named} {choice}"


def options(command: Any) -> set[str]:
    return {"--help"} | {name for p in command.params for name in (*p.opts, *p.secondary_opts)}


def dead_links(text: str, page: Path) -> Iterator[str]:
    for target in LINK.findall(FENCED.sub("", text)):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.exists() or (anchor and file.suffix == ".md" and anchor not in anchors(file)):
            yield f"link {target}"


@cache
def anchors(page: Path) -> frozenset[str]:
    """What links to the headings of a page end in."""
    text = FENCED.sub("", page.read_text("utf-8")) if page.is_file() else ""
    heads = re.findall(r"^#+ +(.+?) *$", text, re.MULTILINE)
    named = re.findall(r'<a id="([\w-]+)"></a>', text)
    return frozenset(re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads) | frozenset(
        named
    )


def dead_names(page: Path) -> list[str]:
    text = page.read_text("utf-8")
    code = code_of(text)
    # Decisions are history: they keep the names of their time.
    modules = [] if page.parent.name == "decisions" else [*dead_modules(code), *dead_members(text, code)]
    return sorted({*modules, *dead_runs(code), *dead_commands(code), *dead_links(text, page)})


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_everything_that_a_page_names_exists(page: Path) -> None:
    assert dead_names(page) == []


def test_every_kind_of_dead_name_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "Alive: `tripwatt.units`, `tripwatt_gamm/fit.py`, `tripwatt mapping suggest FILE`, `make check`, [here](#a-heading).\n"
        "# A heading\n"
        "Dead: `tripwatt.no_module`, `tripwatt.units.NO_NAME`, `no/file.py`, `tripwatt nothing`, "
        '`tripwatt evaluate --no-such`, `make nothing`, `no_call("a")`, `Gone` of `tripwatt.units`, `SUFFIXES` of\n`tripwatt.units`, [gone](gone.md), [lost](#lost), `python -m benchmarks.gone`.\n'
        "```\n"
        "tripwatt mapping guess FILE  # no command\n"
        "tripwatt fit DATA \\\n"
        "    --missing 3\n"
        "```\n",
        encoding="utf-8",
    )
    assert dead_names(page) == [
        "Gone of tripwatt.units",
        "call of no_call",
        "file no/file.py",
        "link #lost",
        "link gone.md",
        "make nothing",
        "module benchmarks.gone",
        "module tripwatt.no_module",
        "module tripwatt.units.NO_NAME",
        "python -m benchmarks.gone",
        "tripwatt evaluate --no-such",
        "tripwatt fit --missing",
        "tripwatt mapping guess",
        "tripwatt nothing",
    ]


def test_the_entries_to_cite_are_those_of_the_citation_file() -> None:
    shown = of_page("reference/citing.md", "bibtex")
    assert shown == write_citation.bibtex(), "python -m tools.docs.write_citation"
    assert [line.split("{")[0] for line in shown.splitlines() if line.startswith("@")] == [
        "@software",
        "@article",
        "@dataset",
    ]
    assert "10.21227/6jr9-5235" in shown
    assert "arXiv:2405.10984" in shown
