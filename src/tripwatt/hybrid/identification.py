"""Values of a car identified from signals of single stages of its powertrain, not from the energy of trips or the power of driving.

A log with the torque of the motor, the power of heater and air conditioner, the power of the standing car or the voltage at rest shows
each stage separately, while the energy of a trip shows only their sum. Each value has a prior around the published value, which the
trips have to outweigh.

=====================  ==========================================================  =======================================
signal                 model                                                       values
=====================  ==========================================================  =======================================
motor torque, speed    work at the wheels less inertia and climb = rolling + air   rolling resistance, its rise in the cold,
                                                                                   drag area
motor torque, braking  shaft = braking power that fades towards standstill          speeds of the recovery's fade
standing, climate off  power = base load                                           base load
heater, compressor     the cabin of `tripwatt.physics.cabin`                       interior heat capacity; in warm air what
                                                                                   the compressor takes for the cooling
voltage at rest        open-circuit voltage = curve + smooth change                open-circuit voltage
=====================  ==========================================================  =======================================
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, cast

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, changes
from tripwatt.auditing.signals import blank_stuck_heater
from tripwatt.hybrid.climate_log import CLIMATE_COLUMNS
from tripwatt.hybrid.climate_values import FARTHEST, MIN_TRIPS, ClimateRecord, climate_values
from tripwatt.hybrid.parameters import with_values
from tripwatt.physics import Simulation, simulate_trip
from tripwatt.physics.battery import internal_resistance, open_circuit_voltage
from tripwatt.physics.road_load import rolling_factor
from tripwatt.physics.simulate import conditions_at_departure
from tripwatt.trips import Trip, resample
from tripwatt.units import GRAVITY_M_S2
from tripwatt.vehicles import Vehicle
from tripwatt.vehicles.parts import given

STRETCH_S: Final = 30.0
"""Length of the stretches over which work is summed [s], so that torque and speed need not belong to the same moment."""
FRICTION_SHARE: Final = 0.9
"""Share of the largest regenerative torque beyond which the friction brakes may take part; such a stretch does not measure the road."""
ROLLING_WIDTH: Final = 0.15
"""Prior relative standard deviation of rolling and driveline drag: about the distance between classes of the EU tyre label
(Regulation (EU) 2020/740: 6.5, 7.7, 9.0 and 10.5 N/kN)."""
DRAG_WIDTH: Final = 0.15
"""Prior relative standard deviation of the drag area: the scatter of the parts C of the table's coast-downs about published drag areas."""
COLD_WIDTH: Final = 1.0
"""Prior standard deviation of the rise of rolling resistance in the cold, relative to the published rise. The published rise is that of
tyres alone, without gear oil, winter tyres and wet roads."""
LOW_BIN_M_S: Final = 0.25
LOW_BINS: Final = 20
"""Bins of speed over which braking power is summed: up to 5 m/s, beyond every published end of the fade."""
COLD_DEGC: Final = 5.0
"""The rise in the cold is identified if at least `MIN_TRIPS` trips are colder than this [°C]; warm trips do not show it. If all trips
are cold, the priors share an excess between the rise and the rolling resistance at the reference temperature."""
BASE_WIDTH: Final = 0.4
"""Prior relative standard deviation of the base load: 0.2 to 0.4 kW, about the 0.25 and 0.3 kW that FASTSim's database gives for electric
cars."""
CURVE_WIDTH_V: Final = 0.05
"""Prior standard deviation of a cell's open-circuit voltage [V]: curves of cathodes of one family differ by about this."""
REST_SD_V: Final = 0.02
"""Standard deviation of the voltage of a cell at rest about its open-circuit voltage, before it has settled [V]."""
REST_BINS: Final = 20
"""Number of bins of charge in which cells at rest are averaged; a choice, finer than the knots of the curve."""
RESTING_A: Final = 3.0
RESTING_S: Final = 10.0
STANDING_M_S: Final = 0.1
CLIMATE_OFF_W: Final = 50.0
"""A cell rests below `RESTING_A` [A] for `RESTING_S` [s]; a car stands below `STANDING_M_S` [m/s]; climate control is off below
`CLIMATE_OFF_W` [W]; choices."""


