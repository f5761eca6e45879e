"""Mutants of source code: one operator, constant, comparison or boundary changed, a statement dropped, branches swapped or a slice one off.

Annotations, docstrings, decorators, messages and the inside of f-strings are left alone: a change of them is no change
of what is computed.
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

OPERATORS: Final[dict[type[ast.operator], type[ast.operator]]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
BOUNDARIES: Final[dict[type[ast.cmpop], type[ast.cmpop]]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
}
COMPARISONS: Final[dict[type[ast.cmpop], type[ast.cmpop]]] = {
    ast.Lt: ast.GtE,
    ast.LtE: ast.Gt,
    ast.Gt: ast.LtE,
    ast.GtE: ast.Lt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
SWAPPED: Final = {"minimum": "maximum", "maximum": "minimum", "min": "max", "max": "min"}
WITHOUT_EFFECT: Final = frozenset({"cast", "overload", "TypeVar", "Flag", "Fault", "warn"})
"""Calls whose arguments are types or words."""
TEXTS: Final = frozenset(
    {"fix", "allowed", "got", "help", "title", "description", "rich_help_panel", "strict"}
)
"""Keyword arguments that hold words, and `strict` of `zip`, which guards against a mistake that is not there."""

AS_IT_IS: Final = frozenset({"named", "statement", "slice"})
"""Kinds whose text takes no brackets."""
EFFECTS: Final = ast.Expr | ast.AugAssign | ast.Continue | ast.Break | ast.Raise | ast.Delete
"""Statements that can be dropped: no later one reads a name that they alone give. Without a return a function fails at once."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change of one file.

    Attributes
    ----------
    path : Path
        Of the file.
    line : int
    kind : str
        ``operator``, ``constant``, ``comparison``, ``boundary``, ``statement``, ``branch`` or ``slice``; ``named`` for any other text.
    before, after : str
        The changed expression.
    start, end : int
        Place of the expression in the bytes of the file.
    first, last : int
        Lines of the innermost statement that holds it.
    function : (int, int) or None
        Lines of the body of the function that holds it; None at the top of a module or class.
    names : tuple of str
        What the statement assigns, where it is at the top of a module or class.
    """

    path: Path
    line: int
    kind: str
    before: str
    after: str
    start: int
    end: int
    first: int
    last: int
    function: tuple[int, int] | None
    names: tuple[str, ...]

    @property
    def change(self) -> str:
        """What is changed into what, on one line."""
        return f"{' '.join(self.before.split())}  ->  {self.after}"

    def applied(self, source: bytes) -> bytes:
        """The file with the change."""
        text = self.after if self.kind in AS_IT_IS else f"({self.after})"
        return source[: self.start] + text.encode() + source[self.end :]


def mutants_of(path: Path) -> list[Mutant]:
    """Every mutant of a file, in the order of its lines. O(nodes)."""
    source = path.read_bytes()
    starts = [0]
    for row in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(row))
    mutants: list[Mutant] = []
    for node, place in _expressions(ast.parse(source)):
        first, last, function, names = place
        start = starts[node.lineno - 1] + node.col_offset
        end = starts[(node.end_lineno or node.lineno) - 1] + (node.end_col_offset or 0)
        before = source[start:end].decode()
        for kind, changed in _changes(node):
            after = ast.unparse(changed)
            mutants.append(
                Mutant(path, node.lineno, kind, before, after, start, end, first, last, function, names)
            )
    return sorted(mutants, key=lambda mutant: (mutant.line, mutant.start))


Place = tuple[int, int, tuple[int, int] | None, tuple[str, ...]]


def _expressions(tree: ast.Module) -> Iterator[tuple[ast.expr | ast.stmt, Place]]:
    """Expressions that compute something and statements with an effect, each with its statement and function."""
    stack: list[tuple[ast.AST, Place]] = [(statement, _place(statement, None)) for statement in tree.body]
    while stack:
        node, place = stack.pop()
        if isinstance(node, ast.expr | EFFECTS | ast.Assign) and not _is_words(node):
            yield node, place
        for child in _computing(node):
            inside = place
            if isinstance(child, ast.stmt):
                inside = _place(child, place[2])
            stack.append((child, inside))


def _place(statement: ast.stmt, function: tuple[int, int] | None) -> Place:
    if isinstance(statement, Function):
        function = statement.body[0].lineno, statement.end_lineno or statement.lineno
    targets: list[ast.expr] = []
    if isinstance(statement, ast.Assign):
        targets = statement.targets
    elif isinstance(statement, ast.AnnAssign):
        targets = [statement.target]
    names = tuple(t.id for t in targets if isinstance(t, ast.Name)) if function is None else ()
    last = statement.end_lineno or statement.lineno
    if isinstance(statement, ast.If | ast.For | ast.While | ast.With | ast.Try | ast.ClassDef | Function):
        last = max(statement.lineno, _head_end(statement))
    return statement.lineno, last, function, names


def _head_end(statement: ast.stmt) -> int:
    body: list[ast.stmt] = getattr(statement, "body", [])
    return body[0].lineno - 1 if body else statement.lineno


def _computing(node: ast.AST) -> Iterator[ast.AST]:
    """Children of a node whose value matters."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return  # a docstring
    if isinstance(node, ast.JoinedStr | ast.Raise | ast.Import | ast.ImportFrom):
        return
    if isinstance(node, ast.If | ast.IfExp):
        node.test.decides = bool(node.orelse)  # type: ignore[attr-defined]
    if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
        return
    if isinstance(node, ast.Call) and _called(node) in WITHOUT_EFFECT:
        return
    skipped: set[int] = set()
    if isinstance(node, ast.ClassDef | Function):
        skipped.update(map(id, node.decorator_list))
    for name in ("annotation", "returns"):
        skipped.add(id(getattr(node, name, None)))
    if isinstance(node, ast.Call):
        skipped.update(id(k) for k in node.keywords if k.arg in TEXTS)
    if isinstance(node, ast.Assign) and isinstance(node.value, ast.Subscript | ast.BinOp) and _is_type(node):
        return
    for child in ast.iter_child_nodes(node):
        if id(child) not in skipped:
            yield child


