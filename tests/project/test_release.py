"""`make release`: what it refuses, that its files are the same wherever they are built, and what it says of them."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import pytest
from packaging.version import Version
from tests.support import ROOT
from tools import release
from tools.quality.contract import released

pytest.importorskip("hatchling", reason="no hatchling: `make check` installs it to build the wheel")
NEXT = f"{released().stem.split('.')[0]}.{int(released().stem.split('.')[1]) + 1}.0"
OURS = ("pyproject.toml", "README.md", "LICENSE", "NOTICE")
GAMM = (*(f"gamm/{name}" for name in OURS), "gamm/src/tripwatt_gamm/__init__.py")
FILES = (*OURS, *GAMM, "CITATION.cff", ".gitignore", release.PAGE)
CHANGES = (
    f"# Changes\n\n## [Unreleased]\n\n- Next.\n\n## [{NEXT}] - 2027-01-01\n\n- New.\n\n## [0.1.0]\n\n- Old.\n"
)


def git(folder: Path, *words: str) -> None:
    who = ("-c", "user.name=t", "-c", "user.email=t@example.org")
    subprocess.run(["git", *who, *words], cwd=folder, check=True, capture_output=True)


def cited() -> str:
    (number,) = re.findall(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text("utf-8"), re.MULTILINE)
    return str(number)


def test_between_releases_the_version_is_that_of_the_next_one_and_the_citation_that_of_the_last() -> None:
    number = Version(release.project(ROOT)["version"])
    if number.is_prerelease:
        assert (cited(), number.is_devrelease) == (released().stem, True)
        assert number.release > Version(cited()).release
        assert any("between releases" in fault for fault in release.not_ready())
    else:
        assert cited() == f"{number}"


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small repository that is ready for its next version."""
    folder = tmp_path_factory.mktemp("clone")
    for name in (*FILES, "src/tripwatt/__init__.py", "src/tripwatt/py.typed"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes((ROOT / name).read_bytes())
    for name in ("check", "service", "map"):
        (folder / "constraints").mkdir(exist_ok=True)
        (folder / "constraints" / f"{name}.txt").write_text(name)
    number = release.project(ROOT)["version"]
    for name, old in (("pyproject.toml", number), ("gamm/pyproject.toml", number), ("CITATION.cff", cited())):
        text = (folder / name).read_text("utf-8")
        (folder / name).write_text(re.sub(rf'\b{re.escape(old)}(?="|\n)', NEXT, text))
    (folder / "CHANGELOG.md").write_text(CHANGES)
    now = json.loads((folder / release.PAGE).read_text("utf-8"))["sources_sha256"]
    (folder / release.PICTURES).parent.mkdir(parents=True)
    (folder / release.PICTURES).write_text(json.dumps({"page-plan": now}), "utf-8")
    git(folder, "init", "--quiet")
    git(folder, "add", "--all")
    git(folder, "commit", "--quiet", "-m", "all")
    return folder


def test_a_clone_with_a_version_and_its_changes_is_ready(clone: Path) -> None:
    assert list(release.not_ready(clone)) == []


def rewrite(name: str, old: str, new: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        text = (folder / name).read_text("utf-8")
        assert old in text
        (folder / name).write_text(text.replace(old, new), "utf-8")

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda folder: (folder / "new.txt").write_text("new"), "not committed"),
        (rewrite("CHANGELOG.md", f"## [{NEXT}]", "## [9.9.9]"), f"no section [{NEXT}]"),
        (rewrite("CITATION.cff", f"version: {NEXT}", "version: 9.9.9"), "CITATION.cff has another version"),
        (rewrite(release.PICTURES, "{", '{"page-old": "0", '), "for page-old."),
        (rewrite("gamm/pyproject.toml", f'"{NEXT}"', '"9.9.9"'), "gamm/pyproject.toml has another version"),
        (rewrite("pyproject.toml", f'"{NEXT}"', f'"{released().stem}"'), f"{released().stem} is released"),
        (
            rewrite("pyproject.toml", f'"{NEXT}"', f'"{NEXT}.dev0"'),
            f"{NEXT}.dev0 is a version between releases",
        ),
    ],
)
def test_what_is_not_ready_is_said(
    clone: Path, tmp_path: Path, change: Callable[[Path], None], words: str
) -> None:
    copy = tmp_path / "copy"
    subprocess.run(["git", "clone", "--quiet", f"{clone}", f"{copy}"], check=True)
    change(copy)
    assert any(words in fault for fault in release.not_ready(copy))


