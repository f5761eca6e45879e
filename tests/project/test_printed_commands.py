"""Every command of the README, the tutorials and the how-tos runs as printed, page by page, in a folder with the files that the page names."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import pytest
from tests.support import ROOT
from tests.support.command import answered
from tests.support.service_process import serving

import tripwatt as tw
from tripwatt.sources.suggest import suggest_mapping

FENCED: Final = re.compile(r"^ *```(\w*)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
PAGES: Final = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").glob("tutorials/*.md")),
    *sorted((ROOT / "docs").glob("howto/*.md")),
]
ELSEWHERE: Final = {
    r"serve\b": "a service that does not end: tests/server/http/test_process.py",
    r"(map build|map info|plan|reach|places) .*": "the map of a country and Valhalla: tests/roads/maps, tests/command/test_journey.py",
    r"(store|fleet) .*": "hours of a fleet: tests/command/test_fleet_commands.py",
    r"vehicles new .*--out vans/evito.toml": "with the commands of a fleet: tests/command/test_fleet_commands.py",
    r"evaluate logs .*": "minutes of a study: tests/command/test_commands.py",
}
"""Commands that are not run here, and which tests run them."""


def commands(page: Path) -> Iterator[str]:
    """The lines of the page's blocks that call tripwatt, continued lines joined."""
    for language, block in FENCED.findall(page.read_text("utf-8")):
        for line in block.replace("\\\n", " ").splitlines():
            if language in ("", "sh") and line.strip().startswith("tripwatt "):
                yield line.strip()


def is_elsewhere(command: str) -> bool:
    return any(re.match(f"tripwatt {pattern}", command) for pattern in ELSEWHERE)


def logs(folder: Path) -> None:
    """Logs of a car, as a logger writes them."""
    folder.mkdir()
    for trip in tw.sample_trips().trips[:9]:
        samples = trip.samples[
            ["time_s", "speed_m_s", "voltage_v", "current_a", "elevation_m", "ambient_temperature_degc"]
        ]
        samples.to_csv(folder / f"{trip.trip_id}.csv", index=False)


def route(file: Path) -> None:
    """The answer of a router, as the tutorial saves it."""
    leg = {
        "distance": 9000.0,
        "duration": 600.0,
        "annotation": {"distance": [500.0] * 18, "duration": [33.3] * 18},
    }
    file.write_text(
        json.dumps({"code": "Ok", "routes": [{"distance": 9000.0, "duration": 600.0, "legs": [leg]}]})
    )


def track(file: Path) -> None:
    points = "".join(f'<trkpt lat="{47 + k / 1000:.4f}" lon="9.5"><ele>500</ele></trkpt>' for k in range(60))
    file.write_text(f'<gpx version="1.1"><trk><trkseg>{points}</trkseg></trk></gpx>')


def trip(file: Path) -> None:
    assert answered("example-trip", "--out", file).code == 0


FILES: Final[dict[str, Callable[[Path], object]]] = {
    "exports": logs,
    "route.gpx": track,
    "route.json": route,
    "trip.csv": trip,
    "my-model": lambda folder: shutil.copytree(ROOT / "src" / "tripwatt" / "models" / "bmw_i3_tum", folder),
    "logs": logs,
    "my.toml": lambda file: file.write_text(suggest_mapping(file.with_name("logs")).toml),
}
"""What commands read and no command of their page writes."""


@pytest.mark.parametrize(
    "page", [p for p in PAGES if any(not is_elsewhere(c) for c in commands(p))], ids=lambda page: page.stem
)
def test_the_commands_of_a_page_run_as_printed(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for line in commands(page):
        if is_elsewhere(line):
            continue
        words = shlex.split(line, comments=True)[1:]
        words, target = (words[:-2], words[-1]) if ">" in words else (words, None)
        if words[:2] == ["car", "new"]:  # another way of the page begins
            shutil.rmtree(words[2], ignore_errors=True)
        for before, name in zip(["", *words], words, strict=False):
            if name in FILES and before != "--out" and not Path(name).exists():
                FILES[name](tmp_path / name)
        answer = answered(*words)
        assert answer.code == 0, f"{line}\n{answer.err}"
        if target:
            Path(target).write_text(answer.out)


def test_what_runs_elsewhere_is_printed_and_its_tests_exist() -> None:
    every = [command for page in PAGES for command in commands(page)]
    assert len(every) > 50
    for pattern, why in ELSEWHERE.items():
        assert any(re.match(f"tripwatt {pattern}", command) for command in every), pattern
        places = re.findall(r"tests/[\w/.]+", why)
        assert places
        assert all((ROOT / place).exists() for place in places), why


ANSWERED: Final = ("advice", "need")
ASKED_ELSEWHERE: Final = {
    "build-on-it": "tests/server/http/test_clients.py",
    "charge-planning": "tests/server/http/test_charge_planning.py",
    "fleet": "tests/integrations/test_emhass.py",
    "journeys": "tests/server/http/test_journeys.py",
    "live": "tests/server/http/test_live.py",
    "proxy": "tests/server/http/test_proxy.py",
}
"""Page with requests of curl -> the tests of its paths, which need a car on the road, a map, models of a fleet or a proxy."""


def requests(page: Path) -> list[list[str]]:
    """The words of each `curl` of a page, without those of a command that its answer goes to."""
    blocks = (block.replace("\\\n", " ") for _, block in FENCED.findall(page.read_text("utf-8")))
    lines = (line.strip() for block in blocks for line in block.splitlines())
    return [shlex.split(line, comments=True)[1:] for line in lines if line.startswith("curl ")]


def test_the_requests_of_the_pages_are_answered(tmp_path: Path) -> None:
    assert {page.stem for page in PAGES if requests(page)} == {*ANSWERED, *ASKED_ELSEWHERE}
    assert all((ROOT / place).is_file() for place in ASKED_ELSEWHERE.values())
    with serving(tmp_path) as service:
        for name in ANSWERED:
            for words in requests(ROOT / "docs" / "howto" / f"{name}.md"):
                (address,) = (word for word in words if word.startswith("localhost:8000/"))
                path = address.removeprefix("localhost:8000")
                body = json.loads(words[words.index("--json") + 1]) if "--json" in words else None
                answer = service.client.post(path, json=body) if body else service.client.get(path)
                assert answer.status_code == 200, f"{words}: {answer.text}"
