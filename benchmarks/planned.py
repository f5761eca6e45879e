"""How good the forecast of a planned route is: leave one trip out, each trip once as driven and once from its links.

Run: ``python -m benchmarks.planned --json links.json`` and publish with ``python -m tools.docs.publish_results links.json``.
Needs TRIPWATT_DATA. The 58 TUM reference trips; one fit for each left-out trip of the default corrector on the car's published values,
`hybrid-published` of the protocol `forecast` and not its `hybrid`, whose values are identified; the doubt of planned routes is learned inside the
fold; the same fitted model forecasts the driven trace, which is the best case, the links of 250 m and those of
1 km, all made from the held-out drive, and again after half of the time. A link's speed is its length over its time, standstill included;
elevation is known at the links' ends; stops are not given. Everything else that a forecast knows at departure is the
first sample of the trip.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from tools.command import run
from typer import Option

from benchmarks.measure import tum_folder
from tripwatt.arrays import FloatArray
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.hybrid import segment_trips
from tripwatt.routes import plan_on_links
from tripwatt.sources import read_logs
from tripwatt.study.evaluation.forecast_scores import LEVELS, UPDATE_LEVEL, coverage_scores
from tripwatt.study.evaluation.metrics import absolute_percentage_error, bootstrap_interval, summarise_errors
from tripwatt.trips import Trip
from tripwatt.uncertainty import Coverage, LinkedTrips, linked_trips
from tripwatt.uncertainty.free_flow import FreeFlowTrips
from tripwatt.vehicles import load_vehicle

LINKS_M: Mapping[str, float | None] = {"driven trace": None, "250 m": 250.0, "1000 m": 1000.0}
"""What is known of the speed -> length of the links."""

FREE_FLOW = "free flow"
"""Links with the speed of an empty road by the proxy, the 90th percentile of the held-out drive's own moving speed, and the travel
times that the other trips let expect."""

SEED = 0
PACKAGES = ("numpy", "scipy", "pandas", "scikit-learn", "lightgbm")


def forecasts(trips: Sequence[Trip], folds: int = 0) -> list[dict[str, Forecast]]:
    """Forecasts of every trip, by what is known of its speed, from a model that was fitted without its fold.

    Without a number of folds each trip is one.
    """
    car = load_vehicle("bmw_i3_60ah")
    segments, routes = segment_trips(trips, car), linked_trips(trips, car)
    free = FreeFlowTrips.from_trips(trips, car)
    by_trip: dict[int, dict[str, Forecast]] = {}
    fold = np.arange(len(trips)) % (folds or len(trips))
    for number in range(int(fold.max()) + 1):
        others = np.flatnonzero(fold != number)
        model = ForecastModel(car, seed=SEED).fit_segments(
            segments.take(others),
            routes=LinkedTrips(tuple(routes.tables[i] for i in others)),
            free_flow=FreeFlowTrips.from_trips([trips[i] for i in others], car),
        )
        for k in np.flatnonzero(fold == number).tolist():
            by_trip[k] = _forecasts_of(trips[k], k, model, free)
        print(f"{len(by_trip)} of {len(trips)} trips", file=sys.stderr, flush=True)
    return [by_trip[k] for k in range(len(trips))]


def _forecasts_of(trip: Trip, k: int, model: ForecastModel, free: FreeFlowTrips) -> dict[str, Forecast]:
    made = {
        name: model.forecast(trip if length is None else plan_on_links(trip, length))
        for name, length in LINKS_M.items()
    }
    uncertainty = model.uncertainty_
    assert uncertainty is not None
    assert uncertainty.free_flow is not None
    plan = free.plan(k, uncertainty.free_flow.factors)
    assert plan is not None
    return made | {FREE_FLOW: model.forecast(plan)}


def so_far(trip: Trip, share: float) -> pd.DataFrame:
    """What was measured in the first part of a trip's time, with the car's speed."""
    time = trip.array("time_s") - float(trip.array("time_s")[0])
    columns = trip.samples[["speed_m_s", "voltage_v", "current_a"]].assign(time_s=time)
    return columns[time <= share * time[-1]].reset_index(drop=True)


def updated(trips: Sequence[Trip], made: Sequence[Forecast], share: float = 0.5) -> FloatArray:
    """Energy of the whole trip, forecast again after a part of its time [Wh]."""
    pairs = zip(trips, made, strict=True)
    return np.array([forecast.update(so_far(trip, share)).energy_wh for trip, forecast in pairs])


def scores(trips: Sequence[Trip], made: Sequence[Forecast], driven: Sequence[Forecast]) -> dict[str, Any]:
    """Errors, coverage and width of some forecasts; widths beside those on the driven trace."""
    observed_wh = np.array([t.observed_energy_wh for t in trips], dtype=np.float64)
    energy = np.array([f.energy_wh for f in made])
    base = np.array([f.energy_wh for f in driven])
    bounds = np.array([[f.interval(level) for level in LEVELS] for f in made])
    error = summarise_errors(observed_wh, energy, SEED)
    ape = absolute_percentage_error(observed_wh, energy)
    worse = ape - absolute_percentage_error(observed_wh, base)
    return {
        **error,
        "mape_more_than_driven": float(worse.mean()),
        "mape_more_than_driven_ci95": bootstrap_interval(worse, SEED),
        "mape_after_half": float(absolute_percentage_error(observed_wh, updated(trips, made)).mean()),
        "energy_differs": float(np.mean(np.abs(energy / base - 1.0))),
        **coverage_scores(observed_wh, bounds[:, :, 0], bounds[:, :, 1], SEED),
        "arrival": {"soc": charge_scores(trips, made)},
        "relative_width": {
            f"{level:g}": float(np.mean((bounds[:, j, 1] - bounds[:, j, 0]) / energy))
            for j, level in enumerate(LEVELS)
        },
        "sd_over_driven": float(np.mean([f.sd_wh / d.sd_wh for f, d in zip(made, driven, strict=True)])),
        "by_trip": [
            {
                "trip": f.plan.trip_id,
                "observed_wh": o,
                "energy_wh": f.energy_wh,
                "low_90_wh": f.interval(0.9)[0],
                "high_90_wh": f.interval(0.9)[1],
            }
            for f, o in zip(made, observed_wh.tolist(), strict=True)
        ],
    }


def charge_scores(trips: Sequence[Trip], made: Sequence[Forecast]) -> dict[str, Any] | None:
    """Displayed charge at arrival beside its interval, of the trips that show it; None where none does."""
    rows = [
        (float(trip.samples["displayed_soc"].dropna().iloc[-1]), *forecast.arrival.interval(UPDATE_LEVEL))
        for trip, forecast in zip(trips, made, strict=True)
        if trip.has("displayed_soc") and forecast.plan.departure.soc is not None
    ]
    if not rows:
        return None
    shown, low, high = np.array(rows).T
    coverage = Coverage.from_bounds(shown, low, high, UPDATE_LEVEL)
    return {
        "n_trips": coverage.trips,
        "coverage": coverage.share,
        "coverage_ci95": coverage.ci95,
        "inside": coverage.inside,
        "interval_width": coverage.width,
        "needed_width": coverage.needed_width,
    }


def measure(folder: Path, folds: int = 0) -> dict[str, Any]:
    """The results file; of a number of folds in place of one for each trip."""
    fleet = read_logs(folder)
    trips = fleet.reference_trips()
    by_trip = forecasts(trips, folds)
    driven = [f["driven trace"] for f in by_trip]
    return {
        "protocol": "links",
        "scheme": f"{folds}_folds" if folds else "leave_one_trip_out",
        "trips": "reference",
        "n_trips": len(trips),
        "seed": SEED,
        "data": fleet.name,
        "synthetic": False,
        "citation": fleet.citation,
        "versions": {name: version(name) for name in ("tripwatt", *PACKAGES)},
        "known": {name: scores(trips, [f[name] for f in by_trip], driven) for name in (*LINKS_M, FREE_FLOW)},
    }


def main(json_to: Annotated[Path | None, Option("--json")] = None, folds: int = 0) -> int:
    """Print the figures. `--folds`: so many, which is quicker than one for each trip."""
    folder = tum_folder()
    if folder is None:
        print("no TUM trips at hand: set TRIPWATT_DATA", file=sys.stderr)
        return 1
    result = measure(folder, folds)
    for name, row in result["known"].items():
        print(
            f"{name:>12}: mean APE {row['mape']:.4f}, bias {row['bias']:+.4f}, after half of the time "
            f"{row['mape_after_half']:.4f}, 90 % interval covers "
            f"{row['coverage']['0.9']:.3f}, width {row['relative_width']['0.9']:.3f} of the energy, "
            f"sd {row['sd_over_driven']:.3f} of the driven trace's"
        )
    if json_to:
        json_to.write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    run(main)
