"""Formulas in the style of mgcv, read into the term values of `tripwatt_gamm.terms`.

    y ~ weather + s(time, by=season) + s(tamb, delev, k=30) + ti(a, b, bs="ps", k=c(6, 6)) + s(trip, bs="re")

The right-hand side is also a valid Python expression, so it is read with Python's own parser, and every fault has the
position of its character.
"""

from __future__ import annotations

import ast
import difflib
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Final, NoReturn, cast, get_args

from tripwatt_gamm.errors import Fault, InvalidInput, raise_faults
from tripwatt_gamm.terms import Basis, Formula, Parametric, RandomEffect, Smooth, Tensor, Term

_BASES: Final = (*get_args(Basis), "re")
_FUNCTIONS: Final = ("s", "te", "ti", "offset")
_ARGUMENTS: Final = ("bs", "k", "by", "knots")
_TERMS_ALLOWED: Final = (
    "a column, a:b, a*b, a/b, s(...), te(...), ti(...), (1 + x | group), offset(x), 1, 0 or -1, joined by +"
)
_MASKED: Final = re.compile(r"(`[^`]*`|[^\W\d][\w.]*)(\s*:\s*(`[^`]*`|[^\W\d][\w.]*))+|`[^`]*`")
_COLUMN: Final = re.compile(r"`([^`]*)`|([^\s:`]+)")
_MASK: Final = re.compile(r"ǂ(\d+)ǂ*")  # Python reads ǂ as a letter; no column is likely to start with it
_RESPONSE: Final = re.compile(r"`([^`]*)`|([^\W\d]\w*(?:\.[^\W\d]\w*)*)?")


class _Unreadable(Exception):
    """Raised to stop reading a term whose fault has been noted."""


