"""The page on a fleet."""

import pandas as pd
import pytest

from tripwatt.evaluation.fleets import FleetEvaluation
from tripwatt.report.fleets import plot_shares, report_page

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def test_the_page_has_every_table_and_escapes_names():
    trips = pd.DataFrame(
        {
            "protocol": "later trips",
            "car_model": "<b>",
            "vehicle_id": ["v&1"] * 12,
            "distance_m": 12e3,
            "ambient_temperature_degc": 5.0,
            "observed_wh": 1000.0,
            "predicted_wh": 1100.0,
            "low_wh": 900.0,
            "high_wh": [1200.0] * 9 + [950.0] * 3,
        }
    )
    own = pd.DataFrame(
        [(0, 3, 0.05, 0.2, 0.05)], columns=["own_trips", "vehicles", "pooled", "own_only", "fleet_only"]
    )
    vehicles = pd.DataFrame(
        [("v&1", "<b>", 12, 0.1, 0.02, "2024-06-01", 0.08), ("v2", "<b>", 9, -0.05, 0.02, None, 0.0)],
        columns=["vehicle_id", "car_model", "trips", "share", "sd", "since", "change"],
    )
    page = report_page("Fleet <1>", FleetEvaluation(trips, own), vehicles)
    assert "<h1>Fleet &lt;1&gt;</h1>" in page
    assert "<b>" not in page
    assert "<script" not in page
    for text in (
        "<dt>Trips</dt><dd>21</dd>",
        "<dt>Vehicles</dt><dd>2</dd>",
        "<dt>With a change</dt><dd>1</dd>",
        "10.0 % on later trips",
        "v&amp;1",
        "+10.0 ± 2.0",
        "+8.0 % since 2024-06-01",
        "By outside temperature",
        "0 to 10 °C",
        "10 to 25 km",
        "<td>10.0</td>\n<td>75</td>",
        "<td>5.0</td>\n<td>20.0</td>\n<td>5.0</td>",
    ):
        assert text in page, text
    assert "v2" not in report_page("F", FleetEvaluation(trips, own), vehicles, most=1)


def test_the_bars_are_the_shares_of_the_vehicles():
    vehicles = pd.DataFrame({"vehicle_id": ["$a", "b"], "share": [0.1, -0.05], "sd": [0.02, 0.01]})
    (axes,) = plot_shares(vehicles).axes
    assert [bar.get_width() for bar in axes.patches] == pytest.approx([10.0, -5.0])
    assert [label.get_text() for label in axes.get_yticklabels()] == ["$a", "b"]
