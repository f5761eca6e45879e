"""Frozen answers of a checkout, to move and delete code without a change of a number: ``python -m tools.quality.golden OUT.json``.

Two such files are compared by ``python -m tools.quality.same_numbers results OLD.json NEW.json``. They hold whole forecasts of the probe's
trips and cars, their updates on the way, planned routes, need and range, one evaluation of each protocol, the documents of a drive that arrives
over a bad connection with restarts, and the rows that are kept of dirty logs.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

import tripwatt as tw
from tools.command import run
from tools.data.dirty_logs import FORMATS, write_dirty_folder
from tools.quality import probe
from tripwatt.errors import InvalidInput
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.routes import plan_on_links
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.telemetry import Sample
from tripwatt.study.evaluation import Execution
from tripwatt.study.evaluation.forecast_data import measured_log
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Plan

Answers = dict[str, Any]

DRIVEN: Final = (0.2, 0.5, 0.8)
"""Shares of the time after which a trip is forecast again."""
MODELS: Final = {
    "paper": ("constant", "linear4", "physics", "gamm", "forest", "boosting"),
    "forecast": ("physics", "power-gamm", "hybrid"),
}
TRIPS: Final = 12
"""Of the evaluations."""
RESTART_EACH: Final = 100
"""Messages after which the car's process begins again."""
DRIVE_S: Final = 1.7e9


def forecasts(models: dict[str, ForecastModel]) -> Answers:
    """Every car on every drive of the probe, as `Forecast.to_dict`."""
    return {
        f"{name}, {k}": dict(model.forecast(plan).to_dict())
        for name, model in models.items()
        for k, plan in enumerate(probe.plans())
    }


def updates(model: ForecastModel) -> Answers:
    """Forecasts on the way."""

    def at(forecast: Forecast, share: float, k: int) -> Answers:
        log = measured_log(probe.trips()[k])
        return dict(forecast.update(log[log["time_s"] <= share * log["time_s"].iloc[-1]]).to_dict())

    before = [model.forecast(Plan.from_trip(trip)) for trip in probe.trips()[::4]]
    return {f"{k}, {share}": at(one, share, 4 * k) for k, one in enumerate(before) for share in DRIVEN}


def without_a_trace(models: dict[str, ForecastModel]) -> Answers:
    """Planned routes, and distances of which the kind of road is known at most."""
    first, *_ = models.values()
    links = {
        trip.trip_id: first.forecast(plan_on_links(trip, probe.LINK_M)).to_dict() for trip in probe.trips()
    }
    cold = tw.Departure(ambient_temperature_degc=-5.0)
    kinds: Answers = {
        f"{name}, {kind}": [
            tw.need(20.0, kind, cold, model=model).to_dict(),
            tw.range_km(0.7, kind, model=model).to_dict(),
        ]
        for name, model in models.items()
        for kind in ("city", "mixed")
    }
    return links | kinds


def evaluations() -> Answers:
    """Results and every held-out prediction of one run of each protocol."""
    runs = {
        name: tw.evaluate(
            synthetic_fleet(TRIPS), protocol=name, models=list(models), execution=Execution(n_jobs=1)
        )
        for name, models in MODELS.items()
    }
    return {
        name: {"results": done.results, "folds": done.folds.to_dict("list")} for name, done in runs.items()
    }


def on_the_road(model: ForecastModel) -> Iterator[Answers]:
    """Documents of a drive whose messages come late, doubled and over restarts of the process."""
    samples = probe.trips()[0].samples
    messages = [
        Sample(
            DRIVE_S + float(row["time_s"]), {name: float(row[name]) for name in row.index if name != "time_s"}
        )
        for _, row in samples[["time_s", "speed_m_s", "voltage_v", "current_a"]].iterrows()
    ]
    order = np.argsort(
        np.arange(len(messages)) + np.random.default_rng(probe.SEED).uniform(0.0, 5.0, len(messages))
    )
    sent = [messages[k] for k in order.tolist() for _ in range(1 + k % 3 // 2)]
    plan = Plan.from_trip(probe.trips()[0])
    with tempfile.TemporaryDirectory() as place:
        for start in range(0, len(sent), RESTART_EACH):
            with Car.follow(Path(place) / "car") as car:
                became = [car.record(sample) for sample in sent[max(0, start - 20) : start + RESTART_EACH]]
                updated = car.update(model.forecast(plan))
                yield {
                    "became": became,
                    "rows": len(car.observed()),
                    "energy_wh": updated.energy_wh,
                    "counts": dict(car.counts),
                }


def dirty_logs() -> Answers:
    """Rows that are kept of each file of one dirty folder of each format, or why the folder is refused."""
    kept: Answers = {}
    for logger in FORMATS:
        with tempfile.TemporaryDirectory() as place:
            write_dirty_folder(Path(place) / "logs", logger, probe.SEED)
            try:
                fleet = tw.read_logs(Path(place) / "logs", "table", car=tw.load_vehicle("nissan_leaf_40"))
            except InvalidInput as error:
                kept[logger] = [fault.what for fault in error.faults]
                continue
            kept[logger] = {
                "logs": {
                    log.trip_id: [len(log), float(np.nansum(log.samples.to_numpy(np.float64)))]
                    for log in fleet.logs
                },
                "files": {
                    file.name: [file.rows, file.rows_used]
                    for file in (fleet.report.files if fleet.report else ())
                },
            }
    return kept


def main(out: Path) -> None:
    """Write the answers of this checkout."""
    models = probe.models()
    model = models[probe.CARS[0]]
    answers = {
        "forecasts": forecasts(models),
        "updates": updates(model),
        "without a trace": without_a_trace(models),
        "evaluations": evaluations(),
        "on the road": list(on_the_road(model)),
        "dirty logs": dirty_logs(),
    }
    out.write_text(json.dumps(answers, default=str), "utf-8")


if __name__ == "__main__":
    run(main)
