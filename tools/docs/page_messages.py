"""Every English message that the page may show, as a template: ``python -m tools.docs.page_messages`` prints them.

A template is a text of the source with ``{}`` for each of its values. They are found by walking the syntax trees of the rooms
that a request reaches: texts of faults and problems, findings of the audit, reasons of a proposed mapping; to them come the
messages of the checks of a document, and the sentences of flags that the page has no own words for. The German of
`web/src/text/messages-de.json` has an entry for each.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from itertools import product
from pathlib import Path
from typing import Final

from pydantic_core._pydantic_core import list_all_errors

import tripwatt
from tripwatt.errors import and_more
from tripwatt.server.http.problems import TITLES, WORDS
from tripwatt.trips.messages import catalogue

PACKAGE: Final = Path(tripwatt.__file__).parent
ROOMS: Final = (
    "auditing",
    "forecasting",
    "roads",
    "routes",
    "server",
    "sources",
    "trips",
    "vehicles",
)
FILES: Final = ("files.py", "errors.py")
NOT_REACHED: Final = (
    "roads/maps/engine.py",
    "roads/maps/extract.py",
    "roads/maps/folder.py",
    "roads/maps/stations.py",
    "server/cars/following.py",
    "server/http/fleet_endpoints.py",
    "server/http/fleets.py",
    "server/http/serving.py",
    "server/http/settings.py",
    "server/mcp.py",
    "sources/__init__.py",
    "sources/public.py",
    "sources/tum.py",
    "sources/ved.py",
    "vehicles/inheriting.py",
    "vehicles/reading.py",
)
"""Modules of the start of a service, of the command line, of fleets, and of files of cars, which the page sends to no service."""

CALLS: Final[Mapping[str, tuple[str, ...]]] = {
    "Fault": ("what", "where", "got", "allowed", "fix"),
    "of": ("what", "where", "got", "allowed", "fix"),
    "Problem": ("", "detail"),
    "Finding": ("", "", "", "what"),
    "whole": ("", "", "what"),
    "between": ("", "", "", "what"),
    "Cut": ("", "", "what"),
    "Guess": ("", "", "", "why"),
    "Flow": ("", "", "why"),
    "replace": (),
}
"""Callables whose arguments are shown, with the names of their first arguments; those without a name are not."""

SHOWN: Final = frozenset(name for names in CALLS.values() for name in names) - {""} | {"fix"}
WITH_REASONS: Final = ("sources/evidence.py",)
"""Modules whose functions return a reason beside a value."""

OPAQUE: Final = frozenset({"and_more", "excerpt", "_excerpt", "printable", "repr", "str", "len"})
DEEPEST: Final = 7
MOST: Final = 40
"""Texts of one expression."""

DOCUMENT_ERRORS: Final = re.compile(
    r"missing|extra_forbidden|finite_number|literal_error|enum|too_short|too_long|value_error|"
    r"(greater|less)_than(_equal)?|string_(type|too_short|too_long|pattern_mismatch)|"
    r"(int|float|bool)_(type|parsing)|int_from_float|(model|dict|list|tuple)_type|model_attributes_type|"
    r"datetime_(type|parsing|from_date_parsing)|date_from_datetime_parsing"
)
"""Kinds of pydantic's errors that a document of a request can have."""

UNITS: Final = frozenset({"km", "kg", "ms", "rad", "min", "ppm", "degc", "degf", "lat", "lon", "ele"})

Scope = ast.FunctionDef | ast.AsyncFunctionDef | None
HOLE: Final = "{}"


