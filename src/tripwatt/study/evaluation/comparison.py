"""Compare models on the splits of a hold-out."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.study.evaluation.held_out_forecasts import HeldOutForecast
from tripwatt.study.evaluation.hold_outs import HoldOut
from tripwatt.study.evaluation.metrics import (
    absolute_percentage_error,
    bootstrap_interval,
    paired_difference,
    summarise_errors,
)
from tripwatt.study.evaluation.tasks import FoldResult, ModelSpec

PHYSICS_ALONE: Final = ("physics-paper", "physics")
"""Models that are a simulation alone; the share of improved trips is relative to them."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Models on the splits of a hold-out.

    Attributes
    ----------
    hold_out : HoldOut
    specs : tuple of ModelSpec
    results : tuple of FoldResult
        Results of every model in every split; empty before the comparison has run.
    """

    hold_out: HoldOut[Any]
    specs: tuple[ModelSpec, ...]
    results: tuple[FoldResult, ...] = ()

    @property
    def _about(self) -> dict[str, str]:
        return {"scheme": self.hold_out.scheme, "trips": self.hold_out.trips}

    @property
    def failed(self) -> list[dict[str, str]]:
        """Return `scheme`, `trips`, `trip`, `model` and `reason` of each prediction that failed."""
        about, names = self._about, self.hold_out.table.trip_ids
        return [
            about | {"trip": names[trip], "model": result.model, "reason": reason}
            for result in self.results
            for trip, reason in result.failed.items()
        ]

    def without_failed(self) -> Comparison:
        """Return the comparison on the trips that every model predicted in every split, so that all scores are over the same trips."""
        failed = np.array(sorted({trip for result in self.results for trip in result.failed}), dtype=np.int64)
        splits = [replace(s, test=s.test[~np.isin(s.test, failed)]) for s in self.hold_out.splits]
        hold_out = replace(self.hold_out, splits=tuple(split for split in splits if len(split.test)))
        results = (result.without(failed) for result in self.results)
        return replace(self, hold_out=hold_out, results=tuple(r for r in results if len(r.split.test)))

    def results_of(self, model: str) -> list[FoldResult]:
        """Return the results of a model."""
        return [result for result in self.results if result.model == model]

    def energies_wh(self, model: str) -> FloatArray:
        """Return the predicted energy of each scored trip, in the order of the trips; a trip counts once for each split that scores it."""
        return np.array(self._ordered(model, "predicted_wh"))

    def forecasts(self, model: str) -> list[HeldOutForecast]:
        """Return the forecasts in the order of `energies_wh`; empty if the model makes none or did not run."""
        forecasts = any(result.forecasts for result in self.results_of(model))
        return self._ordered(model, "forecasts") if forecasts else []

    def _ordered(self, model: str, name: str) -> list[Any]:
        """Sort the values of a field of a model's results (one value per scored trip) by trip, then by split."""
        of_trips = (
            (trip, result.split.number, value)
            for result in self.results_of(model)
            for trip, value in zip(result.split.test.tolist(), getattr(result, name), strict=True)
        )
        return [value for _, _, value in sorted(of_trips, key=lambda item: item[:2])]

    @cached_property
    def frame(self) -> pd.DataFrame:
        """The content of `folds.csv`: one row for each model, scored trip and split that scores it."""
        table, scored = self.hold_out.table, self.hold_out.tested
        last = table.last_rows[scored]
        observed = table.observed_wh[last]
        frames = []
        for spec in self.specs:
            predicted, simulated = self.energies_wh(spec.name), table.simulated(spec.simulation)[last]
            columns = {
                **self._about,
                "trip": [table.trip_ids[i] for i in scored],
                "model": spec.name,
                "observed_energy_wh": observed,
                "simulated_energy_wh": simulated,
                "correction_wh": predicted - simulated,
                "predicted_energy_wh": predicted,
                "ape": absolute_percentage_error(observed, predicted),
            }
            frames.append(pd.DataFrame(columns))
        return pd.concat(frames, ignore_index=True)

    def rows_of(self, model: str) -> pd.DataFrame:
        """Return the rows of a model in `frame`."""
        return self.frame[self.frame["model"] == model]

    def ape(self, model: str) -> FloatArray:
        """Return the absolute percentage error of each scored trip, averaged over the splits that score the trip."""
        _, place = np.unique(self.hold_out.tested, return_inverse=True)
        return np.asarray(np.bincount(place, self.rows_of(model)["ape"]) / np.bincount(place))

    def summary(self, seed: int) -> dict[str, Any]:
        """Summarise the errors of every model."""
        names, models = [spec.name for spec in self.specs], {}
        for name in names:
            rows, results = self.rows_of(name), self.results_of(name)
            observed, predicted = (rows[f"{kind}_energy_wh"].to_numpy() for kind in ("observed", "predicted"))
            errors = summarise_errors(observed, predicted, seed)
            if len(self.hold_out.tested) > len(self.hold_out.scored):  # over trips, not over splits
                ape = self.ape(name)
                errors |= {"mape": float(ape.mean()), "mape_ci95": bootstrap_interval(ape, seed)}
            models[name] = errors | {
                "improved_share": {
                    base: float(np.mean(self.ape(name) < self.ape(base)))
                    for base in PHYSICS_ALONE
                    if base in names and base != name
                },
                **median_times(results),
            }
        return {**self._about, "n_trips": len(self.hold_out.scored), "models": models}

    def paired(self, seed: int) -> list[dict[str, Any]]:
        """Compare every pair of models over the scored trips; the bootstrap draws days."""
        days = [self.hold_out.table.days[i] for i in self.hold_out.scored]
        return [
            {"a": a, "b": b, **asdict(paired_difference(self.ape(a), self.ape(b), seed, days)), **self._about}
            for a, b in itertools.combinations((spec.name for spec in self.specs), 2)
        ]


def median_times(results: Sequence[FoldResult]) -> dict[str, float]:
    """Return medians over the splits of the time of a fit and of the prediction of one trip."""
    return {name: float(np.median([getattr(r, name) for r in results])) for name in ("fit_s", "predict_ms")}
