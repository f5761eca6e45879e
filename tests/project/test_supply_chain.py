"""What is installed is named with its hash; the container is built and run where a daemon is."""

import os
import re
import shutil
import subprocess
import sys
import time
import tomllib
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer.main
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from tests.support import ROOT
from tools import release
from tools.quality import gate

from tripwatt.command import app

FILES = ("check.txt", "core.txt", "service.txt", "map.txt", "tools.txt")
WORKFLOWS = sorted((ROOT / ".github" / "workflows").iterdir())


def pinned(name: str) -> dict[str, str]:
    """Version of each package of a file of `constraints`; all its lines are those of packages with hashes."""
    text = (ROOT / "constraints" / name).read_text().replace("\\\n", " ")
    found = {}
    for line in text.splitlines():
        match = re.fullmatch(
            r"([A-Za-z0-9._-]+)(?:\[[^\]]*\])?==(\S+?)(?: ;[^-]*?)?((?:\s+--hash=sha256:[0-9a-f]{64})+)\s*",
            line,
        )
        assert match, line[:200]
        found[canonicalize_name(match[1])] = match[2]
    return found


@pytest.mark.parametrize("name", FILES)
def test_every_package_has_a_hash_and_no_file_names_an_index(name: str) -> None:
    assert len(pinned(name)) > 30
    text = (ROOT / "constraints" / name).read_text()
    assert "index" not in text
    assert "://" not in text


def required(project: dict[str, Any], extra: str) -> Iterator[str]:
    """Requirements of an extra, those of other extras that it names among them."""
    for text in project["optional-dependencies"][extra]:
        found = Requirement(text)
        yield from (
            (r for e in found.extras for r in required(project, e)) if found.name == "tripwatt" else [text]
        )


@pytest.mark.parametrize(
    ("name", "extras"),
    [
        ("check.txt", ("dev", "interop")),
        ("service.txt", ("service", "fleet", "live")),
        ("map.txt", ("service", "fleet", "live", "routing")),
    ],
)
def test_gate_and_container_have_what_they_need_in_the_same_versions(
    name: str, extras: tuple[str, ...]
) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    needed = [*project["dependencies"], *(r for e in extras for r in required(project, e))]
    image, check = pinned(name), pinned("check.txt")
    for requirement in map(Requirement, needed):
        if requirement.name == "tripwatt-gamm":  # of this repository
            continue
        assert requirement.specifier.contains(image[canonicalize_name(requirement.name)]), requirement
    assert {package: check.get(package) for package in image} == image


def test_the_core_is_tested_in_the_versions_of_the_gate() -> None:
    check, core = pinned("check.txt"), pinned("core.txt")
    assert {package: check.get(package) for package in core} == core


@pytest.mark.parametrize("file", WORKFLOWS, ids=lambda file: file.name)
def test_a_workflow_runs_nothing_that_can_change_under_its_name(file: Path) -> None:
    """Actions are named by their commits, packages by their hashes; the workflow may only read."""
    text = file.read_text()
    used = re.findall(r"uses: *(.*)", text)
    assert used
    for action in used:
        assert re.fullmatch(r"[\w.-]+/[\w./-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", action), action
    for line in re.findall(r"run:.*pip install.*", text):
        safe = ("--require-hashes", "--no-deps --no-build-isolation", "--offline --no-index")
        assert any(words in line for words in safe), line
    assert re.findall(r"permissions:\n((?:  .*\n)+)", text) == ["  contents: read\n"]


def test_the_gate_runs_on_linux_and_the_core_elsewhere() -> None:
    systems = {
        system
        for file in WORKFLOWS
        for system in ("ubuntu", "macos", "windows")
        if f"{system}-latest" in file.read_text()
    }
    assert systems == {"ubuntu", "macos", "windows"}


def test_the_wheels_are_tried_with_the_commands_of_the_readme() -> None:
    text = (ROOT / ".github" / "workflows" / "wheels.yml").read_text("utf-8")
    commands, _ = release.readme_commands((ROOT / "README.md").read_text("utf-8"))
    assert all(f"          {command}\n" in text for command in commands)
    assert re.findall(r"3\.\d+", re.findall(r"python: \[(.+)\]", text)[0]) == release.pythons()
    assert len(re.findall(r"run: uv build .*--require-hashes (?:\.|gamm)$", text, re.MULTILINE)) == 2


def test_tools_are_installed_by_their_hashes() -> None:
    text = (ROOT / "Makefile").read_text()
    (rule,) = re.findall(r"^\.venv-tools/\.ready:.*\n(?:\t.*\n)+", text, re.MULTILINE)
    assert "--require-hashes -r constraints/tools.txt" in rule
    assert not re.search(r"venv-tools/bin/python .*install(?!.*--require-hashes)", text)
    assert {"uv", "twine", "cyclonedx-bom"} <= {*pinned("tools.txt")}


def test_a_part_that_is_missing_fails_the_hosted_gate(tmp_path: Path) -> None:
    (tmp_path / "bin").mkdir()
    for name in ("dirname", "id", "env"):
        (tmp_path / "bin" / name).symlink_to(f"{shutil.which(name)}")
    environment = {"PATH": f"{tmp_path / 'bin'}", "EVERY_PART": "1"}
    bash = f"{shutil.which('bash')}"
    found = subprocess.run(
        [bash, ".ci/run"], cwd=ROOT, env=environment, capture_output=True, text=True, check=False, timeout=60
    )
    assert (found.returncode, found.stdout) == (1, "no chromium: the tests of the page are skipped\n")
    assert 'EVERY_PART: "1"' in (ROOT / ".github" / "workflows" / "check.yml").read_text()
    assert not re.search(r'echo ".*skipped', (ROOT / ".ci" / "run").read_text())