@dataclass(frozen=True, eq=False)
class StageRecord:
    """Summary of the signals of one trip by stage: everything that `identify` needs.

    Attributes
    ----------
    ambient_temperature_degc : float
        Outside temperature at departure [°C].
    road : ndarray, shape (stretches, 4)
        Four works [J], each divided by the root of the distance [m]: of a rolling resistance of 1 N with the published fall in warm
        air, of the same for each kelvin below the reference temperature, of a drag area of 1 m2, and the measured work at the wheels
        without inertia and climb.
    braking : ndarray, shape (bins, 2)
        Braking energy that the motor could take at its full share, and that it took, by bins of low speed [J]; no bins without torque.
    standing_w : float
        Median power of the standing car with climate control off [W]; NaN if this never occurred.
    climate : ClimateRecord or None
        Power of climate control; None if the log lacks heater or air conditioner.
    rest : ndarray, shape (bins, 2)
        State of charge, and open-circuit voltage of a cell minus that of the published curve [V], by bins of charge.

    Examples
    --------
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> stage_record(synthetic_fleet(1).trips[0], load_vehicle(VEHICLE)).climate is None
    False
    """

    ambient_temperature_degc: float
    road: FloatArray
    braking: FloatArray
    standing_w: float
    climate: ClimateRecord | None
    rest: FloatArray


@dataclass(frozen=True, eq=False)
class Identified:
    """Values of a car from signals of its stages.

    Attributes
    ----------
    values : mapping of str to (float or tuple of float)
        Identified values by key of the car's entries, e.g. ``"auxiliaries.base_load_w"``.
    trips : mapping of str to int
        Number of trips that each value was identified on.

    Examples
    --------
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle(VEHICLE)
    >>> nothing = identify([stage_record(trip, car) for trip in synthetic_fleet(2).trips], car)
    >>> nothing.applied(car) is car
    True
    """

    values: Mapping[str, float | tuple[float, ...]]
    trips: Mapping[str, int]

    def applied(self, vehicle: Vehicle) -> Vehicle:
        """Replace published values of a car by the identified ones.

        Parameters
        ----------
        vehicle : Vehicle
            The car that the values were identified for.

        Returns
        -------
        Vehicle
            The car with the identified values; the source of each entry names the trips and the published value. The same object if
            there are no values.

        Examples
        --------
        >>> from tripwatt.vehicles import load_vehicle
        >>> identified = Identified({"auxiliaries.base_load_w": 380.0}, {"auxiliaries.base_load_w": 9})
        >>> identified.applied(load_vehicle("bmw_i3_60ah")).auxiliaries.base_load_w
        380.0
        """
        return with_values(
            vehicle, self.values, {k: f"identified on {n} trips" for k, n in self.trips.items()}
        )

    def __str__(self) -> str:
        """One line of text."""
        known = [f"{key} {value:.4g}" for key, value in self.values.items() if isinstance(value, float)]
        curves = [key for key, value in self.values.items() if not isinstance(value, float)]
        return f"identified from signals: {', '.join([*known, *curves])}"


def stage_record(trip: Trip, vehicle: Vehicle) -> StageRecord:
    """Summarise the signals of a trip by stage. O(samples).

    Parameters
    ----------
    trip : Trip
        Raw trip with the signals that its log has.
    vehicle : Vehicle
        The car with its published values.

    Returns
    -------
    StageRecord
        Summary; parts whose signals are missing are empty.

    Examples
    --------
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> stage_record(synthetic_fleet(1).trips[0], load_vehicle(VEHICLE)).road.shape
    (0, 4)
    """
    trip = resample(trip)
    samples = blank_stuck_heater(trip.samples, "")[0]
    climate, record = None, None
    heater, compressor = (_column(samples, name) for name in CLIMATE_COLUMNS)
    if heater is not None and compressor is not None:
        compressor = np.maximum(compressor, 0.0)
        climate = np.maximum(heater, 0.0) + compressor
        record = ClimateRecord.from_trip(trip, vehicle, climate, compressor)
    road, braking = _torque_rows(trip, vehicle)
    return StageRecord(
        conditions_at_departure(vehicle, trip.departure).ambient_temperature_degc,
        road,
        braking,
        _standing_power(samples, climate),
        record,
        _rest_rows(samples, vehicle),
    )


