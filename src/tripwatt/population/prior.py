"""The population of cars: how far a car on the road is from its simulation, factor by factor, before it has a trip.

Each vehicle deviates from the common mean of all cars by its car model and by itself, driver and log included. The means and the
spreads of both are at the maximum of their posterior given sums of the trips of vehicles (`tripwatt.hybrid.groups`). The spread between
models that certified consumption shows counts as many cars as it is based on. The other spreads are assumed and count as `ASSUMED_DF`
cars. `Population.to_frame` prints both.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.hybrid.factors import ASSUMED_DF, FACTORS, NAMES, SDS, TripEvidence
from tripwatt.hybrid.groups import GroupPosterior, Scales, Sums, fit_scales, group_posterior
from tripwatt.hybrid.learning import Experts
from tripwatt.vehicles import Vehicle
from tripwatt.vehicles.anchors import CLASS_ANCHORS, spreads
from tripwatt.vehicles.catalogue import beyond_classes, mass_range_kg

ROOT_SD: Final = 0.35
"""Prior standard deviation of the common mean of all cars, relative to that between cars: simulations are right on average."""

LEVEL_SDS: Final = np.array([[f.models / f.sd, f.vehicles / f.sd] for f in FACTORS]).T
"""Standard deviations between car models and between vehicles before any trip, in usual standard deviations, shape (2, factors)."""

_LOG_SDS: Final = np.sqrt(0.5 / np.array([[f.df, ASSUMED_DF] for f in FACTORS])).T.ravel()
"""Standard deviations of the logarithms of `LEVEL_SDS`: about sqrt(0.5 / n) for a standard deviation of n degrees of freedom."""


@dataclass(frozen=True, slots=True)
class Source:
    """Origin of the sums of a vehicle.

    Attributes
    ----------
    car_model : str
        Name of the vehicle's car model, such as "nissan_leaf_24".
    vehicle : str
        Name of the vehicle itself.
    dataset : str
        Name of the data set, such as "tum".
    trips : int
        Number of trips in the sums.
    citation : str
        Citation of the data set.
    licence : str
        Licence of the data set.
    """

    car_model: str
    vehicle: str
    dataset: str
    trips: int
    citation: str
    licence: str


@dataclass(frozen=True, eq=False)
class Population:
    """Cars with trips, as sums, and the prior for a car without trips.

    Attributes
    ----------
    sums : Sums
        Sums of the trips. Groups are pairs of car model and vehicle; features are the factors in usual standard deviations.
    sources : tuple of Source
        Data set, citation and licence of each vehicle.
    logs : tuple of float
        Logarithms of the spreads, see `Scales.logs`, if they were fitted before; empty otherwise. The fit imports slow modules.

    Examples
    --------
    >>> everybody = population()
    >>> sorted({source.dataset for source in everybody.sources})
    ['tum', 'twizy', 'ved']
    >>> [source.vehicle for source in everybody.without({"ved"}).sources]
    ['tum', 'twizy']
    >>> list(everybody.to_frame().columns)
    ['unit', 'mean', 'mean_sd', 'car_sd', 'models_sd', 'models_df', 'vehicles_sd', 'vehicles_df', 'source']

    A car without trips:

    >>> from tripwatt.vehicles import load_vehicle
    >>> new = everybody.experts(load_vehicle("vw_id3"))
    >>> new.trips, round(float(new.weights.sum()), 6)
    (0, 1.0)

    Trips of one more BMW i3, in place of those that the package has of this car model:

    >>> from tripwatt.hybrid import segment_trips
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> car, trips = load_vehicle("bmw_i3_60ah"), synthetic_fleet(3).trips
    >>> evidence = TripEvidence.from_table(segment_trips(trips, car), car)
    >>> source = Source(car.name, "mine", "exports", len(evidence), "", "")
    >>> [source.vehicle for source in everybody.with_car(source, evidence).sources]
    ['ved-10', 'ved-541', 'twizy', 'mine']
    >>> alone = Population.from_evidence([(source, evidence)])
    >>> Population.from_dict(alone.to_dict()).sums.groups
    (('bmw_i3_60ah', 'mine'),)
    """

    sums: Sums
    sources: tuple[Source, ...] = ()
    logs: tuple[float, ...] = ()

    @classmethod
    def from_evidence(cls, cars: Sequence[tuple[Source, TripEvidence]]) -> Population:
        """Sum up the trips of some vehicles. O(trips x factors^2).

        Parameters
        ----------
        cars : sequence of (Source, TripEvidence)
            Each vehicle and the evidence of its trips, simulated with its values as on the road.

        Returns
        -------
        Population
            Population of these vehicles only.
        """
        each = (evidence.sums(source.car_model, source.vehicle) for source, evidence in cars)
        return cls(sum(each, Sums.empty(len(NAMES))), tuple(source for source, _ in cars))

    def without(self, datasets: Collection[str]) -> Population:
        """Leave out the vehicles of some data sets.

        Parameters
        ----------
        datasets : collection of str
            Names of data sets, see `Source.dataset`; unknown names are ignored.

        Returns
        -------
        Population
            Population of the other vehicles.
        """
        kept = tuple(source for source in self.sources if source.dataset not in datasets)
        groups = {(source.car_model, source.vehicle) for source in kept}
        return Population(self.sums.take([i for i, g in enumerate(self.sums.groups) if g in groups]), kept)

    def with_car(self, source: Source, evidence: TripEvidence) -> Population:
        """Add the trips of one more vehicle, which replace those of its car model.

        Parameters
        ----------
        source : Source
            The vehicle.
        evidence : TripEvidence
            Evidence of the vehicle's trips.

        Returns
        -------
        Population
            Population of the vehicles of all other car models and this one.
        """
        others = [i for i, (model, _) in enumerate(self.sums.groups) if model != source.car_model]
        own = evidence.sums(source.car_model, source.vehicle)
        kept = tuple(other for other in self.sources if other.car_model != source.car_model)
        return Population(self.sums.take(others) + own, (*kept, source))

    @cached_property
    def _scales(self) -> Scales:
        usual = Scales(tuple(map(tuple, LEVEL_SDS.tolist())), 1.0, tuple(range(len(FACTORS))), ROOT_SD)
        if self.logs:
            return usual.with_logs(np.array(self.logs))
        return fit_scales(self.sums, usual, _LOG_SDS) if self.sums.groups else usual

    @cached_property
    def _posterior(self) -> GroupPosterior:
        return group_posterior(self.sums, self._scales)

    def experts(self, vehicle: Vehicle) -> Experts:
        """Make the prior of a car without trips.

        If there are trips of other vehicles of its car model, the prior starts from these. If the car has the values of a class, the
        prior is wider, the more so the further the car's mass is from those of the library's cars.

        Parameters
        ----------
        vehicle : Vehicle
            The car with its published values; its name, anchor and mass count.

        Returns
        -------
        Experts
            Experts before any trip; factors are in usual standard deviations.
        """
        mean, covariance = self._posterior.weights(vehicle.name)
        if not self.sums.groups:  # a tree without cars has no levels
            covariance = covariance + np.diag((LEVEL_SDS**2).sum(axis=0))
        shift, variance = _beyond_values(vehicle)
        return Experts.from_prior(mean, covariance, shift, variance)

    def to_frame(self) -> pd.DataFrame:
        """Table of the mean of each factor over cars, its spread between cars, and the sources of the spread.

        Returns
        -------
        DataFrame
            One row for each factor: its unit, "1" for a relative change or "kW"; in this unit the mean over cars with its standard
            deviation, and the standard deviation between cars. Then the prior standard deviations before any trip, between car models
            and between vehicles of one model, each with its degrees of freedom, and their source.
        """
        posterior = self._posterior
        between = sum((posterior.scales.variances(level) for level in (1, 2)), np.zeros(len(FACTORS)))
        columns = {
            "unit": [f.unit for f in FACTORS],
            "mean": posterior.weights()[0] * SDS,
            "mean_sd": np.sqrt(np.diag(posterior.covariance[0])) * SDS,
            "car_sd": np.sqrt(between) * SDS,
            "models_sd": [f.models for f in FACTORS],
            "models_df": [f.df for f in FACTORS],
            "vehicles_sd": [f.vehicles for f in FACTORS],
            "vehicles_df": ASSUMED_DF,
            "source": [f.source for f in FACTORS],
        }
        return pd.DataFrame(columns, index=pd.Index(NAMES, name="factor"))

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as in the file that comes with the package.

        Returns
        -------
        dict
            `factors`, the usual standard deviation of each; `sources`; `sums` as nested lists; and `logs` of the spreads.
        """
        return {
            "factors": dict(zip(NAMES, SDS.tolist(), strict=True)),
            "sources": [asdict(source) for source in self.sources],
            "sums": {name: np.asarray(v).tolist() for name, v in self.sums.to_arrays().items()},
            "logs": self._scales.logs.tolist(),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Population:
        """Make a population from plain values: the reverse of `to_dict`.

        Parameters
        ----------
        values : mapping
            Values from `to_dict`.

        Returns
        -------
        Population
            Population with the same sums and sources.

        Raises
        ------
        KeyError, TypeError or ValueError
            If the values are not those of a population.
        """
        sums = Sums.from_arrays({name: np.array(value) for name, value in values["sums"].items()})
        return cls(sums, tuple(Source(**source) for source in values["sources"]), tuple(values["logs"]))


POPULATION_FILE: Final = Path(__file__).parent / "data" / "population.json"


@cache
def population() -> Population:
    """Load the population of the package, from trips that everybody may use: sums by `python -m tools.data.population`.

    Returns
    -------
    Population
        Population of the package; the file is read once.

    Examples
    --------
    >>> sorted({source.car_model for source in population().sources})
    ['bmw_i3_60ah', 'nissan_leaf_24', 'renault_twizy']
    """
    return Population.from_dict(json.loads(POPULATION_FILE.read_text(encoding="utf-8")))


def _beyond_values(vehicle: Vehicle) -> tuple[FloatArray, FloatArray]:
    """Shift of the prior mean and added variance for a car, by the anchor of its values, each of shape (factors,)."""
    shift, variance = np.zeros(len(NAMES)), np.zeros(len(NAMES))
    beyond = beyond_classes(vehicle.body.curb_mass_kg) if vehicle.anchor in CLASS_ANCHORS else 0.0
    for name, width in spreads(vehicle.anchor, beyond).items():
        its = NAMES.index(name)
        variance[its] = max(0.0, (width / SDS[its]) ** 2 - float(LEVEL_SDS[:, its] @ LEVEL_SDS[:, its]))
    # standard deviation of the whole consumption: a quarter of the logarithmic distance of the mass; a choice
    variance[0] += (0.25 * beyond / SDS[0]) ** 2
    if vehicle.body.curb_mass_kg < mass_range_kg()[0]:
        # in proportion to mass and power, or as of the lightest car: the mean of both logarithms
        for its in (NAMES.index("rolling"), NAMES.index("drivetrain")):
            shift[its] = (math.exp(0.5 * beyond) - 1.0) / SDS[its]
    return shift, variance
