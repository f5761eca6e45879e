"""No public function takes a value that cannot be: seeded wrong values for every numeric argument of the door."""

from __future__ import annotations

import datetime as dt
import inspect
import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any, Final

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.refusals import refuses

import tripwatt as tw
from tripwatt.certification import certified_interval
from tripwatt.roads.journey import Atlas, JourneyOptions
from tripwatt.roads.routers import open_server
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips.columns import require_fraction

LINKS = [{"length_m": 5000.0, "speed_m_s": 15.0}]
TRACK = b'{"type": "LineString", "coordinates": [[9.5, 47.1], [9.52, 47.12], [9.53, 47.13]]}'
FOUND = tw.forecast(tw.read_route(LINKS), tw.Departure(soc=0.8, ambient_temperature_degc=10.0))

FRACTIONS: Final[dict[str, Callable[[Any], Any]]] = {
    "interval": FOUND.interval,
    "quantile": FOUND.quantile,
    "arrival.interval": FOUND.arrival.interval,
    "arrival.quantile": FOUND.arrival.quantile,
    "along.soc": FOUND.along.soc,
    "p_arrive": FOUND.p_arrive,
    "soc_needed, probability": lambda value: tw.soc_needed(FOUND, probability=value),
    "soc_needed, reserve": lambda value: tw.soc_needed(FOUND, reserve=value),
    "to_dict": lambda value: FOUND.to_dict(reserve=value),
    "JourneyOptions": lambda value: JourneyOptions(reserve=value),
    "certified_interval": lambda value: certified_interval(tw.load_vehicle("vw_id3"), level=value),
    "Departure.soc": lambda value: tw.Departure(soc=value),
    "Departure.bms_soc": lambda value: tw.Departure(bms_soc=value),
}
"""Arguments that are a probability or a state of charge."""

ARRAYS: Final = ("interval", "quantile", "arrival.interval", "arrival.quantile", "p_arrive")
"""Those that may be an array."""

NUMBERS: Final[dict[str, Callable[[Any], Any]]] = {
    "probability_below": FOUND.probability_below,
    "read_route": lambda value: tw.read_route(TRACK, speed_m_s=value),
    "link length": lambda value: tw.read_route([{**LINKS[0], "length_m": value}]),
    "link speed": lambda value: tw.read_route([{**LINKS[0], "speed_m_s": value}]),
    "synthetic_fleet, trips": lambda value: synthetic_fleet(value),
    "synthetic_fleet, seed": lambda value: synthetic_fleet(1, seed=value),
    "synthetic_fleet, step": lambda value: synthetic_fleet(1, step_s=value),
    "JourneyOptions, alternatives": lambda value: JourneyOptions(alternatives=value),
    "load_vehicle": lambda value: tw.load_vehicle("bmw_i3_60ah", overrides={"mass": value}),
    **{
        f"describe_car, {name}": lambda value, name=name: tw.describe_car(**{name: value})
        for name in ("mass_kg", "usable_battery_kwh", "consumption_kwh_per_100km", "motor_power_kw")
    },
    **{
        f"Departure.{name}": lambda value, name=name: tw.Departure(**{name: value})
        for name in (
            "ambient_temperature_degc",
            "cabin_setpoint_degc",
            "cabin_temperature_degc",
            "battery_temperature_degc",
            "payload_mass_kg",
        )
    },
}
"""Other arguments that are one number."""

NO_NUMBERS: Final = (
    "0.5",
    "",
    b"1",
    True,
    False,
    [0.5],
    (0.5,),
    {"a": 1},
    object(),
    1j,
    math.nan,
    math.inf,
    -math.inf,
    10**400,
    np.array([0.5]),
    np.True_,
    pd.NaT,
    dt.date(2024, 1, 5),
)
"""What is no finite number."""


