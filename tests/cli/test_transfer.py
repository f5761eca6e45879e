"""`tripwatt transfer` and `tripwatt fit --base` as a user of any log meets them, and the page that publishes them."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.support import ROOT
from tools.docs import write_transfer

from tripwatt.cli import main
from tripwatt.forecasting import load_metadata, load_model, save_model
from tripwatt.forecasting.fitting import fit_with_provenance
from tripwatt.physics import simulate_trip
from tripwatt.synthetic import synthetic_fleet
from tripwatt.trips import plan_from_trip
from tripwatt.vehicles import load_vehicle

DOCS = ROOT / "docs"
MAPPING = """
[columns]
time_s = {column = "t", unit = "s"}
speed_m_s = {column = "kmh", unit = "km/h"}
voltage_v = {column = "volt", unit = "V"}
current_a = {column = "ampere", unit = "A"}
ambient_temperature_degc = {column = "outside", unit = "degC"}
elevation_m = {column = "height", unit = "m"}

[current]
positive = "discharge"
"""


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """1 Hz tables of a Leaf: time, speed, current, voltage, outside temperature, elevation, and nothing else."""
    place = tmp_path_factory.mktemp("logs")
    leaf = load_vehicle("nissan_leaf_24", overrides={"base_load": 450.0})
    for trip in synthetic_fleet(6, seed=11).trips:
        run = simulate_trip(leaf, plan_from_trip(trip))
        samples = trip.samples[["time_s", "speed_m_s", "ambient_temperature_degc", "elevation_m"]]
        power = np.interp(samples["time_s"], run.time_s, run.battery_power_w)
        table = samples.assign(volt=360.0, ampere=power / 360.0, speed_m_s=3.6 * samples["speed_m_s"])
        names = {
            "time_s": "t",
            "speed_m_s": "kmh",
            "ambient_temperature_degc": "outside",
            "elevation_m": "height",
        }
        table.rename(columns=names).to_csv(place / f"{trip.trip_id}.csv", index=False)
    (place.parent / "my.toml").write_text(MAPPING, encoding="utf-8")
    return place


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["tripwatt", *map(str, arguments)])
    try:
        main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def test_fit_on_a_base_with_one_trip_of_a_table(
    logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    base = tmp_path / "base"
    model, provenance, figures = fit_with_provenance(
        synthetic_fleet(9, seed=12), load_vehicle("bmw_i3_60ah"), corrector="linear"
    )
    save_model(model, base, provenance=provenance, evaluation=figures)
    some = tmp_path / "logs"
    some.mkdir()
    sound = sorted(logs.glob("*.csv"))[0]
    shutil.copy(sound, some)
    wrong = pd.read_csv(sound).assign(ampere=lambda samples: -samples["ampere"])
    wrong.to_csv(some / "wrong_sign.csv", index=False)
    table = ("--dataset", "table", "--mapping", logs.parent / "my.toml", "--vehicle", "nissan_leaf_24")
    out = tmp_path / "leaf"
    assert run(monkeypatch, "fit", some, *table, "--base", base, "--out", out) == 0
    assert "adapted to 1 trips of 2 (`tripwatt audit` has the reasons)" in capsys.readouterr().out
    about = load_metadata(out)
    assert about["provenance"]["base"]["sha256"] == load_metadata(base)["sha256"]
    assert about["provenance"]["adapted"]["trips"] == 1
    assert run(monkeypatch, "inspect", out) == 0
    said = capsys.readouterr().out
    assert "1 own trips" in said
    assert "base load" in said
    assert load_model(out).vehicle.title.startswith("Nissan Leaf")


def test_faults_of_base_and_car_come_at_once(
    logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    options = (
        "--base",
        tmp_path / "nothing",
        "--vehicle",
        "no_such_car",
        "--mapping",
        logs.parent / "my.toml",
    )
    assert run(monkeypatch, "fit", logs, *options, "--out", tmp_path / "m") == 2
    said = capsys.readouterr().err
    assert "no_such_car" in said
    assert "nothing" in said


def test_transfer_refuses_with_every_fault(
    logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--trips", "0,x", "--vehicle", "no_such_car", "--out", tmp_path / "t")
    assert run(monkeypatch, "transfer", "--from", tmp_path / "none", "--to", logs, *options) == 2
    said = capsys.readouterr().err
    assert all(word in said for word in ("--trips", "no_such_car", "none"))
    assert not (tmp_path / "t").exists()


def test_transfer_to_a_table(
    logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from tripwatt.cli import transfer as transferring

    fleet = synthetic_fleet(9, seed=12)
    table = ("--dataset", "table", "--mapping", str(logs.parent / "my.toml"), "--vehicle", "nissan_leaf_24")
    read = transferring.read_logs
    # the synthetic fleet has no folder of its own
    monkeypatch.setattr(
        transferring, "read_logs", lambda place, *how: fleet if place == Path("fleet") else read(place, *how)
    )
    out = tmp_path / "t"
    options = (
        "--from-vehicle",
        "bmw_i3_60ah",
        "--trips",
        "0,1",
        "--draws",
        "3",
        "--min-km",
        "0",
        "--out",
        out,
    )
    assert run(monkeypatch, "transfer", "--from", "fleet", "--to", logs, *table, *options, "--json") == 0
    results = json.loads(capsys.readouterr().out)
    written = json.loads((out / "results.json").read_text(encoding="utf-8"))
    assert written == results
    (car,) = results["cars"]
    assert [row["k"] for row in car["curves"]["both"]] == [0, 1, 3]
    assert set(results["hidden"]) == {
        "cabin_temperature_degc",
        "cabin_setpoint_degc",
        "battery_temperature_degc",
    }
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 3
    assert {p.name for p in (out / "figures").iterdir()} == {
        f"{stem}.{kind}" for stem in ("models", "curve", "trips") for kind in ("png", "svg")
    }


def test_page_of_the_transfer_says_what_was_published(tmp_path: Path) -> None:
    page = (DOCS / "explanation" / "transfer.md").read_text(encoding="utf-8")
    assert write_transfer.renewed(page) == page, "python -m tools.docs.write_transfer"
    for file in (DOCS / "results").glob("transfer-*.json"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    changed = json.loads((tmp_path / "transfer-tum-ved.json").read_text(encoding="utf-8"))
    changed["cars"][0]["models"]["physics"]["error"] = 0.777
    (tmp_path / "transfer-tum-ved.json").write_text(json.dumps(changed), encoding="utf-8")
    assert "| its physics alone | 77.7 |" in write_transfer.renewed(page, tmp_path)
    assert changed["from"]["dataset"] == "tum"
    assert changed["cars"][0]["trips_second"] == 69
