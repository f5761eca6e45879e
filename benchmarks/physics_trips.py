"""Physics alone on the logged trips of the TUM set: accuracy of the presets, speed, closure of the energy.

Run: ``python -m benchmarks.physics_trips``. Needs TRIPWATT_DATA. Speed is the median of several passes over all trips
at 1 Hz in one process, beside a reference loop of the same machine at the same time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from tools import DATA

from benchmarks.measure import Row, reference_loop, seconds
from tripwatt.physics import simulate_trip
from tripwatt.sources import read_logs
from tripwatt.trips import Trip, resample
from tripwatt.vehicles import Vehicle, load_vehicle


def errors(vehicle: Vehicle, trips: Sequence[Trip]) -> np.ndarray:
    """(simulated - observed) / observed of each trip."""
    simulated = np.array([simulate_trip(vehicle, trip).simulated_energy_wh for trip in trips])
    observed = np.array([trip.observed_energy_wh for trip in trips], dtype=float)
    return (simulated - observed) / observed


def worst_closure(vehicle: Vehicle, trips: Sequence[Trip]) -> float:
    """Largest |sum of causes - battery energy| over the battery energy."""
    worst = 0.0
    for trip in trips:
        run = simulate_trip(vehicle, trip)
        parts = sum(run.by_cause_wh.values())
        worst = max(worst, abs(parts / run.simulated_energy_wh - 1.0))
    return worst


def bars() -> Iterator[Row]:
    """The bars on the sum of the parts."""
    trips = [resample(trip) for trip in read_logs(DATA / "tum").trips]
    for preset in ("default", "paper"):
        gap = worst_closure(load_vehicle("bmw_i3_60ah", preset), trips)
        yield Row(f"energy closes: worst relative gap of the parts, preset {preset}", gap, most=1e-9)


def main() -> None:
    fleet = read_logs(DATA / "tum")
    reference = [resample(trip) for trip in fleet.reference_trips()]
    everything = [resample(trip) for trip in fleet.trips]
    for preset in ("default", "paper"):
        vehicle = load_vehicle("bmw_i3_60ah", preset)
        error = errors(vehicle, reference)
        print(
            f"{preset}: {len(reference)} reference trips, mean APE {np.abs(error).mean():.4f}, "
            f"median {np.median(np.abs(error)):.4f}, max {np.abs(error).max():.3f}, bias {error.mean():+.4f}, "
            f"closure {worst_closure(vehicle, everything):.1e}"
        )
        samples = sum(len(trip) for trip in everything)
        wall = seconds(lambda car=vehicle: [simulate_trip(car, trip) for trip in everything])
        print(
            f"{preset}: {samples} simulated seconds in {wall * 1e3:.1f} ms: {samples / wall:,.0f} per second; "
            f"reference loop {reference_loop() * 1e3:.1f} ms"
        )


if __name__ == "__main__":
    main()