def identify(records: Sequence[StageRecord], vehicle: Vehicle) -> Identified:
    """Most probable values of a car, given the signals of its trips by stage. O(stretches + minutes x passes).

    Parameters
    ----------
    records : sequence of StageRecord
        Records of the trips, made with `vehicle`.
    vehicle : Vehicle
        The car with its published values, which are the centres of the priors.

    Returns
    -------
    Identified
        The values. A value is left out if fewer than `MIN_TRIPS` trips have its signal.

    Notes
    -----
    The values of the road load come from a linear regression with the published rolling resistance, rise and drag area as prior
    observations. Stretches of a trip share wind, load and tyres, so their number is divided by the design effect of the residuals
    (Kish, Survey Sampling, 1965). The value of the cabin comes from a robust fit of one logarithm to the power by minutes, and the
    voltage curve from a ridge regression on its second difference.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> dict(identify([], load_vehicle("bmw_i3_60ah")).values)
    {}
    """
    return identify_each([records], vehicle)[0]


def identify_each(several: Sequence[Sequence[StageRecord]], vehicle: Vehicle) -> list[Identified]:
    """Most probable values of a car from each of several choices of trips, as `identify` finds them, in less time.

    Parameters
    ----------
    several : sequence of sequence of StageRecord
        Records of each choice of trips, made with `vehicle`.
    vehicle : Vehicle
        The car with its published values.

    Returns
    -------
    list of Identified
        One for each choice.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> [dict(shown.values) for shown in identify_each([[], []], load_vehicle("bmw_i3_60ah"))]
    [{}, {}]
    """
    climates = [[r.climate for r in records if r.climate is not None] for records in several]
    enough = [seen for seen in climates if len(seen) >= MIN_TRIPS]
    of_climate = iter(climate_values(enough, vehicle))
    found = []
    for records, climate in zip(several, climates, strict=True):
        values: _Values = {}
        trips: dict[str, int] = {}
        signals: tuple[tuple[Callable[[Any, Vehicle], _Values], list[Any]], ...] = (
            (_road_values, [r for r in records if len(r.road)]),
            (_fade_values, [r.braking for r in records if r.braking.any()]),
            (_base_value, [r.standing_w for r in records if np.isfinite(r.standing_w)]),
            (lambda _, __: next(of_climate), climate),
            (_curve_value, [r.rest for r in records if len(r.rest)]),
        )
        for values_of, seen in signals:
            if len(seen) >= MIN_TRIPS:
                known = values_of(seen, vehicle)
                values |= known
                trips |= dict.fromkeys(known, len(seen))
        found.append(Identified(MappingProxyType(values), MappingProxyType(trips)))
    return found


_Values = dict[str, float | tuple[float, ...]]


def _over_intervals(values: FloatArray) -> FloatArray:
    return np.concatenate((values[:1], 0.5 * (values[1:] + values[:-1])))


def _column(samples: pd.DataFrame, name: str) -> FloatArray | None:
    """Values of a signal; None if the signal is missing or has gaps."""
    if name not in samples:
        return None
    values = samples[name].to_numpy(dtype=np.float64)
    return values if np.isfinite(values).all() else None