@pytest.mark.parametrize(
    "value",
    NO_NUMBERS,
    ids=lambda value: f"{type(value).__name__} {value!r}".partition(" object at ")[0][:30],
)
@pytest.mark.parametrize("name", [*FRACTIONS, *NUMBERS])
def test_what_is_no_number_is_refused(name: str, value: Any) -> None:
    if name in ARRAYS and np.ndim(value):  # an array of numbers is taken, one with a text is not
        value = [*value, "0.5"]
    with pytest.raises(tw.InvalidInput):
        (FRACTIONS | NUMBERS)[name](value)


@pytest.mark.parametrize("name", FRACTIONS)
@given(value=st.one_of(st.floats(1.0, 1e9, exclude_min=True), st.floats(-1e9, -1e-9), st.integers(2, 100)))
@settings(max_examples=20, deadline=None)
def test_a_percentage_is_refused_with_a_hint(name: str, value: float) -> None:
    with pytest.raises(tw.InvalidInput, match=r"give a fraction, 0\.9 for 90 %"):
        FRACTIONS[name](value)


@pytest.mark.parametrize(
    "name", [*FRACTIONS, "synthetic_fleet, trips", "synthetic_fleet, seed", "describe_car, mass_kg"]
)
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_no_number_raises_anything_else(name: str, seed: int) -> None:
    """A number gives an answer or `InvalidInput`, whatever its size and type."""
    rng = np.random.default_rng(seed)
    size = float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(2.0, 300.0))
    for value in (size, np.float64(size), int(size), Fraction(int(size) or 1, 3)):
        with pytest.raises(tw.InvalidInput):
            (FRACTIONS | NUMBERS)[name](
                -abs(value) if "seed" in name else value if abs(value) > 1e6 else -abs(value)
            )


@pytest.mark.parametrize("value", [0.5, 1, 1.0, np.float32(0.75), Fraction(3, 4)])
def test_every_kind_of_number_is_one(value: Any) -> None:
    assert require_fraction("level", value) == float(value)
    assert FOUND.p_arrive(value) == FOUND.p_arrive(float(value))


def test_below_one_half_a_charge_to_leave_with_has_no_meaning() -> None:
    refuses(r"got 0\.3; allowed: 0\.5 to 1", tw.soc_needed, FOUND, probability=0.3)
    assert (FOUND.along.soc(0.3) >= FOUND.along.soc(0.7)).all()  # a band has two sides


FIELDS: Final[dict[str, tuple[Any, ...]]] = {
    "season": ("wintr", "Winter", "", 1, True, ["winter"], b"winter"),
    "climate": ("Auto", "on", 1, True, ["auto"], np.array(["auto"])),
    "weather": (1, True, ["sunny"], b"sunny"),
    "follows_trip": (1, 0, "yes", "true", [True], 1.0),
    "cabin_logged": (1, 0, "yes", [True], 1.0),
    "terrain": ("alps", "Flat", "", 1, True, ["flat"], b"flat"),
    "departs_at": (
        "2024-01-05",
        "2024-01-05T08:00",
        dt.date(2024, 1, 5),
        1.7e9,
        pd.NaT,
        True,
        [dt.datetime.now()],
    ),
    "extras": ("roof_box", ("roof",), {"roof_box"}, (1,), 1, True, [["roof_box"]]),
}
"""Wrong values for the fields of a departure that are no numbers."""


@pytest.mark.parametrize(("name", "value"), [(n, v) for n, values in FIELDS.items() for v in values])
def test_a_field_of_a_departure_of_another_type_or_choice_is_refused(name: str, value: Any) -> None:
    with pytest.raises(tw.InvalidInput, match=f"{name}: got"):
        tw.Departure(**{name: value})


def test_the_signature_of_a_departure_has_its_fields() -> None:
    shown = inspect.signature(tw.Departure).parameters
    assert list(shown) == [*tw.Departure.__dataclass_fields__]
    assert all(field.default is None for field in shown.values())
    refuses("unknown field: Departure: got 'ambient'.*did you mean", tw.Departure, ambient=5.0)


