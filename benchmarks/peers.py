"""Other systems on the same trips: `make peers`, or `python -m benchmarks.peers [--write]` where they are installed.

Each is given the speed of a second, the grade of the road and the outside temperature of the logged trips, and forecasts their
energy at the battery; none is fitted on them, but the constant, which leaves each trip out. Times are of one process, in one
run, with the building of the car left out. `--write` puts the table into docs/explanation/peers.md.
"""

from __future__ import annotations

import contextlib
import io
import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from tools import command
from tools.docs import pages

from benchmarks.measure import Row, seconds, tum_folder
from benchmarks.pipeline import fastsim_drive
from tripwatt.auditing import audit
from tripwatt.physics import simulate_trip
from tripwatt.physics.road_load import air_density, grade_from_elevation
from tripwatt.sources import read_logs
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Trip, resample
from tripwatt.units import WH_PER_J
from tripwatt.vehicles import Vehicle, load_vehicle

SHORTEST_M: Final = 2000.0
NO_SIMULATION: Final = 3e8
"""Seconds of driving in a second from which a system is a product of two numbers."""
LINK_S: Final = 30
"""Seconds of a link of RouteE, which takes links and not samples."""


@dataclass(frozen=True)
class Cars:
    """Trips of one car, 1 Hz, and what each system calls it."""

    title: str
    vehicle: Vehicle
    trips: tuple[Trip, ...]
    observed_wh: np.ndarray
    emobpy: tuple[str, str, str]

    @classmethod
    def of(cls, title: str, vehicle: str, trips: Sequence[Trip], emobpy: tuple[str, str, str]) -> Cars:
        """Trips of at least two kilometres with a measured energy."""
        known = [t for t in trips if t.observed_energy_wh is not None and t.distance_m >= SHORTEST_M]
        observed = np.array([t.observed_energy_wh for t in known], dtype=np.float64)
        return cls(title, load_vehicle(vehicle), tuple(resample(t) for t in known), observed, emobpy)

    @property
    def seconds(self) -> float:
        """Seconds of all trips."""
        return float(sum(trip.duration_s for trip in self.trips))


def all_cars() -> list[Cars]:
    """The BMW i3 of the TUM, both Nissan Leafs of the VED, and the synthetic world."""
    cars = []
    folder = tum_folder()
    if folder is not None:
        fleet = read_logs(folder, "tum")
        cars.append(
            Cars.of("BMW i3 (TUM)", "bmw_i3_60ah", fleet.reference_trips(), ("BMW", "i3 22 kWh", "2014"))
        )
        ved = audit(read_logs(folder.parent / "ved", "ved")).trips
        leaf = ("Nissan", "Leaf SV", "2013")
        for car in ("VED10", "VED541"):
            own = [trip for trip in ved if trip.trip_id.startswith(f"{car}-")]
            cars.append(Cars.of(f"Nissan Leaf ({car[:3]} {car[3:]})", "nissan_leaf_24", own, leaf))
    trips = synthetic_fleet(60, 3).trips
    return [*cars, Cars.of("synthetic i3", "bmw_i3_60ah", trips, ("BMW", "i3 22 kWh", "2014"))]


def ambient_degc(trip: Trip) -> float:
    """Outside temperature at departure; 15 °C where the log has none."""
    known = trip.departure.ambient_temperature_degc
    return 15.0 if known is None else known


def grade(trip: Trip) -> np.ndarray:
    """Rise over distance, the same for every system."""
    if "elevation_m" not in trip.samples:
        return np.zeros(len(trip))
    return grade_from_elevation(trip.array("time_s"), trip.array("speed_m_s"), trip.array("elevation_m"))


Job = Callable[[], np.ndarray]


def tripwatt_physics(cars: Cars) -> Job:
    """Our physics with published values."""
    return lambda: np.array([simulate_trip(cars.vehicle, trip).simulated_energy_wh for trip in cars.trips])


def constant(cars: Cars) -> Job:
    """Energy of a kilometre of the other trips."""
    distance = np.array([trip.distance_m for trip in cars.trips])
    return lambda: distance * (cars.observed_wh.sum() - cars.observed_wh) / (distance.sum() - distance)


