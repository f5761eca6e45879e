"""Size of the code without blanks, comments and docstrings: ``python -m tools.quality.code_size [--root CHECKOUT] [--before CHECKOUT]``.

Prints code lines by room and outside of the package, the distribution of function lengths, the largest functions, classes and
argument lists, and the bars; exit code 1 where one is missed. With ``--before``, the lines of that checkout stand beside.
"""

from __future__ import annotations

import ast
import io
import tokenize
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from tools import ROOT
from tools.command import run

PARTS: Final = ("roads", "server", "fleet", "study", "gamm")
"""Rooms that are a part; all others together are the core. `gamm` is a distribution of its own."""
BUDGETS: Final[Mapping[str, int]] = {
    "core": 20_424,
    "roads": 4_443,
    "server": 5_984,
    "fleet": 2_899,
    "study": 4_648,
    "gamm": 3_853,
}
"""Most code lines of each part. They only fall: whoever needs lines finds them first. The fleet may have up to 3,400, for what a manager
asks, where the others fall by as much. That of the roads is below the 4,800 of the house plan."""
TABLE_ROWS: Final = 4
"""Rows of a table that count as one line of code: moving code into tables saves nothing."""
MAX_FUNCTION: Final = 60
MAX_CLASS: Final = 250
MAX_ARGUMENTS: Final = 8
P90_FUNCTION: Final = 22

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True, slots=True)
class Piece:
    """A function or class: where it is, its lines of code, its positional and keyword arguments."""

    where: str
    lines: int
    arguments: int = 0
    public: bool = True


def code_rows(source: str, tree: ast.Module | None = None) -> set[int]:
    """Numbers of the rows with code: no blanks, comments or docstrings."""
    skipped = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT}
    rows: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in skipped and token.type != tokenize.ENDMARKER:
            rows.update(range(token.start[0], token.end[0] + 1))
    for node, _ in statements(ast.parse(source) if tree is None else tree):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            rows -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return rows


def statements(tree: ast.AST, inside: str = "") -> Iterator[tuple[ast.AST, str]]:
    """Every statement below a node, with the names of the functions and classes around it."""
    for name in ("body", "handlers", "orelse", "finalbody", "cases"):
        part = getattr(tree, name, ())
        for node in part if isinstance(part, list) else ():
            yield node, inside
            named = isinstance(node, ast.ClassDef | Function)
            yield from statements(node, f"{inside}{node.name}." if named else inside)


def pieces(tree: ast.Module, rows: set[int], place: str) -> Iterator[tuple[str, Piece]]:
    """Functions and classes of a file, each as (kind, piece)."""
    for node, inside in statements(tree):
        if isinstance(node, ast.ClassDef | Function):
            start = node.lineno if isinstance(node, ast.ClassDef) else node.body[0].lineno
            lines = len(rows & set(range(start, (node.end_lineno or node.lineno) + 1)))
            name = f"{inside}{node.name}"
            where, public = (
                f"{place}:{node.lineno} {name}",
                not any(p.startswith("_") for p in name.split(".")),
            )
            if isinstance(node, ast.ClassDef):
                yield "class", Piece(where, lines, 0, public)
            else:
                yield "function", Piece(where, lines, _arguments(node), public)


def _arguments(node: Function) -> int:
    names = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
    return len([name for name in names if name not in ("self", "cls")])


@dataclass(frozen=True, slots=True)
class Sizes:
    """Sizes of one checkout.

    Attributes
    ----------
    by_room : mapping of str to int
        Lines of code.
    outside : mapping of str to int
        Lines of the tools, the benchmarks and the scripts of the docs.
    functions, classes : tuple of Piece
        The longest first.
    """

    by_room: Mapping[str, int]
    outside: Mapping[str, int]
    functions: tuple[Piece, ...]
    classes: tuple[Piece, ...]

    @property
    def by_part(self) -> dict[str, int]:
        """Lines of the core and of each part."""
        parts = {part: self.by_room[part] for part in PARTS}
        return {"core": sum(self.by_room.values()) - sum(parts.values())} | parts

    @property
    def total(self) -> int:
        """Lines of the package and outside of it."""
        return sum(self.by_room.values()) + sum(self.outside.values())

    @property
    def p90(self) -> float:
        """Length that nine of ten functions do not exceed."""
        return float(np.percentile([piece.lines for piece in self.functions], 90))

    @property
    def wide(self) -> list[Piece]:
        """Public functions with too many arguments; commands and constructors of estimators aside."""
        return [
            f
            for f in sorted(self.functions, key=lambda p: -p.arguments)
            if f.public and f.arguments > MAX_ARGUMENTS and not f.where.startswith("command/")
        ]


