"""Tables of segments and correctors of which the tests know everything."""

import numpy as np
import pandas as pd

from tripwatt.hybrid import SegmentTable
from tripwatt.hybrid.power import summed
from tripwatt.hybrid.segments import LINE_CAUSES

EXACT = {"rel": 1e-9, "abs": 1e-9}
NO = np.nan
CAUSES_W = [f"{cause}_w" for cause in LINE_CAUSES]


def table(
    rows, hours, *, simulated=None, observed=None, climate=None, simulated_climate=None, charge=None
) -> SegmentTable:
    """Trips with these numbers of rows."""
    n = sum(rows)
    return SegmentTable(
        trip_ids=tuple(f"t{i}" for i in range(len(rows))),
        offsets=np.concatenate(([0], np.cumsum(rows))),
        features=pd.DataFrame(
            {
                "climate_w": np.zeros(n) if simulated_climate is None else simulated_climate,
                "row": np.arange(float(n)),
            }
        ),
        hours=np.asarray(hours, dtype=float),
        simulated_w=np.zeros(n) if simulated is None else np.asarray(simulated, dtype=float),
        observed_w=None if observed is None else np.asarray(observed, dtype=float),
        observed_climate_w=None if climate is None else np.asarray(climate, dtype=float),
        charge=charge,
    )


class Fixed:
    """A corrector with a fixed correction that remembers what it was fitted on."""

    def __init__(self, watts=0.0, factor=0.0) -> None:
        self.watts, self.factor, self.seen = watts, factor, None

    def fit(self, own):
        self.seen = own
        return self

    def clone_tuned(self):
        return Fixed(self.watts + 0.5, self.factor)

    def predict(self, own):
        return np.full(len(own.hours), self.watts)

    def outside_factor(self, own):
        return np.full((len(own.hours), 1), 10.0 * self.factor)

    def predict_with_uncertainty(self, own, hours=None):
        return self.predict(own), summed(np.full((len(own.hours), 1), self.factor), hours)
