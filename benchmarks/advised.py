"""Drives of synthetic worlds as they are and as advised: whether stated savings and chances hold. See `benchmarks.savings`.

A true car differs from its simulation by each factor of the model, drawn from what the model believes of a car without trips, and by the shape of its
losses, which no factor has: rolling resistance, air drag, drivetrain, base load and cabin over speed, losses over load, and heat over the outside air. Their
spread is that with which differences between schedules are as far from the simulation as those of a BMW i3 on a dynamometer. A day has errors of
every trip, and two shares of its energy, one of which evens out; outside air and wind differ from the forecast; on a planned road the car drives another trace than the plan has; the
battery holds more or less than its display shows. All other spreads are those that the model states: the arithmetic is tested, not the spreads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Final, NamedTuple

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from tools import DATA

import tripwatt as tw
from benchmarks.measure import Row
from benchmarks.worlds import WORLDS as PUBLISHED
from benchmarks.worlds import changed
from tripwatt.arrays import FloatArray
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.forecasting.difference import MIN_SHARE
from tripwatt.forecasting.leaving import soc_needed
from tripwatt.hybrid import segment_table
from tripwatt.hybrid.factors import USUAL_SHARE, USUAL_SHARE_KM, USUAL_WH, FactorCorrector, factor_power
from tripwatt.hybrid.learning import Experts
from tripwatt.physics import DriveConditions, Simulation, simulate, simulate_trip
from tripwatt.population import for_car
from tripwatt.population.adapting import population_of
from tripwatt.roads.advice import Action, Advice
from tripwatt.roads.weather import TEMPERATURE_SD_K, WIND_SD_M_S
from tripwatt.routes.links import links_of_trip
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Plan
from tripwatt.trips.weather import WIND_AT_CAR, PlanWeather
from tripwatt.uncertainty.charge import CAPACITY_SD, PUBLISHED_DISPLAY_SD
from tripwatt.uncertainty.coverage import clopper_pearson
from tripwatt.units import WH_PER_J
from tripwatt.vehicles import Vehicle

CAR: Final = "tesla_model_3_lr"
CHANCE: Final = 0.95
USUAL_M_S: Final = 15.0
MIN_M_S: Final = 1.0
USUAL_POWER_W: Final = 8000.0
MIN_POWER_W: Final = 200.0
USUAL_DEGC: Final = 5.0
WARMER_BY_K: Final = 15.0
LINK_M: Final = 250.0
FIRST_SEED: Final = 1000
"""Of what is reported; the drives of the seeds below were looked at during development."""


class Way(NamedTuple):
    """What shapes of losses are functions of, an array for the samples of a drive."""

    speed_m_s: FloatArray
    power_w: FloatArray
    degc: float


def _speed(way: Way) -> FloatArray:
    return way.speed_m_s / USUAL_M_S - 1.0


def _log_speed(way: Way) -> FloatArray:
    return np.log(np.maximum(way.speed_m_s, MIN_M_S) / USUAL_M_S)


def _log_power(way: Way) -> FloatArray:
    return np.log(np.maximum(np.abs(way.power_w), MIN_POWER_W) / USUAL_POWER_W)


def _outside(way: Way) -> FloatArray:
    return np.full_like(way.speed_m_s, (way.degc - USUAL_DEGC) / WARMER_BY_K)


SHAPES: Final[Sequence[tuple[str, Callable[[Way], FloatArray]]]] = (
    ("rolling", _speed),
    ("air", _log_speed),
    ("drivetrain", _log_speed),
    ("drivetrain", _log_power),
    ("base_load", _speed),
    ("climate", _speed),
    ("climate", _outside),
)
"""Cause and what its relative error grows with: an exponent of the speed or of the power where that is a logarithm."""


def shape_energies(run: Simulation, speed_m_s: FloatArray, degc: float) -> FloatArray:
    """Energy by a coefficient of 1 of each shape [Wh], shape (shapes,)."""
    hours = np.diff(run.time_s, prepend=run.time_s[0]) * WH_PER_J
    way = Way(speed_m_s, run.wheel_power_w, degc)
    return np.array([(run.power_by_cause_w[cause] * of(way)) @ hours for cause, of in SHAPES])


@cache
def shape_sd() -> float:
    """Spread of the coefficients with which differences between schedules err by `MIN_SHARE` of their causes, as root mean square.

    The car and the schedules are those of which `MIN_SHARE` was measured; for independent coefficients it is in proportion to them.
    """
    car = tw.load_vehicle("bmw_i3_60ah")
    lab = DriveConditions(
        on_dynamometer=True, ambient_temperature_degc=23.0, climate="off", initial_warmth=1.0
    )
    causes, shapes = [], []
    for name in ("udds", "hwfet", "us06"):
        cycle = pd.read_csv(DATA / "cycles" / f"{name}.csv")
        time, speed = (cycle[c].to_numpy(float) for c in ("cycSecs", "cycMps"))
        run = simulate(car, time, speed, conditions=lab)
        metres = np.trapezoid(speed, time)
        causes.append(np.array([*run.by_cause_wh.values()]) / metres)
        shapes.append(shape_energies(run, speed, 23.0) / metres)
    pairs = ((0, 1), (0, 2), (1, 2))
    shares = [np.linalg.norm(shapes[a] - shapes[b]) / np.linalg.norm(causes[a] - causes[b]) for a, b in pairs]
    return MIN_SHARE / float(np.sqrt(np.mean(np.square(shares))))


@dataclass(frozen=True)
class World:
    """Where the true cars of a world come from, and what is known before a drive.

    `published` is the name of a world of `benchmarks.worlds`, whose cars have other values and no other factors. Worlds of one setting have the same
    drives and the same advice.
    """

    about: str
    published: str = ""
    has_shapes: bool = False
    setting: str = "known road"


PLANNED: Final = "planned road"
KNOWN_CAR: Final = "known car"
WORLDS: Final[Mapping[str, World]] = {
    "siblings": World(
        "other coast-downs of one model, the rest even: narrower than the model believes", "siblings"
    ),
    "factors": World("factors as the model believes"),
    "shapes": World("as factors, and the shape of the losses", has_shapes=True),
    "planned": World("as shapes, on a planned road with the weather of a forecast", "", True, PLANNED),
    "known car": World(
        "as shapes, of a car whose factors are known, as after many own trips", "", True, KNOWN_CAR
    ),
}


@dataclass(frozen=True)
class Taken:
    """What a drive takes by what true cars differ in [Wh]: the simulation, its causes, the factors, shapes and errors of the day."""

    simulated: float
    causes: Mapping[str, float]
    factors: FloatArray
    shapes: FloatArray
    day: FloatArray

    @classmethod
    def of(cls, vehicle: Vehicle, plan: Plan, warmer_k: float = 0.0, headwind_m_s: float = 0.0) -> Taken:
        """Of a plan, in other weather than that of its departure."""
        degc = plan.departure.ambient_temperature_degc
        assert degc is not None  # every synthetic trip has it
        if warmer_k or headwind_m_s:
            warmer = replace(plan.departure, ambient_temperature_degc=degc + warmer_k)
            wind = PlanWeather(np.full(len(plan.samples), headwind_m_s))
            plan = replace(plan, departure=warmer).with_weather(wind)
        run = simulate_trip(vehicle, plan)
        table = segment_table(plan, run)
        factors = table.hours @ factor_power(table, vehicle.body.test_mass_kg)
        net = float(table.simulated_w @ table.hours)
        return cls(
            run.simulated_energy_wh,
            run.by_cause_wh,
            np.append(factors, factors[0]),  # the drift acts on everything
            shape_energies(run, plan.array("speed_m_s"), degc + warmer_k),
            np.array([1.0, net, net / np.sqrt(plan.distance_m / 1000.0)]),
        )


@dataclass(frozen=True)
class Truth:
    """A true car on a day: its vehicle, relative changes of factors, shapes and causes, errors of the day, of capacity and display, and the weather."""

    vehicle: Vehicle
    factors: FloatArray
    shapes: FloatArray
    causes: Mapping[str, float]
    day: FloatArray
    capacity: float
    display: float
    weather: tuple[float, float]

    @classmethod
    def drawn(cls, world: World, model: ForecastModel, experts: Experts, seed: int) -> Truth:
        """Of a world: what worlds have in common is the same in all."""
        rng = np.random.default_rng((seed, 1))
        k = int(rng.choice(len(experts.noise), p=experts.weights))
        factors = rng.multivariate_normal(experts.mean[k], experts.covariance[k], method="eigh")
        usual = np.array([USUAL_WH, USUAL_SHARE, USUAL_SHARE_KM]) * np.sqrt(experts.noise[k])
        day, shapes = usual * rng.standard_normal(3), rng.standard_normal(len(SHAPES))
        capacity, display = rng.standard_normal(2) * (CAPACITY_SD, PUBLISHED_DISPLAY_SD)
        kelvin, wind = rng.standard_normal(2) * (TEMPERATURE_SD_K[0], WIND_AT_CAR * WIND_SD_M_S[0])
        own = PUBLISHED[world.published][1](rng) if world.published else {}
        return cls(
            changed(model.vehicle, own),
            np.zeros_like(factors) if own else factors,
            shapes * (shape_sd() if world.has_shapes else 0.0),
            {cause: own.get(cause, 0.0) for cause in ("drivetrain", "climate")},
            day,
            capacity,
            display,
            (kelvin, wind) if world.setting == PLANNED else (0.0, 0.0),
        )

    def taken_wh(self, taken: Taken) -> float:
        """What a drive of this car takes."""
        by_cause = sum(taken.causes[cause] * share for cause, share in self.causes.items())
        by_car = taken.factors @ self.factors + taken.shapes @ self.shapes + taken.day @ self.day
        return taken.simulated + by_cause + float(by_car)

    def left(self, forecast: Forecast, leaves_with: float, taken_wh: float) -> float:
        """Displayed charge at arrival."""
        wh = forecast.charge.wh_per_display * (1.0 + self.capacity)
        return leaves_with - taken_wh / wh + self.display


class Saved(NamedTuple):
    """A saving: its action, what is stated, both ends of its 90 % interval, and the true one [Wh]."""

    code: str
    stated: float
    low: float
    high: float
    true: float


class Followed(NamedTuple):
    """One drive of a world."""

    saved: list[Saved]
    stays: tuple[float, bool]
    """Chance as it is, and whether it arrives."""
    follows: tuple[float, bool] | None
    """The same as advised; None where no advice reaches the chance."""
    just: bool | None
    """Whether one arrives who leaves with the charge with which the advised chance is just `CHANCE`."""


def with_weather_error(forecast: Forecast) -> Forecast:
    """A forecast with the error of the weather, as a journey's."""
    plan = forecast.plan
    degc = plan.departure.ambient_temperature_degc
    assert degc is not None
    colder = replace(
        plan, departure=replace(plan.departure, ambient_temperature_degc=degc - TEMPERATURE_SD_K[0])
    )
    windy = plan.with_weather(PlanWeather(np.full(len(plan.samples), WIND_AT_CAR * WIND_SD_M_S[0])))
    runs = [simulate_trip(forecast.vehicle, p).simulated_energy_wh for p in (plan, colder, windy)]
    sd = float(np.linalg.norm((forecast.state_sd_wh, runs[1] - runs[0], runs[2] - runs[0])))
    return replace(forecast, state_sd_wh=sd)


