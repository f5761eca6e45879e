"""On the real trips: the baselines meet the figures that others got for them, so trips and energies are the same."""

from dataclasses import replace

import pytest

from tripwatt.sources import read_logs
from tripwatt.study.evaluation import Execution, evaluate
from tripwatt.study.evaluation.paper_protocol import _usable
from tripwatt.study.synthetic import synthetic_fleet


@pytest.fixture(scope="module")
def main_row(data_dir):
    run = evaluate(
        read_logs(data_dir / "tum", "tum"),
        models=("constant", "linear4", "physics"),
        hold_outs="leave_one_trip_out:reference",
        execution=Execution(n_jobs=1),
    )
    row = run.results["evaluations"][0]
    assert (row["scheme"], row["trips"], row["n_trips"]) == ("leave_one_trip_out", "reference", 58)
    return row["models"]


@pytest.mark.parametrize(("name", "peers_mape"), [("constant", 0.202), ("linear4", 0.122)])
def test_baselines_meet_the_published_figures(main_row, name, peers_mape):
    assert main_row[name]["mape"] == pytest.approx(peers_mape, abs=0.0015)


def test_default_physics_stays_within_its_bar(main_row):
    assert main_row["physics"]["mape"] <= 0.20


def test_a_row_of_unaudited_trips_names_what_it_leaves_out():
    first, second, third = synthetic_fleet(3).trips
    bare = replace(second, observed_energy_wh=None)
    gains = replace(third, observed_energy_wh=-5.0)
    usable, notes = _usable([first, bare, gains])
    assert usable == [first]
    assert notes == [
        f"unaudited row leaves out no measured, positive energy: {trip.trip_id}" for trip in (second, third)
    ]
