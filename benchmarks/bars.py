"""The project's own bars, each with its figure: `python -m benchmarks.bars [--results DIR] [--forecast DIR] [--links FILE]`.

Prints a table and ends with code 1 when a bar is missed. A bar whose data or extra is not at hand is listed as not
measured. Accuracy comes from the `results.json` of an evaluation of the TUM trips: one that is run here, or with
`--results` one that was run before (its running time is then not measured); that of planned routes likewise from
`benchmarks.planned`, or with `--links` from its results.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools import DATA, REFERENCE, ROOT
from tools.command import run

from benchmarks import (
    anchors,
    argonne,
    coverage,
    gam,
    half_known,
    hostile,
    leave_with,
    live,
    physics_trips,
    pipeline,
    planned,
    service,
    six_numbers,
    unknown_climb,
    ved_trips,
)
from benchmarks import forecast as forecast_speed
from benchmarks import journeys as journeys_of
from benchmarks.measure import RUNS, Row, data_folder, tum_folder
from tripwatt.sources.tum import REFERENCE_TRIPS

NOT_AT_HAND = "not at hand"
EVALUATE = "tripwatt evaluate DATA/tum --protocol paper"


@dataclass(frozen=True)
class Bar:
    """One bar. `met` is None where nothing was measured or the bar asks for a figure only."""

    text: str
    measure: str
    figure: str
    required: str
    met: bool | None

    @property
    def verdict(self) -> str:
        if self.met is None:
            return "not measured" if self.figure.startswith(NOT_AT_HAND) else "shown"
        return "yes" if self.met else "NO"


def at_most(text: str, measure: str, value: float, bound: float, unit: str = "") -> Bar:
    return Bar(text, measure, f"{value:.4g} {unit}".strip(), f"<= {bound:g} {unit}".strip(), value <= bound)


def at_least(text: str, measure: str, value: float, bound: float, unit: str = "") -> Bar:
    return Bar(text, measure, f"{value:.4g} {unit}".strip(), f">= {bound:g} {unit}".strip(), value >= bound)


def shown(text: str, measure: str, figure: str, beside: str) -> Bar:
    return Bar(text, measure, figure, beside, None)


def missing(text: str, measure: str, why: str = "") -> Bar:
    return Bar(text, measure, f"{NOT_AT_HAND}{': ' if why else ''}{why}", "", None)


def accuracy(results: Mapping[str, Any]) -> Iterator[Bar]:
    """Bars on the error of the energy, from a `results.json`."""
    evaluations = {(e["scheme"], e["trips"]): e for e in results["evaluations"]}
    main = evaluations["leave_one_trip_out", "reference"]
    models = main["models"]
    sizes = [evaluations["leave_one_trip_out", name]["n_trips"] for name in ("reference", "audited", "all")]
    yield Bar(
        "reference, audited and all trips are rows of their own",
        EVALUATE,
        ", ".join(map(str, sizes)),
        "58, any, 60",
        (sizes[0], sizes[2]) == (58, 60),
    )
    for name, aim in (("forest", 0.106), ("boosting", 0.103)):
        mape = models[name]["mape"]
        yield at_most(f"mean APE of {name}, 58 trips", EVALUATE, mape, 0.110)
        yield shown(f"mean APE of {name} beside the paper's", EVALUATE, f"{mape:.4f}", f"aim {aim}")
    yield _clearly_worse(results)
    crude = models["physics-paper"]["mape"]
    yield shown(
        "mean APE of physics-paper beside the paper's", EVALUATE, f"{crude:.4f}", "0.379 in the paper"
    )
    for name in ("gamm", "forest", "boosting"):
        share = models[name]["improved_share"]["physics-paper"]
        yield shown(
            f"trips that {name} improves over physics-paper", EVALUATE, f"{share:.0%}", "> 90 % in the paper"
        )
    yield at_most("mean APE of physics, default preset", EVALUATE, models["physics"]["mape"], 0.20)
    yield at_most("mean APE of the boosting as in the paper", EVALUATE, models["boosting"]["mape"], 0.103)
    yield at_most("mean APE of the forest as in the paper", EVALUATE, models["forest"]["mape"], 0.106)
    yield shown(
        "mean APE of the GAMM, errors t", EVALUATE, f"{models['gamm']['mape']:.4f}", "0.115 in the paper"
    )
    studied = (results.get("studies") or {}).get("models") or {}
    if "gamm-chosen" in studied:
        chosen = studied["gamm-chosen"]["mape"]
        yield at_most("mean APE of the GAMM, errors chosen inside the fold", EVALUATE, chosen, 0.115)
    for name in ("gamm", "forest", "boosting"):
        if f"{name}-brochure" in studied:
            share = studied[f"{name}-brochure"]["improved_share"]
            yield shown(
                f"trips that {name} improves over the form nearest to the paper's",
                EVALUATE,
                f"{share:.0%}",
                "> 90 % in the paper",
            )


def _clearly_worse(results: Mapping[str, Any]) -> Bar:
    pairs = {frozenset((p["a"], p["b"])): p for p in results["paired"]}
    pair = pairs[frozenset(("boosting", "boosting-only"))]
    sign = 1.0 if pair["a"] == "boosting-only" else -1.0
    low = min(sign * bound for bound in pair["ci95"])
    text = "boosting without physics is worse: mean APE more, lower end of the 95 % interval"
    return Bar(text, EVALUATE, f"{sign * pair['diff']:+.3f}, {low:+.3f}", "> 0", low > 0)


FORECAST = "tripwatt evaluate DATA/tum --protocol forecast"
UPDATE_BARS = {"0.1": 0.058, "0.25": 0.060, "0.5": 0.037, "0.75": 0.024}
"""Fraction of the trip's time -> largest mean APE of the re-forecast total."""
ARRIVAL_BARS = {"soc": (1.3, 5.5), "bms_soc": (1.7, 7.5)}
"""What was known at departure -> largest mean error of the displayed charge at arrival and widest interval [points]."""
REGIME_WIDTH_KWH = {
    "longer third": 1.00,
    "faster third": 0.90,
    "winter, fitted on summer": 0.85,
    "summer, fitted on winter": 1.15,
}
"""Trips of another kind than those fitted on -> widest mean 90 % interval."""


