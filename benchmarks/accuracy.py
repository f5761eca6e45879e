"""Bars on the accuracy of the product, from results of evaluations: those of a run of now, or of one before."""

from __future__ import annotations

import itertools
import json
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from tools import DATA

from benchmarks import coverage, pipeline, planned
from benchmarks.measure import Row
from tripwatt.study.evaluation.forecast_scores import LEVELS

APE: Final[Mapping[str, float]] = {"boosting": 0.103, "forest": 0.106, "physics": 0.20}
"""Model of the paper's protocol -> largest mean APE."""
UPDATES: Final[Mapping[str, float]] = {"0.1": 0.058, "0.25": 0.060, "0.5": 0.037, "0.75": 0.024}
"""Fraction of the trip's time -> largest mean APE of the re-forecast total."""
ARRIVAL: Final[Mapping[str, tuple[float, float]]] = {"soc": (1.3, 5.5), "bms_soc": (1.7, 7.5)}
"""What was known at departure -> largest mean error of the displayed charge at arrival and widest interval [points]."""
REGIMES: Final[Mapping[str, float]] = {
    "longer third": 1.00,
    "faster third": 0.90,
    "winter, fitted on summer": 0.85,
    "summer, fitted on winter": 1.15,
}
"""Trips of another kind than those fitted on -> widest mean 90 % interval [kWh]."""
LINKS: Final[Mapping[str, float]] = {"250 m": 0.085, "1000 m": 0.095}
"""Length of links -> largest mean APE of the forecast from them."""


def evaluated(protocol: str, results: Path | None) -> tuple[float | None, dict[str, Any]]:
    """The running time [s] and the results of an evaluation of the TUM trips; no time where results of a run before are given."""
    with tempfile.TemporaryDirectory() as scratch:
        out = results or Path(scratch) / "out"
        took = None
        if results is None:
            took = pipeline.evaluating(str(DATA / "tum"), "--protocol", protocol, out=out)
        path = out / "results.json" if out.is_dir() else out
        return took, json.loads(path.read_text(encoding="utf-8"))


def timed(name: str, took: float | None, max_s: float) -> Iterator[Row]:
    """The time of an evaluation that was run now."""
    if took is not None:
        yield Row(name, took, "s", most=max_s)


def _paired(results: Mapping[str, Any], a: str, b: str) -> tuple[float, float, bool]:
    """Mean APE of a less that of b, the upper end of its 95 % interval, and whether it is significant."""
    pair = next(p for p in results["paired"] if {p["a"], p["b"]} == {a, b})
    sign = 1.0 if pair["a"] == a else -1.0
    return sign * pair["diff"], max(sign * end for end in pair["ci95"]), pair["significant"]


def paper(path: Path | None = None) -> Iterator[Row]:
    """Bars on the protocol of the paper."""
    took, results = evaluated("paper", path)
    yield from timed("evaluate the TUM trips, whole protocol", took, 300.0)
    evaluations = {e["trips"]: e for e in results["evaluations"] if e["scheme"] == "leave_one_trip_out"}
    for name, number in (("reference", 58), ("all", 60)):
        yield Row(f"{name} trips", evaluations[name]["n_trips"], least=number, most=number)
    models = evaluations["reference"]["models"]
    for name, most in APE.items():
        yield Row(f"mean APE of {name}, 58 trips", models[name]["mape"], most=most)
    yield Row("mean APE of physics-paper", models["physics-paper"]["mape"], note="0.379 in the paper")
    yield Row("mean APE of the GAMM, errors t", models["gamm"]["mape"], note="0.115 in the paper")
    text = "boosting less boosting without physics: mean APE, upper end of the 95 % interval"
    yield Row(text, _paired(results, "boosting", "boosting-only")[1], most=0.0)
    studied = (results.get("studies") or {}).get("models") or {}
    if "gamm-chosen" in studied:
        text = "mean APE of the GAMM, errors chosen inside the fold"
        yield Row(text, studied["gamm-chosen"]["mape"], most=0.115)
    for name in ("gamm", "forest", "boosting"):
        shares = {"physics-paper": models[name]["improved_share"]["physics-paper"]}
        if f"{name}-brochure" in studied:
            shares["the form nearest to the paper's"] = studied[f"{name}-brochure"]["improved_share"]
        for other, share in shares.items():
            yield Row(f"trips that {name} improves over {other}", share, note="more than 0.9 in the paper")


