"""What of a correction is about the car and what about the world: zero-shot transfer with other covariates, both ways.

    python -m benchmarks.transfer_covariates [--out docs/results/transfer-covariates.json]

A process is fitted on one car and corrects the other's physics, by half and in full;
scored on the second half in time of the other car's trips of 2 km and more, as `tripwatt transfer` does. Nothing of the
other car is fitted, and no value of a car comes from the other's logs.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from tools import DATA, DOCS
from tools.command import run
from tripwatt.evaluation.transfer_scores import energy_error, paired_energy_error, resamples
from tripwatt.forecasting.donor import unknown_inputs, without_inputs
from tripwatt.hybrid.hierarchy import Members, term_scales

from tripwatt.arrays import FloatArray
from tripwatt.auditing import audit
from tripwatt.hybrid import SegmentTable, segment_trips
from tripwatt.hybrid.power import LINES, GPCorrector
from tripwatt.sources import read_logs
from tripwatt.trips import Trip
from tripwatt.vehicles import Vehicle, load_vehicle, without_data

PARTS = GPCorrector().terms
SMOOTH = tuple(term for term in PARTS if term.kind == "smooth")
Scales = Callable[[Members, Vehicle, Vehicle], FloatArray]


def as_watts(members: Members, source: Vehicle, target: Vehicle) -> FloatArray:
    return np.ones(sum(members.sizes))


def all_smooth(ratio: Callable[[Vehicle], float]) -> Scales:
    def scales(members: Members, source: Vehicle, target: Vehicle) -> FloatArray:
        factor = ratio(target) / ratio(source)
        factors = [factor if term.kind == "smooth" else 1.0 for term in members.terms]
        return np.repeat(np.array(factors), members.sizes)

    return scales


def mass(car: Vehicle) -> float:
    return car.body.test_mass_kg


def rated(car: Vehicle) -> float:
    return car.drivetrain.motor_max_power_w


VARIANTS = {
    "car-free: causes as shares, speed per mass, climate per cabin heat": (PARTS, term_scales, True),
    "smooth parts in watts, as they are": (PARTS, as_watts, True),
    "smooth parts per mass": (PARTS, all_smooth(mass), True),
    "smooth parts as a fraction of rated power": (PARTS, all_smooth(rated), True),
    "shares of the simulated causes alone": (LINES, as_watts, True),
    "smooth parts in watts alone": (SMOOTH, as_watts, True),
    "car-free, but nothing hidden from the first car": (PARTS, term_scales, False),
}


def direction(
    source: Sequence[Trip], target: Sequence[Trip], cars: tuple[Vehicle, Vehicle]
) -> dict[str, Any]:
    hidden = unknown_inputs(target)
    scored = segment_trips(target[len(target) // 2 :], cars[1])
    observed = scored.totals_wh(scored.observed_power_w)
    simulated = scored.totals_wh(scored.simulated_w)
    index = resamples(len(observed), 0)
    learned = {
        hide: segment_trips([without_inputs(t, hidden if hide else ()) for t in source], cars[0])
        for hide in (True, False)
    }
    rows, first = [], None
    for name, (parts, scales, hide) in VARIANTS.items():
        correction = _correction(GPCorrector(parts).fit(learned[hide]), scales, scored, cars)
        half, full = (simulated + share * correction for share in (0.5, 1.0))
        first = half if first is None else first
        rows.append(
            {
                "covariates": name,
                "half": energy_error(observed, half),
                "full": energy_error(observed, full),
                "half_minus_physics": paired_energy_error(observed, half, simulated, index),
                "half_minus_car_free": paired_energy_error(observed, half, first, index),
            }
        )
    return {
        "from": cars[0].title,
        "to": cars[1].title,
        "trips_scored": len(observed),
        "hidden": list(hidden),
        "physics": energy_error(observed, simulated),
        "variants": rows,
    }


def _correction(
    corrector: GPCorrector, scales: Scales, table: SegmentTable, cars: tuple[Vehicle, Vehicle]
) -> FloatArray:
    members = Members.from_corrector(corrector)
    features = members.features(table) * scales(members, *cars) * members.familiarity(table)[:, None]
    return table.totals_wh(features @ members.weights)


def main(out: Path = DOCS / "results" / "transfer-covariates.json") -> None:
    """Print the variants, and write them."""
    tum = list(read_logs(DATA / "tum", "tum").reference_trips())
    ved = [t for t in audit(read_logs(DATA / "ved", "ved")).trips if t.distance_m >= 2000.0]
    car_10 = [t for t in ved if t.context.car == "10"]
    i3, leaf = load_vehicle("bmw_i3_60ah"), load_vehicle("nissan_leaf_24")
    tum.sort(key=lambda trip: str(trip.context.started_at))
    ways = [
        direction(tum, car_10, (i3, leaf)),
        direction(ved, tum, (without_data(leaf, "tum"), without_data(i3, "tum"))),
    ]
    for way in ways:
        print(f"{way['from']} -> {way['to']}, physics {100 * way['physics'][0]:.1f} %")
        for row in way["variants"]:
            pair = row["half_minus_car_free"]
            told = f"{100 * pair['diff']:+.2f} ({100 * pair['diff_ci95'][0]:+.2f} to {100 * pair['diff_ci95'][1]:+.2f})"
            print(
                f"  {row['covariates']:70s} half {100 * row['half'][0]:5.1f} full {100 * row['full'][0]:5.1f}  {told}"
            )
    out.write_text(json.dumps(ways, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    run(main)