def forecast_accuracy(results: Path | None) -> Iterator[Bar]:
    """Bars on the forecast before departure and on the way, from a `results.json` of its protocol."""
    text = "the forecast on the 58 reference trips"
    folder = tum_folder()
    if results is None and folder is None:
        yield missing(text, FORECAST)
        return
    with tempfile.TemporaryDirectory() as scratch:
        if results is None:
            out = Path(scratch) / "forecast"
            seconds = pipeline.evaluating(str(folder), "--protocol", "forecast", out=out, runs=1)
            yield at_most("the whole evaluation of the forecast", FORECAST, seconds / 60.0, 8.0, "min")
            results = out
        path = results / "results.json" if results.is_dir() else results
        found = json.loads(path.read_text(encoding="utf-8"))
    main, by_day = (
        next(e for e in found["evaluations"] if (e["scheme"], e["trips"]) == (scheme, "reference"))
        for scheme in ("leave_one_trip_out", "leave_one_day_out")
    )
    score = main["models"]["hybrid"]
    yield at_most(f"{text}: mean APE", FORECAST, score["mape"], 0.0605)
    yield shown(f"{text}: mean APE beside the aim", FORECAST, f"{score['mape']:.4f}", "aim 0.055")
    yield at_most(f"{text}: RMSE", FORECAST, score["rmse_wh"] / 1000.0, 0.168, "kWh")
    yield shown(f"{text}, leave one day out", FORECAST, f"{by_day['models']['hybrid']['mape']:.4f}", "")
    yield from _paired_forecast(found)
    for level, (low, high) in score["coverage_ci95"].items():
        figure = f"{score['coverage'][level]:.3f}, {low:.3f} to {high:.3f}"
        name = f"{text}: coverage, its Clopper-Pearson interval holds {level}"
        yield Bar(name, FORECAST, figure, level, low <= float(level) <= high)
    width = score["interval_width_wh"]["0.9"] / 1000.0
    yield at_most(f"{text}: mean width of the 90 % interval", FORECAST, width, 0.60, "kWh")
    same = score["crps_same_width_wh"]
    yield at_most(f"{text}: CRPS against one width for all", FORECAST, score["crps_wh"], same, "Wh")
    for fraction, row in score["update"].items():
        name = f"re-forecast after {float(fraction):.0%} of the time"
        if fraction in UPDATE_BARS:
            yield at_most(f"{name}: mean APE", FORECAST, row["mape"], UPDATE_BARS[fraction])
        for other in ("no_update", "naive_gauge"):
            yield at_most(f"{name}: mean APE beside {other}", FORECAST, row["mape"], row[other])
        yield at_least(f"{name}: 90 % interval covers", FORECAST, row["coverage"], 0.85)
    widths = [row["interval_width_wh"] for row in score["update"].values()]
    grows = any(later > 1.0001 * before for before, later in itertools.pairwise(widths))
    figure = ", ".join(f"{width:.0f}" for width in widths)
    yield Bar("width on the way, never above the one before", FORECAST, f"{figure} Wh", "falling", not grows)
    yield from _arrival(score["arrival"])
    yield from _regimes(found["evaluations"])
    half = score["update"]["0.5"]
    figure = f"{half['diff']:+.4f}, {half['diff_ci95'][0]:+.4f} to {half['diff_ci95'][1]:+.4f}"
    met = half["significant"] and half["diff"] < 0
    yield Bar("re-forecast after half: better than no update", FORECAST, figure, "significant", met)


