"""Every line that installs the package follows one switch: from a clone, or from an index once the package is on one."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from tools.docs.install_lines import PAGES, SENTENCES, in_form

from tripwatt.errors import EXTRAS, ON_AN_INDEX, InvalidInput, extras_faults, install

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
DECLARED = PROJECT["optional-dependencies"]
GAMM = tomllib.loads((ROOT / "gamm" / "pyproject.toml").read_text())["project"]["optional-dependencies"]
ON_INDEX = re.compile(r"pip install '?tripwatt(?P<gamm>-gamm)?(?:\[(?P<extras>[a-z]+(?:,[a-z]+)*)\]')?")
IN_CLONE = re.compile(
    r"pip install(?: -e gamm)?(?: -e)? (?:\.(?=[`)\s]|$)|'(?:\.|(?P<gamm>gamm))\[(?P<extras>[a-z]+(?:,[a-z]+)*)\]')"
)
SHAPE = ON_INDEX if ON_AN_INDEX else IN_CLONE


def install_lines() -> list[tuple[str, str]]:
    files = [*PAGES, ROOT / "CONTRIBUTING.md"]
    for folder, kinds in (
        ("src/tripwatt", ("py",)),
        ("gamm/src", ("py",)),
        ("web/src", ("ts", "tsx")),
        ("tools", ("py",)),
        ("benchmarks", ("py",)),
    ):
        for kind in kinds:
            files += sorted((ROOT / folder).rglob(f"*.{kind}"))
    texts = ((file.relative_to(ROOT), file.read_text()) for file in files)
    return [
        (f"{name}:{k}", line)
        for name, text in texts
        if "pip install" in text
        for k, line in enumerate(text.splitlines(), 1)
        if re.search(r"pip install\s+(-e\s+)?['\".]|pip install.*tripwatt", line)
    ]


LINES = install_lines()


def test_lines_that_install_are_found() -> None:
    assert len(LINES) > 5


@pytest.mark.parametrize(("where", "line"), LINES, ids=[where for where, _ in LINES])
def test_an_install_line_follows_the_switch_and_names_known_extras(where: str, line: str) -> None:
    if "{" in line or "tools/docs/install_lines" in where:  # made by `install`; both forms
        return
    assert ON_AN_INDEX or not re.search(r"pip install[^`]*tripwatt(-gamm)?\[", line), where
    if "(cd client" in line:  # a client that was generated
        return
    found = SHAPE.search(line)
    assert found, f"{where}: {line}"
    for extra in (found["extras"] or "").split(","):
        assert not extra or extra in (GAMM if found["gamm"] else DECLARED), f"{where}: {extra}"
        editable = ON_AN_INDEX or not extra or "pip install -e" in line
        assert editable, f"{where}: the install of `make run` stays editable"


def test_pages_follow_the_switch_and_it_goes_both_ways() -> None:
    texts = [page.read_text("utf-8") for page in PAGES]
    assert [in_form(text, on_index=ON_AN_INDEX) for text in texts] == texts
    on_index = [in_form(text, on_index=True) for text in texts]
    assert sum(len(re.findall("pip install '?tripwatt", text)) for text in on_index) > 10
    left = "\n".join(on_index).replace("(cd client && pip install .)", "")
    assert not re.search(r"pip install (-e )?'?(\.|gamm)", left)
    assert [in_form(text, on_index=False) for text in on_index] == [
        in_form(text, on_index=False) for text in texts
    ]
    for sentence in SENTENCES:
        assert any(sentence[ON_AN_INDEX] in text for text in texts)


def test_messages_follow_the_switch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tripwatt.errors.ON_AN_INDEX", True)
    assert install("service", "fleet") == "run pip install 'tripwatt[service,fleet]'"
    monkeypatch.setattr("tripwatt.errors.ON_AN_INDEX", False)
    assert install("mcp") == "run pip install -e '.[mcp]' in the clone of tripwatt"
    monkeypatch.setattr("tripwatt.errors.__file__", "/venv/lib/python3.12/site-packages/tripwatt/errors.py")
    assert install("mcp") == "run pip install 'tripwatt[mcp]'"  # of the installed wheel


def test_messages_and_make_run_name_extras_that_exist() -> None:
    makefile = (ROOT / "Makefile").read_text()
    extras = re.search(r"^EXTRAS \?= (.*)$", makefile, re.MULTILINE)
    assert extras
    assert {*extras[1].split(","), *EXTRAS} <= set(DECLARED)
    assert {"service", "fleet", "routing"} <= set(extras[1].split(","))  # the page, --cars, plan
    assert SHAPE.search(install("service", "fleet"))


def brought(extra: str) -> set[str]:
    """Names of the packages that an extra brings, those of other extras of tripwatt among them."""
    needed = [Requirement(text) for text in DECLARED[extra]]
    own = {r.name for r in needed} - {"tripwatt"}
    return own.union(*(brought(other) for r in needed if r.name == "tripwatt" for other in r.extras))


def test_an_extra_resolves_to_what_its_commands_need() -> None:
    names = {
        "prometheus_client": "prometheus-client",
        "tripwatt_gamm": "tripwatt-gamm",
        "sklearn": "scikit-learn",
    }
    for extra, modules in EXTRAS.items():
        assert {names.get(module, module) for module in modules} <= brought(extra), extra


def test_all_missing_extras_come_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tripwatt.errors.find_spec", lambda name: None)
    faults = extras_faults({"service": "tripwatt serve", "fleet": "--cars"})
    assert [fault.where for fault in faults] == ["tripwatt serve", "--cars"]
    assert all("pip install -e '.[service,fleet]'" in fault.fix for fault in faults)


def test_serve_checks_what_its_options_need_before_it_starts(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from tripwatt.command.serve import serve

    monkeypatch.setattr("tripwatt.errors.find_spec", lambda name: None if name == "aiomqtt" else object())
    with pytest.raises(InvalidInput, match=r"missing package: --mqtt: got no aiomqtt.*\.\[live\]"):
        serve(cars=tmp_path / "cars", mqtt="mqtt://192.0.2.7")
    assert not (tmp_path / "cars").exists()