def test_every_field_of_a_departure_is_checked() -> None:
    class Strange:
        def __repr__(self) -> str:
            return "strange"

    for name in tw.Departure.__dataclass_fields__:
        refuses("strange", tw.Departure, **{name: Strange()})


def test_what_a_departure_takes() -> None:
    when = pd.Timestamp("2024-01-05T08:30")
    found = tw.Departure(
        season="winter", departs_at=when, follows_trip=np.True_, weather="sunny", extras=["roof_box"]
    )  # type: ignore[arg-type]
    assert (found.departs_at, found.extras) == (when, ("roof_box",))
    refuses("did you mean 'winter'", tw.Departure, season="wintr")


ATLAS = Atlas(open_server("osrm=http://127.0.0.1:9"))
MODEL, TRIPS = tw.load_model(), tw.sample_trips().trips
PLAN = tw.read_route(LINKS)

TYPES: Final[dict[str, tuple[Callable[[Any], Any], str]]] = {
    "read_route": (tw.read_route, ""),
    "forecast": (tw.forecast, ""),
    "forecast, departure": (lambda given: tw.forecast(PLAN, given), "none"),
    "forecast, car": (lambda given: tw.forecast(PLAN, car=given), "none"),
    "forecast, model": (lambda given: tw.forecast(PLAN, model=given), "none"),
    "ForecastModel.forecast": (MODEL.forecast, ""),
    "simulate": (lambda given: tw.simulate(given, "vw_id3"), ""),
    "simulate, car": (lambda given: tw.simulate(PLAN, given), ""),
    "sweep": (lambda given: tw.sweep(given, "vw_id3"), ""),
    "sweep, car": (lambda given: tw.sweep(PLAN, given), ""),
    "sweep, values": (lambda given: tw.sweep(PLAN, "vw_id3", given), "object"),
    "sweep, model": (lambda given: tw.sweep(PLAN, "vw_id3", model=given), "none"),
    "fit": (lambda given: tw.fit(given, "bmw_i3_60ah"), ""),
    "fit, car": (lambda given: tw.fit(TRIPS, given), ""),
    "fit, corrector": (lambda given: tw.fit(TRIPS, "bmw_i3_60ah", corrector=given), ""),
    "fit, seed": (lambda given: tw.fit(TRIPS, "bmw_i3_60ah", corrector="linear", seed=given), "number"),
    "fit, covariates": (lambda given: tw.fit(TRIPS[:1], "bmw_i3_60ah", covariates=given), ""),
    "adapt": (lambda given: tw.adapt(given, TRIPS[:1], "nissan_leaf_24"), ""),
    "adapt, trips": (lambda given: tw.adapt(MODEL, given, "nissan_leaf_24"), ""),
    "adapt, car": (lambda given: tw.adapt(MODEL, TRIPS[:1], given), ""),
    "for_car": (tw.for_car, "none"),
    "for_car, car": (lambda given: tw.for_car(None, given), "none"),
    "load_model": (tw.load_model, "none"),
    "save_model": (lambda given: tw.save_model(given, "never-written"), ""),
    "save_model, folder": (lambda given: tw.save_model(MODEL, given), "text"),
    "load_vehicle": (tw.load_vehicle, ""),
    "audit": (tw.audit, "generator list object"),
    "read_logs": (tw.read_logs, ""),
    "read_trips": (tw.read_trips, ""),
    "evaluate": (tw.evaluate, ""),
    "evaluate, car": (lambda given: tw.evaluate(TRIPS, given), ""),
    "advise": (tw.advise, ""),
    "leaving_with": (lambda given: tw.leaving_with(given, 0.5), ""),
    "soc_needed": (tw.soc_needed, ""),
    "need": (tw.need, "number fraction"),
    "need, departure": (lambda given: tw.need(10, departure=given), "none"),
    "range_km, kind": (lambda given: tw.range_km(0.8, given), ""),
    "range_km, departure": (lambda given: tw.range_km(0.8, departure=given), "none"),
    "range_km, model": (lambda given: tw.range_km(0.8, model=given), "none"),
    "create_car": (lambda given: tw.create_car(given, "vw_id3"), "text"),
    "create_car, base": (lambda given: tw.create_car("never-made", "vw_id3", base=given), "none"),
    "create_car, label": (
        lambda given: tw.create_car("never-made", [], label=given),
        "none text list object series",
    ),
    "create_car, car": (lambda given: tw.create_car("never-made", given), ""),
    "open_car": (tw.open_car, ""),
    "create_store": (tw.create_store, "text"),
    "create_store, buckets": (lambda given: tw.create_store("never-made", buckets=given), "number"),
    "open_store, options": (lambda given: tw.open_store("never-made", options=given), "series"),
    "plan_journey": (lambda given: tw.plan_journey(given, atlas=ATLAS), ""),
    "plan_journey, stop": (lambda given: tw.plan_journey([given, "47,9"], atlas=ATLAS), ""),
    "plan_journey, options": (
        lambda given: tw.plan_journey(["1,2", "2,3"], atlas=ATLAS, options=given),
        "none list object series",
    ),
    "load_vehicle, preset": (lambda given: tw.load_vehicle("vw_id3", given), ""),
    "load_vehicle, overrides": (
        lambda given: tw.load_vehicle("vw_id3", overrides=given),
        "none list object series",
    ),
    "evaluate, seed": (lambda given: tw.evaluate(TRIPS, seed=given), "number"),
    "evaluate, models": (lambda given: tw.evaluate(TRIPS, models=given), "none object list generator"),
    "open_store": (tw.open_store, ""),
}
"""Arguments of the door that are objects or names, and the kinds of wrong values that they take."""