def _arrival(arrival: Mapping[str, Any]) -> Iterator[Bar]:
    for start, (most_points, widest_points) in ARRIVAL_BARS.items():
        found, text = arrival[start], f"displayed charge at arrival, from {start}"
        yield at_most(f"{text}: mean error", FORECAST, 100.0 * found["mae"], most_points, "points")
        yield at_most(
            f"{text}: 90 % width", FORECAST, 100.0 * found["interval_width"], widest_points, "points"
        )
        yield at_least(f"{text}: covers", FORECAST, found["coverage"], 0.85)


def _regimes(evaluations: Sequence[Mapping[str, Any]]) -> Iterator[Bar]:
    for evaluation in evaluations:
        if evaluation["scheme"] not in ("leave_regime_out", "time_split"):
            continue
        score, name = evaluation["models"]["hybrid"], evaluation["trips"]
        yield at_least(f"{name}: 90 % interval covers", FORECAST, score["coverage"]["0.9"], 0.85)
        width = score["interval_width_wh"]["0.9"] / 1000.0
        if name in REGIME_WIDTH_KWH:
            yield at_most(f"{name}: its mean width", FORECAST, width, REGIME_WIDTH_KWH[name], "kWh")


def _paired_forecast(found: Mapping[str, Any]) -> Iterator[Bar]:
    pairs = {frozenset((p["a"], p["b"])): p for p in found["paired"]}
    for other in ("physics4", "linear6"):
        pair = pairs[frozenset(("hybrid", other))]
        sign = 1.0 if pair["a"] == "hybrid" else -1.0
        figure, met = f"{sign * pair['diff']:+.4f}", pair["significant"] and sign * pair["diff"] < 0
        yield Bar(f"the forecast against {other}, paired", FORECAST, figure, "significant, below 0", met)


def synthetic_coverage() -> Iterator[Bar]:
    """The 90 % interval on many synthetic trips."""
    found = coverage.synthetic_coverage()
    share = found.share[coverage.LEVELS.index(0.9)]
    text = f"90 % interval on {found.trips} synthetic trips covers"
    measure = "python -m benchmarks.coverage"
    yield Bar(text, measure, f"{share:.3f}", "0.88 to 0.92", 0.88 <= share <= 0.92)