def advised_drive(setting: str, seed: int, base: ForecastModel, truth: Truth) -> tuple[Advice, Plan]:
    """Advice about a drive that is planned with too small a charge, and the trace that is driven."""
    rng = np.random.default_rng(seed)
    model = for_car(base, tw.load_vehicle(CAR))
    if setting == KNOWN_CAR:
        corrector = model.fitted_parts("car")[0]
        assert isinstance(corrector, FactorCorrector)
        known_car = replace(corrector, mean=truth.factors, factor=1e-3 * corrector.factor)
        model = replace(model, corrector_=known_car)
    (trip,) = synthetic_fleet(1, 40_000 + seed, vehicle=tw.load_vehicle(CAR), hours=(0.5, 2.0)).trips
    driven = Plan.from_trip(trip)
    known = replace(driven.departure, extras=("roof_box",), soc=None, bms_soc=None)
    driven = plan = replace(driven, departure=known)
    if setting == PLANNED:
        plan = links_of_trip(trip, LINK_M).plan(trip_id=trip.trip_id).with_departure(known)

    def forecast_with(departure: tw.Departure | None = None) -> Forecast:
        made = model.forecast(plan, departure)
        return with_weather_error(made) if setting == PLANNED else made

    needed = soc_needed(forecast_with(), 0.1, float(rng.uniform(0.75, 0.94)))
    leaves = tw.Departure(soc=min(max(needed, 0.11), 1.0))
    return tw.advise(forecast_with(leaves)), driven.with_departure(leaves)