class Sources:
    """Syntax trees of the modules that a request reaches, with what resolves a name."""

    def __init__(self) -> None:
        self.constants: dict[str, list[ast.expr]] = {}
        self.functions: dict[str, list[ast.FunctionDef | ast.AsyncFunctionDef]] = {}
        self.calls: dict[str, list[tuple[ast.Call, Scope]]] = {}
        self.parts: set[str] = set()
        self.names: dict[tuple[str, int], set[str]] = {}
        self.reasons: list[tuple[ast.expr, Scope]] = []
        self.place: dict[ast.Call, str] = {}
        for file in _files():
            name = file.relative_to(PACKAGE).as_posix()
            tree = ast.parse(file.read_text())
            for node in tree.body:
                target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
                value = getattr(node, "value", None)
                if isinstance(target, ast.Name) and value is not None:
                    self.constants.setdefault(target.id, []).append(value)
            self._visit(tree, None, name)

    def _visit(self, node: ast.AST, scope: Scope, file: str) -> None:
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            scope = node
            self.functions.setdefault(node.name, []).append(node)
        if isinstance(node, ast.Call):
            self.calls.setdefault(_name(node.func), []).append((node, scope))
            self.place[node] = f"{file}:{node.lineno}"
        if file.startswith(WITH_REASONS) and scope is not None and isinstance(node, ast.Tuple):
            self.reasons += [(element, scope) for element in node.elts]
        for child in ast.iter_child_nodes(node):
            self._visit(child, scope, file)

    def texts(self, node: ast.expr | None, scope: Scope, depth: int = 0) -> set[str]:
        """The templates that an expression may be."""
        if node is None or depth > DEEPEST:
            return {HOLE}
        deeper = depth + 1
        match node:
            case ast.Constant(value=str(text)):
                return {text}
            case ast.JoinedStr(values=values):
                parts = [self._part(value, scope, deeper) for value in values]
                return {"".join(text) for text in product(*parts)} if _n(parts) <= MOST else {HOLE}
            case ast.IfExp(body=one, orelse=other):
                return self.texts(one, scope, deeper) | self.texts(other, scope, deeper)
            case ast.BoolOp(values=values):
                return set().union(*(self.texts(value, scope, deeper) for value in values))
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                parts = [self.texts(left, scope, deeper), self.texts(right, scope, deeper)]
                return {"".join(text) for text in product(*parts)}
            case ast.Subscript(value=ast.JoinedStr() | ast.Constant() as text):
                return self.texts(text, scope, deeper)
            case ast.Attribute(attr="format") | ast.Subscript():
                return {HOLE}
            case ast.Attribute(attr=name) if name in self.functions:
                return self._returned(name, deeper)
            case ast.Call(func=ast.Attribute(value=text, attr="format")):
                return {re.sub(r"\{[^}]*\}", HOLE, t) for t in self.texts(text, scope, deeper)}
            case ast.Call(func=func) if (name := _name(func)) in self.functions and name not in OPAQUE:
                return self._returned(name, deeper)
            case ast.Name(id=name):
                return self._named(name, scope, deeper)
        return {HOLE}

    def _part(self, node: ast.expr, scope: Scope, depth: int) -> set[str]:
        if isinstance(node, ast.FormattedValue):
            inner = node.value
            texts = self.texts(inner, scope, depth)
            if isinstance(inner, ast.IfExp):
                return texts
            if node.format_spec is None:
                self.parts |= texts
            return {HOLE}
        return self.texts(node, scope, depth)

    def _returned(self, name: str, depth: int) -> set[str]:
        texts: set[str] = set()
        for function in self.functions[name]:
            for node in ast.walk(function):
                if isinstance(node, ast.Return) and isinstance(
                    node.value, (ast.Constant, ast.JoinedStr, ast.IfExp, ast.BinOp)
                ):
                    texts |= self.texts(node.value, function, depth)
        return texts or {HOLE}

    def _named(self, name: str, scope: Scope, depth: int) -> set[str]:
        key = (name, id(scope))
        if key not in self.names:
            self.names[key] = {HOLE}  # for a name that is assigned from itself
            self.names[key] = self._bound(name, scope, depth)
        return self.names[key]

    def _bound(self, name: str, scope: Scope, depth: int) -> set[str]:
        texts: set[str] = set()
        for node in ast.walk(scope) if scope is not None else ():
            if isinstance(node, ast.Assign):
                for target in node.targets:
                    begun = self._assigned(name, target, node.value, scope, depth)
                    texts |= self._continued(name, node, begun, scope, depth) if begun else set()
            elif isinstance(node, ast.NamedExpr) and node.target.id == name:
                texts |= self.texts(node.value, scope, depth)
            elif isinstance(node, (ast.For, ast.comprehension)):
                texts |= self._looped(name, node.target, node.iter, scope, depth)
        if scope is not None:
            texts |= self._given(name, scope, depth)
        for value in () if texts else self.constants.get(name, ()):
            if isinstance(value, (ast.Constant, ast.JoinedStr, ast.BinOp, ast.Call)):
                texts |= self.texts(value, None, depth)
        return texts or {HOLE}

    def _continued(self, name: str, begun: ast.Assign, texts: set[str], scope: Scope, depth: int) -> set[str]:
        """Texts with what is added to them (`+=`) up to the next assignment; under an `if`, it may be."""
        nodes = sorted(
            (n for n in ast.walk(scope or begun) if isinstance(n, (ast.Assign, ast.AugAssign))
             and n.lineno > begun.lineno and name in map(_name, getattr(n, "targets", [getattr(n, "target", n)]))),
            key=lambda node: node.lineno,
        )  # fmt: skip
        for node in nodes:
            if isinstance(node, ast.Assign):
                break
            may = set() if node.col_offset <= begun.col_offset else {""}
            texts = {a + b for a, b in product(texts, self.texts(node.value, scope, depth) | may)}
        return texts

    def _assigned(self, name: str, target: ast.AST, value: ast.expr, scope: Scope, depth: int) -> set[str]:
        if isinstance(target, ast.Name):
            return self.texts(value, scope, depth) if target.id == name else set()
        if not isinstance(target, ast.Tuple) or name not in map(_name, target.elts):
            return set()
        if isinstance(value, ast.IfExp):
            both = (self._assigned(name, target, side, scope, depth) for side in (value.body, value.orelse))
            return set().union(*both)
        place = [*map(_name, target.elts)].index(name)
        is_unpacked = isinstance(value, ast.Tuple) and len(value.elts) == len(target.elts)
        return self.texts(value.elts[place], scope, depth) if is_unpacked else set()  # type: ignore[attr-defined]

    def _looped(self, name: str, target: ast.AST, over: ast.expr, scope: Scope, depth: int) -> set[str]:
        texts: set[str] = set()
        if isinstance(over, ast.Name):
            values = [n.value for n in ast.walk(scope or ast.Pass()) if isinstance(n, ast.Assign)
                      and over.id in map(_name, n.targets)]  # fmt: skip
            for value in values or self.constants.get(over.id, []):
                texts |= (
                    set() if isinstance(value, ast.Name) else self._looped(name, target, value, scope, depth)
                )
        for item in over.elts if isinstance(over, (ast.Tuple, ast.List)) else ():
            texts |= self._assigned(name, target, item, scope, depth)
        return texts

    def _given(self, name: str, scope: ast.FunctionDef | ast.AsyncFunctionDef, depth: int) -> set[str]:
        """What callers give as an argument."""
        arguments = scope.args
        placed = [argument.arg for argument in (*arguments.posonlyargs, *arguments.args)]
        if name not in (*placed, *(argument.arg for argument in arguments.kwonlyargs)):
            return set()
        texts: set[str] = set()
        skipped = 1 if placed[:1] in (["self"], ["cls"]) else 0
        for call, caller in self.calls.get(scope.name, ()):
            arguments_of_call = {word.arg: word.value for word in call.keywords}
            if not any(isinstance(argument, ast.Starred) for argument in call.args):
                arguments_of_call |= dict(zip(placed[skipped:], call.args, strict=False))
            if name in arguments_of_call:
                texts |= self.texts(arguments_of_call[name], caller, depth)
        defaults = dict(zip(placed[::-1], arguments.defaults[::-1], strict=False))
        return texts | (self.texts(defaults[name], None, depth) if name in defaults else set())