def physics() -> Iterator[Bar]:
    """Bars on the physics alone: the dynamometer's rows and the closure of the energy."""
    text, measure = (
        "moving parts: worst row at 21-25 °C of Argonne's dynamometer",
        "python -m benchmarks.argonne",
    )
    if (DATA / "cycles").is_dir() and (REFERENCE / "anl_d3_i3.csv").is_file():
        worst = argonne.summary(argonne.argonne_rows(DATA, REFERENCE))["worst_error_21_to_25_degc"]
        yield at_most(text, measure, worst, 0.08)
    else:
        yield missing(text, measure)
    text, measure = "energy closes: worst relative gap of the parts", "python -m benchmarks.physics_trips"
    folder = tum_folder()
    if folder is None:
        yield missing(text, measure)
        return
    from tripwatt.sources import read_logs
    from tripwatt.trips import resample
    from tripwatt.vehicles import load_vehicle

    trips = [resample(trip) for trip in read_logs(folder).trips]
    for preset in ("default", "paper"):
        gap = physics_trips.worst_closure(load_vehicle("bmw_i3_60ah", preset), trips)
        yield at_most(f"{text}, preset {preset}", measure, gap, 1e-9)


def leafs() -> Iterator[Bar]:
    """Bars on the physics alone on the VED's Leafs, on which nothing is fitted."""
    from tripwatt.sources import read_logs
    from tripwatt.vehicles import load_vehicle

    text, measure = "physics of the VED's Leafs, trips over 2 km", "python -m benchmarks.ved_trips"
    folder = data_folder("ved")
    if folder is None:
        yield missing(text, measure)
        return
    results = ved_trips.outcomes(read_logs(folder, "ved").trips, load_vehicle(ved_trips.CAR))
    for row in ved_trips.scores(results):
        name = f"{text}, {row.name}, {row.n_trips} trips"
        if row.name not in ved_trips.BARS_ON:
            yield shown(name, measure, f"{row.error:.3f}, bias {row.bias:+.3f}", "")
            continue
        yield at_most(f"{name}: energy-weighted error", measure, row.error, ved_trips.ERROR_BAR)
        yield at_most(f"{name}: size of the bias", measure, abs(row.bias), ved_trips.BIAS_BAR)


Made = Callable[[str, str, Row], Bar]


def value_at_most(bound: float) -> Made:
    return lambda text, measure, row: at_most(text, measure, row.value, bound, row.unit)


def value_at_least(bound: float) -> Made:
    return lambda text, measure, row: at_least(text, measure, row.value, bound, row.unit)


def ratio_at_least(bound: float) -> Made:
    return lambda text, measure, row: at_least(f"{text}, times {row.peer}", measure, row.ratio or 0.0, bound)


SPEED: Mapping[str, tuple[Made, ...]] = {
    "simulate the trips at 1 Hz, one process": (value_at_least(1e6), ratio_at_least(20)),
    "read the TUM trips": (value_at_most(4.0),),
    pipeline.READ_VED: (value_at_most(3.0),),
    "peak memory of reading the TUM trips": (value_at_most(1024.0),),
    pipeline.EVALUATE_TUM: (
        value_at_most(300.0),
        lambda text, measure, row: value_at_most(480.0)(f"{text}, the GAMM included", measure, row),
    ),
    pipeline.EVALUATE_SYNTHETIC: (value_at_most(60.0),),
}
"""Row of `benchmarks.pipeline` -> its bars."""