@dataclass
class _Reader:
    """Terms and faults of a formula, collected while its syntax tree is read.

    Attributes
    ----------
    source : str
        The right-hand side in brackets, with quoted names and interactions masked; the syntax tree has its positions.
    offset : int
        Position of `source` in the text of the user.
    masked : tuple of str
        Texts of these names and interactions.
    """

    source: str
    offset: int
    masked: tuple[str, ...]
    terms: list[Term] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    intercept: bool = True
    known: str | None = None

    # -- reporting -------------------------------------------------------------------------------

    def original(self, node: ast.AST) -> str:
        """Text of a node as the user wrote it."""
        piece = ast.get_source_segment(self.source, node) or ""
        return _MASK.sub(lambda hit: self.masked[int(hit[1])], piece).replace(">>", "||")

    def note_fault(self, node: ast.expr, what: str, got: str, allowed: str, fix: str = "") -> None:
        before = self.source.encode()[: node.col_offset].decode()  # the offsets of `ast` count bytes
        where = f"term {self.original(node)!r} at character {self.offset + len(before) + 1}"
        self.faults.append(Fault(what, where, got, allowed, fix))

    def refuse(self, node: ast.expr, what: str, got: str, allowed: str, fix: str = "") -> NoReturn:
        """Note a fault and leave the term."""
        self.note_fault(node, what, got, allowed, fix)
        raise _Unreadable

    # -- names and values ------------------------------------------------------------------------

    def columns(self, node: ast.expr) -> tuple[str, ...]:
        """Columns that a node names: one by a plain, dotted or quoted name, several of an interaction; () for any other node."""
        if isinstance(node, ast.Name):
            hit = _MASK.fullmatch(node.id)
            names = _COLUMN.findall(self.masked[int(hit[1])]) if hit else [("", node.id)]
            return tuple(dict.fromkeys(quoted or plain for quoted, plain in names))
        if isinstance(node, ast.Attribute) and len(left := self.columns(node.value)) == 1:
            return (f"{left[0]}.{node.attr}",)
        return ()

    def column(self, node: ast.expr) -> str | None:
        """Column that a node names; returns None for any other node."""
        names = self.columns(node)
        return names[0] if len(names) == 1 else None

    def vector(self, node: ast.expr) -> tuple[ast.expr, ...]:
        """Elements of c(...), a tuple or a list; else the value itself."""
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "c":
            return tuple(node.args)
        return tuple(node.elts) if isinstance(node, ast.Tuple | ast.List) else (node,)

    def dimensions(self, call: ast.Call, node: ast.expr) -> tuple[int, ...]:
        """Read the basis dimensions of the argument `k`."""
        values = []
        for element in self.vector(node):
            value = element.value if isinstance(element, ast.Constant) else None
            if isinstance(value, bool) or not isinstance(value, int) or value < 2:
                self.refuse(call, "k is no whole number", self.original(node), "whole numbers >= 2")
            values.append(value)
        return tuple(values)

    def knots(self, call: ast.Call, node: ast.expr) -> tuple[float, ...]:
        """Read the numbers of the argument `knots`."""
        try:
            return tuple(float(ast.literal_eval(element)) for element in self.vector(node))
        except (TypeError, ValueError):
            self.refuse(call, "knots are no numbers", self.original(node), "knots=c(0, 24)")

    def basis(self, call: ast.Call, node: ast.expr) -> str:
        """Read the basis of the argument `bs`; several elements must be equal."""
        values = {e.value if isinstance(e, ast.Constant) else None for e in self.vector(node)}
        value = next(iter(values)) if len(values) == 1 else None
        if not isinstance(value, str) or value not in _BASES:
            hint = nearest(value, _BASES) if isinstance(value, str) else "one basis for all margins"
            allowed = ", ".join(f'"{b}"' for b in _BASES)
            self.refuse(call, "unknown basis", f"bs={self.original(node)}", allowed, hint)
        return value

    # -- terms -----------------------------------------------------------------------------------

    def add(self, sign: int, node: ast.expr) -> None:
        """Add one summand to the model, or note its fault."""
        try:
            if sign < 0:
                if not (isinstance(node, ast.Constant) and node.value == 1):
                    got = f"- {self.original(node)}"
                    self.refuse(node, "only the intercept can be taken away", got, "-1")
                self.intercept = False
            elif isinstance(node, ast.Constant) and node.value in (0, 1) and not isinstance(node.value, bool):
                self.intercept = bool(node.value)
            elif isinstance(node, ast.Call) and self.column(node.func) == "offset":
                name = self.column(node.args[0]) if len(node.args) == 1 else None
                if name is None or node.keywords or self.known is not None:
                    self.refuse(node, "an offset is one column", self.original(node), "offset(x), once")
                self.known = name
            else:
                self.terms += self.parts(node)
        except _Unreadable:
            pass

    def parts(self, node: ast.expr) -> list[Term]:
        """Read columns and their products, a call or the random effects of a group."""
        if isinstance(node, ast.Call):
            return [self.call(node)]
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitOr | ast.RShift):
            effects = self.correlated(node)
            if isinstance(node.op, ast.BitOr):
                return [effects]
            return [RandomEffect(effects.name), *(RandomEffect(effects.name, (x,)) for x in effects.others)]
        return [Parametric(name, tuple(others)) for name, *others in self.products(node)]

    def products(self, node: ast.expr) -> list[tuple[str, ...]]:
        """Columns of each term of a product: a*b is a + b + a:b, and a/b is a + a:b."""
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Mult | ast.Div):
            left, right = self.products(node.left), self.products(node.right)
            outer = [sum(left, ())] if isinstance(node.op, ast.Div) else left
            crossed = [] if isinstance(node.op, ast.Add) else [a + b for a in outer for b in right]
            every = [*left, *(right if not isinstance(node.op, ast.Div) else []), *crossed]
            return list(dict.fromkeys(tuple(dict.fromkeys(names)) for names in every))
        names = self.columns(node)
        if not names:
            fix = "an interaction of smooths is s(x, by=f), te(a, b) or ti(a, b)"
            self.refuse(node, "not a term", self.original(node), _TERMS_ALLOWED, fix)
        return [names]

    def call(self, node: ast.Call) -> Term:
        """Read a smooth, a tensor product or a random effect from its call."""
        kind = self.column(node.func) or self.original(node.func)
        if kind not in _FUNCTIONS:
            fix = nearest(kind, _FUNCTIONS) or "compute transformed columns beforehand"
            allowed = ", ".join(f"{name}()" for name in _FUNCTIONS)
            self.refuse(node, "unknown function", f"{kind}()", allowed, fix)
        names = [self.column(positional) for positional in node.args]
        columns = tuple(column for column in names if column is not None)
        if not names or len(columns) < len(names):
            self.refuse(node, "a smooth takes columns", self.original(node), f"{kind}(column, ...)")
        if len(set(columns)) < len(columns):
            self.refuse(node, "column given twice", ", ".join(columns), "distinct columns")
        options: dict[str, ast.expr] = {}
        for argument in node.keywords:
            if argument.arg not in _ARGUMENTS:
                name = argument.arg or "**"
                self.refuse(node, "unknown argument", name, ", ".join(_ARGUMENTS), nearest(name, _ARGUMENTS))
            options[argument.arg] = argument.value
        basis = self.basis(node, options["bs"]) if "bs" in options else "tp" if kind == "s" else "cr"
        if kind == "s" and basis == "re":
            if len(options) > 1:
                got = ", ".join(key for key in options if key != "bs")
                self.refuse(node, "a random effect takes columns only", got, 's(group, x, bs="re")')
            return RandomEffect(columns[0], columns[1:])
        k = self.dimensions(node, options["k"]) if "k" in options else ()
        by = self.column(options["by"]) if "by" in options else None
        if by is None and "by" in options:
            self.refuse(node, "by takes one column", f"by={self.original(options['by'])}", "by=column")
        knots = self.knots(node, options["knots"]) if "knots" in options else ()
        if kind == "s":
            return replace(self.smooth(node, columns, cast(Basis, basis), k, by), knots=knots)
        if knots:
            self.refuse(node, "a tensor product takes no knots", "knots", 's(x, bs="cc", knots=c(0, 24))')
        if len(columns) < 2 or basis == "re":
            got, allowed = self.original(node), f'{kind}(a, b, bs="ps", k=c(6, 6))'
            self.refuse(node, "a tensor product takes two or more covariates", got, allowed)
        if len(k) not in (0, 1, len(columns)):
            got = f"{len(k)} numbers for {len(columns)} covariates"
            self.refuse(node, "k does not match the covariates", got, f"1 or {len(columns)} numbers")
        k = k * len(columns) if len(k) == 1 else k
        return Tensor(columns, cast(Basis, basis), k or None, "te" if kind == "te" else "ti", by)

    def smooth(
        self, node: ast.Call, columns: tuple[str, ...], basis: Basis, k: tuple[int, ...], by: str | None
    ) -> Smooth:
        """Make a smooth of one covariate, or for each level of a factor, or an isotropic one of several."""
        if basis == "fs" and (len(columns) != 2 or by is not None):
            self.refuse(node, "a factor-smooth takes two columns", self.original(node), 's(x, f, bs="fs")')
        if basis == "fs":
            by, columns = columns[-1], columns[:1]
        if len(columns) > 1 and basis != "tp":
            fix = f'te({", ".join(columns)}, bs="{basis}") or ti(...)'
            self.refuse(node, "basis of one covariate only", f'bs="{basis}"', '"tp"', fix)
        if len(k) > 1:
            self.refuse(node, "k takes one number", f"{len(k)} numbers", f"k={k[0]}")
        return Smooth(columns, basis, k[0] if k else None, by)

    def correlated(self, node: ast.BinOp) -> RandomEffect:
        """Read the intercept and slopes of a group, (1 + x | g)."""
        group = self.column(node.right)
        parts = [part for part in _summands(node.left) if ast.unparse(part[1]) != "1" or part[0] < 0]
        names = [name for sign, part in parts if sign > 0 and (name := self.column(part)) is not None]
        if group is None or len(names) < len(parts) or len({group, *names}) <= len(names):
            self.refuse(node, "random effects cannot be read", self.original(node), "(1 + x | group)")
        return RandomEffect(group, tuple(names), correlated=bool(names))


