"""The files of the integration and the add-on: texts in two languages, versions, types, and a start from the add-on's options."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml
from tests.integrations.hass import COMPONENTS, environment
from tests.support import ROOT
from tests.support.service_process import TOKEN, free_port, wait_for
from typer.main import get_command

from tripwatt.command import app
from tripwatt.server.cars.discovery import SENSORS

OURS = COMPONENTS / "tripwatt"
ADD_ON = ROOT / "integrations" / "home_assistant" / "add-on"
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
PYTHON, WHY = environment()


def read(name: str) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((OURS / name).read_text("utf-8"))
    return document


def leaves(document: Any, path: str = "") -> dict[str, str]:
    """The texts of a document by their paths."""
    if not isinstance(document, dict):
        return {path: document}
    return {
        key: text for name, part in document.items() for key, text in leaves(part, f"{path}/{name}").items()
    }


def constants(file: str) -> set[str]:
    """The texts in the code of a module."""
    tree = ast.parse((OURS / file).read_text("utf-8"))
    return {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }


def test_every_text_is_there_in_english_and_german() -> None:
    english, german = (leaves(read(f"translations/{language}.json")) for language in ("en", "de"))
    assert set(english) == set(german)
    same = {key for key, text in english.items() if german[key] == text}
    assert {english[key] for key in same} <= {"Token", "Reserve", "Chance"}
    assert all(german.values())
    holes = {key: re.findall(r"\{\w+\}", text) for key, text in english.items()}
    assert holes == {key: re.findall(r"\{\w+\}", text) for key, text in german.items()}


def test_every_sensor_error_and_action_has_its_text_and_its_icon() -> None:
    texts, icons = read("translations/en.json"), read("icons.json")
    sensors = texts["entity"]["sensor"]
    assert {sensor.key for sensor in SENSORS} == set(sensors) == set(icons["entity"]["sensor"])
    assert set(sensors) <= constants("sensor.py")
    assert set(texts["entity"]["calendar"]) == set(icons["entity"]["calendar"]) == {"trips"}
    assert set(texts["config"]["error"]) <= constants("config_flow.py")
    thrown = constants("actions.py") | constants("coordinator.py")
    assert set(texts["exceptions"]) <= thrown
    actions = yaml.safe_load((OURS / "services.yaml").read_text("utf-8"))
    assert set(actions) == set(texts["services"]) == set(icons["services"]) == {"plan", "advise", "set_plan"}
    for name, action in actions.items():
        assert set(action["fields"]) == set(texts["services"][name]["fields"]), name


BRONZE = (
    "action-setup", "appropriate-polling", "brands", "common-modules", "config-flow-test-coverage", "config-flow",
    "dependency-transparency", "docs-actions", "docs-high-level-description", "docs-installation-instructions",
    "docs-removal-instructions", "entity-event-setup", "entity-unique-id", "has-entity-name", "runtime-data",
    "test-before-configure", "test-before-setup", "unique-config-entry",
)  # fmt: skip
SILVER = (
    "action-exceptions", "config-entry-unloading", "docs-configuration-parameters", "docs-installation-parameters",
    "entity-unavailable", "integration-owner", "log-when-unavailable", "parallel-updates", "reauthentication-flow",
    "test-coverage",
)  # fmt: skip


def shows(evidence: str) -> bool:
    """Whether a test, a section of a page or a file is there."""
    path, mark, name = re.fullmatch(r"([\w./-]+?)(?:(::|#)([\w-]+))?", evidence).groups()  # type: ignore[union-attr]
    if not (ROOT / path).is_file():
        return False
    text = (ROOT / path).read_text("utf-8")
    if mark == "::":
        tree = ast.parse(text)
        return any(isinstance(node, ast.FunctionDef) and node.name == name for node in tree.body)
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return mark is None or name in {heading.lower().replace(" ", "-") for heading in headings}


def test_every_rule_of_the_bronze_and_silver_scale_is_done_and_shown_or_exempt_with_a_reason() -> None:
    rules = yaml.safe_load((OURS / "quality_scale.yaml").read_text("utf-8"))["rules"]
    assert tuple(rules) == BRONZE + SILVER
    for rule, row in rules.items():
        assert set(row) == {"status", "comment"}, rule
        if row["status"] == "done":
            missing = [one for one in row["comment"].split(", ") if not shows(one)]
            assert missing == [], rule
        else:
            assert row["status"] == "exempt", rule
            assert row["comment"].endswith("."), rule
    assert not shows("tests/integrations/test_files.py::test_that_is_not_there")
    assert not shows("docs/howto/home-assistant-evcc.md#nowhere")
    assert not shows("no/such/file.py")


def test_all_parts_have_the_version_of_the_project() -> None:
    manifest = read("manifest.json")
    add_on = yaml.safe_load((ADD_ON / "config.yaml").read_text("utf-8"))
    assert manifest["version"] == add_on["version"] == VERSION
    assert manifest["requirements"] == []  # all that it needs is in Home Assistant
    hacs = json.loads((ADD_ON.parent / "hacs.json").read_text("utf-8"))
    assert set(hacs) == {"name", "homeassistant", "render_readme"}


@pytest.mark.skipif(PYTHON is None, reason=WHY)
def test_the_types_of_the_integration_agree_with_those_of_home_assistant(tmp_path: Path) -> None:
    """The gate's mypy cannot import Home Assistant, which lives in an environment of its own; here it can."""
    assert PYTHON is not None
    command = [sys.executable, "-m", "mypy", "--strict", "-p", "custom_components.tripwatt"]
    python = ["--python-executable", str(PYTHON / "bin" / "python"), "--python-version", "3.13"]
    (tmp_path / "mypy.ini").write_text("[mypy]\n")
    done = subprocess.run(
        [*command, *python, "--config-file", str(tmp_path / "mypy.ini"), "--cache-dir", str(tmp_path)],
        cwd=COMPONENTS.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_option_of_the_add_on_is_one_of_serve_and_has_its_text() -> None:
    config = yaml.safe_load((ADD_ON / "config.yaml").read_text("utf-8"))
    known = {parameter.name for parameter in options_of_serve()}
    schema = set(config["schema"])
    assert schema - {"token", "mqtt_password"} <= {name.rstrip("_") for name in known if name}
    assert set(config["options"]) <= schema
    for language in ("en", "de"):
        texts = yaml.safe_load((ADD_ON / "translations" / f"{language}.yaml").read_text("utf-8"))
        assert set(texts["configuration"]) == schema


def test_the_add_on_starts_the_service_with_its_options(tmp_path: Path) -> None:
    options = {"token": TOKEN, "workers": 1, "follow": [], "keep_days": 30.5, "map": None}
    (tmp_path / "options.json").write_text(json.dumps(options))
    port = free_port()
    folder = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    known = os.environ | {"ADD_ON_DATA": str(tmp_path), "PATH": folder}
    words = [sys.executable, str(ADD_ON / "run.py"), "--host", "127.0.0.1", "--port", str(port)]
    process = subprocess.Popen(words, env=known, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    headers = {"authorization": f"Bearer {TOKEN}"}

    def answers() -> bool:
        try:
            return httpx.get(f"http://127.0.0.1:{port}/readyz").status_code == 200
        except httpx.TransportError:
            return False

    try:
        assert wait_for(answers)
        assert httpx.get(f"http://127.0.0.1:{port}/v1/cars").status_code == 401
        cars = httpx.get(f"http://127.0.0.1:{port}/v1/cars", headers=headers)
        assert cars.json() == {"cars": [], "damaged": {}}  # it keeps cars, in the folder that lasts
        assert (tmp_path / "cars").is_dir()
    finally:
        process.terminate()
        process.wait(60)
    (tmp_path / "options.json").write_text(json.dumps(options | {"token": ""}))
    refused = subprocess.run(words, env=known, capture_output=True, text=True, check=False)
    assert refused.returncode == 1
    assert "16 characters" in refused.stderr


def test_the_add_on_has_all_that_its_image_is_built_from(tmp_path: Path) -> None:
    place = tmp_path / "tripwatt"
    subprocess.run(["make", "--silent", "add-on", f"ADD_ON={place}"], cwd=ROOT, check=True)
    text = (place / "Dockerfile").read_text("utf-8")
    copied = re.findall(r"^COPY (?!--from)(.+) \S+$", text, re.MULTILINE)
    names = {name.rstrip("/") for words in copied for name in words.split()}
    assert {"constraints", "src", "run.py"} <= names
    assert [name for name in names if not (place / name).exists()] == []
    stages = re.findall(r"^FROM (\S+)(?: AS (\S+))?$", text, re.MULTILINE)
    assert [name for name, _ in stages] == ["${BASE}", "${BASE}", "service"]
    assert stages[1][1] == "service"


def test_compose_starts_the_service_of_this_project_with_its_integration() -> None:
    folder = ADD_ON.parent
    compose = yaml.safe_load((folder / "compose.yaml").read_text("utf-8"))
    service, hass = compose["services"]["tripwatt"], compose["services"]["homeassistant"]
    assert (folder / service["build"] / "Dockerfile").resolve() == ROOT / "Dockerfile"
    known = {word for parameter in options_of_serve() for word in parameter.opts}
    assert {word for word in service["command"] if word.startswith("--")} <= known
    (ours,) = [volume for volume in hass["volumes"] if "custom_components" in volume]
    assert (folder / ours.partition(":")[0]).resolve() == OURS
    named = {
        v.partition(":")[0] for part in (service, hass) for v in part["volumes"] if not v.startswith(".")
    }
    assert named == set(compose["volumes"])


def options_of_serve() -> list[Any]:
    """The options of `tripwatt serve`."""
    command: Any = get_command(app)
    options: list[Any] = command.commands["serve"].params
    return options
