"""Many vehicles: a map over a trip store, and a hierarchical model on sums that add up."""

from typing import NamedTuple


class Warranty(NamedTuple):
    """What a maker guarantees of a battery; the defaults are usual for cars in Europe.

    Attributes
    ----------
    share : float
        Share of the energy of a new battery.
    years, km : float
        Age and distance up to which it is guaranteed, whichever comes first.
    """

    share: float = 0.7
    years: float = 8
    km: float = 160_000
