"""Random drives of one forecast: energy and displayed charge along the road, drawn together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.units import with_units


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Drives that are drawn from a forecast, each along the whole road; made by `Forecast.sample`.

    Attributes
    ----------
    time_s, distance_m : ndarray, shape (edges,)
        Time [s] and distance [m] since departure.
    cumulative_energy_wh : ndarray, shape (draws, edges)
        Energy since departure [Wh].
    displayed_soc : ndarray, shape (draws, edges)
        Displayed state of charge, 0 to 1.

    Examples
    --------
    >>> import tripwatt as tw
    >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
    >>> drawn = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0)).sample(200)
    >>> bool((drawn.displayed_soc[:, 0] == 0.8).all())
    True
    """

    time_s: FloatArray
    distance_m: FloatArray
    cumulative_energy_wh: FloatArray
    displayed_soc: FloatArray

    def to_frame(self) -> pd.DataFrame:
        """Tabulate the drives, one row for each draw and edge.

        Returns
        -------
        DataFrame
            `draw, time_s, distance_m, cumulative_energy_wh, displayed_soc`; ``attrs["units"]`` has the units.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> tw.forecast(plan).sample(2).to_frame().attrs["units"]["cumulative_energy_wh"]
        'Wh'
        """
        n, edges = self.displayed_soc.shape
        columns = {
            "draw": np.repeat(np.arange(n), edges),
            "time_s": np.tile(self.time_s, n),
            "distance_m": np.tile(self.distance_m, n),
            "cumulative_energy_wh": self.cumulative_energy_wh.ravel(),
            "displayed_soc": self.displayed_soc.ravel(),
        }
        return with_units(pd.DataFrame(columns))