def measure(root: Path) -> Sizes:
    """Sizes of the package in a checkout."""
    source, gamm = root / "src" / "tripwatt", root / "gamm" / "src" / "tripwatt_gamm"
    by_room: Counter[str] = Counter()
    measured: dict[str, list[Piece]] = {"function": [], "class": []}
    for path in (*sorted(source.rglob("*.py")), *sorted(gamm.rglob("*.py"))):
        text, inside = path.read_text("utf-8"), path.is_relative_to(source)
        place = path.relative_to(source) if inside else "gamm" / path.relative_to(gamm)
        tree = ast.parse(text)
        rows = code_rows(text, tree)
        by_room[place.parts[0] if len(place.parts) > 1 else path.stem] += len(rows)
        for kind, piece in pieces(tree, rows, place.as_posix()):
            measured[kind].append(piece)
    for path in source.rglob("*.toml"):
        place = path.relative_to(source)
        if not {"data", "mappings", "models"} & {*place.parts}:
            table = [line for line in path.read_text("utf-8").splitlines() if line.strip() and line[0] != "#"]
            by_room[place.parts[0]] += len(table) // TABLE_ROWS
    outside = {
        folder: sum(len(code_rows(path.read_text("utf-8"))) for path in (root / folder).rglob("*.py"))
        for folder in ("tools", "benchmarks", "docs")
    }
    longest = {kind: tuple(sorted(all_, key=lambda p: -p.lines)) for kind, all_ in measured.items()}
    return Sizes(by_room, outside, longest["function"], longest["class"])


def bars(sizes: Sizes) -> Iterator[tuple[str, float, float]]:
    """What is bounded, its figure and its bound."""
    for part, lines in sizes.by_part.items():
        yield f"lines of {part}", lines, BUDGETS[part]
    yield "nine in ten functions, lines", sizes.p90, P90_FUNCTION
    yield "longest function, lines", sizes.functions[0].lines, MAX_FUNCTION
    yield "largest class, lines", sizes.classes[0].lines, MAX_CLASS
    yield f"public functions with more than {MAX_ARGUMENTS} arguments", len(sizes.wide), 0


def main(root: Path = ROOT, before: Path | None = None) -> int:
    """Print the tables and the bars; 1 where one is missed."""
    sizes, old = measure(root), None if before is None else measure(before)
    columns = [s for s in (old, sizes) if s is not None]
    rows = [
        (room, [s.by_room.get(room, 0) for s in columns])
        for room in sorted(sizes.by_room, key=lambda r: -sizes.by_room[r])
    ]
    rows += [(f"{folder}/", [s.outside[folder] for s in columns]) for folder in sizes.outside]
    rows += [(f"{part}, in all", [s.by_part[part] for s in columns]) for part in BUDGETS]
    rows += [("the package", [sum(s.by_room.values()) for s in columns]), ("all", [s.total for s in columns])]
    for name, lines in rows:
        print(f"{name:14s}" + "".join(f"{n:8d}" for n in lines))
    for title, chosen in (
        ("longest functions", sizes.functions[:12]),
        ("largest classes", sizes.classes[:8]),
    ):
        print(f"\n{title}")
        for piece in chosen:
            print(f"{piece.lines:6d}  {piece.where}")
    print("\nmost arguments")
    for piece in sizes.wide:
        print(f"{piece.arguments:6d}  {piece.where}")
    print(
        f"\n{len(sizes.functions)} functions, median {np.median([f.lines for f in sizes.functions]):g} lines; {len(sizes.classes)} classes"
    )
    missed = False
    for name, figure, bound in bars(sizes):
        missed |= figure > bound
        print(f"{'yes' if figure <= bound else 'NO':3s} {name}: {figure:g}, at most {bound:g}")
    return int(missed)


if __name__ == "__main__":
    run(main)
