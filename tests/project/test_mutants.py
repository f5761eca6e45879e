"""The tool that plants mutants: what it changes, and that its named places still exist."""

from pathlib import Path

from tools import ROOT
from tools.quality.mutants import ROOMS, named_mutants, order_tests, read_map
from tools.quality.mutating import mutants_of

SOURCE = '''"""Text of 3 words."""
LIMIT: Final = 0.5

def f(x: int | None = None, *, n: int = 2) -> float | None:
    """Doc."""
    if x is None or n <= 1:
        raise ValueError(f"{n + 1}")
    return max(x, 0) * LIMIT - 1.0
'''


def test_operators_constants_comparisons_and_boundaries_are_changed(tmp_path: Path) -> None:
    path = tmp_path / "module.py"
    path.write_text(SOURCE)
    changes = {(m.kind, m.change) for m in mutants_of(path)}
    assert ("constant", "0.5  ->  1.0") in changes
    assert ("operator", "max(x, 0) * LIMIT - 1.0  ->  max(x, 0) * LIMIT + 1.0") in changes
    assert ("operator", "max(x, 0) * LIMIT  ->  max(x, 0) / LIMIT") in changes
    assert ("boundary", "max(x, 0)  ->  min(x, 0)") in changes
    assert ("boundary", "n <= 1  ->  n < 1") in changes
    assert ("comparison", "n <= 1  ->  n > 1") in changes
    assert ("comparison", "x is None or n <= 1  ->  x is None and n <= 1") in changes
    assert ("statement", 'raise ValueError(f"{n + 1}")  ->  pass') in changes
    # neither annotations nor what an error says
    assert not [c for kind, c in changes if "int" in c or ("n + 1" in c and kind != "statement")]


def test_slices_are_one_off_and_branches_swapped(tmp_path: Path) -> None:
    path = tmp_path / "module.py"
    path.write_text("def f(x, k):\n    return x[:k] if k > 1 else x[1:]\n")
    changes = {m.change for m in mutants_of(path) if m.kind in ("slice", "branch")}
    assert changes == {":k  ->  1:k", ":k  ->  :k - 1", "1:  ->  1 + 1:", "k > 1  ->  not k > 1"}


def test_every_mutant_is_a_program_and_one_change(tmp_path: Path) -> None:
    path = tmp_path / "module.py"
    path.write_text(SOURCE)
    for mutant in mutants_of(path):
        text = mutant.applied(path.read_bytes())
        compile(text, "module.py", "exec")
        assert text != SOURCE.encode()


def test_rooms_of_mutants_exist() -> None:
    assert [room for room in ROOMS if not (ROOT / "src" / "tripwatt" / room).is_dir()] == []


def test_named_places_exist_and_change() -> None:
    found = named_mutants()
    assert len(found) == 12
    for mutant in found:
        compile(mutant.applied(mutant.path.read_bytes()), str(mutant.path), "exec")


def test_tests_are_chosen_by_line_and_quick_files_come_first(tmp_path: Path) -> None:
    kept = tmp_path / "map.json"
    kept.write_text(
        '{"lines": {"src/a.py": {"1": ["t/x.py::slow|run"], "2": ["t/y.py::one|setup"]}},'
        ' "seconds": {"t/x.py::slow": [0, 9.0], "t/y.py::one": [1.0, 0.5], "t/y.py::two": [0, 0.1]}}'
    )
    known = read_map(kept)
    assert known.of_lines("src/a.py", [1]) == {"t/x.py::slow"}
    assert known.of_lines("src/a.py", [2]) == {"t/y.py::one", "t/y.py::two"}  # a fixture of the module
    chosen, seconds = order_tests(known.of_lines("src/a.py", [1, 2]), known, 60.0)
    assert chosen == ["t/y.py::two", "t/y.py::one", "t/x.py::slow"]
    assert seconds == 10.6
    assert order_tests(known.of_lines("src/a.py", [1, 2]), known, 5.0)[0] == ["t/y.py::two", "t/y.py::one"]
