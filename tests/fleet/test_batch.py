"""Forecasts of many planned trips."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.fleet.batch import _open_parquet, _read_batches, forecast_batch, output_schema, quantile_column
from tripwatt.fleet.executors import Workers
from tripwatt.trips import Departure
from tripwatt.trips.messages import message

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def links(trip, vehicle, **more):
    return [
        {"trip": trip, "vehicle_id": vehicle, "length_m": 1500.0, "speed_m_s": v, **more}
        for v in (12.0, 20.0, 15.0)
    ]


def test_a_batch_is_the_forecasts_of_its_trips(fleet, saved, tmp_path):
    import tripwatt as tw

    *_, model, _ = fleet
    known = {"soc": 0.8, "ambient_temperature_degc": 4.0, "car_model": None}
    table = [
        *links("b", "V00001", **known),
        *links("a", "V00000", **known),
        *links("c", "new", **{**known, "car_model": "vw_id3"}),
        *links("d", "nobody", **known),
        *links("e", "V00000", **{**known, "ambient_temperature_degc": 99.0}),
        *links("f", "V00000", soc=None, ambient_temperature_degc=None, car_model=None),
    ]
    pq.write_table(pa.Table.from_pylist(table), tmp_path / "in.parquet")
    files = tmp_path / "in.parquet", tmp_path / "out.parquet"
    assert forecast_batch(saved, *files, Workers(), quantiles=(0.1, 0.975), reserve=0.1) == 6
    found = pq.read_table(tmp_path / "out.parquet")
    assert found.schema.names == output_schema((0.1, 0.975)).names
    out = {row["trip"]: row for row in found.to_pylist()}
    assert list(out) == ["b", "a", "c", "d", "e", "f"]  # as in the input
    plan = tw.read_route([{"length_m": 1500.0, "speed_m_s": v} for v in (12.0, 20.0, 15.0)], trip_id="a")
    departure = Departure(soc=0.8, ambient_temperature_degc=4.0)
    own = model.forecast(plan, departure, vehicle_id="V00000")
    unknown = model.forecast(plan, vehicle_id="V00000")
    assert out["a"]["energy_wh"] == pytest.approx(own.energy_wh, rel=1e-12)
    assert out["a"]["energy_wh_q10"] == pytest.approx(own.quantile(0.1), rel=1e-12)
    assert out["a"]["energy_wh_q97_5"] == pytest.approx(own.quantile(0.975), rel=1e-12)
    assert out["a"]["soc_arrival"] == pytest.approx(own.soc_arrival, rel=1e-12)
    ends = [out["a"]["soc_arrival_q10"], out["a"]["soc_arrival_q97_5"]]
    assert ends == pytest.approx([own.arrival.quantile(0.1), own.arrival.quantile(0.975)], rel=1e-12)
    assert out["a"]["p_arrive"] == pytest.approx(own.p_arrive(0.1), rel=1e-12)
    assert (out["a"]["distance_m"], out["a"]["sd_wh"]) == (
        pytest.approx(4500.0, rel=1e-4),
        pytest.approx(own.sd_wh),
    )
    assert out["c"]["energy_wh"] > 0.0
    assert out["f"]["error"] is None
    usual = "ambient_temperature_degc, cabin_temperature_degc, cabin_setpoint_degc, battery_temperature_degc"
    assert out["f"]["assumed"] == f"{usual}, soc"
    assert out["a"]["assumed"] == usual.partition(", ")[2]
    assert out["f"]["flags"] == list(dict.fromkeys(flag.code for flag in unknown.flags))
    assert out["f"]["reasons"].split("; ") == [message(flag).replace("; ", ", ") for flag in unknown.flags]
    assert "soc_assumed" in out["f"]["flags"]
    assert (out["d"]["assumed"], out["d"]["flags"], out["d"]["reasons"]) == (None, None, None)
    assert "such as 'V00000'" in out["d"]["error"]
    assert "unknown vehicle" in out["d"]["error"]
    assert "ambient_temperature_degc" in out["e"]["error"]
    assert out["e"]["energy_wh"] is None


class Stopping(ThreadPoolExecutor):
    """Runs so many tasks, then fails as a batch does that is interrupted."""

    def __init__(self, most):
        super().__init__(1)
        self.left = self.most = most

    def submit(self, fn, /, *args, **kwargs):
        if self.left == 0:
            raise KeyboardInterrupt
        self.left -= 1
        return super().submit(fn, *args, **kwargs)


def test_a_batch_that_was_stopped_goes_on_and_ends_in_the_same_file(saved, tmp_path, monkeypatch):
    monkeypatch.setattr("tripwatt.fleet.batch.TRIPS_PER_PART", 2)
    monkeypatch.setattr("tripwatt.fleet.executors._TASKS_PER_WORKER", 1)
    trips = [links(f"t{k}", f"V{k % 8:05d}", soc=0.5 + 0.05 * k if k else float("nan")) for k in range(9)]
    table = pa.Table.from_pylist([row for trip in trips for row in trip])
    pq.write_table(table, tmp_path / "in.parquet", row_group_size=7)  # trips go on in the next group

    def run(executor, out, reserve=0.0):
        given = (saved, tmp_path / "in.parquet", tmp_path / out, executor)
        return forecast_batch(*given, reserve=reserve)

    assert run(Workers(), "whole") == 9
    assert pq.read_table(tmp_path / "whole")["trip"].to_pylist() == [f"t{k}" for k in range(9)]
    assert "soc_assumed" in pq.read_table(tmp_path / "whole")["flags"][0].as_py()
    with pytest.raises(KeyboardInterrupt):
        run(Workers(Stopping(3)), "out")
    assert not (tmp_path / "out").exists()
    assert len(list((tmp_path / "out.unfinished").iterdir())) == 3
    rest = Stopping(2)  # of five parts
    assert run(Workers(rest), "out") == 9
    assert rest.left == 0
    assert (tmp_path / "out").read_bytes() == (tmp_path / "whole").read_bytes()
    assert not (tmp_path / "out.unfinished").exists()
    with pytest.raises(KeyboardInterrupt):
        run(Workers(Stopping(3)), "out")
    with pytest.raises(KeyboardInterrupt):
        run(Workers(Stopping(4)), "out", reserve=0.2)  # finished parts of another question do not count
    assert len(list((tmp_path / "out.unfinished").iterdir())) == 7


def test_a_batch_without_trips_is_a_file_without_rows(saved, tmp_path):
    pq.write_table(pa.Table.from_pylist(links("a", "b"))[:0], tmp_path / "in.parquet")
    assert forecast_batch(saved, tmp_path / "in.parquet", tmp_path / "out", Workers()) == 0
    assert pq.read_table(tmp_path / "out").schema.names == output_schema((0.05, 0.5, 0.95)).names


def test_a_batch_that_cannot_be_read_is_one_error(tmp_path):
    pq.write_table(pa.table({"trip": ["a"]}), tmp_path / "in.parquet")
    with pytest.raises(InvalidInput) as error:
        forecast_batch(tmp_path, tmp_path / "in.parquet", tmp_path / "o", Workers())
    assert [f.allowed for f in error.value.faults] == ["a column 'vehicle_id'", "a column 'length_m'"]
    with pytest.raises(InvalidInput, match=r"unreadable Parquet file.*to_parquet"):
        forecast_batch(tmp_path, tmp_path / "none", tmp_path / "o", Workers())
    for bad in (0.0, 1.0):
        with pytest.raises(InvalidInput, match="quantiles"):
            forecast_batch(tmp_path, tmp_path / "in.parquet", tmp_path / "o", Workers(), quantiles=(bad,))
    for bad in (-0.1, 1.0):
        with pytest.raises(InvalidInput, match="reserve"):
            forecast_batch(tmp_path, tmp_path / "in.parquet", tmp_path / "o", Workers(), reserve=bad)
    assert [quantile_column(q) for q in (0.5, 0.999)] == ["energy_wh_q50", "energy_wh_q99_9"]


def test_a_column_whose_name_is_no_text_is_a_fault(tmp_path):
    table = pa.table({"trip": ["a"], "vehicle_id": ["v"], "length_m": [1.0], "note": [1]})
    pq.write_table(table, tmp_path / "in.parquet")
    broken = (tmp_path / "in.parquet").read_bytes().replace(b"note", b"no\xffe")
    (tmp_path / "in.parquet").write_bytes(broken)
    with (
        pytest.raises(InvalidInput, match="unreadable Parquet file"),
        _open_parquet(tmp_path / "in.parquet") as file,
    ):
        list(_read_batches(file, "in.parquet"))


def test_what_was_read_of_the_input_is_not_kept(tmp_path):
    rows = 200_000
    lengths = np.random.default_rng(1).uniform(size=rows)
    table = pa.table({"trip": ["t"] * rows, "vehicle_id": ["v"] * rows, "length_m": lengths})
    pq.write_table(table, tmp_path / "in.parquet", row_group_size=4000)
    before = pa.total_allocated_bytes()
    with _open_parquet(tmp_path / "in.parquet") as file:
        assert sum(len(batch) for batch in _read_batches(file, "in.parquet")) == rows
        assert pa.total_allocated_bytes() - before < (tmp_path / "in.parquet").stat().st_size / 4
