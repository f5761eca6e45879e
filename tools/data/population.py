"""Make the sums of cars that come with the package anew: ``python -m tools.data.population [--data DATA]``.

DATA has the folders `tum`, `ved` and `twizy`. Only sums over all trips of a vehicle go into the file; no data set whose licence limits its use is read.
Printed beside them: the two shares of the net energy by which trips of a vehicle err after its own factors (`hybrid.factors.USUAL_SHARE`), and those at
which all vehicles together, one vote each, are most probable.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from tools import DATA
from tools.command import run
from tripwatt.arrays import FloatArray
from tripwatt.auditing import audit
from tripwatt.certification import describe_car
from tripwatt.hybrid import segment_trips
from tripwatt.hybrid.factors import SDS, TAIL_DF, USUAL_WH, TripEvidence
from tripwatt.hybrid.parameters import on_road
from tripwatt.population.prior import POPULATION_FILE, Population, Source
from tripwatt.sources import read_logs
from tripwatt.trips import Trip, TripSet
from tripwatt.vehicles import Vehicle, load_vehicle
from tripwatt.vehicles.catalogue import QUADRICYCLE

MIN_M = 2000.0
MIN_TRIPS = 15
LICENCES = {"tum": "CC BY 4.0", "ved": "Apache-2.0", "twizy": "CC BY 4.0"}
CITATIONS = {
    "twizy": "Y. NaitMalek et al., RSK Twizy EV dataset, doi:10.1109/ACCESS.2022.3225643 and doi:10.3390/su14169993",
}


def cars(data: Path) -> Iterator[tuple[Source, list[Trip], Vehicle]]:
    """Each vehicle whose data may be shipped, its trips in order of time, and its car with published values."""
    tum = read_logs(data / "tum", "tum")
    yield _source(tum, "bmw_i3_60ah", "tum"), list(tum.reference_trips()), load_vehicle("bmw_i3_60ah")
    ved = read_logs(data / "ved", "ved")
    sound = [
        trip for trip in audit(ved).trips if trip.distance_m >= MIN_M and trip.observed_energy_wh is not None
    ]
    leaf = load_vehicle("nissan_leaf_24")
    for name in sorted({str(trip.context.car) for trip in sound}):
        trips_of_car = [trip for trip in sound if trip.context.car == name]
        trips_of_car.sort(key=lambda trip: (str(trip.context.started_at), trip.trip_id))
        yield _source(ved, leaf.name, f"ved-{name}"), trips_of_car, leaf
    twizy = read_logs(data / "twizy", "table", Path(__file__).parent / "twizy.toml")
    car = replace(describe_car(body=QUADRICYCLE), name="renault_twizy")
    yield _source(twizy, car.name, "twizy"), [t for t in twizy.trips if t.observed_energy_wh is not None], car


def _source(fleet: TripSet, car_model: str, vehicle: str) -> Source:
    dataset = vehicle.partition("-")[0]
    return Source(car_model, vehicle, dataset, 0, fleet.citation or CITATIONS[dataset], LICENCES[dataset])


def evidence(trips: list[Trip], car: Vehicle) -> TripEvidence:
    """What trips show of a car with its values as on the road."""
    road = on_road(car)
    return TripEvidence.from_table(segment_trips(trips, road), road)


@dataclass(frozen=True, eq=False, slots=True)
class Errors:
    """Errors of trips after the vehicle's own factors [Wh], with size [Wh] and length [km]; shapes (trips,)."""

    error_wh: FloatArray
    measured_wh2: FloatArray
    size_wh: FloatArray
    km: FloatArray

    @classmethod
    def of(cls, found: TripEvidence, trips: list[Trip]) -> Errors:
        """Each trip by the factors of the others: a ridge whose errors follow a t distribution."""
        X, y, weight = found.factors_wh, found.residual_wh, np.ones(len(found))
        for _ in range(10):
            variance = (found.usual_wh2 + found.measured_wh2) * weight
            inverse = np.linalg.inv((X.T / variance) @ X + np.eye(X.shape[1]))
            error = y - X @ (inverse @ ((X.T / variance) @ y))
            lever = np.einsum("ij,jk,ik->i", X, inverse, X) / variance
            weight = (TAIL_DF + error**2 / variance) / (TAIL_DF + 1.0)
        km = np.array([trip.distance_m for trip in trips]) / 1000.0
        size = np.abs(found.factors_wh[:, 0] / SDS[0])
        return cls(error / np.sqrt(np.maximum(1.0 - lever, 0.2)), found.measured_wh2, size, km)

    def cost(self, logs: FloatArray) -> float:
        """Negative mean log likelihood of t-distributed errors, by the logarithms of the squares of both shares."""
        stays, over_km = np.exp(logs)
        variance = USUAL_WH**2 + self.size_wh**2 * (stays + over_km / self.km) + self.measured_wh2
        tail = 0.5 * (TAIL_DF + 1.0) * np.log1p(self.error_wh**2 / variance / (TAIL_DF - 2.0))
        return float(np.mean(0.5 * np.log(variance) + tail))


def shares(vehicles: Sequence[Errors]) -> tuple[float, float]:
    """The share that stays and the one over a kilometre at which the errors of vehicles are most probable, one vote each."""

    def cost(logs: FloatArray) -> float:
        return sum(vehicle.cost(logs) for vehicle in vehicles)

    best = minimize(cost, np.log([0.04**2, 0.3**2]), method="Nelder-Mead")
    stays, over_km = np.exp(0.5 * best.x).tolist()
    return stays, over_km


def main(data: Path = DATA) -> int:
    """Write the file."""
    known, errors = [], []
    for source, trips, car in cars(data):
        about = Source(**{n: getattr(source, n) for n in Source.__slots__ if n != "trips"}, trips=len(trips))
        known.append((about, evidence(trips, car)))
        print(f"{about.vehicle}: {about.trips} trips")
        if len(trips) >= MIN_TRIPS:
            errors.append(Errors.of(known[-1][1], trips))
            print(
                "  shares of the net energy: {:.3f} and {:.3f} over a kilometre".format(*shares(errors[-1:]))
            )
    print("all vehicles: {:.3f} and {:.3f} over a kilometre".format(*shares(errors)))
    text = json.dumps(Population.from_evidence(known).to_dict(), indent=1)
    POPULATION_FILE.write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    run(main)
