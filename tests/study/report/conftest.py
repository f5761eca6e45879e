"""A seeded run with every part that a report can show, and ways to take parts away."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tripwatt.hybrid.trip_table import build_table
from tripwatt.study.paper import HybridModel, Table2Corrector
from tripwatt.study.paper.insight import GammInsight, insight
from tripwatt.study.report.panel import Panel
from tripwatt.study.report.panels import build_sections
from tripwatt.study.report.view import View
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.vehicles import load_vehicle
from tripwatt_gamm import RandomEffects

MODELS = {
    "constant": (0.20, 0.0),
    "linear4": (0.12, 0.0),
    "linear6": (0.11, 0.0),
    "physics-paper": (0.15, -0.33),
    "physics": (0.16, -0.12),
    "physics4": (0.11, 0.0),
    "gamm": (0.13, 0.02),
    "forest": (0.12, 0.01),
    "boosting": (0.115, 0.0),
    "boosting-only": (0.4, 0.05),
}


def bootstrap(values: np.ndarray, rng: np.random.Generator) -> list[float]:
    draws = values[rng.integers(0, len(values), (500, len(values)))].mean(axis=1)
    return [float(q) for q in np.quantile(draws, [0.025, 0.975])]


def make_folds(
    trips: list[str], scheme: str, name: str, rng: np.random.Generator, models: Sequence[str]
) -> pd.DataFrame:
    observed = rng.uniform(600.0, 6000.0, len(trips))
    simulated = observed * (0.67 + 0.15 * rng.standard_normal(len(trips)))
    parts = []
    for model in models:
        spread, bias = MODELS[model]
        noise = rng.standard_t(4, len(trips))
        predicted = simulated if model == "physics-paper" else observed * (1 + bias + spread * noise / 1.4)
        parts.append(
            pd.DataFrame(
                {
                    "scheme": scheme,
                    "trips": name,
                    "trip": trips,
                    "model": model,
                    "observed_energy_wh": observed,
                    "simulated_energy_wh": simulated,
                    "correction_wh": predicted - simulated,
                    "predicted_energy_wh": predicted,
                    "ape": np.abs(predicted - observed) / observed,
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def evaluation_of(folds: pd.DataFrame, rng: np.random.Generator) -> dict:
    wide = folds.pivot_table(index="trip", columns="model", values="ape")[list(folds["model"].unique())]
    models = {}
    for model in wide.columns:
        rows = folds[folds["model"] == model]
        difference = rows["predicted_energy_wh"] - rows["observed_energy_wh"]
        models[model] = {
            "mape": float(rows["ape"].mean()),
            "mape_ci95": bootstrap(rows["ape"].to_numpy(), rng),
            "median_ape": float(rows["ape"].median()),
            "max_ape": float(rows["ape"].max()),
            "bias": float((difference / rows["observed_energy_wh"]).mean()),
            "rmse_wh": float(np.sqrt((difference**2).mean())),
            "improved_share": {
                p: float((wide[model] < wide[p]).mean()) for p in ("physics-paper", "physics")
            },
            "fit_s": float(rng.uniform(0.01, 4.0)),
            "predict_ms": float(rng.uniform(0.1, 9.0)),
        }
    first = folds.iloc[0]
    return {"scheme": first["scheme"], "trips": first["trips"], "n_trips": len(wide), "models": models}


def pairs_of(folds: pd.DataFrame, rng: np.random.Generator) -> list[dict]:
    wide = folds.pivot_table(index="trip", columns="model", values="ape")
    names = list(folds["model"].unique())
    pairs = []
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            difference = (wide[a] - wide[b]).to_numpy()
            low, high = bootstrap(difference, rng)
            pair = {"a": a, "b": b, "diff": float(difference.mean()), "ci95": [low, high]}
            pairs.append({**pair, "significant": low > 0 or high < 0})
    return pairs


@lru_cache
def fitted_gamm() -> GammInsight:
    """A real fit on few synthetic trips, with a weather that none of them has."""
    table = build_table(
        synthetic_fleet(n_trips=6, seed=3).trips,
        {"physics-paper": load_vehicle("bmw_i3_60ah", preset="paper")},
        step_s=2.0,
    )
    found = insight(
        table.take(range(6)),
        {"gamm": HybridModel(Table2Corrector(), "physics-paper")},
        weathers=("dark, little rainy",),
    )
    assert found is not None
    return found


def gamm_of(trips: list[str]) -> GammInsight:
    """`fitted_gamm` with the names of other trips."""
    fitted = fitted_gamm()
    effects = {
        label: replace(e, level=tuple(trips[i % len(trips)] for i in range(len(e.level))))
        if isinstance(e, RandomEffects)
        else e
        for label, e in fitted.effects.items()
    }
    return replace(fitted, effects=effects)


def make_run(
    dataset: str = "tum",
    trips: list[str] | None = None,
    seed: int = 7,
    models: Sequence[str] = tuple(MODELS),
) -> SimpleNamespace:
    rng = np.random.default_rng(seed)
    trips = trips or [f"A{i:02d}" for i in range(1, 33)] + [f"B{i:02d}" for i in range(2, 28)]
    sets = [
        ("leave_one_trip_out", "reference"),
        ("leave_one_trip_out", "audited"),
        ("leave_one_trip_out", "all"),
        ("leave_one_day_out", "reference"),
    ]
    folds = [make_folds(trips, scheme, name, rng, models) for scheme, name in sets]
    main = folds[0]
    results = {
        "protocol": "paper",
        "seed": seed,
        "versions": {"tripwatt": "0.1.0", "numpy": np.__version__},
        "dataset": dataset,
        "citation": "Nobody et al.: Made-up drives, DOI 10.0000/none, CC BY 4.0",
        "notes": ["Season and weather come from the overview sheet."],
        "trips_read": [*trips, "X99"],
        "trips_used": {"reference": trips, "audited": trips[1:], "all": [*trips, "X99"]},
        "evaluations": [evaluation_of(f, rng) for f in folds],
        "paired": pairs_of(main, rng),
    }
    return SimpleNamespace(
        results=results,
        folds=pd.concat(folds, ignore_index=True),
        gamm=gamm_of(trips),
    )


@pytest.fixture(scope="session")
def run() -> SimpleNamespace:
    return make_run()


@pytest.fixture(scope="session")
def panels(run: SimpleNamespace) -> dict[str, Panel]:
    """All panels of `run` by their keys."""
    return {
        panel.key: panel
        for panels in build_sections(View(run.results, run.folds, run.gamm)).values()
        for panel in panels
    }


@pytest.fixture(scope="session")
def made_up() -> Callable[..., SimpleNamespace]:
    """Makes a run of any data set and trips: `made_up("tum", trips=["a", "b"])`."""
    return make_run
