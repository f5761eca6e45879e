"""The example of an integrator, `docs/examples/afternoon.mjs`: from a plan to a drive that is sent in five ways."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import orjson
import pytest
from tests.support import ROOT
from tests.support.roads import osrm
from tests.support.router_server import answering, write_map
from tests.support.service_process import TOKEN, serving

SCRIPT = ROOT / "docs" / "examples" / "afternoon.mjs"
DOORS = ["by-field", "by-bearer", "by-query", "by-form", "by-address"]
MIN_NODE = 20


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the script prints for a service with a token, a map and a folder of cars."""
    node = shutil.which("node")
    version = subprocess.run([node or "true", "--version"], capture_output=True, text=True, check=True).stdout
    if int(version[1:].partition(".")[0] or 0) < MIN_NODE:
        pytest.skip(f"needs Node {MIN_NODE} or newer, found {version or 'none'}")
    folder = tmp_path_factory.mktemp("afternoon")
    for name in ("cars", "logs"):
        (folder / name).mkdir()
    with answering(osrm(annotated=True)) as router:
        roads = f"{write_map(folder / 'map')}@osrm={router.url}"
        options = ("--workers", "1", "--map", roads, "--cars", f"{folder / 'cars'}")
        with serving(folder / "logs", *options, token=TOKEN) as service:
            done = _run(f"{node}", service.url, "Westend", "Ostheim")
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = orjson.loads(done.stdout)
    return found


def _run(node: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "TRIPWATT_TOKEN": TOKEN}
    command = [node, f"{SCRIPT}", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, env=environment)


def test_five_ways_to_send_a_drive_give_one_state(shown: dict[str, Any]) -> None:
    first, *others = shown["cars"]
    assert [car["name"] for car in shown["cars"]] == DOORS
    for other in others:
        for name in ("faults", "need"):
            assert other[name] == first[name]
        # the message is of the last minute, and two cars are not asked in the same second
        assert other["message"]["verdict"] == first["message"]["verdict"]
        assert other["message"]["soc_arrival"] == pytest.approx(first["message"]["soc_arrival"], abs=0.01)
        assert other["energy_wh"] == pytest.approx(first["energy_wh"], rel=1e-9)
        assert other["p_arrive"] == pytest.approx(first["p_arrive"], rel=1e-6)
    assert first["energy_wh"] == pytest.approx(1290.0, rel=0.1)  # as the log measured it


def test_plan_advice_and_need_of_one_road_agree(shown: dict[str, Any]) -> None:
    """The charge of the plan is too small for the reserve."""
    assert shown["charge_to"] > 0.17
    assert f"{100 * shown['charge_to']:.0f} % is enough" in shown["leave"]
    assert {car["need"] for car in shown["cars"]} == {shown["leave"]}
    assert all(car["p_arrive"] < 0.95 for car in shown["cars"])


def test_the_script_is_short_and_needs_no_package() -> None:
    text = Path(SCRIPT).read_text("utf-8")
    assert len(text.splitlines()) <= 80
    assert "import " not in text
    assert "require(" not in text
