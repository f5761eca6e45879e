"""Trips as one flat table, against arithmetic that is written out here."""

import datetime as dt
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from tests.hybrid.tables import EXACT
from tests.support.refusals import refusal

from tripwatt.hybrid.trip_table import TripTable, build_table
from tripwatt.trips import Context, Trip
from tripwatt.vehicles import load_vehicle


class TestTripTable:
    def trip(self, name="a", context=None, start=50.0, **columns) -> Trip:
        time = start + np.arange(5.0)
        rows = {
            "time_s": time,
            "speed_m_s": [0.0, 10.0, 20.0, 10.0, 10.0],
            "voltage_v": 360.0,
            "current_a": 10.0,
        }
        return Trip.from_samples(name, pd.DataFrame(rows | columns), context or Context())

    def made(self) -> TripTable:
        one = self.trip(context=Context(season="winter"), ambient_temperature_degc=5.0)
        two = self.trip("b", elevation_m=[100.0, 101.0, 102.0, 103.0, 104.0], ambient_temperature_degc=30.0)
        return build_table([one, two, self.trip("c")], {"x": load_vehicle("bmw_i3_60ah")})

    def test_any_energy_above_zero_counts(self) -> None:
        little = self.trip(current_a=0.25)
        assert little.observed_energy_wh == pytest.approx(0.1)
        cars = {"x": load_vehicle("bmw_i3_60ah")}
        assert build_table([little], cars).trip_ids == ("a",)
        allowed = "allowed: voltage and current, or a column observed_energy_wh, above 0 Wh"
        assert refusal(
            build_table, [self.trip(current_a=0.0), replace(self.trip("b"), observed_energy_wh=None)], cars
        ).splitlines() == [
            f"no measured energy: a: got 0 Wh or less; {allowed}",
            f"no measured energy: b: {allowed}",
        ]
        assert refusal(build_table, [], cars).startswith("no trips: training: got 0")

    def test_the_day_of_a_trip_is_its_name_where_no_date_is_known(self) -> None:
        dated = self.trip("b", context=Context(started_at=dt.datetime(2024, 3, 1, 8, 0)))
        made = build_table([self.trip(), dated], {"x": load_vehicle("bmw_i3_60ah")})
        assert made.days == ("a", "2024-03-01")

    def test_running_sums(self) -> None:
        """Of the bin means of 1 s that the table holds; 20 °C is comfortable."""
        made = self.made()
        for i, (cold, hot) in enumerate(((15.0, 0.0), (0.0, 10.0), (0.0, 0.0))):
            rows = slice(int(made.offsets[i]), int(made.offsets[i + 1]))
            own, totals = made.trips[i], made.totals.iloc[rows]
            time, speed = own.array("time_s"), own.array("speed_m_s")
            step = np.concatenate(([0.0], np.diff(time)))
            hours = (time - time[0]) / 3600.0
            assert len(time) >= 4
            assert totals["distance_km"].to_numpy() == pytest.approx(
                np.cumsum(speed * step) / 1000.0, **EXACT
            )
            assert totals["duration_h"].to_numpy() == pytest.approx(hours, **EXACT)
            assert totals["cold_h"].to_numpy() == pytest.approx(cold * hours, **EXACT)
            assert totals["hot_h"].to_numpy() == pytest.approx(hot * hours, **EXACT)
            assert totals["cubed_speed"].to_numpy() == pytest.approx(np.cumsum(speed**3 * step), **EXACT)
            faster = np.concatenate(([0.0], np.maximum(np.diff(speed), 0.0)))
            assert totals["acceleration_work"].to_numpy() == pytest.approx(np.cumsum(faster * speed), **EXACT)

    def test_covariates(self) -> None:
        made = self.made()
        climb = made.covariates["elevation_difference_m"].to_numpy()[made.groups == 1]
        assert climb[0] == 0.0
        assert (np.diff(climb) > 0.0).all()
        assert np.isnan(made.covariates["elevation_difference_m"][made.groups != 1]).all()
        assert set(made.covariates["season"][made.groups == 0]) == {"winter"}
        assert set(made.covariates["season"][made.groups == 1]) == {"unknown"}
        assert made.notes == ("covariate weather dropped: no trip has it",)
        assert "weather" not in made.covariates

    def test_rows(self) -> None:
        made = self.made()
        assert len(made) == 3
        lengths = [len(t) for t in made.trips]
        assert made.offsets.tolist() == np.concatenate(([0], np.cumsum(lengths))).tolist()
        assert made.last_rows.tolist() == (np.cumsum(lengths) - 1).tolist()
        assert made.observed_wh[made.last_rows] == pytest.approx([4.0] * 3, rel=1e-6)
        taken = made.take([2, 0])
        assert taken.trip_ids == ("c", "a")
        assert taken.offsets.tolist() == [0, lengths[2], lengths[2] + lengths[0]]
        rows = made.rows_of(np.array([2, 0]))
        assert taken.observed_wh.tolist() == made.observed_wh[rows].tolist()
        assert taken.simulated("x").tolist() == made.simulated("x")[rows].tolist()
        assert taken.covariates.index.tolist() == list(range(len(rows)))
        assert taken.totals["distance_km"].tolist() == made.totals["distance_km"].iloc[rows].tolist()
        assert made.rows_of(np.array([], dtype=int)).tolist() == []
        assert made.simulated(None).tolist() == [0.0] * len(made.observed_wh)

    def test_digest_and_slim(self) -> None:
        made = self.made()
        assert made.digest() == self.made().digest()
        assert made.take([0, 1]).digest() != made.digest()
        assert replace(made, covariates=made.covariates.iloc[::-1]).digest() != made.digest()
        slim = made.without_samples()
        assert all(len(t.samples) == 0 for t in slim.trips)
        assert slim.digest() == made.digest()
