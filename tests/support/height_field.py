"""Heights of a made country: a random field whose differences grow with the distance as net climbs do."""

import numpy as np

from tripwatt.routes.terrain import GROWTH, REFERENCE_M

KM_DEG = 1.0 / 111.195
"""Degrees of latitude in a kilometre."""


def height_field(rng, scale_m, at_km):
    """Draw the heights of places, the lowest of which has 300 m; `scale_m` is the standard deviation of a difference over 10 km. O(places³).

    Parameters
    ----------
    at_km : ndarray, shape (places, 2)
        Places on a plane [km].
    """
    places_m = 1000.0 * np.asarray(at_km)
    power = 2.0 * GROWTH
    apart = (np.linalg.norm(places_m[:, None] - places_m[None], axis=2) / REFERENCE_M) ** power
    covariance = 0.5 * (apart[:1] + apart[:, :1] - apart)
    unit = rng.multivariate_normal(np.zeros(len(places_m)), covariance, method="eigh")
    return 300.0 + scale_m * (unit - unit.min())
