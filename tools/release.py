"""A release that anybody can repeat, into `dist`: ``make release``.

It builds sdist and wheel twice, from two copies of the commit at places of their own, and each wheel from its sdist, and refuses where a byte
differs. Beside them it writes the bill of materials, the provenance, the release notes and the sums of all, none of which has a time or a name
of the machine. For each Python that is at hand it collects both wheels and what they need in a folder, installs them from that folder alone
into an empty environment, and runs the commands of the README there. Nothing is uploaded.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from typing import Annotated, Any, Final

from packaging.version import Version
from typer import Option

from tools import ROOT
from tools.command import run
from tools.quality.contract import BREAKS, released

TOOLS: Final = ROOT / ".venv-tools" / "bin"
DIST: Final = ROOT / "dist"
DISTRIBUTIONS: Final = (".", "gamm")
"""Folders of what is released: tripwatt, and the GAMM engine."""
NAMES: Final = ("tripwatt[learners]", "tripwatt-gamm")
"""What is tried: the README fits a model, whose corrector has trees."""
PAGE: Final = "src/tripwatt/server/http/page/manifest.json"
PICTURES: Final = "docs/images/page.json"
"""The digest of the page's sources that each picture shows."""
MAX_WHEEL_BYTES: Final = 3_000_000
MAX_IMPORT_S: Final = 0.15
BUILDERS: Final = ("hatchling", "packaging", "pathspec", "pluggy", "trove-classifiers")
"""Packages that sdist and wheel depend on; `constraints/check.txt` has their hashes."""

TIMED: Final = """
import subprocess, sys
code = "import time; start = time.perf_counter(); import tripwatt; print(time.perf_counter() - start)"
print(min(float(subprocess.check_output([sys.executable, "-c", code])) for _ in range(5)))
"""


def project(root: Path = ROOT) -> dict[str, Any]:
    """The project's table of `pyproject.toml`."""
    table: dict[str, Any] = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["project"]
    return table


def not_ready(root: Path = ROOT) -> Iterator[str]:
    """What is to be done before the release, each as a sentence."""
    number, last = Version(project(root)["version"]), Version(released().stem)
    if number.is_prerelease:
        yield f"{number} is a version between releases: set that of the release in pyproject.toml, CITATION.cff and integrations/home_assistant."
    if project(root / "gamm")["version"] != project(root)["version"]:
        yield "gamm/pyproject.toml has another version than pyproject.toml."
    if _git(root, "status", "--porcelain"):
        yield "There are changes that are not committed."
    if not section(root, f"{number}"):
        yield f"CHANGELOG.md has no section [{number}]: give the unreleased changes this title."
    if f"\nversion: {number}\n" not in (root / "CITATION.cff").read_text("utf-8"):
        yield f"CITATION.cff has another version than {number}."
    if old := older_pictures(root):
        yield f"Pictures of an older page: run tools/docs/write_page_images.py for {', '.join(old)}."
    if number <= last:
        yield f"{last} is released: set a later version in pyproject.toml and CITATION.cff."
    if BREAKS.read_text("utf-8") and number.release[:2] <= last.release[:2]:
        yield f"Clients of {last} break (docs/reference/openapi/breaks.txt): the release needs a new minor version."


def older_pictures(root: Path = ROOT) -> list[str]:
    """Pictures of the docs that show the page as older sources made it."""
    now = json.loads((root / PAGE).read_text("utf-8"))["sources_sha256"]
    shown = json.loads((root / PICTURES).read_text("utf-8"))
    return sorted(name for name, digest in shown.items() if digest != now)


def build(root: Path, folder: Path) -> dict[str, bytes]:
    """Build sdist and wheel of each distribution from the files of the commit, in a new folder.

    Parameters
    ----------
    root : Path
        A clone; only what is committed counts.
    folder : Path
        Where to build; its name has no effect.

    Returns
    -------
    dict of str to bytes
        Content by name of the file.
    """
    archive = subprocess.run(["git", "archive", "HEAD"], cwd=root, check=True, capture_output=True).stdout
    with tarfile.open(fileobj=BytesIO(archive)) as tree:
        tree.extractall(folder / "source", filter="data")
    out = folder / "out"
    for place in DISTRIBUTIONS:
        _hatch(root, folder / "source" / place, out, "sdist", "wheel")
    return {file.name: file.read_bytes() for file in sorted(out.iterdir())}