def _files() -> Iterator[Path]:
    rooms = (file for room in ROOMS for file in sorted((PACKAGE / room).rglob("*.py")))
    for file in (*rooms, *(PACKAGE / name for name in FILES)):
        if not file.relative_to(PACKAGE).as_posix().startswith(NOT_REACHED):
            yield file


def _name(node: ast.AST) -> str:
    return ast.unparse(node).rpartition(".")[2]


def _n(parts: Iterable[set[str]]) -> int:
    n = 1
    for part in parts:
        n *= len(part)
    return n


def _is_shown(call: ast.Call, name: str) -> bool:
    return name != "of" or (
        isinstance(call.func, ast.Attribute) and _name(call.func.value).endswith(("Input", "Error"))
    )


def _of_sources() -> Iterator[tuple[str, str, str]]:
    sources = Sources()
    for name, arguments in CALLS.items():
        for call, scope in sources.calls.get(name, ()):
            if not _is_shown(call, name):
                continue
            texts_by_name = dict(zip(arguments, call.args, strict=False)) | {
                w.arg: w.value for w in call.keywords
            }
            for shown in SHOWN & texts_by_name.keys():
                for text in sources.texts(texts_by_name[shown], scope):
                    yield text, sources.place[call], "where" if shown == "where" else "text"
    for node, scope in sources.reasons:
        for text in sources.texts(node, scope):
            if " " in text:  # the others are units
                yield text, scope.name if scope else "", "text"
    for text in sources.parts:
        if " " in text and not text.startswith("{}, "):  # the others are names
            yield text, "part of a text", "text"


