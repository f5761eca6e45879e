"""Tables, mappings and vehicle files on the command line: what is wrong is one message with place, finding and remedy."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.support.command import Answer, Run

MAPPING = """
[columns]
time_s = { column = "Time", unit = "s" }
speed_m_s = { column = "Speed", unit = "km/h" }
voltage_v = { column = "Volt", unit = "V" }
current_a = { column = "Amp", unit = "A" }
ambient_temperature_degc = { column = "Outside", unit = "degC" }
elevation_m = { column = "Height", unit = "m" }
[current]
positive = "discharge"
"""
Table = pd.DataFrame


@pytest.fixture
def run(run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Run:
    """The command, started where the files are, its errors on one line."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: object) -> Answer:
        answer = run(*arguments)
        return answer._replace(err=" ".join(answer.err.split()))

    return call


def drive(n: int = 700, seed: int = 0) -> Table:
    rng = np.random.default_rng(seed)
    time = np.arange(float(n))
    speed = np.maximum(12.0 + 9.0 * np.sin(time / 11.0 + seed) + 3.0 * np.sin(time / 4.3), 0.0)
    current = (1500.0 * speed * np.gradient(speed, time) + 250.0 * speed + 900.0) / 390.0
    current += rng.normal(0.0, 0.2, n)
    volt = 390.0 - 0.1 * current
    height = 300.0 + 10.0 * np.sin(time / 90.0)
    return Table(
        {"Time": time, "Speed": 3.6 * speed, "Volt": volt, "Amp": current, "Outside": 12.0, "Height": height}
    )


BAD: dict[str, tuple[Callable[[Table], Table], tuple[str, ...]]] = {
    "missing column": (
        lambda d: d.rename(columns={"Volt": "Voltage"}),
        ("missing column: drive.csv", "'Time', 'Speed', 'Voltage'", "a column 'Volt'", "did you mean 'Voltage'?", "my.toml"),
    ),
    "900 km/h": (
        lambda d: d.assign(Speed=900.0),
        ("value out of range: drive.csv row 2 column 'Speed'", "got 900 km/h", "-36 to 324 km/h", "check the unit"),
    ),
    "current of the wrong sign": (
        lambda d: d.assign(Amp=-d.Amp),
        ("current has the wrong sign: column 'Amp'", "charge while it accelerates", 'positive = "charge" in place', "my.toml"),
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("command", "what"),
    [
        *((("audit",), what) for what in BAD),
        *((verb, "900 km/h") for verb in (("simulate",), ("evaluate",), ("fit",))),
    ],
)
def test_bad_tables_are_one_message_and_code_2(run, tmp_path, command, what) -> None:
    damage, words = BAD[what]
    (tmp_path / "my.toml").write_text(MAPPING)
    damage(drive()).to_csv(tmp_path / "drive.csv", index=False)
    verb, *options = command
    answer = run(verb, "drive.csv", "--dataset", "table", "--mapping", "my.toml", "--strict", *options)
    assert answer.code == 2
    assert answer.err.count("error:") == 1
    assert "Traceback" not in answer.err
    for word in words:
        assert word in answer.err
    assert {p.name for p in tmp_path.iterdir()} == {"my.toml", "drive.csv"}, "nothing half-written is left"


def test_several_trips_in_one_file_without_a_trip_column_are_no_traceback(run, tmp_path) -> None:
    (tmp_path / "my.toml").write_text(MAPPING)
    pd.concat([drive(), drive(seed=1)]).to_csv(tmp_path / "all.csv", index=False)
    answer = run("simulate", "all.csv", "--mapping", "my.toml")
    assert answer.code == 2
    assert "time does not increase: all" in answer.err
    assert "tripwatt audit" in answer.err
    assert "[trip]" in run("audit", "all.csv", "--mapping", "my.toml").err
    assert run("mapping", "apply", "all.csv", "--mapping", "my.toml", "--trip", "all-2").code == 0
    refused = run("mapping", "apply", "all.csv", "--mapping", "my.toml", "--trip", "all")
    assert refused.code == 2
    assert "all-1, all-2" in refused.err


def test_from_a_strange_table_to_a_forecast(run, tmp_path) -> None:
    """suggest, audit, simulate, fit, mapping apply, forecast, each with what the one before wrote."""
    folder = tmp_path / "logs"
    folder.mkdir()
    for k in range(8):
        d = drive(600 + 40 * k, seed=k)
        strange = Table(
            {
                "Zeit": d.Time,
                "v_kmh": d.Speed,
                "I_Akku": -d.Amp,
                "U_Akku": d.Volt,
                "T_aussen": 12.0,
                "z_m": d.Height,
            }
        )
        strange.to_csv(folder / f"fahrt{k}.csv", index=False, sep=";", decimal=",")
    assert run("mapping", "suggest", "logs", "--out", "my.toml").code == 0
    audited = run("audit", "logs", "--mapping", "my.toml", "--json")
    assert len(json.loads(audited.out)["used"]) == 8, audited.out
    simulated = run("simulate", "logs", "--mapping", "my.toml", "--car", "vw_id3", "--trip", "fahrt2", "--json")  # fmt: skip
    answer = json.loads(simulated.out)
    assert answer["vehicle"] == "vw_id3"
    assert answer["simulated_energy_wh"] > 0 < answer["observed_energy_wh"]
    fit = run("fit", "logs", "--mapping", "my.toml", "--car", "vw_id3", "--corrector", "linear", "--out", "model")  # fmt: skip
    assert fit.code == 0, fit.err
    assert run("mapping", "apply", "logs", "--mapping", "my.toml", "--trip", "fahrt2").code == 0
    found = run("forecast", "model", "trip.csv", "--json")
    assert found.code == 0, found.err
    observed = answer["observed_energy_wh"]
    assert json.loads(found.out)["energy_wh"] == pytest.approx(observed, rel=0.25)