def build_twice(root: Path = ROOT) -> dict[str, bytes]:
    """Build twice, and return what both have; exits where they differ."""
    with (
        tempfile.TemporaryDirectory() as folder,
        tempfile.TemporaryDirectory(suffix="-another") as another_folder,
    ):
        first, second = build(root, Path(folder)), build(root, Path(another_folder))
    if first != second:
        sys.exit(f"two builds differ: {', '.join(name for name in first if first[name] != second.get(name))}")
    with tempfile.TemporaryDirectory() as folder:
        again = from_sdists(root, first, Path(folder))
    if differing := [name for name, data in again.items() if first[name] != data]:
        sys.exit(f"the wheel of an sdist differs: {', '.join(differing)}")
    return first


def from_sdists(root: Path, built: Mapping[str, bytes], folder: Path) -> dict[str, bytes]:
    """Build the wheel of each sdist, as who packages it elsewhere does; gives content by name of the file."""
    for name, data in built.items():
        if name.endswith(".tar.gz"):
            with tarfile.open(fileobj=BytesIO(data)) as tree:
                tree.extractall(folder, filter="data")
            _hatch(root, folder / name.removesuffix(".tar.gz"), folder / "out", "wheel")
    return {file.name: file.read_bytes() for file in sorted((folder / "out").iterdir())}


def _hatch(root: Path, source: Path, out: Path, *targets: str) -> None:
    """Build in a folder of sources, with the time of the commit."""
    command = [sys.executable, "-m", "hatchling", "build", "-d", f"{out}"]
    command += [word for target in targets for word in ("-t", target)]
    environment = {**os.environ, "SOURCE_DATE_EPOCH": _git(root, "log", "-1", "--format=%ct")}
    subprocess.run(command, cwd=source, check=True, capture_output=True, env=environment)


def provenance(root: Path, built: Mapping[str, bytes]) -> dict[str, Any]:
    """Statement of in-toto on the sources and the build of the files, with the predicate of SLSA 1.0, which nobody signed."""
    commit, number = _git(root, "rev-parse", "HEAD"), project(root)["version"]
    inputs = [f"constraints/{name}" for name in ("check.txt", "service.txt", "map.txt")]
    definition = {
        "buildType": "make release",
        "externalParameters": {"command": "make release", "version": number},
        "internalParameters": {
            "SOURCE_DATE_EPOCH": _git(root, "log", "-1", "--format=%ct"),
            "python": sys.version.split()[0],
            "packages": {name: version(name) for name in BUILDERS},
        },
        "resolvedDependencies": [
            {"uri": "git+commit", "digest": {"gitCommit": commit}},
            *({"uri": name, "digest": {"sha256": _sum((root / name).read_bytes())}} for name in inputs),
        ],
    }
    return {
        "_type": "https://in-toto.io/Statement/v1",
        "subject": [{"name": name, "digest": {"sha256": _sum(data)}} for name, data in built.items()],
        "predicateType": "https://slsa.dev/provenance/v1",
        "predicate": {"buildDefinition": definition, "runDetails": {"builder": {"id": "make release"}}},
    }


def section(root: Path, name: str) -> str:
    """A section of the change log; empty where it has none of the name."""
    text = (root / "CHANGELOG.md").read_text("utf-8")
    return text.partition(f"\n## [{name}]")[2].partition("\n")[2].partition("\n## ")[0].strip()


def notes(root: Path = ROOT) -> str:
    """The release notes: the section of the version, or the unreleased changes where there is none."""
    return (section(root, project(root)["version"]) or section(root, "Unreleased")) + "\n"


def readme_commands(text: str) -> tuple[list[str], str]:
    """The commands of the README's forecast, and its lines of Python."""
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)
    commands = next(block for kind, block in blocks if not kind and block.startswith("tripwatt "))
    return commands.splitlines(), next(block for kind, block in blocks if kind == "python")


