"""Logs from tables in memory."""

import numpy as np
import pandas as pd
import pytest

import tripwatt as tw
from tripwatt.trips import observed_cumulative_energy
from tripwatt.trips.messages import message


@pytest.fixture(scope="module")
def frames():
    """The sample's trips as a logger with a counter of kWh in steps of 0.01 has them."""
    tables = {}
    for trip in tw.sample_trips().trips:
        counted = 10.0 * np.round(observed_cumulative_energy(trip.samples) / 10.0)
        table = trip.samples.drop(columns=["voltage_v", "current_a"])
        tables[trip.trip_id] = table.assign(observed_energy_wh=counted, traffic=1, driver="anna")
    return tables


def test_tables_with_a_counter_of_energy_are_fitted_in_every_form(frames):
    logs = tw.read_logs(frames)
    assert [log.trip_id for log in logs.logs] == [*frames]
    assert message(logs.notes[0]) == "columns that are no signals are kept as covariates: traffic, driver"
    assert [*logs.logs[0].to_dict()["samples"]][-1] == "traffic"
    joined = pd.concat([table.assign(trip=name) for name, table in frames.items()])
    models = [
        tw.fit(each, "bmw_i3_60ah", corrector="linear") for each in (frames, [*frames.values()], joined)
    ]
    assert models[0].trip_ids_ == models[2].trip_ids_ == (*frames,)
    trip = tw.sample_trips().trips[0]
    assert len({model.forecast(trip).energy_wh for model in models}) == 1
    assert len(tw.adapt(models[0], frames, "vw_id3").trip_ids_) == len(frames)


def test_times_may_be_the_index_and_faults_of_all_tables_are_told_at_once():
    index = pd.date_range("2024-05-31 08:15", periods=3, freq="min", tz="Europe/Berlin")
    (log,) = tw.read_logs(pd.DataFrame({"speed_m_s": 10.0}, index=index)).logs
    assert (log.trip_id, log.duration_s, f"{log.context.started_at}") == (
        "trip",
        120.0,
        "2024-05-31 08:15:00",
    )
    with pytest.raises(tw.InvalidInput) as error:
        tw.read_logs([pd.DataFrame({"time_s": [0.0, 1.0]}), {"time_s": [0.0]}])
    assert [fault.what for fault in error.value.faults] == ["missing column", "unknown type"]
    for nothing in (pd.DataFrame(), [], {}):
        with pytest.raises(tw.InvalidInput, match="no tables: source"):
            tw.read_logs(nothing)


def test_a_file_may_have_a_counter_in_kwh(tmp_path, frames):
    table = frames["TripA01"][["time_s", "speed_m_s", "observed_energy_wh"]]
    table.assign(observed_energy_wh=table["observed_energy_wh"] / 1000.0).to_csv(
        tmp_path / "a.csv", index=False
    )
    (tmp_path / "map.toml").write_text(
        '[columns]\ntime_s = { column = "time_s" }\nspeed_m_s = { column = "speed_m_s", unit = "m/s" }\n'
        'observed_energy_wh = { column = "observed_energy_wh", unit = "kWh" }\n'
    )
    (log,) = tw.read_logs(tmp_path, "table", tmp_path / "map.toml").logs
    assert log.observed_energy_wh == pytest.approx(table["observed_energy_wh"].iloc[-1])
    table.to_csv(tmp_path / "a.csv", index=False)
    assert tw.read_logs(tmp_path / "a.csv", "table").logs[0].observed_energy_wh == log.observed_energy_wh


def test_a_mapping_names_covariates_and_columns_that_are_not_read_are_told(tmp_path):
    columns = {"t": [0, 1, 2], "v": 9.0, "Traffic": [1, "", 3], "Who": ["anna", "", "anna"], "Humidity": 60}
    pd.DataFrame(columns).to_csv(tmp_path / "a.csv", index=False)
    mapping = '[columns]\ntime_s = { column = "t" }\nspeed_m_s = { column = "v", unit = "m/s" }\n'
    (tmp_path / "map.toml").write_text(mapping + '[covariates]\ntraffic = "Traffic"\ndriver = "Who"\n')
    logs = tw.read_logs(tmp_path, "table", tmp_path / "map.toml")
    assert logs.logs[0].departure.covariates == {"traffic": 2.0, "driver": "anna"}
    assert [note.value for note in logs.notes if note.code == "columns_unread"] == ["Humidity"]
    for wrong in ('speed_m_s = "Traffic"', "traffic = 3", 'traffic = "Trafic"'):
        (tmp_path / "map.toml").write_text(f"{mapping}[covariates]\n{wrong}\n")
        with pytest.raises(tw.InvalidInput, match=r"not a column|did you mean 'Traffic'"):
            tw.read_logs(tmp_path, "table", tmp_path / "map.toml")
