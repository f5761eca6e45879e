"""Make the model that comes with the package anew: ``python -m tools.data.fit_default_model DATA [RESULTS]``.

DATA is the folder of the TUM trips. RESULTS, a `results.json` of `tripwatt evaluate DATA --protocol forecast`, adds the
scores of the model `hybrid` to the figures of the fit. No trip goes into the model.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from tripwatt.forecasting import save_model
from tripwatt.forecasting.fitting import fit_with_provenance
from tripwatt.forecasting.storage import model_folder
from tripwatt.sources import read_logs
from tripwatt.vehicles import load_vehicle


def published(results: Path) -> list[dict[str, Any]]:
    """Scores of the default model, one for each scheme of an evaluation."""
    evaluations = json.loads(results.read_text(encoding="utf-8"))["evaluations"]
    schemes = []
    for evaluation in evaluations:
        if "hybrid" in evaluation["models"]:
            scores = {**evaluation["models"]["hybrid"]}
            arrival = scores.get("arrival") or {}
            scores["arrival"] = {
                start: row and {k: v for k, v in row.items() if k != "reliability"}
                for start, row in arrival.items()
            }
            schemes.append({**{k: v for k, v in evaluation.items() if k != "models"}, **scores})
    return schemes


def make(data: Path, results: Path | None = None) -> Path:
    """Fit and write; gives the model's folder."""
    model, provenance, figures = fit_with_provenance(read_logs(data, "tum"), load_vehicle("bmw_i3_60ah"))
    model.roads_ = None  # whoever asks without a car of their own does not drive these roads
    if results is not None:
        figures["held_out_of_everything"] = published(results)
    provenance["data"]["licence"] = "CC BY 4.0"
    save_model(model, model_folder(), provenance=provenance, evaluation=figures)
    return model_folder()


if __name__ == "__main__":
    print(make(*map(Path, sys.argv[1:3])))