def fastsim3(cars: Cars) -> Job:
    """FASTSim's model of a Zoe with the car's own mass, road load and auxiliary load; it has no climate control."""
    import fastsim

    template = fastsim.Vehicle.from_resource("2022_Renault_Zoe_ZE50_R135.yaml")
    template.set_save_interval(None)
    about, load, own = template.to_dict(), cars.vehicle.road_load, cars.vehicle
    weight_n = own.body.test_mass_kg * 9.81
    constant_part, linear = load.rolling_coefficients
    about["chassis"] |= {
        "drag_coef": load.drag_area_m2 / 2.4,
        "frontal_area_square_meters": 2.4,
        "wheel_rr_coef": constant_part + linear * 15.0,
        "glider_mass_kilograms": None,
        "cargo_mass_kilograms": None,
        "mass_kilograms": None,
    }
    about |= {"mass_kilograms": weight_n / 9.81, "pwr_aux_base_watts": own.auxiliaries.base_load_w}
    for part in about["pt_type"]["BEV"].values():
        if isinstance(part, dict) and "mass_kilograms" in part:
            part["mass_kilograms"] = None
            part.pop("specific_pwr_watts_per_kilogram", None)
    car = fastsim.Vehicle.from_dict(about)
    udds = fastsim.Cycle.from_resource("udds.csv").to_dict()
    drives = [fastsim_drive(fastsim, car, udds, trip, grade(trip).tolist()) for trip in cars.trips]

    def job() -> np.ndarray:
        energies = []
        for drive in drives:
            fresh = drive.copy()
            with contextlib.suppress(RuntimeError):
                fresh.run()
            battery = fresh.to_dict()["veh"]["pt_type"]["BEV"]["res"]["state"]
            energies.append(float(battery["energy_out_electrical_joules"]) * WH_PER_J)
        return np.array(energies)

    return job


def emobpy(cars: Cars) -> Job:
    """The equations of emobpy with its own values of the car, on the driven trace, with its cabin."""
    logging.disable(logging.INFO)
    from emobpy import BEVspecs, HeatInsulation, MGefficiency, Weather
    from emobpy import functions as of
    from emobpy.consumption import MODULE_DATA_PATH

    data = Path(MODULE_DATA_PATH)
    with contextlib.redirect_stdout(io.StringIO()):
        car = BEVspecs(str(data / "evspecs.json")).model(cars.emobpy, msg=False).parameters
        motor = MGefficiency(str(data / "motor_efficiency.csv"))
        cabin = HeatInsulation(default=True)
        weather = Weather()

    def energy(trip: Trip) -> float:
        speed, outside = trip.array("speed_m_s"), ambient_degc(trip)
        change = np.diff(speed, append=speed[-1:])
        mass = of.vehicle_mass(car["curb_weight"], 75.0)
        rolling = of.rolling_resistance_coeff(method="M1", temp=outside, v=speed * 3.6, road_type=0)
        wheel = of.p_wheel(
            of.prollingresistance(rolling, mass, 9.81, speed),
            of.pairdrag(air_density(outside), car["front_area"], car["drag_coeff"], speed, 0.0),
            of.p_gravity(mass, 9.81, speed, np.arctan(grade(trip))),
            of.pinertia(car["inertial_mass"], mass, change, speed),
        )
        out = of.p_motorout(wheel, car["transmission_eff"])
        back = of.p_generatorin(wheel, car["transmission_eff"], of.EFFICIENCYregenerative_braking(change))
        full = 1000.0 * car["power"]
        given = of.p_motorin(out, motor.get_efficiency(out / full, 1))
        taken = of.p_generatorout(back, motor.get_efficiency(back / full, -1))
        target, cop = (20.0, 2.0) if outside < 17.0 else (None, 1.0) if outside <= 24.0 else (22.0, 2.0)
        heat, _ = of.qhvac(
            weather.humidair_density,
            outside,
            target,
            car["cabin_volume"],
            0.01,
            cabin.zone_layers_,
            cabin.zone_surface_,
            cabin.layer_conductivity_,
            cabin.layer_thickness_,
            speed,
        )
        power = given + 1000.0 * car["auxiliary_power"] + np.abs(heat[:, 0]) / cop + taken
        into = np.minimum(power, 0.0) * car["battery_charging_eff"]
        return float((np.maximum(power, 0.0) / car["battery_discharging_eff"] + into).sum() * WH_PER_J)

    return lambda: np.array([energy(trip) for trip in cars.trips])