def forecast(path: Path | None = None) -> Iterator[Row]:
    """Bars on the forecast before departure and on the way."""
    took, results = evaluated("forecast", path)
    yield from timed("evaluate the forecast on the TUM trips", took, 480.0)
    evaluations = results["evaluations"]
    main, by_day = (
        next(e for e in evaluations if (e["scheme"], e["trips"]) == (scheme, "reference"))["models"]["hybrid"]
        for scheme in ("leave_one_trip_out", "leave_one_day_out")
    )
    text = "the forecast on the 58 reference trips"
    yield Row(f"{text}: mean APE", main["mape"], most=0.0605, note="aim 0.055")
    yield Row(f"{text}: RMSE", main["rmse_wh"] / 1000.0, "kWh", most=0.168)
    yield Row(f"{text}, leave one day out: mean APE", by_day["mape"])
    for other in ("physics4", "linear6"):
        off, _, significant = _paired(results, "hybrid", other)
        yield Row(
            f"the forecast less {other}, paired, significant: mean APE", off if significant else 1.0, most=0.0
        )
    for level, (low, high) in main["coverage_ci95"].items():
        note = f"{low:.3f} to {high:.3f}"
        off = max(low - float(level), float(level) - high)
        yield Row(
            f"{text}: {level} outside of the Clopper-Pearson interval of its coverage",
            off,
            most=0.0,
            note=note,
        )
    width = main["interval_width_wh"]["0.9"] / 1000.0
    yield Row(f"{text}: mean width of the 90 % interval", width, "kWh", most=0.60)
    same = main["crps_same_width_wh"]
    yield Row(f"{text}: CRPS against one width for all", main["crps_wh"], "Wh", most=same)
    yield from _updates(main["update"])
    for start, (error, widest) in ARRIVAL.items():
        score, name = main["arrival"][start], f"displayed charge at arrival, from {start}"
        yield Row(f"{name}: mean error", 100.0 * score["mae"], "points", most=error)
        yield Row(f"{name}: 90 % width", 100.0 * score["interval_width"], "points", most=widest)
        yield Row(f"{name}: covers", score["coverage"], least=0.85)
    for evaluation in evaluations:
        if evaluation["scheme"] in ("leave_regime_out", "time_split"):
            score, name = evaluation["models"]["hybrid"], evaluation["trips"]
            yield Row(f"{name}: 90 % interval covers", score["coverage"]["0.9"], least=0.85)
            if name in REGIMES:
                width = score["interval_width_wh"]["0.9"] / 1000.0
                yield Row(f"{name}: its mean width", width, "kWh", most=REGIMES[name])


def _updates(updates: Mapping[str, Any]) -> Iterator[Row]:
    for fraction, row in updates.items():
        name = f"re-forecast after {float(fraction):.0%} of the time"
        others = {"bar": UPDATES.get(fraction, 1.0)} | {n: row[n] for n in ("no_update", "naive_gauge")}
        other, most = min(others.items(), key=lambda item: item[1])
        yield Row(f"{name}: mean APE", row["mape"], most=most, note=other)
        yield Row(f"{name}: 90 % interval covers", row["coverage"], least=0.85)
    widths = [row["interval_width_wh"] for row in updates.values()]
    grows = max(later / before for before, later in itertools.pairwise(widths))
    yield Row("width on the way over the one before, largest", grows, most=1.0001)
    half = updates["0.5"]
    off = half["diff"] if half["significant"] else 1.0
    yield Row("re-forecast after half less no update, paired, significant: mean APE", off, most=0.0)


def synthetic_coverage() -> Iterator[Row]:
    """The 90 % interval on many synthetic trips."""
    score = coverage.synthetic_coverage()
    share = score.share[LEVELS.index(0.9)]
    yield Row(f"90 % interval on {score.trips} synthetic trips covers", share, least=0.88, most=0.92)


def planned_routes(path: Path | None = None) -> Iterator[Row]:
    """Bars on the forecast of planned routes."""
    results = planned.measure(DATA / "tum") if path is None else json.loads(path.read_text(encoding="utf-8"))
    known = results["known"]
    for name in ("driven trace", *LINKS, planned.FREE_FLOW):
        if name in known:
            row = known[name]
            yield Row(f"mean APE of the forecast given {name}", row["mape"], most=LINKS.get(name, 1.0))
            least = 0.85 if name == planned.FREE_FLOW else 0.0
            width = f"width {row['relative_width']['0.9']:.3f} of the energy"
            yield Row(f"90 % interval given {name} covers", row["coverage"]["0.9"], least=least, note=width)