GAM_SPEED: Mapping[str, tuple[Made, ...]] = {
    "gam ps scat, 78,735 rows": (ratio_at_least(5),),
    "gam paper scat, 78,735 rows": (value_at_most(10.0),),
    "gam table2 scat, 78,735 rows": (value_at_most(10.0),),
    "gam ps scat, leave one trip out, 60 folds, 78,735 rows": (value_at_most(60.0),),
    "gam paper scat, leave one trip out, 60 folds, 78,735 rows": (value_at_most(60.0),),
    "gam table2 scat, leave one trip out, 60 folds, 78,735 rows": (value_at_most(60.0),),
    "gam ps scat, 787,129 rows": (value_at_most(20.0),),
    "peak memory of all of these": (value_at_most(700.0),),
}
"""Row of `benchmarks.gam` -> its bars."""


FORECAST_SPEED: Mapping[str, tuple[Made, ...]] = {
    forecast_speed.ONE: (value_at_most(5.0),),
    forecast_speed.COMMAND: (value_at_most(1.5),),
    forecast_speed.FIT_TUM: (value_at_most(60.0),),
    forecast_speed.LONG: (value_at_most(25.0),),
    forecast_speed.LONG_UPDATE: (value_at_most(15.0),),
    forecast_speed.GROWTH: (value_at_most(1.1),),
    forecast_speed.GROWTH_UPDATE: (value_at_most(1.1),),
}
"""Row of `benchmarks.forecast` -> its bars."""


SERVICE: Mapping[str, tuple[Made, ...]] = {
    service.P50_SAMPLES: (value_at_most(15.0),),
    service.P99_SAMPLES: (value_at_most(60.0),),
    service.ERRORS: (value_at_most(0.0),),
    service.MEMORY: (value_at_most(0.10),),
    service.P50_LINKS: (value_at_most(8.0),),
    service.BATCH_RATE: (value_at_least(200.0),),
    service.KILLED: (value_at_most(0.0),),
    service.SCHEMA: (value_at_most(0.0),),
    service.FUZZ: (value_at_most(0.0),),
}
"""Row of `benchmarks.service` -> its bars."""

LEAVE_WITH: Mapping[str, tuple[Made, ...]] = {
    leave_with.LARGEST: (value_at_most(leave_with.WORST),),
    leave_with.UNEXPLAINED: (value_at_most(0.0),),
    leave_with.DEPENDS: (value_at_most(0.001),),
    leave_with.HTTP: (value_at_most(leave_with.WORST),),
}
"""Row of `benchmarks.leave_with` -> its bars."""

HOSTILE: Mapping[str, tuple[Made, ...]] = {
    hostile.MUTANTS_NUMBER: (value_at_least(50_000.0),),
    hostile.MUTANTS_WRONG: (value_at_most(0.0),),
    hostile.CARS_WRONG: (value_at_most(0.0),),
    hostile.MEMORY: (value_at_most(1.5),),
    hostile.MEDIAN: (value_at_most(250.0),),
    hostile.P99: (value_at_most(500.0),),
    hostile.FORECASTS: (value_at_most(1.0),),
    hostile.REFUSED: (value_at_most(0.0),),
    hostile.AFTER: (value_at_most(0.10),),
    hostile.WRITES: (value_at_most(0.0),),
    hostile.WORKERS: (value_at_most(0.0),),
}
"""Row of `benchmarks.hostile` -> its bars."""


def speed(
    rows: Iterator[Row], bars: Mapping[str, tuple[Made, ...]], measure: str, why: str = ""
) -> Iterator[Bar]:
    """Bars on measured rows, and those of the rows that were not measured, with the reason."""
    seen = set()
    for row in rows:
        seen.add(row.name)
        for made in bars.get(row.name, ()):
            yield made(row.name, measure, row)
        if row.name not in bars:
            yield shown(row.name, measure, f"{row.value:.4g} {row.unit}", "")
    yield from (missing(name, measure, why) for name in bars if name not in seen)


GAM_TESTS: Mapping[str, str] = {
    "equal to mgcv on the synthetic sets": "tests/gam/test_engine_mgcv.py -k 'not real and not nested'",
    "equal to mgcv's bam and gam on the TUM regressions": "tests/gam/test_engine_mgcv.py -k 'real or nested'",
    "summary and tests equal to mgcv's": "tests/gam/test_summary.py tests/gam/test_inference.py",
    "laws of the GAMM": "tests/gam/test_engine_laws.py",
}
"""Bars of the GAMM that are tests of the gate -> what pytest runs."""


