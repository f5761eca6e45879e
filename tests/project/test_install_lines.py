"""Every line that installs the package works in a clone: the package is on no index."""

from __future__ import annotations

import re
import tomllib
from importlib.metadata import requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tripwatt.errors import EXTRAS, InvalidInput, extras_faults, install

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
DECLARED = PROJECT["optional-dependencies"]
SHAPE = re.compile(r"pip install(?: -e)? (?:\.(?=[`)\s]|$)|'\.\[(?P<extras>[a-z]+(?:,[a-z]+)*)\]')")


def read_texts() -> list[tuple[str, str]]:
    files = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
    for folder, kinds in (
        ("src/tripwatt", ("py",)),
        ("web/src", ("ts", "tsx")),
        ("tools", ("py",)),
        ("benchmarks", ("py",)),
    ):
        for kind in kinds:
            files += sorted((ROOT / folder).rglob(f"*.{kind}"))
    return [
        (f"{file.relative_to(ROOT)}:{k}", line)
        for file in files
        for k, line in enumerate(file.read_text().splitlines(), 1)
    ]


LINES = [
    (where, line)
    for where, line in read_texts()
    if re.search(r"pip install\s+(-e\s+)?['\".]|pip install.*tripwatt", line)
]


def test_lines_that_install_are_found() -> None:
    assert len(LINES) > 5


@pytest.mark.parametrize(("where", "line"), LINES, ids=[where for where, _ in LINES])
def test_an_install_line_is_that_of_a_clone_and_names_known_extras(where: str, line: str) -> None:
    assert not re.search(r"pip install[^`]*tripwatt\[", line), where
    if "{" in line:  # made by `install`
        return
    found = SHAPE.search(line)
    assert found, f"{where}: {line}"
    for extra in (found["extras"] or "").split(","):
        assert not extra or extra in DECLARED, f"{where}: {extra}"
        assert not extra or "pip install -e" in line, f"{where}: the install of `make run` stays editable"


def test_messages_and_make_run_name_extras_that_exist() -> None:
    makefile = (ROOT / "Makefile").read_text()
    brought = re.search(r"^EXTRAS \?= (.*)$", makefile, re.MULTILINE)
    assert brought
    assert {*brought[1].split(","), *EXTRAS} <= set(DECLARED)
    assert {"service", "fleet", "routing"} <= set(brought[1].split(","))  # the page, --cars, plan
    assert SHAPE.search(install("service", "fleet"))


def test_the_front_page_has_an_install_line_for_each_goal() -> None:
    index = (ROOT / "docs" / "index.md").read_text()
    found = [match for match in map(SHAPE.search, index.splitlines()) if match]
    named = {extra for match in found for extra in (match["extras"] or "").split(",") if extra}
    assert len(found) >= 6
    assert named == set(EXTRAS) | {"elevation"}


def test_an_extra_resolves_to_what_its_commands_need() -> None:
    """As the installed package declares it, so that pip would bring every module that a command asks for."""
    names = {"prometheus_client": "prometheus-client"}
    declared = [Requirement(text) for text in requires("tripwatt") or []]
    for extra, modules in EXTRAS.items():
        brought = {r.name for r in declared if r.marker is None or r.marker.evaluate({"extra": extra})}
        assert {names.get(module, module) for module in modules} <= brought, extra


def test_all_missing_extras_come_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tripwatt.errors.find_spec", lambda name: None)
    faults = extras_faults({"service": "tripwatt serve", "fleet": "--cars"})
    assert [fault.where for fault in faults] == ["tripwatt serve", "--cars"]
    assert all("pip install -e '.[service,fleet]'" in fault.fix for fault in faults)


def test_serve_checks_what_its_options_need_before_it_starts(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from tripwatt.cli.serve import serve

    monkeypatch.setattr("tripwatt.errors.find_spec", lambda name: None if name == "deltalake" else object())
    with pytest.raises(InvalidInput, match=r"missing package: --cars: got no deltalake.*\.\[fleet\]"):
        serve(cars=tmp_path / "cars", map_="", places="", weather="", stations=None)
    assert not (tmp_path / "cars").exists()