def _torque_rows(trip: Trip, vehicle: Vehicle) -> tuple[FloatArray, FloatArray]:
    """Rows of the regression of the road load, and braking energy by bins of low speed; both without rows if there is no torque."""
    torque = _column(trip.samples, "motor_torque_nm")
    if torque is None or len(torque) < STRETCH_S:
        return np.empty((0, 4)), np.empty((0, 2))
    drivetrain, torque = vehicle.drivetrain, _over_intervals(torque)
    run = simulate_trip(vehicle, trip)
    step, speed = changes(run.time_s), _over_intervals(trip.array("speed_m_s"))
    efficiency = np.where(torque > 0.0, drivetrain.gearbox_efficiency, 1.0 / drivetrain.gearbox_efficiency)
    force = torque * efficiency * (drivetrain.gear_ratio / drivetrain.wheel_radius_m)
    metres = speed * step
    conditions = conditions_at_departure(vehicle, trip.departure)
    factor, colder_k, tyres = np.ones_like(speed), 0.0, vehicle.tyres
    if tyres is not None:
        reference, ambient = tyres.reference_temperature_degc, conditions.ambient_temperature_degc
        colder_k = max(reference - ambient, 0.0)
        factor = rolling_factor(speed, step, max(reference, ambient), tyres, conditions.initial_warmth)
    density = run.aero_drag_force_n / np.maximum(0.5 * vehicle.road_load.drag_area_m2 * speed * speed, 1e-9)
    mass = vehicle.body.test_mass_kg
    load = (mass + conditions.payload_mass_kg) / mass
    constant, linear = vehicle.road_load.rolling_coefficients
    rolled, squares = metres * factor * load, 0.5 * density * speed * speed * metres
    # the part in proportion to speed keeps its published share, and does not rise in the cold
    with_speed = rolled + metres * load * speed * (linear / constant)
    resisted = metres * (force - run.inertia_force_n - run.grade_force_n)
    columns = np.column_stack((with_speed, rolled * colder_k, squares, resisted))
    stretch = ((run.time_s - run.time_s[0]) / STRETCH_S).astype(np.int64)
    number = int(stretch[-1]) + 1
    sums = np.column_stack([np.bincount(stretch, column, number) for column in columns.T])
    way = np.bincount(stretch, metres, number)
    hardest = np.full(number, np.inf)
    np.minimum.at(hardest, stretch, torque)
    slowest = np.full(number, np.inf)
    np.minimum.at(slowest, stretch, np.where(step > 0.0, speed, np.inf))
    rules = vehicle.regeneration
    kept = (slowest > rules.full_speed_m_s) & (hardest > -FRICTION_SHARE * rules.max_torque_nm)
    braking = _braking_rows(vehicle, run, speed, step, torque)
    return np.asarray(sums[kept] / np.sqrt(way[kept])[:, None]), braking


def _braking_rows(
    vehicle: Vehicle, run: Simulation, speed: FloatArray, step: FloatArray, torque: FloatArray
) -> FloatArray:
    """Braking energy that the motor could take, and that it took, by bins of low speed [J], shape (bins, 2)."""
    drivetrain, rules = vehicle.drivetrain, vehicle.regeneration
    turning = drivetrain.gear_ratio / drivetrain.wheel_radius_m
    possible = -run.wheel_power_w * drivetrain.gearbox_efficiency * rules.fraction
    # beyond this deceleration the car brakes, not only the road; a choice
    slowing = -changes(speed) > 0.3 * step
    bins = (speed / LOW_BIN_M_S).astype(np.int64)
    soft = possible < FRICTION_SHARE * rules.max_torque_nm * turning * speed
    low = slowing & soft & (possible > 0.0) & (bins < LOW_BINS) & (step > 0.0)
    return np.column_stack(
        [
            np.bincount(bins[low], (power * step)[low], LOW_BINS)
            for power in (possible, -torque * turning * speed)
        ]
    )