def gam_tests() -> Iterator[Bar]:
    """The bars that tests of the gate measure: passed, failed, skipped."""
    import shlex

    for text, selection in GAM_TESTS.items():
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *shlex.split(selection)],
            cwd=ROOT, capture_output=True, text=True, check=False,
        )  # fmt: skip
        last = done.stdout.strip().splitlines()[-1] if done.stdout.strip() else done.stderr.strip()[-80:]
        counts = {word: int(n) for n, word in re.findall(r"(\d+) (passed|failed|skipped|error)", done.stdout)}
        measure = f"pytest {selection}"
        if done.returncode == 0 and not counts.get("passed") and "skipped" in last:
            yield missing(text, measure)
        else:
            figure = ", ".join(f"{n} {word}" for word, n in counts.items()) or f"code {done.returncode}"
            yield Bar(
                text,
                measure,
                figure,
                "all pass, none skipped",
                done.returncode == 0 and "skipped" not in counts,
            )


def certified() -> Iterator[Bar]:
    """The cars of the library against their certified consumption, before and after their anchors."""
    outcomes = anchors.committed()
    for name, figure in anchors.figures_of_bars(outcomes).items():
        done = anchors.met(name, figure)
        yield Bar(
            f"library: {name}", "python -m benchmarks.anchors", f"{figure:.4g}", anchors.limit(name), done
        )
    measure = "python -m benchmarks.six_numbers"
    if (six_numbers.CATALOGUE / "wltp.csv").is_file():
        for what, trials in (
            ("without the consumption", six_numbers.without_consumption()),
            ("with the label of the EPA alone", six_numbers.with_label()),
        ):
            held, width = six_numbers.summary(list(trials))
            text = f"described cars {what}: WLTP figure inside the 90 % interval"
            yield at_least(text, measure, held, six_numbers.LEAST_HELD)
            yield at_most(f"described cars {what}: median width", measure, width, six_numbers.MOST_WIDTH)
    else:
        yield missing("described cars: WLTP figure inside the 90 % interval", measure, "no lists of cars")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", *EVERY_CAR],
        cwd=ROOT,
        env={**os.environ, "TRIPWATT_EVERY_CAR": "1"},
        check=False,
    )
    figure = "pass" if done.returncode == 0 else "fail"
    yield Bar(
        "laws of every car of the library", f"pytest {' '.join(EVERY_CAR)}", figure, "pass", figure == "pass"
    )


EVERY_CAR = (
    "tests/vehicles",
    "tests/certification",
    "tests/forecasting/test_every_car.py",
    "tests/forecasting/test_possible.py",
    "tests/forecasting/test_storage.py",
    "tests/project/test_packaging.py",
)
"""Tests that take a sample of the library in the gate, and every car with TRIPWATT_EVERY_CAR set."""


FREE_FLOW_COVERAGE = 0.85
LINKS_BARS: Mapping[str, float] = {"250 m": 0.085, "1000 m": 0.095}
"""Length of links -> largest mean APE of the forecast from them."""