def test_breaks_need_a_new_minor_version(
    clone: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy, patch = tmp_path / "copy", f"{released().stem.rpartition('.')[0]}.99"
    subprocess.run(["git", "clone", "--quiet", f"{clone}", f"{copy}"], check=True)
    rewrite("pyproject.toml", f'"{NEXT}"', f'"{patch}"')(copy)
    breaks = tmp_path / "breaks.txt"
    monkeypatch.setattr(release, "BREAKS", breaks)
    breaks.write_text("")
    assert not any("minor version" in fault for fault in release.not_ready(copy))
    breaks.write_text("GET /v1/need: operation is removed\n")
    assert any("minor version" in fault for fault in release.not_ready(copy))


def test_two_builds_are_the_same_and_provenance_has_their_hashes(clone: Path, tmp_path: Path) -> None:
    other = tmp_path / "elsewhere"
    subprocess.run(["git", "clone", "--quiet", f"{clone}", f"{other}"], check=True)
    (other / "stray.txt").write_text("not committed")
    built = release.build_twice(clone)
    assert release.build(other, tmp_path / "once") == built
    assert sorted(name.rpartition(".")[2] for name in built) == ["gz", "gz", "whl", "whl"]
    wheels = [data for name, data in built.items() if name.endswith(".whl")]
    stamps = {part.date_time[0] for data in wheels for part in zipfile.ZipFile(BytesIO(data)).infolist()}
    assert min(stamps) >= 2024  # that of the commit
    statement = release.provenance(clone, built)
    assert {s["name"]: s["digest"]["sha256"] for s in statement["subject"]} == {
        name: hashlib.sha256(data).hexdigest() for name, data in built.items()
    }
    assert statement == release.provenance(other, built)
    text = str(statement)
    assert str(clone) not in text
    assert sys.prefix not in text


def test_the_wheel_of_an_sdist_is_that_of_the_commit(clone: Path, tmp_path: Path) -> None:
    built = release.build(clone, tmp_path / "once")
    wheels = {name: data for name, data in built.items() if name.endswith(".whl")}
    assert release.from_sdists(clone, built, tmp_path) == wheels


def test_builds_that_differ_are_refused(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    several = iter([{"a.whl": b"1", "b": b""}, {"a.whl": b"2", "b": b""}])
    monkeypatch.setattr(release, "build", lambda root, folder: next(several))
    with pytest.raises(SystemExit, match=r"two builds differ: a\.whl$"):
        release.build_twice(clone)


def test_notes_are_the_section_of_the_version_or_what_is_unreleased(clone: Path, tmp_path: Path) -> None:
    assert release.notes(clone) == "- New.\n"
    copy = tmp_path / "copy"
    subprocess.run(["git", "clone", "--quiet", f"{clone}", f"{copy}"], check=True)
    rewrite("CHANGELOG.md", f"## [{NEXT}]", "## [9.9.9]")(copy)
    assert release.notes(copy) == "- Next.\n"


def test_the_commands_of_the_readme_are_those_that_are_tried() -> None:
    commands, code = release.readme_commands((ROOT / "README.md").read_text("utf-8"))
    assert [line.split()[:2] for line in commands] == [["tripwatt", "example-trip"], ["tripwatt", "forecast"]]
    assert code.startswith("import tripwatt as tw\n")
    assert release.pythons() == ["3.11", "3.12", "3.13"]


def test_every_picture_of_the_page_has_the_digest_of_what_it_shows() -> None:
    """A release names those of an older page; every other picture has a stamp or is made with its page."""
    shown = json.loads((ROOT / release.PICTURES).read_text("utf-8"))
    assert set(shown) == {file.stem for file in (ROOT / release.PICTURES).parent.glob("page-*.png")}
    assert set(release.older_pictures(ROOT)) <= set(shown)