def _fade_values(records: Sequence[FloatArray], vehicle: Vehicle) -> _Values:
    """Speeds between which recovery fades, by a search over both ends; the published fade counts as five trips."""
    rules = vehicle.regeneration
    possible, taken = np.sum(records, axis=0).T
    middle = (np.arange(LOW_BINS) + 0.5) * LOW_BIN_M_S
    high = middle > rules.full_speed_m_s
    # a torque that recovers a smaller or larger share of the braking power belongs to another motor; a choice
    if not 0.4 * possible[high].sum() < taken[high].sum() < 1.2 * possible[high].sum():
        return {}

    def fade(zero: FloatArray, full: FloatArray) -> FloatArray:
        return np.clip((middle - zero[:, None]) / (full - zero)[:, None], 0.0, 1.0)

    published = fade(np.array([rules.zero_speed_m_s]), np.array([rules.full_speed_m_s]))[0]
    # the published fade counts as five trips: how late the friction brakes take over is known for few cars
    prior = 5.0 / len(records)
    seen = possible > 0.0
    target = published.copy()
    target[seen] = (taken[seen] / possible[seen] + prior * published[seen]) / (1.0 + prior)
    # speeds without braking keep the published fade
    weight = np.maximum(possible, 1e-3 * possible.max())
    # steps of 0.1 m/s are finer than the bins
    steps = np.arange(0.0, LOW_BINS * LOW_BIN_M_S, 0.1)
    zero, full = (ends.ravel() for ends in np.meshgrid(steps, steps))
    zero, full = zero[full > zero], full[full > zero]
    best = int(np.argmin(((fade(zero, full) - target) ** 2) @ weight))
    ends = {"regeneration.zero_speed_m_s": zero[best], "regeneration.full_speed_m_s": full[best]}
    return {key: float(value) for key, value in ends.items()}


