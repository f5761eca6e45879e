"""The habits that a script can check: sizes of functions, classes and argument lists; no choice by a name."""

import ast
import subprocess
import sys

import pytest
from tests.support import ROOT
from tools.quality.code_size import (
    BUDGETS,
    MAX_CLASS,
    MAX_FUNCTION,
    P90_FUNCTION,
    Sizes,
    code_rows,
    measure,
)

from tripwatt.study.evaluation import PROTOCOLS

NAMES = {*PROTOCOLS} | {spec.name for protocol in PROTOCOLS.values() for spec in protocol.models}
OWN_ROOMS = ("study",)


@pytest.fixture(scope="module")
def sizes() -> Sizes:
    return measure(ROOT)


def test_code_is_counted_without_blanks_comments_and_docstrings() -> None:
    source = (
        '"""Doc.\n\nMore."""\n\n# comment\nx = [\n    1,\n]\n\n\ndef f():\n    """Doc."""\n    return x\n'
    )
    assert code_rows(source) == {6, 7, 8, 11, 13}


@pytest.mark.parametrize("part", BUDGETS)
def test_a_part_keeps_its_budget(sizes: Sizes, part: str) -> None:
    assert sizes.by_part[part] <= BUDGETS[part]


def test_functions_are_short(sizes: Sizes) -> None:
    assert sizes.p90 <= P90_FUNCTION
    assert [piece.where for piece in sizes.functions if piece.lines > MAX_FUNCTION] == []


def test_classes_are_small(sizes: Sizes) -> None:
    assert [piece.where for piece in sizes.classes if piece.lines > MAX_CLASS] == []


def test_public_functions_have_few_arguments(sizes: Sizes) -> None:
    assert [piece.where for piece in sizes.wide] == []


def compared_names(tree: ast.AST) -> list[tuple[int, str]]:
    """Comparisons and prefix tests with the name of a model or protocol: (line, name)."""
    found = []
    for node in ast.walk(tree):
        texts: list[ast.expr] = []
        if isinstance(node, ast.Compare) and all(isinstance(op, ast.Eq | ast.NotEq) for op in node.ops):
            if isinstance(node.left, ast.Attribute) and node.left.attr == "kind":
                continue  # a kind of model is no name
            texts = [node.left, *node.comparators]
        elif isinstance(node, ast.MatchValue):
            texts = [node.value]
        elif (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Attribute)
            and node.func.attr == "startswith"
        ):
            texts = [
                a for a in node.args if isinstance(a, ast.Constant) and str(a.value) in ("power-", "adapted-")
            ]
            found += [(node.lineno, str(a.value)) for a in texts if isinstance(a, ast.Constant)]
            continue
        found += [(node.lineno, t.value) for t in texts if isinstance(t, ast.Constant) and t.value in NAMES]
    return found


@pytest.mark.parametrize("code", ["x == 'hybrid'", "'paper' != x", "x.startswith('power-')"])
def test_a_comparison_with_a_name_is_found(code: str) -> None:
    assert compared_names(ast.parse(code))


def test_nothing_is_chosen_by_the_name_of_a_model_or_protocol() -> None:
    source = ROOT / "src" / "tripwatt"
    found = [
        f"{path.relative_to(source)}:{line} {name}"
        for path in source.rglob("*.py")
        if path.relative_to(source).parts[0] not in OWN_ROOMS
        for line, name in compared_names(ast.parse(path.read_text("utf-8")))
    ]
    assert found == []


@pytest.mark.parametrize(
    "code", ["import pandas as pd\n\npd.read_csv('a')\n", "from pandas import read_excel\n"]
)
def test_no_parser_of_pandas_reads_files_from_outside(code: str) -> None:
    """Pipes and devices never end for them, and some values end the interpreter; the rule is one of ruff's."""
    command = [sys.executable, "-m", "ruff", "check", "--select", "TID251", "--stdin-filename"]
    for place, expected in (("src/tripwatt/sources/a.py", 1), ("tests/a.py", 0)):
        done = subprocess.run([*command, place, "-"], input=code, text=True, capture_output=True, cwd=ROOT)
        assert done.returncode == expected, done.stdout
        assert ("TID251" in done.stdout) == bool(expected)
