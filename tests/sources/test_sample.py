"""The sample of real trips in the package: complete, small, made by its rule, and read by nothing that is fitted or scored."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.support import ROOT
from tests.support.refusals import refuses
from tools.data.sample import listed, main, write_sample

import tripwatt as tw
from tripwatt.sources.sample import FOLDER, SAMPLES
from tripwatt.trips import Log

MAX_BYTES = 500_000


def test_every_sample_has_sound_trips_their_context_and_their_licence() -> None:
    trips = {name: tw.audit(tw.sample_trips(name)).trips for name in SAMPLES}
    assert {name: len(sound) for name, sound in trips.items()} == {"tum": 15, "ved": 19, "twizy": 17}
    assert all(trip.observed_energy_wh for sound in trips.values() for trip in sound)
    assert {trip.context.season for trip in trips["tum"]} == {"summer", "winter"}
    assert all(trip.context.weather for name in ("tum", "twizy") for trip in trips[name])
    for name in SAMPLES:
        sample = tw.sample_trips(name)
        departures = [log.context.started_at for log in sample.logs if log.context.started_at]
        assert len(departures) == len(sample)
        assert departures == sorted(departures)
        assert ("Apache-2.0" if name == "ved" else "CC BY 4.0") in sample.citation
        assert sample.citation.partition(",")[0] in (FOLDER / "README.md").read_text("utf-8")
    assert sum(file.stat().st_size for file in FOLDER.iterdir()) < MAX_BYTES
    refuses("unknown data set: dataset: got 'synthetic'", tw.sample_trips, "synthetic")


def test_a_sample_is_written_with_the_same_bytes_again(tmp_path: Path) -> None:
    for name in SAMPLES:
        for turn in ("first", "second"):
            (tmp_path / turn).mkdir(exist_ok=True)
            write_sample(name, tw.sample_trips(name), tmp_path / turn)
        for kind in ("npz", "toml"):
            first, second = (
                (tmp_path / turn / f"{name}.{kind}").read_bytes() for turn in ("first", "second")
            )
            assert first == second
        assert (tmp_path / "first" / f"{name}.toml").read_bytes() == (FOLDER / f"{name}.toml").read_bytes()


def test_the_sample_is_what_its_rule_chooses(
    data_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    main(data_dir, tmp_path)
    shipped = {name: tw.sample_trips(name) for name in SAMPLES}
    monkeypatch.setattr("tripwatt.sources.sample.FOLDER", tmp_path)
    for name in SAMPLES:
        assert (tmp_path / f"{name}.toml").read_text("utf-8") == (FOLDER / f"{name}.toml").read_text("utf-8")
        for made, log in zip(tw.sample_trips(name).logs, shipped[name].logs, strict=True):
            pd.testing.assert_frame_equal(made.samples, log.samples, rtol=1e-12, atol=0.0)


def test_a_column_is_listed_and_read_with_the_same_bits() -> None:
    rng = np.random.default_rng(3)
    decimals = rng.integers(-400, 400, 1000) / 1000.0
    for values, parts in (
        (decimals, 1000.0),
        (np.where(decimals > 0.3, np.nan, decimals), 1000.0),
        (rng.normal(size=1000), 1.0),
        (np.full(1000, 7.0), 1.0),
    ):
        arrays = listed("speed_m_s", values)
        assert arrays["speed_m_s.parts"] == parts
        again = (arrays["speed_m_s.whole"] / parts)[np.cumsum(arrays["speed_m_s"])]
        assert again.tobytes() == values.tobytes()


def test_the_audit_finds_what_is_wrong_in_a_real_trip_and_nothing_else() -> None:
    sample = tw.sample_trips()
    tables = {log.trip_id: log.samples.copy() for log in sample.logs}
    tables["TripB19"].iloc[867:, 1:] = tables["TripB19"].iloc[866, 1:].to_numpy()
    tables["TripA13"]["current_a"] *= -1.0
    tables["TripB03"].iloc[601:645, 1:] = np.nan
    tables["TripB03"] = tables["TripB03"].interpolate()
    logs = [Log.from_samples(log.trip_id, tables[log.trip_id], log.context) for log in sample.logs]
    sound, faulty = (tw.audit(each).findings for each in (sample, replace(sample, logs=tuple(logs))))
    assert {f.consequence for f in sound} == {"noted"}
    findings = [f for f in faulty if f.consequence != "noted"]
    by_trip = {f.trip: (f.consequence, f.from_s, f.to_s) for f in findings}
    assert by_trip == {
        "TripA13": ("set aside", 0.0, 715.0),
        "TripB03": ("set aside", pytest.approx(600.0, abs=2.0), pytest.approx(645.0, abs=2.0)),
        "TripB19": ("trimmed", 866.0, 1191.0),
    }
    words = {"TripA13": "sign", "TripB03": "a filled gap", "TripB19": "frozen"}
    assert all(any(word in f.what for f in findings if f.trip == trip) for trip, word in words.items())


def test_no_model_and_no_score_reads_the_sample(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    links = [{"length_m": 6000.0, "speed_m_s": 15.0}]
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=-5)

    def energies() -> list[float]:
        plan = tw.read_route(links)
        cars = ("bmw_i3_60ah", "nissan_leaf_24")
        return [tw.for_car(tw.load_model(), car).forecast(plan, departure).energy_wh for car in cars]

    before = energies()
    monkeypatch.setattr("tripwatt.sources.sample.FOLDER", tmp_path)
    with pytest.raises(FileNotFoundError):
        tw.sample_trips()
    assert energies() == before
    monkeypatch.undo()
    sample = tw.sample_trips()
    assert not sample.reference_trips()
    refuses("hold-out", tw.evaluate, sample, models=["constant"], hold_outs="leave_one_trip_out:reference")
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]
    (alone,) = (
        c for c in contracts["contracts"] if c.get("forbidden_modules") == ["tripwatt.sources.sample"]
    )
    assert {"tripwatt.study", "tripwatt.population", "tripwatt.hybrid"} <= set(alone["source_modules"])