def followed(names: Sequence[str], seed: int, base: ForecastModel) -> dict[str, Followed]:
    """Advise about a drive, and drive it as it is and as advised in worlds of one setting."""
    setting, car = WORLDS[names[0]].setting, for_car(base, tw.load_vehicle(CAR))
    experts = population_of(base).experts(tw.load_vehicle(CAR))
    truths = {name: Truth.drawn(WORLDS[name], car, experts, seed) for name in names}
    advice, driven = advised_drive(setting, seed, base, truths[names[0]])
    first, *ways = ((), *(one.actions for one in (*advice.singly, *advice.least[:1])))
    made: dict[tuple[object, ...], Taken] = {}

    def taken_wh(truth: Truth, chosen: tuple[Action, ...]) -> float:
        other = driven
        for action in chosen:
            other = action.apply_to(other)
        key = (truth.vehicle is car.vehicle, truth.weather, *(id(action) for action in chosen))
        if not key[0] or key not in made:
            made[key] = Taken.of(truth.vehicle, other, *truth.weather)
        return truth.taken_wh(made[key])

    return {
        name: _outcome(
            advice,
            [taken_wh(truth, way) for way in (first, *ways)],
            truth,
        )
        for name, truth in truths.items()
    }


def _outcome(advice: Advice, taken_wh: Sequence[float], truth: Truth) -> Followed:
    """What a drive took as it is, with each action, and with the first set that reaches the chance if there is one."""
    forecast = advice.forecast
    soc = float(forecast.plan.departure.soc or 0.0)
    as_it_is, *others = taken_wh
    saved = [
        Saved(one.actions[0].code, one.difference.energy_wh, *one.difference.interval(0.9), wh - as_it_is)
        for one, wh in zip(advice.singly, others, strict=False)
    ]
    stays = advice.p_arrive, truth.left(forecast, soc, as_it_is) >= advice.reserve
    if not advice.least:
        return Followed(saved, stays, None, None)
    best = advice.least[0]
    follows = best.p_arrive, truth.left(forecast, soc, others[-1]) >= advice.reserve
    leaves = soc_needed(best.forecast, advice.reserve, CHANCE)
    just = truth.left(forecast, leaves, others[-1]) >= advice.reserve if leaves <= 1.0 else None
    return Followed(saved, stays, follows, just)


