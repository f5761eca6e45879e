"""Size of the code without blanks, comments and docstrings: ``python -m tools.quality.code_size [FOLDER]``.

Prints code lines by room, the distribution of function lengths, and the largest functions, classes and argument lists.
FOLDER is a checkout of the project, by default this one; run it on two checkouts to compare them.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from tools import ROOT

MOST_FUNCTION: Final = 60
MOST_CLASS: Final = 250
MOST_ARGUMENTS: Final = 8
P90_FUNCTION: Final = 24

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
            first = node.lineno if isinstance(node, ast.ClassDef) else node.body[0].lineno
            lines = len(rows & set(range(first, (node.end_lineno or node.lineno) + 1)))
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
    functions, classes : tuple of Piece
        The longest first.
    """

    by_room: Mapping[str, int]
    functions: tuple[Piece, ...]
    classes: tuple[Piece, ...]

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
            if f.public and f.arguments > MOST_ARGUMENTS and not f.where.startswith("cli/")
        ]


def measure(root: Path) -> Sizes:
    """Sizes of the package in a checkout."""
    source = root / "src" / "tripwatt"
    by_room: Counter[str] = Counter()
    found: dict[str, list[Piece]] = {"function": [], "class": []}
    for path in sorted(source.rglob("*.py")):
        text, place = path.read_text("utf-8"), path.relative_to(source)
        tree = ast.parse(text)
        rows = code_rows(text, tree)
        by_room[place.parts[0] if len(place.parts) > 1 else path.stem] += len(rows)
        for kind, piece in pieces(tree, rows, place.as_posix()):
            found[kind].append(piece)
    longest = {kind: tuple(sorted(all_, key=lambda p: -p.lines)) for kind, all_ in found.items()}
    return Sizes(by_room, longest["function"], longest["class"])


def main() -> int:
    """Print the tables."""
    root = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT).resolve()
    sizes = measure(root)
    for room, lines in sorted(sizes.by_room.items(), key=lambda item: -item[1]):
        print(f"{room:14s}{lines:7d}")
    print(f"{'all':14s}{sum(sizes.by_room.values()):7d}")
    lengths = [piece.lines for piece in sizes.functions]
    print(
        f"functions: {len(lengths)}, median {np.median(lengths):g}, p90 {sizes.p90:g} (at most {P90_FUNCTION}), "
        f"over {MOST_FUNCTION}: {sum(n > MOST_FUNCTION for n in lengths)}"
    )
    print(
        f"classes: {len(sizes.classes)}, over {MOST_CLASS}: {sum(c.lines > MOST_CLASS for c in sizes.classes)}"
    )
    print(f"public functions with more than {MOST_ARGUMENTS} arguments: {len(sizes.wide)}")
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
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
