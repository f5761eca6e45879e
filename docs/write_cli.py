"""Write docs/cli.md, the pages that `--help` shows: ``python docs/write_cli.py``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer.main

from tripwatt.cli import app

PAGE = Path(__file__).with_name("cli.md")
BAR = "\\|"
"""How a table cell holds a bar."""

HEAD = """# The command line

<!-- written by docs/write_cli.py from what `--help` shows; do not edit -->

Each command is the thin twin of a public function. Tables and JSON go to standard output; progress, notes and errors
go to standard error, so that `tripwatt ... --json | ...` always reads one JSON document.

| exit code | meaning |
|---:|---|
| 0 | done |
| 1 | done, but something needs a look: a data set with missing trips, a proposed mapping with gaps |
| 2 | the input cannot be used: one message names every fault, and nothing is written |
| 130 | interrupted from the keyboard |

**Whole or not at all.** `tripwatt evaluate` writes into `OUT.unfinished` (into `OUT/.unfinished` where OUT exists) and
renames at the end: a new OUT appears complete, by one rename. In an OUT that holds older results these go first,
`results.json` before all others, and the new `results.json` comes last: where it stands, the files beside it belong to
it. An interrupted run keeps its finished folds there for `--resume`. `tripwatt fit` writes its model beside MODEL and
renames it; an older model goes only when the new one is whole.
"""


def commands(command: Any, name: str = "tripwatt") -> Iterator[tuple[str, Any]]:
    """(full name, command) of every command that does something, in the order of the help."""
    children = getattr(command, "commands", {})
    if not children:
        yield name, command
    for child, found in children.items():
        yield from commands(found, f"{name} {child}")


def section(name: str, command: Any) -> str:
    """One command: what it does, its arguments and options, its examples."""
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    options = [p for p in command.params if p.param_type_name == "option"]
    usage = " ".join([name, *(_argument(a) for a in arguments), "[OPTIONS]"])
    lines = [f"## {name}", "", "```", usage, "```", "", *_paragraphs(command.help), ""]
    rows = [(f"`{_argument(a).replace('|', BAR)}`", a) for a in arguments]
    rows += [(", ".join(f"`{o}`" for o in p.opts) + _value(p), p) for p in options if p.name != "help"]
    if rows:
        lines += ["| argument or option | what it does | default |", "|---|---|---|"]
        lines += [f"| {shown} | {_cell(p.help)} | {_default(p)} |" for shown, p in rows]
        lines.append("")
    examples = command.epilog.replace("\b\n", "").removeprefix("Examples:\n")
    return "\n".join([*lines, "```sh", *(line.removeprefix("  ") for line in examples.splitlines()), "```"])


def _argument(parameter: Any) -> str:
    name = str(parameter.metavar or parameter.name.upper())
    if name.startswith("[") and name.endswith("]"):
        name = name[1:-1]
    return name if parameter.required else f"[{name}]"


def _value(parameter: Any) -> str:
    return "" if getattr(parameter, "is_flag", False) else f" `{parameter.metavar.replace('|', BAR)}`"


def _default(parameter: Any) -> str:
    default = parameter.default
    if getattr(parameter, "is_flag", False) or default is None or default in ("", [], ()):
        return ""
    return f"`{default}`"


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", BAR)


def _paragraphs(text: str) -> list[str]:
    blocks = [" ".join(block.split()) for block in text.strip().split("\n\n")]
    return "\n\n".join(blocks).split("\n")


def render() -> str:
    """The whole page."""
    return "\n".join([HEAD, *(f"{section(n, c)}\n" for n, c in commands(typer.main.get_command(app)))])


if __name__ == "__main__":
    PAGE.write_text(render(), encoding="utf-8")