def planned_routes(found: Path | None) -> Iterator[Bar]:
    """Bars on the forecast of planned routes, from a results file of `benchmarks.planned` or a run of now."""
    measure = "python -m benchmarks.planned"
    text = "mean APE of the forecast from links of {}, 58 trips"
    folder = tum_folder()
    if found is None and folder is None:
        yield from (missing(text.format(name), measure) for name in LINKS_BARS)
        return
    results = planned.measure(folder) if found is None else json.loads(found.read_text(encoding="utf-8"))
    trace = results["known"]["driven trace"]
    for name, bound in LINKS_BARS.items():
        row = results["known"][name]
        yield at_most(text.format(name), measure, row["mape"], bound)
        figure = f"{row['coverage']['0.9']:.3f}, width {row['relative_width']['0.9']:.3f} of the energy"
        beside = f"{trace['coverage']['0.9']:.3f}, {trace['relative_width']['0.9']:.3f} with the driven trace"
        yield shown(f"90 % intervals from links of {name} hold", measure, figure, beside)
    if planned.FREE_FLOW in results["known"]:
        row = results["known"][planned.FREE_FLOW]
        beside = f"{results['known']['250 m']['mape']:.4f} with driven mean speeds"
        yield shown("mean APE of the forecast given free flow", measure, f"{row['mape']:.4f}", beside)
        covers = row["coverage"]["0.9"]
        yield at_least("90 % interval given free flow covers", measure, covers, FREE_FLOW_COVERAGE)


def journeys() -> Iterator[Bar]:
    """Bars on journeys: cutting a road, and a real Valhalla where it is prepared."""
    measure = "python -m benchmarks.journeys"
    for row in journeys_of.rows():
        yield (
            at_most(row.text, measure, row.value, row.bound, row.unit)
            if row.value is not None
            else missing(row.text, measure, row.why)
        )


def on_the_road() -> Iterator[Bar]:
    """Bars on cars on the road: the same forecast as an update, after a kill too, coverage, many cars."""
    measure = "python -m benchmarks.live"
    data = tum_folder()
    if data is None:
        yield missing("TUM trips sent to a service, 200 cars for 600 s", measure)
        return
    for row in live.rows(data, len(REFERENCE_TRIPS), cars=200, seconds=600.0):
        if row.least > 0.0:
            yield at_least(row.text, measure, row.value, row.least)
        else:
            yield at_most(row.text, measure, row.value, row.most)


def unknown_climbs() -> Iterator[Bar]:
    """Bars on roads whose heights are hidden."""
    measure, tum = "python -m benchmarks.unknown_climb", tum_folder()
    if tum is None:
        yield missing("logs with hidden heights", measure)
        return
    for row in unknown_climb.bounds():
        if row.least > 0.0 and math.isfinite(row.least):
            yield at_least(row.text, measure, row.value, row.least)
        if math.isfinite(row.most):
            yield at_most(row.text, measure, row.value, row.most)


def energy_half_known() -> Iterator[Bar]:
    """Bars on trips with a state of charge in whole percent, or a power in whole kilowatts, alone."""
    measure = "python -m benchmarks.half_known"
    data = tum_folder()
    if data is None:
        yield missing("TUM trips with half of what was measured", measure)
        return
    for row in half_known.rows(data):
        if row.least > 0.0:
            yield at_least(row.text, measure, row.value, row.least)
        elif row.most < float("inf"):
            yield at_most(row.text, measure, row.value, row.most)
        else:
            yield shown(row.text, measure, f"{row.value:.4g}", "")


def transfer() -> Iterator[Bar]:
    """Bars on the way of a correction from the i3 to the VED's car 10, with the time that it takes."""
    from tripwatt.evaluation.transfer import evaluate_transfer
    from tripwatt.sources import read_logs

    text, measure = "transfer i3 to car 10", "tripwatt transfer --from DATA/tum --to DATA/ved"
    tum, ved = tum_folder(), ved_trips.ved_folder()
    if tum is None or ved is None:
        yield missing(text, measure)
        return
    began = time.perf_counter()
    run = evaluate_transfer(read_logs(tum, "tum"), read_logs(ved, "ved"))
    took = time.perf_counter() - began
    car = next(car for car in run.results["cars"] if car["car"] == "10")
    pair = car["bars"]["zero_shot_better_than_physics"]
    low, high = pair["diff_ci95"]
    figure = f"{pair['diff']:+.4f} ({low:+.4f} to {high:+.4f})"
    yield Bar(
        f"{text}, no own trip: error less that of physics", measure, figure, "< 0, significant", pair["met"]
    )
    ratio = car["bars"]["ten_trips_within_15_percent_of_own"]["ratio"]
    yield at_most(f"{text}, 10 own trips: error over that of the best model of its own", measure, ratio, 1.15)
    zero, alone = car["models"]["zero-shot"]["error"], car["models"]["data-only"]["error"]
    yield shown(f"{text}, no own trip: error", measure, f"{zero:.4f}", f"{alone:.4f} with data alone, as is")
    yield at_most(f"{text}: running time", measure, took, 300.0, "s")


