"""What the error of the paper's GAMM depends on: `python -m benchmarks.gamm_choices`.

Leave-one-trip-out on the 58 reference trips, one setting changed at a time. The table of the protocol `paper` has Table 2 with
Student's t errors on rows a minute apart. Prints a Markdown table.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.measure import tum_folder
from tripwatt.hybrid import build_table
from tripwatt.sources import read_logs
from tripwatt.study.evaluation.metrics import summarise_errors
from tripwatt.study.paper import TABLE2, correctors
from tripwatt.vehicles import load_vehicle

SURFACE = next(term for term in TABLE2 if "k=30" in term)
AMBIENT = "s(ambient_temperature_degc)"


def terms(changed: Mapping[str, str | None]) -> tuple[str, ...]:
    """Table 2 with some terms replaced, or left out where the replacement is None."""
    chosen = [changed.get(term, term) for term in TABLE2]
    return tuple(term for term in chosen if term is not None)


CHOICES: Mapping[str, dict[str, Any]] = {
    "as in the table: t errors, rows every 60 s": {},
    "thinning: rows every 120 s": {"every_rows": 120},
    "thinning: rows every 300 s": {"every_rows": 300},
    "t with at least 10 degrees of freedom, not 3": {"min_df": 10.0},
    "normal errors": {"errors": "normal"},
    "knots: surface with k = 10, not 30": {"terms": terms({SURFACE: SURFACE.replace("k=30", "k=10")})},
    "shrinkage: the ambient temperature as a straight line": {
        "terms": terms({AMBIENT: "ambient_temperature_degc"})
    },
    "without the surface": {"terms": terms({SURFACE: None})},
    "AR(1) errors": {"errors": "ar1"},
    "AR(1) errors, without the surface": {"errors": "ar1", "terms": terms({SURFACE: None})},
}


def measure() -> None:
    """Print the table as Markdown, a row as soon as it is measured."""
    folder = tum_folder()
    if folder is None:
        raise SystemExit("the TUM trips are not at hand: set TRIPWATT_DATA")
    trips = read_logs(folder, "tum").reference_trips()
    table = build_table(trips, {correctors.SIMULATION: load_vehicle("bmw_i3_60ah", "paper")})
    observed = table.observed_wh[table.last_rows]
    print("| choice | mean error [%] | 95 % interval | median [%] | largest [%] |")
    print("|:--|--:|--:|--:|--:|", flush=True)
    for name, settings in CHOICES.items():
        model = correctors.gamm(**settings)
        energy = model.predict_held_out(table, np.arange(len(table)))[table.last_rows]
        errors = summarise_errors(observed, energy, 0)
        low, high = errors["mape_ci95"]
        print(
            f"| {name} | {100 * errors['mape']:.1f} | {100 * low:.1f} to {100 * high:.1f} | {100 * errors['median_ape']:.1f} "
            f"| {100 * errors['max_ape']:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    measure()