def tried(wheels: Iterable[Path], python: str, folder: Path) -> str:
    """Install the wheels from a folder without an index into an empty environment, run the README there, and say how it went.

    Parameters
    ----------
    wheels : iterable of Path
    python : str
        Version, such as 3.12.
    folder : Path
        A new folder.
    """
    uv, here = f"{TOOLS / 'uv'}", folder / "bin"
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment = {**kept, "UV_PYTHON_DOWNLOADS": "never", "PATH": f"{here}{os.pathsep}{os.environ['PATH']}"}

    def call(*command: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            command, cwd=folder.parent, env=environment, capture_output=True, text=True, check=False
        )

    of_pyenv = sorted((Path.home() / ".pyenv" / "versions").glob(f"{python}.*/bin/python"))
    found = f"{of_pyenv[-1]}" if of_pyenv else python
    if call(uv, "venv", "--quiet", "--python", found, f"{folder}").returncode:
        return "not at hand"
    commands, code = readme_commands((ROOT / "README.md").read_text("utf-8"))
    index, python_here = f"{folder.parent / 'index'}", f"{here / 'python'}"
    wanted = [f"{wheel}[learners]" if wheel.name.startswith("tripwatt-") else f"{wheel}" for wheel in wheels]
    download = [
        "-m",
        "pip",
        "download",
        "--quiet",
        "--only-binary",
        ":all:",
        "--python-version",
        python,
        "--dest",
    ]
    install = ["pip", "install", "--quiet", "--no-cache", "--offline", "--no-index", "--find-links"]
    steps = [
        [f"{TOOLS / 'python'}", *download, index, *wanted],
        [uv, *install, index, "--python", python_here, *NAMES],
    ]
    steps += [[f"{here / 'tripwatt'}", *line.split()[1:]] for line in commands]
    steps += [[python_here, "-c", code], [python_here, "-c", TIMED]]
    for step in steps:
        done = call(*step)
        if done.returncode:
            sys.exit(f"Python {python}: {' '.join(step)[:200]}:\n{done.stdout}{done.stderr}")
    seconds = float(done.stdout)
    if seconds > MAX_IMPORT_S:
        sys.exit(f"Python {python}: `import tripwatt` takes {seconds:.3f} s; allowed: {MAX_IMPORT_S} s")
    return f"README runs, import in {seconds:.3f} s"


def pythons() -> list[str]:
    """Versions of Python that the project names."""
    return re.findall(r"Python :: (3\.\d+)", "\n".join(project()["classifiers"]))


def main(
    rehearsal: Annotated[bool, Option(help="Build what is not ready for a release.")] = False,
) -> int:
    """Build, check and try a release, into `dist`."""
    faults = list(not_ready())
    print("\n".join(faults))
    if faults and not rehearsal:
        return 2
    built = build_twice()
    DIST.mkdir(exist_ok=True)
    for old in DIST.iterdir():
        old.unlink()
    for name, data in built.items():
        (DIST / name).write_bytes(data)
    wheels = sorted(DIST.glob("*.whl"))
    size = sum(wheel.stat().st_size for wheel in wheels)
    if size > MAX_WHEEL_BYTES:
        sys.exit(f"the wheels have {size} bytes; allowed: {MAX_WHEEL_BYTES}")
    subprocess.run([f"{TOOLS / 'twine'}", "check", "--strict", *map(str, DIST.iterdir())], check=True)
    for kind in ("service", "map"):
        sbom = ("--output-reproducible", "--of", "JSON", "-o", f"{DIST / f'sbom-{kind}.json'}")
        command = [f"{TOOLS / 'cyclonedx-py'}", "requirements", f"constraints/{kind}.txt", *sbom]
        subprocess.run(command, cwd=ROOT, check=True)
    (DIST / "provenance.json").write_text(json.dumps(provenance(ROOT, built), indent=1) + "\n", "utf-8")
    (DIST / "release-notes.md").write_text(notes(), "utf-8")
    sums = {file.name: _sum(file.read_bytes()) for file in sorted(DIST.iterdir())}
    (DIST / "SHA256SUMS").write_text("".join(f"{value}  {name}\n" for name, value in sums.items()), "utf-8")
    for python in pythons():
        with tempfile.TemporaryDirectory() as folder:
            print(f"Python {python}: {tried(wheels, python, Path(folder) / 'environment')}", flush=True)
    print((DIST / "SHA256SUMS").read_text("utf-8"), end="")
    return 0


def _git(root: Path, *arguments: str) -> str:
    return subprocess.run(
        ["git", *arguments], cwd=root, check=True, capture_output=True, text=True
    ).stdout.strip()


def _sum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


if __name__ == "__main__":
    run(main)