def _of_documents() -> Iterator[tuple[str, str, str]]:
    for error in list_all_errors():
        if DOCUMENT_ERRORS.fullmatch(error["type"]) and error["type"] not in WORDS["faults"]:
            yield re.sub(r"\{\w+\}", HOLE, error["message_template_python"]), "pydantic", "text"
    for texts in WORDS["faults"].values():
        yield from ((re.sub(r"\{\w+\}", HOLE, text), "words", "text") for text in texts if text)


def _of_problems() -> Iterator[tuple[str, str, str]]:
    for kind, (_status, title) in TITLES.items():
        yield title, f"problem {kind}", "text"


def _of_flags() -> Iterator[tuple[str, str, str]]:
    for code, entry in catalogue()["flags"].items():
        words = entry["cli"]["text"]
        for text in () if "de" in entry else [words] if isinstance(words, str) else words.values():
            yield re.sub(r"\{\w+\}", HOLE, text), f"flag {code}", "text"


def _has_words(text: str) -> bool:
    """Whether a template has a word that is no name of a field, no unit and no example."""
    bare = re.sub(r"\{[^}]*\}|`[^`]*`|'[^']*'|\"[^\"]*\"|\w*_\w*|\w+[.\[]\w[\w.\]]*|--\w+", " ", text)
    return bool(set(re.findall(r"(?<!\w)(?:[a-z]{2,}|CHECK)(?!\w)", bare)) - UNITS)


@cache
def messages(role: str = "text") -> Mapping[str, str]:
    """Templates with words, each with a place where it is made; for the role `where` those of places in an input."""
    place_of: dict[str, str] = (
        {and_more("xy", HOLE).replace("1", HOLE): "errors.py"} if role == "text" else {}
    )
    for text, place, kind in (*_of_sources(), *_of_documents(), *_of_problems(), *_of_flags()):
        if kind == role and _has_words(text):
            place_of.setdefault(re.sub(r"\{:[^}]*\}", HOLE, text.strip(" ")), place)
    return dict(sorted(place_of.items()))


if __name__ == "__main__":
    for text, place in {**messages(), **messages("where")}.items():
        print(f"{text}\t{place}")