WRONG: Final[dict[str, Callable[[], Any]]] = {
    "none": lambda: None,
    "number": lambda: 5,
    "fraction": lambda: 0.5,
    "text": lambda: "no such name",
    "list": list,
    "list of numbers": lambda: [1],
    "object": dict,
    "generator": lambda: iter(()),
    "strange": object,
    "series": lambda: pd.Series([1.0]),
}


@pytest.mark.parametrize(
    ("name", "kind"), [(name, kind) for name in TYPES for kind in WRONG if kind not in TYPES[name][1].split()]
)
def test_an_argument_of_another_type_is_refused(name: str, kind: str) -> None:
    with pytest.raises(tw.InvalidInput) as refused:
        TYPES[name][0](WRONG[kind]())
    assert all(fault.what and fault.where and fault.allowed for fault in refused.value.faults)


@pytest.mark.parametrize("call", [tw.for_car, tw.load_model, lambda name: tw.forecast(PLAN, model=name)])
def test_a_car_in_place_of_a_model_is_told(call: Callable[[Any], Any]) -> None:
    refuses(
        "i3_60ah: got the name of a car; .*i3_60ah is a car of the library: pass car=", call, "bmw_i3_60ah"
    )
    refuses("bmw_i4: got the name of a car; .* pass car='bmw_i4_edrive35'", call, "bmw_i4")
    refuses("no model: no_such: got nothing", call, "no_such")


def test_trips_of_a_generator_are_a_list_of_them() -> None:
    fitted = tw.fit((trip for trip in TRIPS[:9]), "bmw_i3_60ah", corrector="linear", identified=False)
    assert fitted.trip_ids_ == tuple(trip.trip_id for trip in TRIPS[:9])
    refuses("trips: got Trip; allowed: a list of trips", tw.fit, TRIPS[0], "bmw_i3_60ah")


