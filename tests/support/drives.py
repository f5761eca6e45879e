"""A drive as a table."""

from __future__ import annotations

import pandas as pd

from tripwatt.study.synthetic import synthetic_fleet


def example_trip(seed: int = 0) -> pd.DataFrame:
    """The samples of the first synthetic trip, in canonical columns at 1 Hz."""
    return synthetic_fleet(1, seed).trips[0].samples