def routee(cars: Cars) -> Job:
    """RouteE Powertrain's model of a 2017 Chevrolet Bolt, the electric car that it ships; it knows speed and grade alone."""
    import routee.powertrain as routee_powertrain

    shipped = Path(routee_powertrain.__file__).parent / "resources" / "bundled_registry" / "v2"
    (folder,) = (shipped / "chevrolet" / "bolt_bev" / "2017").glob("*/v1")
    model = routee_powertrain.load_model(folder)
    tables, trips = [], []
    for number, trip in enumerate(cars.trips):
        link = np.arange(len(trip)) // LINK_S
        by_link = pd.DataFrame({"v": trip.array("speed_m_s"), "g": grade(trip)}).groupby(link).mean()
        tables.append(
            pd.DataFrame(
                {
                    "speed_mph": by_link["v"] / 0.44704,
                    "grade_percent": 100.0 * by_link["g"],
                    "distance": by_link["v"] * np.bincount(link) / 1609.344,
                }
            )
        )
        trips.append(np.full(len(by_link), number))
    links, owner = pd.concat(tables, ignore_index=True), np.concatenate(trips)

    def job() -> np.ndarray:
        energy_kwh = model.predict(links).to_numpy(dtype=np.float64)[:, 0]
        return np.bincount(owner, weights=1000.0 * energy_kwh)

    return job


OURS: Final = "tripwatt, physics alone"

SYSTEMS: Final[dict[str, tuple[Callable[[Cars], Job], str]]] = {
    OURS: (tripwatt_physics, "published values of the car, climate control"),
    "FASTSim 3": (fastsim3, "its Zoe with the car's mass, drag area, rolling resistance and auxiliary load"),
    "emobpy": (emobpy, "its own values of the car, its cabin"),
    "RouteE Powertrain": (routee, "its 2017 Bolt, links of 30 s"),
    "constant Wh/km": (constant, "the energy of the car's other trips"),
}


@dataclass(frozen=True)
class Score:
    """One system on the trips of one car."""

    cars: str
    trips: int
    system: str
    error: float
    weighted: float
    bias: float
    speed: float
    given: str

    @property
    def line(self) -> str:
        """As a row of the table."""
        speed = f"{self.speed:,.0f}" if self.speed < NO_SIMULATION else ""
        return (
            f"| {self.cars} | {self.trips} | {self.system} | {self.error:.1%} | {self.weighted:.1%} | {self.bias:+.1%} "
            f"| {speed} | {self.given} |"
        )


def scored(cars: Cars, system: str) -> Score:
    """Error, bias, and seconds of drive in a second of this process: the best of three runs."""
    build, given = SYSTEMS[system]
    job = build(cars)
    best, energies = seconds(job, 3, of=min), job()
    error, total = energies - cars.observed_wh, float(cars.observed_wh.sum())
    return Score(
        cars.title,
        len(cars.trips),
        system,
        float(np.mean(np.abs(error) / cars.observed_wh)),
        float(np.abs(error).sum() / total),
        float(error.sum() / total),
        cars.seconds / best,
        given,
    )


HEAD: Final = (
    "| trips of | trips | system | mean error | by energy | bias | s of drive / s | what it has of the car |\n"
    "|---|---:|---|---:|---:|---:|---:|---|"
)


def run() -> list[Score]:
    """Every system on every car; a system that is not installed is left out."""
    scores = []
    for cars in all_cars():
        for system in SYSTEMS:
            try:
                score = scored(cars, system)
            except ImportError as error:
                print(f"{system}: {error}")
                continue
            print(score.line, flush=True)
            scores.append(score)
    return scores


def rows() -> Iterator[Row]:
    """Our error by energy beside that of each other system, a row each."""
    ours: Score | None = None
    for score in run():
        if score.system == OURS:
            ours = score
            continue
        if ours is not None and ours.cars == score.cars:
            name = f"error by energy, physics alone, {score.cars}"
            ratio = score.weighted / ours.weighted
            theirs = 100.0 * score.weighted
            yield Row(name, 100.0 * ours.weighted, "%", peer=score.system, peer_value=theirs, ratio=ratio)


def main(write: bool = False) -> None:
    """Print the table. `--write` renews that of docs/explanation/peers.md."""
    table = "\n".join([HEAD, *(score.line for score in run())])
    if write:
        pages.renew("explanation/peers.md", "peers", table)


if __name__ == "__main__":
    command.run(main)
