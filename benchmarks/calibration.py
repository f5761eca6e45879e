"""What calibrated book values gain, leave-one-trip-out on the reference trips: `python -m benchmarks.calibration`."""

from __future__ import annotations

import numpy as np

from benchmarks.measure import tum_folder
from tripwatt.hybrid.calibrate import calibrate
from tripwatt.physics import simulate_trip
from tripwatt.sources import read_logs
from tripwatt.vehicles import load_vehicle


def main() -> None:
    folder = tum_folder()
    if folder is None:
        print("no TUM trips at hand")
        return
    trips = read_logs(folder).reference_trips()
    car = load_vehicle("bmw_i3_60ah")
    observed = np.array([trip.observed_energy_wh for trip in trips], dtype=float)
    before = np.array([simulate_trip(car, trip).simulated_energy_wh for trip in trips])
    after = []
    for i, trip in enumerate(trips):
        found = calibrate([t for j, t in enumerate(trips) if j != i], car)
        after.append(simulate_trip(found.applied(car), trip).simulated_energy_wh)
    for name, energy in (("book values", before), ("calibrated in the fold", np.array(after))):
        ape = np.abs(energy - observed) / observed
        print(
            f"physics, {name}: mean APE {ape.mean():.4f}, RMSE {np.sqrt(np.mean((energy - observed) ** 2)):.0f} Wh"
        )
    found = calibrate(trips, car)
    for name, change in found.changes.items():
        print(f"{name}: {change:+.1%} +- {found.sd[name]:.1%}")


if __name__ == "__main__":
    main()