def drives(
    number: int, base: ForecastModel, setting: str, jobs: int = 2, first: int = FIRST_SEED
) -> dict[str, list[Followed]]:
    """Drives of the worlds of a setting, side by side."""
    names = [name for name, world in WORLDS.items() if world.setting == setting]
    batches = [range(first + k, first + number, 4 * jobs) for k in range(min(4 * jobs, number))]
    made = Parallel(n_jobs=jobs)(
        delayed(lambda seeds: [followed(names, seed, base) for seed in seeds])(seeds) for seeds in batches
    )
    return {name: [one[name] for some in made for one in some] for name in names}


def chance_row(name: str, what: str, pairs: Sequence[tuple[float, bool]]) -> Row:
    """The share that arrives; its bounds are the mean stated chance and what a draw of so many drives differs from it by, 19 times in 20."""
    stated, came = (np.array(column, dtype=float) for column in zip(*pairs, strict=True))
    half = 1.96 * float(np.sqrt((stated * (1.0 - stated)).sum())) / len(stated)
    mean = float(stated.mean())
    most = np.inf if WORLDS[name].published else mean + half
    note = f"stated {mean:.3f}"
    return Row(f"{name}: arrived {what}, of {len(came)}", float(came.mean()), "", mean - half, most, note)


def rows_of(name: str, made: Sequence[Followed]) -> Iterator[Row]:
    """Coverage of savings and shares of arrivals."""
    saved = pd.DataFrame([one for drive in made for one in drive.saved], columns=Saved._fields)
    saved["held"] = saved["true"].between(saved["low"], saved["high"])
    shares = "95 % interval {:.3f} to {:.3f}".format(*clopper_pearson(int(saved["held"].sum()), len(saved)))
    most = np.inf if WORLDS[name].published else 0.94  # narrower than the belief: wide intervals are right
    held = float(saved["held"].mean())
    yield Row(f"{name}: savings in their 90 % interval, of {len(saved)}", held, "", 0.86, most, shares)
    for code, its in saved.groupby("code"):
        note = f"of {len(its)}; stated {its['stated'].mean():.0f} Wh, true {its['true'].mean():.0f} Wh"
        yield Row(f"{name}: savings by {code} in their 90 % interval", float(its["held"].mean()), note=note)
    if WORLDS[name].setting == KNOWN_CAR:
        return
    yield chance_row(name, "as it is", [drive.stays for drive in made])
    yield chance_row(name, "as advised", [drive.follows for drive in made if drive.follows])
    just = [drive.just for drive in made if drive.just is not None]
    shares = "95 % interval {:.3f} to {:.3f}".format(*clopper_pearson(sum(just), len(just)))
    most = np.inf if WORLDS[name].published else 0.97
    what = f"{name}: arrived as advised for {CHANCE:.0%}, of {len(just)}"
    yield Row(what, float(np.mean(just)), "", 0.93, most, shares)


def world_rows(number: int, base: ForecastModel, jobs: int = 2) -> Iterator[Row]:
    """All worlds: `number` drives on known roads, as many on planned ones, and a quarter of a known car."""
    for setting, share in (("known road", 1.0), (PLANNED, 1.0), (KNOWN_CAR, 0.25)):
        for name, made in drives(max(round(share * number), 1), base, setting, jobs).items():
            yield from rows_of(name, made)
