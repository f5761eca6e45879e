"""Make the sums of cars that come with the package anew: ``python -m tools.data.population [--data DATA]``.

DATA has the folders `tum`, `ved` and `twizy`. Only sums over all trips of a vehicle go into the file; no data set whose licence limits its use is read.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from tools import DATA
from tools.command import run
from tripwatt.auditing import audit
from tripwatt.certification import describe_car
from tripwatt.hybrid import segment_trips
from tripwatt.hybrid.factors import TripEvidence
from tripwatt.hybrid.parameters import on_road
from tripwatt.population.prior import POPULATION_FILE, Population, Source
from tripwatt.sources import read_logs
from tripwatt.trips import Fleet, Trip
from tripwatt.vehicles import Vehicle, load_vehicle
from tripwatt.vehicles.catalogue import QUADRICYCLE

LEAST_M = 2000.0
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
        trip
        for trip in audit(ved).trips
        if trip.distance_m >= LEAST_M and trip.observed_energy_wh is not None
    ]
    leaf = load_vehicle("nissan_leaf_24")
    for name in sorted({str(trip.context.car) for trip in sound}):
        own = [trip for trip in sound if trip.context.car == name]
        own.sort(key=lambda trip: (str(trip.context.started_at), trip.trip_id))
        yield _source(ved, leaf.name, f"ved-{name}"), own, leaf
    twizy = read_logs(data / "twizy", "table", Path(__file__).parent / "twizy.toml")
    car = replace(describe_car(body=QUADRICYCLE), name="renault_twizy")
    yield _source(twizy, car.name, "twizy"), [t for t in twizy.trips if t.observed_energy_wh is not None], car


def _source(fleet: Fleet, car_model: str, vehicle: str) -> Source:
    dataset = vehicle.partition("-")[0]
    return Source(car_model, vehicle, dataset, 0, fleet.citation or CITATIONS[dataset], LICENCES[dataset])


def evidence(trips: list[Trip], car: Vehicle) -> TripEvidence:
    """What trips show of a car with its values as on the road."""
    road = on_road(car)
    return TripEvidence.from_table(segment_trips(trips, road), road)


def main(data: Path = DATA) -> int:
    """Write the file."""
    known = []
    for source, trips, car in cars(data):
        about = Source(**{n: getattr(source, n) for n in Source.__slots__ if n != "trips"}, trips=len(trips))
        known.append((about, evidence(trips, car)))
        print(f"{about.vehicle}: {about.trips} trips")
    text = json.dumps(Population.from_evidence(known).to_dict(), indent=1)
    POPULATION_FILE.write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    run(main)
