"""What `--help` shows as Markdown, for the site; writes the example of the README and the fields of a departure: ``python -m tools.docs.write_cli``."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from typing import Any

import typer.main

from tools import ROOT
from tools.docs import pages
from tripwatt.command import app
from tripwatt.trips.departure import ASKED

BAR = "\\|"
"""How a table cell holds a bar."""


def commands(command: Any, name: str = "tripwatt") -> Iterator[tuple[str, Any]]:
    """(full name, command) of every command of the help that does something, in its order."""
    children = {n: c for n, c in getattr(command, "commands", {}).items() if not c.hidden}
    if not children:
        yield name, command
    for child, below in children.items():
        yield from commands(below, f"{name} {child}")


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


def _cell(text: str | None) -> str:
    return " ".join((text or "").split()).replace("|", BAR)


def _paragraphs(text: str) -> list[str]:
    blocks = [" ".join(block.split()) for block in text.strip().split("\n\n")]
    return "\n\n".join(blocks).split("\n")


def render() -> str:
    """Every command, for the page docs/reference/cli.md of the site."""
    return "\n".join(f"{section(n, c)}\n" for n, c in commands(typer.main.get_command(app)))


def departure() -> str:
    """The table of the fields of a departure."""
    rows = ["| field | option | what it is |", "|---|---|---|"]
    for name, field in ASKED.items():
        allowed = "" if field.column is None else f" {field.allowed}."
        rows.append(f"| `{name}` | `{field.option}` | {field.help}{allowed} |")
    return "\n".join(rows)


EXAMPLE = ("tripwatt example-trip --out trip.csv", "tripwatt forecast trip.csv --soc 0.8 --ambient 5")
"""Commands of the README; the output of the last one is shown."""


def example() -> str:
    """The commands of the README's example and what the last one prints."""
    columns = {**os.environ, "COLUMNS": "100", "NO_COLOR": "1"}
    with tempfile.TemporaryDirectory() as folder:
        for command in EXAMPLE:
            done = subprocess.run(
                [sys.executable, "-m", "tripwatt", *command.split()[1:]],
                check=True,
                capture_output=True,
                text=True,
                cwd=folder,
                env=columns,
            )
    printed = "\n".join(line.rstrip() for line in done.stdout.rstrip().splitlines())
    return "\n".join(["```", *EXAMPLE, "```", "", "prints", "", "```", printed, "```"])


if __name__ == "__main__":
    pages.renew(ROOT / "README.md", "example", example())
    pages.renew("reference/forecast.md", "departure", departure())