def test_the_container_installs_nothing_without_a_hash_and_runs_as_nobody() -> None:
    text = (ROOT / "Dockerfile").read_text()
    installs = re.findall(r"pip --python \S+ install .*?(?=&&|\n\S)", text, re.DOTALL)
    assert len(installs) == 2
    assert '--require-hashes -r "constraints/${PACKAGES}.txt"' in installs[0]
    assert "--no-deps" in installs[1]
    assert "--no-build-isolation ." in installs[1]
    assert len(re.findall(r"pip \S+ \S+ install|pip install", text)) == len(installs)
    assert re.findall(r"^FROM (\S+)", text, re.MULTILINE) == ["${BASE}", "${BASE}"]
    assert re.findall(r"^ARG PACKAGES=(\w+)", text, re.MULTILINE) == ["service"]
    last = text.rpartition("\nFROM ")[2]
    assert "\nUSER 10001\n" in last
    assert "\nHEALTHCHECK " in last


def test_what_the_container_leaves_out_is_not_imported_by_the_service() -> None:
    """Its commands run in a process in which these packages cannot be imported."""
    text = (ROOT / "Dockerfile").read_text()
    (words,) = re.findall(r"uninstall --yes --quiet(.*?)&&", text, re.DOTALL)
    modules = {"trove-classifiers": "trove_classifiers"}
    gone = [modules.get(word, word) for word in words.replace("\\", " ").split()]
    assert {"dask", "distributed"} <= set(gone)
    script = f"""
import sys
sys.modules |= dict.fromkeys({gone!r})
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.settings import Limits, Settings
from tripwatt.server.http.app import create_app
import tripwatt.server.http.worker, tripwatt.server.http.live, tripwatt.server.cars, tripwatt.fleet.store, tripwatt.fleet.registry
create_app()
Jobs.from_folders({{}}, Limits()).warm_up()
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_container_file_has_no_fault_that_hadolint_finds() -> None:
    if shutil.which("hadolint") is None:
        pytest.skip("no hadolint")
    done = subprocess.run(["hadolint", "Dockerfile"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def docker() -> str:
    """Why no container can be built here; empty where one can."""
    if shutil.which("docker") is None:
        return "no docker"
    done = subprocess.run(["docker", "info"], capture_output=True, text=True, timeout=30, check=False)
    return "" if done.returncode == 0 else f"no docker daemon: {done.stderr.strip()[:100]}"


@pytest.fixture
def image() -> Iterator[str]:
    if why := docker():
        pytest.skip(why)
    name = f"tripwatt-test-{os.getpid()}"
    subprocess.run(["docker", "build", "--quiet", "--tag", name, str(ROOT)], check=True, timeout=1200)
    yield name
    subprocess.run(["docker", "rmi", "--force", name], check=False, capture_output=True)


def test_the_container_is_built_and_answers(image: str) -> None:
    run = [
        "docker",
        "run",
        "--rm",
        "--detach",
        "--publish",
        "127.0.0.1::8000",
        "--env",
        "TRIPWATT_TOKEN=" + "x" * 20,
    ]
    options = ["--read-only", "--tmpfs", "/tmp", "--cap-drop", "ALL"]
    container = subprocess.run(
        [*run, *options, image], check=True, capture_output=True, text=True
    ).stdout.strip()
    try:
        port = subprocess.run(
            ["docker", "port", container, "8000"], check=True, capture_output=True, text=True
        ).stdout
        url, until = f"http://{port.splitlines()[0]}/readyz", time.monotonic() + 120
        while True:
            try:
                with urllib.request.urlopen(url, timeout=2) as answer:
                    assert answer.status == 200
                    break
            except OSError:
                assert time.monotonic() < until
                time.sleep(0.5)
    finally:
        subprocess.run(["docker", "stop", container], check=False, capture_output=True)


def test_citation_workflow_and_hooks_agree_with_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert f"\nlicense: {project['license']}\n" in citation
    assert [a["name"] for a in project["authors"]] == re.findall(r"^  - name: (.+)$", citation, re.MULTILINE)
    workflow = (ROOT / ".github" / "workflows" / "check.yml").read_text("utf-8")
    (pythons,) = re.findall(r"python: \[(.+)\]", workflow)
    listed = re.findall(r"Programming Language :: Python :: (3\.\d+)", " ".join(project["classifiers"]))
    assert re.findall(r"3\.\d+", pythons) == listed
    assert "\n      - run: .ci/run\n" in workflow
    hooks = (ROOT / ".pre-commit-config.yaml").read_text("utf-8")
    quick = [words for part, words in gate.PARTS.items() if part != "tests"]
    hooked = {entry.removeprefix(".venv-check/bin/") for entry in re.findall(r"entry: (.+)", hooks)}
    assert hooked == {words.removesuffix(" .") for words in quick}


def test_the_forms_of_issues_name_commands_that_there_are() -> None:
    forms = {file.stem: file.read_text("utf-8") for file in (ROOT / ".github" / "ISSUE_TEMPLATE").iterdir()}
    assert set(forms) == {"addition", "config", "fault", "forecast"}
    assert "SECURITY.md" in forms.pop("config")
    for name, text in forms.items():
        found = yaml.safe_load(text)
        assert {"name", "description", "body"} == set(found), name
        assert all(part["validations"]["required"] for part in found["body"]), name
        for words in re.findall(r"`tripwatt ([a-z]+)`", text):
            assert words in typer.main.get_command(app).commands, words  # type: ignore[attr-defined]