def _is_type(node: ast.Assign) -> bool:
    """Whether an assignment names a type, such as ``Number = float | FloatArray``."""
    return all(isinstance(t, ast.Name) and t.id[0].isupper() and not t.id.isupper() for t in node.targets)


def _called(node: ast.Call) -> str:
    function = node.func
    return function.id if isinstance(function, ast.Name) else getattr(function, "attr", "")


def _is_words(node: ast.AST) -> bool:
    """Whether a node is a docstring."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _changes(node: ast.expr | ast.stmt) -> Iterator[tuple[str, ast.AST]]:
    if isinstance(node, EFFECTS):
        yield "statement", ast.Pass()
    elif isinstance(node, ast.Assign):
        if all(isinstance(target, ast.Subscript | ast.Attribute) for target in node.targets):
            yield "statement", ast.Pass()
    elif isinstance(node, ast.Slice):
        one = ast.Constant(1)
        lower = ast.BinOp(node.lower, ast.Add(), one) if node.lower else one
        yield "slice", _with(node, lower=lower)
        if node.upper is not None:
            yield "slice", _with(node, upper=ast.BinOp(node.upper, ast.Sub(), one))
    if isinstance(node, ast.expr) and getattr(node, "decides", False):
        yield "branch", ast.UnaryOp(ast.Not(), node)
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        if not (isinstance(node.left, ast.Constant | ast.JoinedStr) and _is_text(node.left)):
            yield "operator", _with(node, op=OPERATORS[type(node.op)]())
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield "operator", node.operand
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield "comparison", node.operand
    elif isinstance(node, ast.BoolOp):
        other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield "comparison", _with(node, op=other)
    elif isinstance(node, ast.Compare):
        for index, op in enumerate(node.ops):
            for kind, table in (("boundary", BOUNDARIES), ("comparison", COMPARISONS)):
                if type(op) in table:
                    ops = [*node.ops[:index], table[type(op)](), *node.ops[index + 1 :]]
                    yield kind, _with(node, ops=ops)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        for value in _other_values(node.value):
            yield "constant", ast.Constant(value)
    elif isinstance(node, ast.Call) and _called(node) in SWAPPED:
        function = copy.copy(node.func)
        if isinstance(function, ast.Name):
            function.id = SWAPPED[function.id]
        elif isinstance(function, ast.Attribute):
            function.attr = SWAPPED[function.attr]
        yield "boundary", _with(node, func=function)


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or isinstance(getattr(node, "value", None), str)


def _other_values(value: float | bool) -> tuple[float | bool, ...]:
    if isinstance(value, bool):
        return (not value,)
    if value == 0:
        return (type(value)(1),)
    if isinstance(value, int):
        return (value + 1, value - 1)
    return (value * 2.0, value / 10.0) if value != 1.0 else (2.0, 0.0)


def _with(node: ast.AST, **fields: object) -> ast.AST:
    changed = copy.copy(node)
    for name, value in fields.items():
        setattr(changed, name, value)
    return changed
