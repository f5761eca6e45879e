"""What cars have in common: how far a car of the road is from its simulation, factor by factor, before it has a trip.

Each vehicle deviates from what all cars have in common by its car model and by itself, driver and log included. The means and the spreads of
both are at the maximum of their posterior given sums of the trips of vehicles (`tripwatt.hybrid.groups`). With a handful of car models a spread
is partly an assumption: it counts as much as `ASSUMED_DF` further cars, and `Population.to_frame` prints both.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.hybrid.factors import FACTORS, NAMES, SDS, TripEvidence
from tripwatt.hybrid.groups import GroupPosterior, Scales, Sums, fit_scales, group_posterior
from tripwatt.hybrid.learning import Experts
from tripwatt.vehicles import Vehicle
from tripwatt.vehicles.catalogue import beyond_classes, mass_range_kg
from tripwatt.vehicles.spreads import CLASS_ANCHORS, spreads

CAR_MODEL_SHARE: Final = 0.6
"""Share of the variance between vehicles that is between car models; the rest is vehicle, driver and log. An assumption."""

ROOT_SD: Final = 0.5
"""Prior standard deviation of what all cars have in common, over that between cars: simulations are made to be right on average."""

ASSUMED_DF: Final = 4
"""Degrees of freedom of the assumed spreads."""

_BEYOND_SHARE: Final = 0.25
"""Standard deviation of the whole consumption by a mass far outside of the classes, over its logarithmic distance."""


@dataclass(frozen=True, slots=True)
class Source:
    """Where the sums of a vehicle come from.

    Attributes
    ----------
    car_model, vehicle : str
    dataset : str
        Name of the data set, such as "tum".
    trips : int
    citation, licence : str
    """

    car_model: str
    vehicle: str
    dataset: str
    trips: int
    citation: str
    licence: str


@dataclass(frozen=True, eq=False)
class Population:
    """Cars with trips, as sums, and what follows for a car without any.

    Attributes
    ----------
    sums : Sums
        Groups are pairs of car model and vehicle; features are the factors in usual standard deviations.
    sources : tuple of Source

    Examples
    --------
    >>> everybody = population()
    >>> sorted({source.dataset for source in everybody.sources})
    ['tum', 'twizy', 'ved']
    >>> list(everybody.to_frame().columns)
    ['unit', 'mean', 'mean_sd', 'car_sd', 'assumed_sd', 'car_models', 'assumed_df', 'source']
    """

    sums: Sums
    sources: tuple[Source, ...] = ()

    @classmethod
    def from_evidence(cls, cars: Sequence[tuple[Source, TripEvidence]]) -> Population:
        """Of cars with their trips."""
        total = Sums.empty(len(NAMES))
        for source, evidence in cars:
            total = total + evidence.sums(source.car_model, source.vehicle)
        return cls(total, tuple(source for source, _ in cars))

    def without(self, datasets: Collection[str]) -> Population:
        """Without the vehicles of some data sets."""
        kept = tuple(source for source in self.sources if source.dataset not in datasets)
        groups = {(source.car_model, source.vehicle) for source in kept}
        return Population(self.sums.take([i for i, g in enumerate(self.sums.groups) if g in groups]), kept)

    def with_car(self, source: Source, evidence: TripEvidence) -> Population:
        """With the trips of one more vehicle, which take the place of those of its car model."""
        others = [i for i, (model, _) in enumerate(self.sums.groups) if model != source.car_model]
        own = evidence.sums(source.car_model, source.vehicle)
        kept = tuple(other for other in self.sources if other.car_model != source.car_model)
        return Population(self.sums.take(others) + own, (*kept, source))

    @cached_property
    def _posterior(self) -> GroupPosterior:
        parts = len(FACTORS)
        shares = (CAR_MODEL_SHARE, 1.0 - CAR_MODEL_SHARE)
        usual = Scales(tuple((share**0.5,) * parts for share in shares), 1.0, tuple(range(parts)), ROOT_SD)
        counted = self.sums.count.sum() > 0
        # the logarithm of a standard deviation of n degrees of freedom has about this standard deviation
        scales = fit_scales(self.sums, usual, math.sqrt(0.5 / ASSUMED_DF)) if counted else usual
        return group_posterior(self.sums, scales)

    def experts(self, vehicle: Vehicle) -> Experts:
        """What is believed of a car without trips.

        A car model with trips of other vehicles starts from these. Values of a class are less certain than the car's own, the more so the
        further its mass is from the library's cars.
        """
        mean, covariance = self._posterior.weights(vehicle.name)
        shift, variance = _beyond_values(vehicle)
        return Experts.from_prior(mean + shift, covariance, variance)

    def to_frame(self) -> pd.DataFrame:
        """One row for each factor: its mean over cars, its spread between cars, and what both rest on."""
        mean = self._posterior.weights()[0]
        root = np.sqrt(np.diag(self._posterior.covariance[0]))
        between = sum((self._posterior.scales.variances(level) for level in (1, 2)), np.zeros(len(FACTORS)))
        models = len({source.car_model for source in self.sources})
        rows = [
            (f.unit, m * f.sd, r * f.sd, s * f.sd, f.sd, models, ASSUMED_DF, f.source)
            for f, m, r, s in zip(FACTORS, mean, root, np.sqrt(between), strict=True)
        ]
        columns = ["unit", "mean", "mean_sd", "car_sd", "assumed_sd", "car_models", "assumed_df", "source"]
        return pd.DataFrame(rows, index=pd.Index(NAMES, name="factor"), columns=columns)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as the file that comes with the package has them."""
        arrays = self.sums.to_arrays()
        sources = [{name: getattr(s, name) for name in Source.__slots__} for s in self.sources]
        rounded = {name: np.asarray(v).tolist() for name, v in arrays.items()}
        return {"factors": dict(zip(NAMES, SDS.tolist(), strict=True)), "sources": sources, "sums": rounded}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Population:
        """Reverse of `to_dict`."""
        sums = Sums.from_arrays({name: np.array(value) for name, value in values["sums"].items()})
        return cls(sums, tuple(Source(**source) for source in values["sources"]))


POPULATION_FILE: Final = Path(__file__).parent / "data" / "population.json"


@cache
def population() -> Population:
    """The cars whose trips may be used by everybody: sums that `python -m tools.data.population` makes."""
    return Population.from_dict(json.loads(POPULATION_FILE.read_text(encoding="utf-8")))


def _beyond_values(vehicle: Vehicle) -> tuple[FloatArray, FloatArray]:
    """What is expected of a car because of what its values are anchored to: shift of the mean, and variance that is added."""
    shift, variance = np.zeros(len(NAMES)), np.zeros(len(NAMES))
    beyond = beyond_classes(vehicle.body.curb_mass_kg) if vehicle.anchor in CLASS_ANCHORS else 0.0
    for name, width in spreads(vehicle.anchor, beyond).items():
        its = NAMES.index(name)
        variance[its] = max(0.0, (width / SDS[its]) ** 2 - 1.0)
    variance[0] += (_BEYOND_SHARE * beyond / SDS[0]) ** 2
    if vehicle.body.curb_mass_kg < mass_range_kg()[0]:
        # in proportion to mass and power, or as of the lightest car: the mean of both logarithms
        for its in (NAMES.index("rolling"), NAMES.index("drivetrain")):
            shift[its] = (math.exp(0.5 * beyond) - 1.0) / SDS[its]
    return shift, variance
