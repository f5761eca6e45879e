"""Widths of the 90 % interval over the energy, for every car of the library: ``python -m benchmarks.widths``.

Flat roads of 20 to 600 km at 50 to 130 km/h and -15 to 35 °C, links of 5 km, everything known at departure. Prints the
widest for each car; for the packaged model's own car also by the conditions of its bar, and the narrowest interval inside
and outside the range of its training at the same length.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from tools.command import run

import tripwatt as tw
from tripwatt.population import for_car
from tripwatt.trips import Departure
from tripwatt.vehicles import vehicle_names

KM = (20, 60, 160, 300, 600)
KM_H = (50, 90, 110, 130)
DEGC = (-15, -5, 10, 20, 30, 35)
MOST = 0.70
MAX_OWN_USUAL, MAX_OWN = 0.30, 0.45


@dataclass(frozen=True, slots=True)
class Width:
    """One drive: its conditions, its width over the energy, and whether it is flagged as unlike the training."""

    km: int
    km_h: int
    degc: int
    width_wh: float
    share: float
    low_wh: float
    outside: bool


def drives(model: tw.ForecastModel) -> Iterator[Width]:
    """Every combination of conditions."""
    for km, km_h in itertools.product(KM, KM_H):
        pieces = max(km // 5, 1)
        plan = tw.read_route([{"length_m": 1000.0 * km / pieces, "speed_m_s": km_h / 3.6}] * pieces)
        for degc in DEGC:
            cold = float(degc)
            known = Departure(
                soc=0.9,
                ambient_temperature_degc=cold,
                battery_temperature_degc=cold,
                cabin_temperature_degc=cold,
                cabin_setpoint_degc=21.0,
            )
            forecast = model.forecast(plan, known)
            low, high = forecast.interval(0.9)
            outside = any(flag.code == "outside_training" for flag in forecast.flags)
            yield Width(km, km_h, degc, high - low, (high - low) / forecast.energy_wh, low, outside)


def _narrowest(rows: Sequence[Width]) -> str:
    return f"{min(r.width_wh for r in rows):.0f} Wh ({min(r.share for r in rows):.1%} of the energy)"


def main() -> int:
    """Print the widths; exit code 1 when a bar is missed."""
    base = tw.load_model()
    missed = 0
    for name in vehicle_names():
        rows = list(drives(for_car(base, name)))
        widest = max(rows, key=lambda row: row.share)
        least = min(row.low_wh for row in rows)
        bound = MOST
        if name == base.vehicle.name:
            bound = MAX_OWN
            usual = [r for r in rows if r.km >= 60 and -5 <= r.degc <= 30 and r.km_h <= 110]
            worst = max(usual, key=lambda row: row.share)
            missed += worst.share > MAX_OWN_USUAL
            print(f"{name}: from 60 km, -5 to 30 °C, up to 110 km/h: {worst.share:.1%} ({worst})")
            for km in KM:
                inside, beyond = ([r for r in rows if r.km == km and r.outside == o] for o in (False, True))
                if inside and beyond:
                    missed += min(r.width_wh for r in beyond) < min(r.width_wh for r in inside)
                    print(f"  {km} km: narrowest inside {_narrowest(inside)}, outside {_narrowest(beyond)}")
        missed += widest.share > bound or least <= 0.0
        print(
            f"{name:24s} widest {widest.share:6.1%} at {widest.km} km, {widest.km_h} km/h, {widest.degc} °C; "
            f"lowest bound {least:.0f} Wh",
            flush=True,
        )
    return int(missed > 0)


if __name__ == "__main__":
    run(main)