def nearest(name: str, allowed: Iterable[str]) -> str:
    """Ask whether one of the allowed names was meant; returns an empty text if none is similar.

    Examples
    --------
    >>> nearest("tmie", ["time", "vel"])
    'did you mean time?'
    """
    near = difflib.get_close_matches(name, list(allowed), n=3, cutoff=0.5)
    return f"did you mean {' or '.join(near)}?" if near else ""


def _summands(node: ast.expr, sign: int = 1) -> Iterator[tuple[int, ast.expr]]:
    """Yield the terms of a sum from left to right with their signs; a loop, so that long sums do not exhaust the stack."""
    stack = [(node, sign)]
    while stack:
        top, s = stack.pop()
        if isinstance(top, ast.BinOp) and isinstance(top.op, ast.Add | ast.Sub):
            stack.append((top.right, s if isinstance(top.op, ast.Add) else -s))
            stack.append((top.left, s))
        elif isinstance(top, ast.UnaryOp) and isinstance(top.op, ast.UAdd | ast.USub):
            stack.append((top.operand, s if isinstance(top.op, ast.UAdd) else -s))
        else:
            yield s, top


def parse_formula(text: str) -> Formula:
    """Read a formula in mgcv's style.

    Parameters
    ----------
    text : str
        ``response ~ term + term + ...``. Terms: a column (numeric or factor) and interactions ``a:b``, ``a*b``
        (``a + b + a:b``), ``a/b`` (``a + a:b``); ``s(x)``, ``s(x, by=f)``, ``s(a, b)`` with ``bs`` ("tp", "ps",
        "cr", "cc"), ``k``, ``by``, ``knots`` (of "cc"); ``s(x, f, bs="fs")``; ``te(a, b)``, ``ti(a, b)``; ``s(group, bs="re")``, ``s(group, x, bs="re")``,
        ``(1 + x | group)``, ``(1 + x || group)`` without a correlation; ``offset(x)``; ``-1`` or ``+0`` to leave out
        the intercept. ``c(6, 6)`` gives one number per margin. A column whose name is no plain name is written in
        backticks. The response may be missing.

    Returns
    -------
    Formula

    Raises
    ------
    InvalidInput
        With one fault for every term that cannot be read: the term, its position and what is allowed.

    Examples
    --------
    >>> formula = parse_formula('y ~ weather + s(time, by=season, k=12) + s(trip, bs="re")')
    >>> formula.response, [term.label for term in formula.terms]
    ('y', ['weather', 's(time):season', 's(trip)'])
    >>> parse_formula("y ~ s(time, kk=12)")
    Traceback (most recent call last):
    tripwatt_gamm.errors.InvalidInput: unknown argument: term 's(time, kk=12)' at character 5: got kk; allowed: bs, k, by, knots; did you mean k?
    """
    left, tilde, right = text.partition("~")
    if not tilde or "~" in right:
        got = f"{text.count('~')} of them"
        raise InvalidInput.of("wrong number of ~", repr(text), got, "response ~ terms")
    if not right.strip():
        raise InvalidInput.of("no terms", f"right of ~ in {text!r}", "nothing", _TERMS_ALLOWED)
    # R allows a line break inside a sum, Python only within brackets; the opening bracket is part of `offset`
    flat = right.replace("\n", " ").replace("\t", " ").replace("\r", " ")
    masked, numbers = tuple(hit[0] for hit in _MASKED.finditer(flat)), count()
    plain = _MASKED.sub(
        lambda hit: f"ǂ{next(numbers)}".ljust(len(hit[0]), "ǂ"), flat
    )  # `ast` keeps positions
    source = f"({plain.replace('||', '>>')})"  # of the same rank beside + and |, and Python reads it
    reader = _Reader(source, len(left) + len(tilde) - 1, masked)
    response = _response(reader, left)
    try:
        tree = ast.parse(source, mode="eval").body
    except (SyntaxError, ValueError) as error:
        reader.faults.append(_syntax_fault(error, text, reader.offset))
        raise InvalidInput(reader.faults) from None
    bar = isinstance(tree, ast.BinOp) and isinstance(tree.op, ast.BitOr | ast.RShift)
    if bar and not right.strip().startswith("("):
        reader.note_fault(tree, "random effects without brackets", reader.original(tree), "(1 + x | group)")
    for sign, node in _summands(tree):
        reader.add(sign, node)
    raise_faults(reader.faults)
    return Formula(response, tuple(reader.terms), reader.intercept, reader.known)


def _response(reader: _Reader, left: str) -> str | None:
    """Name of the response, None without one; note a fault if the left side is not one column."""
    name = left.strip()
    hit = _RESPONSE.fullmatch(name)
    if hit is None:
        fix = "compute a transformed response beforehand, write odd names in `backticks`"
        reader.faults.append(
            Fault("response is not a column", "left of ~ at character 1", name, "one column", fix)
        )
    return hit and (hit[2] if hit[1] is None else hit[1])


def _syntax_fault(error: SyntaxError | ValueError, text: str, offset: int) -> Fault:
    """Fault of a text that Python cannot read, with its place in the text of the user."""
    position = getattr(error, "offset", None)
    at = min(offset + position, len(text)) if position not in (None, 1) else len(text)  # 1 is our own "("
    around = text[text.rfind(" ", 0, max(0, at - 12)) + 1 : at + 12].strip()
    reason = error.msg if isinstance(error, SyntaxError) else str(error)
    return Fault(
        "formula cannot be read",
        f"near {around!r} at character {at}",
        reason,
        _TERMS_ALLOWED,
        "by-smooths are s(x, by=f); write odd column names in `backticks`",
    )
