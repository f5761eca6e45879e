"""One model on one hold-out of the paper's protocol, and a gradient booster from outside beside ours: `python -m benchmarks.own_way`.

Needs TRIPWATT_DATA. The settings of the booster are those of the how-to; nothing was chosen on these trips.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from typing import Final

from sklearn.ensemble import HistGradientBoostingRegressor
from tools import DATA

import tripwatt as tw
from benchmarks.measure import Row, report

ONE: Final = "leave_one_trip_out:reference"
MODELS: Final = ("forest", "boosting", "gamm")


def rows() -> Iterator[Row]:
    """Seconds with two processes, and errors of held-out trips."""
    for model in MODELS:
        began = time.perf_counter()
        run = tw.evaluate(DATA / "tum", models=[model], hold_outs=ONE)
        note = f"mean error {run.to_frame()['mape'].item():.1%}"
        yield Row(
            f"paper protocol, one hold-out, {model}", time.perf_counter() - began, "s", most=20.0, note=note
        )
    outside = HistGradientBoostingRegressor(max_iter=60, max_leaf_nodes=4)
    run = tw.evaluate(
        DATA / "tum", protocol="forecast", models={"hybrid": "hybrid", "outside": outside}, hold_outs=ONE
    )
    errors = run.to_frame().set_index("model")
    for name, row in errors.iterrows():
        spread = f"{row['mape_low']:.1%} to {row['mape_high']:.1%}"
        yield Row(f"forecast, {name}: mean error", 100.0 * row["mape"], "%", note=spread)
    pair = run.compare("outside", "hybrid")
    low, high = pair.ci95
    yield Row(
        "outside less hybrid", 100.0 * pair.diff, "points", note=f"{100 * low:+.1f} to {100 * high:+.1f}"
    )


if __name__ == "__main__":
    sys.exit(report(rows()))
