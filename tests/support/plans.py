"""Plans of cars on the road."""

from __future__ import annotations

from typing import Any

import pandas as pd

from tripwatt.server.http.schemas import BMS_SOC
from tripwatt.trips import ROUTE_COLUMNS, SIGNALS
from tripwatt.trips.samples import columns_of


def request_of_samples(samples: pd.DataFrame) -> dict[str, Any]:
    """A driven speed trace, and the signals of its departure, as the fields of a request."""
    names = [name for name in (*ROUTE_COLUMNS, *SIGNALS.values()) if name in samples]
    return {"samples": columns_of(samples[names].rename(columns=BMS_SOC))}