SOUND = TRIPS[0].samples
UNCHECKED: Final = {
    "shuffled": (SOUND.sample(frac=1.0, random_state=0), "time does not increase: A"),
    "another order after the first": (SOUND.iloc[[0, *range(40, 20, -1), 50]], "time does not increase: A"),
    "no speed": (SOUND.drop(columns="speed_m_s"), "missing column: A: .*'speed_m_s'"),
    "no time": (SOUND.drop(columns="time_s"), "missing column: A: .*'time_s'"),
    "no rows": (SOUND.iloc[:0], "too few samples: A"),
    "text": (SOUND.assign(speed_m_s="fast"), "not a number: A, column 'speed_m_s'"),
    "no table": (None, "unknown type: A: got None; allowed: a DataFrame"),
}
"""Samples that `Trip.from_samples` refuses, and how."""


@pytest.mark.parametrize(("samples", "words"), UNCHECKED.values(), ids=UNCHECKED)
def test_a_trip_that_was_not_checked_is_refused_like_its_samples(samples: Any, words: str) -> None:
    refuses(words, tw.Trip.from_samples, "A", samples)
    trip = tw.Trip("A", samples, observed_energy_wh=900.0)
    refuses(words, tw.forecast, trip)
    refuses(words, tw.simulate, trip, "vw_id3")
    refuses(words, tw.fit, [trip] * 9, "bmw_i3_60ah", corrector="linear")


@pytest.mark.parametrize("name", ["no speed", "no time", "text", "no table"])
def test_a_plan_without_a_speed_over_time_cannot_be_made(name: str) -> None:
    refuses(UNCHECKED[name][1], tw.Plan, "A", UNCHECKED[name][0])
    refuses("time does not increase", tw.forecast, tw.Plan("A", UNCHECKED["shuffled"][0]))


DRIVEN = pd.DataFrame(
    {"time_s": [0.0, 60.0, 120.0], "voltage_v": 350.0, "current_a": 30.0, "speed_m_s": 15.0}
)

NO_SAMPLES: Final = {
    "no time": (DRIVEN.drop(columns="time_s"), "missing column.*'time_s'"),
    "no rows": (DRIVEN.iloc[:0], "too few samples"),
    "an empty table": (pd.DataFrame(), "missing column"),
    "one row": (DRIVEN.iloc[:1], "too few samples"),
    "no energy": (DRIVEN[["time_s", "speed_m_s"]], "no measured energy"),
    "no current": (DRIVEN.drop(columns="current_a"), "no measured energy"),
    "text": (DRIVEN.assign(current_a="30"), "not a number.*'current_a'"),
    "text as time": (DRIVEN.assign(time_s=["a", "b", "c"]), "not a number.*'time_s'"),
    "truth values": (DRIVEN.assign(voltage_v=True), "not a number.*'voltage_v'"),
    "complex": (DRIVEN.assign(current_a=1j), "not a number.*'current_a'"),
    "objects as energy": (
        DRIVEN[["time_s"]].assign(observed_energy_wh=["a", 1, 2]),
        "not a number.*observed_energy_wh",
    ),
    "missing integers": (
        DRIVEN.assign(current_a=pd.array([30, None, 30], dtype="Int64")),
        "not a number.*'current_a'.*Int64",
    ),
    "a column twice": (pd.concat([DRIVEN, DRIVEN[["time_s"]]], axis=1), "column given twice"),
    "no table": (DRIVEN.to_dict("list"), "unknown type.*a DataFrame"),
    "nothing": (None, "unknown type"),
    "time that goes back": (DRIVEN.assign(time_s=[0.0, 60.0, 30.0]), "time does not increase"),
}


@pytest.mark.parametrize("update", ["update", "update_since_departure"])
@pytest.mark.parametrize(("observed", "words"), NO_SAMPLES.values(), ids=NO_SAMPLES)
def test_what_is_no_table_of_samples_is_refused(update: str, observed: Any, words: str) -> None:
    with pytest.raises(tw.InvalidInput, match=words):
        getattr(FOUND, update)(observed)


def test_integers_without_gaps_are_samples() -> None:
    observed = DRIVEN.assign(current_a=pd.array([30, 30, 30], dtype="Int64"))
    assert FOUND.update(observed).energy_wh == FOUND.update(DRIVEN).energy_wh
