"""The result of an evaluation, as one object and as the files `results.json` and `folds.csv`.

`results.json` is a contract; its keys are listed in `docs/explanation/evaluation.md`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from tripwatt.errors import Fault, InvalidInput, percent, raise_faults
from tripwatt.files import csv_text, write_text
from tripwatt.forecasting.fitting import versions
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.hold_outs import Prepared
from tripwatt.study.evaluation.metrics import PairedDifference, paired_difference
from tripwatt.study.paper.insight import GammInsight
from tripwatt.trips.showing import html_table
from tripwatt.units import with_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SYNTHETIC: Final = "synthetic"
"""Name of the built-in fleet."""


@dataclass(frozen=True, eq=False, repr=False)
class EvaluationRun:
    """Everything that the report shows.

    Attributes
    ----------
    results : dict
        The content of `results.json`.
    folds : DataFrame
        The content of `folds.csv`: one row per evaluation, trip and model.
    gamm : GammInsight or None
        Summary, diagnosis and effects of the GAMM, fitted on all trips of the first evaluation; None if it was not
        among the models.
    forecast : DataFrame or None
        The content of `forecasts.csv`: held-out forecasts of the first evaluation; None in a protocol without them.

    Examples
    --------
    >>> import tripwatt as tw
    >>> from tripwatt.study.evaluation import Execution
    >>> run = tw.evaluate(tw.sample_trips(), protocol="paper", models=["constant"], execution=Execution(n_jobs=1))
    >>> run.folds["model"].unique().tolist()
    ['constant']
    """

    results: dict[str, Any]
    folds: pd.DataFrame
    gamm: GammInsight | None = None
    forecast: pd.DataFrame | None = None

    def to_frame(self) -> pd.DataFrame:
        """Tabulate the errors of every model in every hold-out.

        Returns
        -------
        DataFrame
            `scheme, trips, model, n_trips, mape, mape_low, mape_high` (95 % bootstrap interval over trips), `median_ape,
            max_ape, bias, rmse_wh`; errors as fractions.

        Examples
        --------
        >>> import tripwatt as tw
        >>> from tripwatt.study.evaluation import Execution
        >>> run = tw.evaluate(tw.sample_trips(), models=["constant", "physics"], execution=Execution(n_jobs=1))
        >>> run.to_frame().groupby("scheme")["model"].count().to_dict()
        {'leave_one_day_out': 2, 'leave_one_trip_out': 4}
        """
        rows = []
        for part in self.results["evaluations"]:
            for model, scores in part["models"].items():
                low, high = scores["mape_ci95"]
                about = {"scheme": part["scheme"], "trips": part["trips"], "model": model}
                errors = {"mape": scores["mape"], "mape_low": low, "mape_high": high}
                further_errors = {k: scores[k] for k in ("median_ape", "max_ape", "bias", "rmse_wh")}
                rows.append({**about, "n_trips": part["n_trips"], **errors, **further_errors})
        return with_units(pd.DataFrame(rows))

    @property
    def failed(self) -> pd.DataFrame:
        """One row for each prediction that failed: `scheme`, `trips`, `trip`, `model` and `reason`; no score contains these trips."""
        return pd.DataFrame(self.results["failed"], columns=["scheme", "trips", "trip", "model", "reason"])

    def compare(self, a: str, b: str, *, hold_out: str | None = None) -> PairedDifference:
        """Compare two models over the same held-out trips.

        Parameters
        ----------
        a, b : str
            Names of models of the run.
        hold_out : str, optional
            A hold-out as ``scheme:trips``; default: the first of the run.

        Returns
        -------
        PairedDifference
            Mean APE of `a` minus that of `b`, with its bootstrap interval over days.

        Raises
        ------
        InvalidInput
            On an unknown model or hold-out.

        Examples
        --------
        >>> import tripwatt as tw
        >>> from tripwatt.study.evaluation import Execution
        >>> run = tw.evaluate(tw.sample_trips(), models=["constant", "physics"], execution=Execution(n_jobs=1))
        >>> run.compare("physics", "constant").diff < 0.0
        True
        """
        _, ape = self._ape(hold_out)
        raise_faults(
            Fault.unknown("unknown model", "compare", name, [*map(str, ape)])
            for name in (a, b)
            if name not in ape
        )
        days = [self.results["days"].get(trip, trip) for trip in ape.index]
        return paired_difference(ape[a].to_numpy(), ape[b].to_numpy(), self.results["seed"], days)

    def plot(self, ax: Axes | None = None, *, hold_out: str | None = None) -> Figure:
        """Draw a box plot of the trips' errors for each model.

        Parameters
        ----------
        ax : Axes, optional
            Axes to draw on; a new figure by default.
        hold_out : str, optional
            As for `compare`.

        Returns
        -------
        matplotlib.figure.Figure
            Absolute percentage error [%], on a logarithmic scale.

        Raises
        ------
        InvalidInput
            On an unknown hold-out.

        Examples
        --------
        >>> run.plot().savefig("errors.png")  # doctest: +SKIP
        """
        from tripwatt.study.evaluation.plots import plot_errors  # matplotlib is slow to import

        label, ape = self._ape(hold_out)
        return plot_errors(ape, f"{label.replace('_', ' ')}, {len(ape)} trips", ax)

    def _ape(self, hold_out: str | None) -> tuple[str, pd.DataFrame]:
        """Return the label of a hold-out and its errors: trips as rows, models as columns, averaged over the splits of a trip."""
        labels = self.folds["scheme"] + ":" + self.folds["trips"]
        label = labels.iloc[0] if hold_out is None else hold_out
        if label not in set(labels):
            raise InvalidInput(Fault.unknown("unknown hold-out", "hold_out", label, labels.unique()))
        rows = self.folds[labels == label]
        return label, rows.pivot_table(index="trip", columns="model", values="ape", sort=False)

    def _repr_html_(self) -> str:
        rows = [
            (
                f"{row['model']}, {row['scheme']} of {row['trips']} trips",
                f"{percent(row['mape'], 1)} ({percent(row['mape_low'], 1)} to {percent(row['mape_high'], 1)}) over {row['n_trips']} trips",
            )
            for row in self.to_frame().to_dict("records")
        ]
        return html_table(f"{self!r}"[1:-1], rows)

    def __repr__(self) -> str:
        protocol, models, read = (self.results[key] for key in ("protocol", "models", "trips_read"))
        return f"<EvaluationRun protocol {protocol}, {len(models)} models, {len(read)} trips read>"


def build_run(
    protocol: str, prepared: Prepared[Any], main: Sequence[Comparison], seed: int, scores: Mapping[str, Any]
) -> EvaluationRun:
    """Build a run of a protocol's scores, data and models, and of the paired differences of the first comparison."""
    first, fleet, known = main[0], prepared.test_fleet or prepared.fleet, versions()
    results = {
        "protocol": protocol,
        "dataset": fleet.name,
        "synthetic": fleet.name == SYNTHETIC,
        "citation": fleet.citation,
        "seed": seed,
        "versions": {"python": known["python"], **known["packages"]},
        "vehicle": next(iter(prepared.cars.values())).name,
        "notes": list(dict.fromkeys(prepared.notes)),
        "models": {spec.name: spec.title for spec in first.specs},
        "trips_read": [t.trip_id for t in fleet.trips],
        "trips_used": {h.trips: [h.table.trip_ids[i] for i in h.scored] for h in prepared.hold_outs},
        "days": dict(zip(first.hold_out.table.trip_ids, first.hold_out.table.days, strict=True)),
        "audit": [asdict(finding) for finding in prepared.audited.findings],
        "paired": first.paired(seed),
        **scores,
    }
    return EvaluationRun(results, pd.concat([comparison.frame for comparison in main], ignore_index=True))


def write_results(run: EvaluationRun, out: Path) -> None:
    """Write `results.json`, `folds.csv` and, if there are forecasts, `forecasts.csv` into the folder `out`.

    Parameters
    ----------
    run : EvaluationRun
        Result of `evaluate`.
    out : Path
        Folder, created if missing; files of the same names are replaced.

    Examples
    --------
    >>> import tempfile
    >>> import tripwatt as tw
    >>> from tripwatt.study.evaluation import Execution
    >>> run = tw.evaluate(tw.sample_trips(), protocol="paper", models=["constant"], execution=Execution(n_jobs=1))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_results(run, Path(folder))
    ...     print(sorted(file.name for file in Path(folder).iterdir()))
    ['folds.csv', 'results.json']
    """
    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps(run.results, indent=1, allow_nan=False, default=np.generic.item)
    write_text(out / "results.json", f"{text}\n")
    write_text(out / "folds.csv", csv_text(run.folds))
    if run.forecast is not None:
        write_text(out / "forecasts.csv", csv_text(run.forecast))
