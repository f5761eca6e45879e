"""Forecasts of many planned trips."""

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.fleet.batch import forecast_batch, quantile_column, schema_of
from tripwatt.fleet.executors import InProcess
from tripwatt.fleet.storage import save_fleet
from tripwatt.trips import Departure

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def links(trip, vehicle, **more):
    return [
        {"trip": trip, "vehicle_id": vehicle, "length_m": 1500.0, "speed_m_s": v, **more}
        for v in (12.0, 20.0, 15.0)
    ]


def test_a_batch_is_the_forecasts_of_its_trips(fleet, tmp_path):
    import tripwatt as tw

    *_, model, _ = fleet
    save_fleet(model, tmp_path / "m")
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
    count = forecast_batch(
        tmp_path / "m",
        tmp_path / "in.parquet",
        tmp_path / "out.parquet",
        InProcess(),
        quantiles=(0.1, 0.975),
        reserve=0.1,
    )
    assert count == 6
    found = pq.read_table(tmp_path / "out.parquet")
    assert found.schema.names == schema_of((0.1, 0.975)).names
    out = {row["trip"]: row for row in found.to_pylist()}
    assert list(out) == ["a", "e", "f", "b", "c", "d"]  # by vehicle and trip
    plan = tw.read_route([{"length_m": 1500.0, "speed_m_s": v} for v in (12.0, 20.0, 15.0)], trip_id="a")
    departure = Departure(soc=0.8, ambient_temperature_degc=4.0)
    own = model.forecast(plan, departure, vehicle_id="V00000")
    assert out["a"]["energy_wh"] == pytest.approx(own.energy_wh, rel=1e-12)
    assert out["a"]["energy_wh_q10"] == pytest.approx(own.quantile(0.1), rel=1e-12)
    assert out["a"]["energy_wh_q97_5"] == pytest.approx(own.quantile(0.975), rel=1e-12)
    assert out["a"]["soc_arrival"] == pytest.approx(own.soc_arrival, rel=1e-12)
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
    assert out["d"]["assumed"] is None
    assert "such as 'V00000'" in out["d"]["error"]
    assert "unknown vehicle" in out["d"]["error"]
    assert "ambient_temperature_degc" in out["e"]["error"]
    assert out["e"]["energy_wh"] is None


def test_a_batch_that_cannot_be_read_is_one_error(fleet, tmp_path):
    pq.write_table(pa.table({"trip": ["a"]}), tmp_path / "in.parquet")
    with pytest.raises(InvalidInput) as error:
        forecast_batch(tmp_path, tmp_path / "in.parquet", tmp_path / "o", InProcess())
    assert [f.allowed for f in error.value.faults] == ["a column 'vehicle_id'", "a column 'length_m'"]
    with pytest.raises(InvalidInput, match=r"unreadable Parquet file.*to_parquet"):
        forecast_batch(tmp_path, tmp_path / "none", tmp_path / "o", InProcess())
    for bad in (0.0, 1.0):
        with pytest.raises(InvalidInput, match="quantiles"):
            forecast_batch(tmp_path, tmp_path / "in.parquet", tmp_path / "o", InProcess(), quantiles=(bad,))
    for bad in (-0.1, 1.0):
        with pytest.raises(InvalidInput, match="reserve"):
            forecast_batch(tmp_path, tmp_path / "in.parquet", tmp_path / "o", InProcess(), reserve=bad)
    assert [quantile_column(q) for q in (0.05, 0.5, 0.999)] == [
        "energy_wh_q05",
        "energy_wh_q50",
        "energy_wh_q99_9",
    ]