def evaluations(results: Path | None, runs: int) -> tuple[list[Row], dict[str, Any] | None]:
    """Times of the evaluations, and the results of the real trips; None without them."""
    folder = tum_folder()
    if results is not None:
        path = results / "results.json" if results.is_dir() else results
        return [], json.loads(path.read_text(encoding="utf-8"))
    rows, found = [], None
    with tempfile.TemporaryDirectory() as scratch:
        if folder is not None:
            out = Path(scratch) / "tum"
            rows.append(Row(pipeline.EVALUATE_TUM, pipeline.evaluating(str(folder), out=out, runs=runs), "s"))
            found = json.loads((out / "results.json").read_text(encoding="utf-8"))
        rows.append(Row(pipeline.EVALUATE_SYNTHETIC, pipeline.evaluating(runs=runs), "s"))
    return rows, found


def bars(
    results: Path | None, runs: int, links: Path | None = None, forecast: Path | None = None
) -> Iterator[Bar]:
    """All bars, as they are measured."""
    rows, found = evaluations(results, runs)
    if found is None:
        yield missing("mean errors on the 58 reference trips", EVALUATE)
    else:
        yield from accuracy(found)
    yield from forecast_accuracy(forecast)
    yield from synthetic_coverage()
    yield from planned_routes(links)
    yield from journeys()
    yield from on_the_road()
    yield from energy_half_known()
    yield from unknown_climbs()
    yield from physics()
    yield from leafs()
    yield from transfer()
    yield from speed(
        iter([*pipeline.quick(), *rows]),
        SPEED,
        "make bench",
        "" if results is None else "--results was given",
    )
    yield from speed(iter(gam.run()), GAM_SPEED, "OMP_NUM_THREADS=1 python -m benchmarks.gam")
    yield from speed(forecast_speed.run(), FORECAST_SPEED, "python -m benchmarks.forecast")
    yield from speed(service.run(), SERVICE, "python -m benchmarks.service")
    yield from speed(hostile.rows(), HOSTILE, "python -m benchmarks.hostile")
    yield from speed(iter(leave_with.run()), LEAVE_WITH, "python -m benchmarks.leave_with")
    yield from gam_tests()
    yield from certified()


def render(measured: list[Bar]) -> str:
    """Markdown table of all bars and a line that counts them."""
    lines = ["| bar | measure | figure | required | met |", "|---|---|---|---|---|"]
    lines += [f"| {b.text} | `{b.measure}` | {b.figure} | {b.required} | {b.verdict} |" for b in measured]
    count = {word: sum(b.verdict == word for b in measured) for word in ("yes", "NO", "not measured")}
    lines += ["", f"{count['yes']} bars met, {count['NO']} missed, {count['not measured']} not measured"]
    return "\n".join(lines)


def main(
    results: Path | None = None, runs: int = RUNS, links: Path | None = None, forecast: Path | None = None
) -> int:
    """Print the bars; 1 when one is missed.

    `--results` and `--forecast` take the `results.json`, or its folder, of an evaluation of the TUM trips; `--links` those of
    `benchmarks.planned`; times are medians of `--runs`.
    """
    measured = []
    for bar in bars(results, runs, links, forecast):
        measured.append(bar)
        print(f"{bar.verdict:>12}  {bar.text}: {bar.figure} ({bar.required})", file=sys.stderr, flush=True)
    print(render(measured))
    return 1 if any(bar.met is False for bar in measured) else 0


if __name__ == "__main__":
    run(main)