def _road_values(records: Sequence[StageRecord], vehicle: Vehicle) -> _Values:
    """Rolling resistance, its rise in the cold, and drag area."""
    from scipy.optimize import lsq_linear  # scipy is slow to import

    load, tyres = vehicle.road_load, vehicle.tyres
    everything = np.concatenate([r.road for r in records])
    rolling_n = vehicle.body.test_mass_kg * GRAVITY_M_S2 * load.rolling_coefficients[0]
    rise = 0.0 if tyres is None else tyres.temperature_coefficient_per_k
    ambient = np.array([r.ambient_temperature_degc for r in records])
    free = int((ambient < COLD_DEGC).sum()) >= MIN_TRIPS and rise > 0.0
    # unknowns: rolling resistance [N], its rise for each kelvin [N/K], drag area [m2], each with a prior of its own
    means = np.array([rolling_n, rise * rolling_n, load.drag_area_m2])
    widths = np.array([ROLLING_WIDTH * means[0], COLD_WIDTH * means[1], DRAG_WIDTH * means[2]])
    known = np.array([True, free, True])
    prior, target = np.diag(1.0 / np.where(widths > 0.0, widths, 1.0))[known], (means / widths)[known]
    if not free:  # the published rise is kept as a share of the rolling resistance
        everything = everything @ np.array([[1, 0, 0, 0], [rise, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    scale = float(np.std(everything[:, 3]))
    bounds = (0.0, np.array([np.inf, np.inf if free else 1e-12, np.inf]))
    ends = np.cumsum([len(r.road) for r in records])[:-1]
    # the error of the regression settles in two solutions
    for _ in range(3):
        X, y = np.vstack([everything[:, :3] / scale, prior]), np.append(everything[:, 3] / scale, target)
        values = lsq_linear(X, y, bounds=bounds).x
        error = everything[:, 3] - everything[:, :3] @ values
        variance = float(np.mean(error**2))
        together = float(np.mean([len(e) * np.mean(e) ** 2 for e in np.split(error, ends)])) / variance
        scale = float(np.sqrt(variance * max(together, 1.0)))
    rolling, colder, drag_area = (float(v) for v in values)
    identified: dict[str, Any] = {}
    if (np.abs(values - means)[[0, 2]] > FARTHEST * widths[[0, 2]]).any():
        return {}
    if free and rolling > 0.0:
        # 3 % per kelvin is a rolling drag of 2.2 times the reference at -20 °C, more than any source has
        identified["tyres.temperature_coefficient_per_k"] = min(colder / rolling, 0.03)
    if load.method == "coastdown":
        for part in ("road_load.coastdown_a_n", "road_load.coastdown_b_n_s_m"):
            identified[part] = cast(float, vehicle.value(part)) * rolling / rolling_n
        identified["road_load.coastdown_c_n_s2_m2"] = (
            0.5 * given(load.coastdown_air_density_kg_m3) * drag_area
        )
    else:
        published = given(load.rolling_resistance_coefficient)
        identified["road_load.rolling_resistance_coefficient"] = published * rolling / rolling_n
        identified["road_load.drag_coefficient"] = drag_area / given(load.frontal_area_m2)
    return identified


def _standing_power(samples: pd.DataFrame, climate: FloatArray | None) -> float:
    """Median power of the standing car while climate control is off [W]; NaN if there are fewer than ten such samples."""
    voltage, current = (_column(samples, name) for name in ("voltage_v", "current_a"))
    speed = _column(samples, "speed_m_s")
    if climate is None or voltage is None or current is None or speed is None:
        return float("nan")
    still = (speed < STANDING_M_S) & (climate < CLIMATE_OFF_W)
    # the median of fewer than ten seconds would be chance; a choice
    return float(np.median((voltage * current)[still])) if still.sum() >= 10.0 else float("nan")


def _base_value(standing: Sequence[float], vehicle: Vehicle) -> _Values:
    """Base load, from the power of the standing car."""
    published = vehicle.auxiliaries.base_load_w
    # the standing power of trips scatters by a tenth at least; a choice
    sd = max(float(np.std(standing, ddof=1)), 0.1 * published, 1.0)
    precision, prior = len(standing) / sd**2, max(BASE_WIDTH * published, 1.0) ** -2
    value = (precision * float(np.mean(standing)) + prior * published) / (precision + prior)
    if value <= 0.0 or abs(value - published) > FARTHEST * BASE_WIDTH * published:
        return {}
    return {"auxiliaries.base_load_w": value}


def _rest_rows(samples: pd.DataFrame, vehicle: Vehicle) -> FloatArray:
    """Open-circuit voltage of a cell at rest minus the published curve, by bins of charge; see `StageRecord.rest`."""
    voltage, current, soc = (_column(samples, name) for name in ("voltage_v", "current_a", "soc"))
    if voltage is None or current is None or soc is None:
        return np.empty((0, 2))
    calm = pd.Series(np.abs(current) < RESTING_A, dtype=float).rolling(int(RESTING_S)).min().to_numpy() == 1.0
    if not calm.any():
        return np.empty((0, 2))
    voltage, current, soc = voltage[calm], current[calm], np.clip(soc[calm], 0.0, 1.0)
    battery = vehicle.battery
    warm = np.full_like(soc, battery.resistance_temperature_degc)
    above = voltage + current * internal_resistance(soc, warm, battery) - open_circuit_voltage(soc, battery)
    place = np.minimum((soc * REST_BINS).astype(np.int64), REST_BINS - 1)
    count = np.bincount(place, minlength=REST_BINS)
    seen = count > 0
    charge, change = (np.bincount(place, v, REST_BINS)[seen] / count[seen] for v in (soc, above))
    return np.column_stack((charge, change / battery.cells_in_series))


def _curve_value(rows: Sequence[FloatArray], vehicle: Vehicle) -> _Values:
    """Open-circuit voltage of a cell: the published curve plus a smooth change."""
    battery = vehicle.battery
    knots = np.linspace(0.0, 1.0, 11)
    everything = np.concatenate(rows)
    hats = np.column_stack([np.interp(everything[:, 0], knots, peak) for peak in np.eye(len(knots))])
    # second differences of the change over steps of 0.1 have a prior standard deviation of 0.01 V; a choice
    bends = np.diff(np.eye(len(knots)), n=2, axis=0)
    X = np.vstack([hats / REST_SD_V, np.eye(len(knots)) / CURVE_WIDTH_V, bends / 0.01])
    y = np.concatenate([everything[:, 1] / REST_SD_V, np.zeros(len(knots) + len(bends))])
    change = np.linalg.lstsq(X, y, rcond=None)[0]
    if np.abs(change).max() > FARTHEST * CURVE_WIDTH_V:
        return {}
    soc = np.asarray(battery.ocv_soc)
    curve = np.maximum.accumulate(np.asarray(battery.ocv_v) + np.interp(soc, knots, change))
    return {"battery.ocv_v": tuple(curve.tolist())}
