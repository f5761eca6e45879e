"""A car from a few figures."""

import math

import numpy as np
import pytest
from benchmarks.anchors import class_anchors, unanchored
from tools.data.anchoring import certified_figures

import tripwatt as tw
from tripwatt.certification import certified_interval, describe_car
from tripwatt.certification.consumption import (
    OPEN,
    charging_efficiency,
    driven_wh_per_km,
    schedule,
    wltp_test_mass,
)
from tripwatt.certification.describing import usual_figures
from tripwatt.errors import InvalidInput
from tripwatt.vehicles import load_vehicle, render_vehicle
from tripwatt.vehicles.anchors import CLASS, anchors, class_of
from tripwatt.vehicles.catalogue import catalogue, class_values, mass_range_kg

SIX = {
    "mass_kg": 1830.0,
    "usable_battery_kwh": 58.0,
    "consumption_kwh_per_100km": 15.5,
    "motor_power_kw": 150.0,
    "body": "hatchback",
    "heat_pump": True,
}


def wltp(car) -> float:
    mass = wltp_test_mass(car.body.test_mass_kg)
    return driven_wh_per_km(car, schedule("wltc"), mass) / charging_efficiency() / 10.0


def test_a_described_car_has_its_figures_and_meets_its_consumption() -> None:
    car = describe_car(**SIX)
    assert car.body.curb_mass_kg == 1830.0
    assert car.drivetrain.motor_max_power_w == 150_000.0
    assert car.climate is not None
    assert car.climate.heat_pump_max_heat_w == 5000.0
    window = car.battery.displayed_full_soc - car.battery.displayed_zero_soc
    assert window == pytest.approx(0.94)
    assert car.battery.capacity_ah * window * car.battery.cells_in_series * 3.72 == pytest.approx(58_000.0)
    assert wltp(car) == pytest.approx(15.5, rel=2e-3)
    assert car.anchor == "certification"
    assert car.title == "hatchback, 1830 kg, 58 kWh, 150 kW, WLTP 15.5 kWh/100 km"
    assert car.entries["body.curb_mass_kg"].source == "given by the caller"
    assert car.entries["body.curb_mass_kg"].licence == "user"


def test_the_label_of_the_epa_is_met_over_its_factor() -> None:
    car = describe_car(mass_kg=1900, body="suv", consumption_kwh_per_100km=19.0, procedure="epa")
    mass = 1900.0 + 300.0 * 0.45359237
    city, highway = (driven_wh_per_km(car, schedule(cycle), mass) for cycle in ("udds", "hwfet"))
    label = (0.55 * city + 0.45 * highway) / charging_efficiency() / 0.7 / 10.0
    assert label == pytest.approx(19.0, rel=2e-3)


def test_what_is_missing_is_that_of_a_usual_car() -> None:
    car, usual = describe_car(), usual_figures("suv")
    assert car.anchor == "class"
    assert car.body.curb_mass_kg == pytest.approx(usual["mass_kg"])
    assert car.drivetrain.motor_max_power_w == pytest.approx(1000.0 * usual["motor_power_kw"])
    assert car.climate is not None
    assert car.climate.heat_pump_max_heat_w == 0.0
    assert car.entries["body.curb_mass_kg"].licence == "estimate"
    assert describe_car(body="Estate").title == "sedan"
    assert usual_figures("van") == usual_figures("van")
    assert usual_figures("small")["mass_kg"] < usual_figures("sedan")["mass_kg"]
    classes = class_values()
    load = car.road_load
    factor = anchors()[class_of("suv")].entries["factor"]
    assert load.drag_area_m2 == pytest.approx(factor ** OPEN["air"] * classes.drag_area_m2["suv"])
    rolling = np.array([classes.rolling, classes.rolling_per_speed_s_m])
    assert load.rolling_coefficients == pytest.approx(factor ** OPEN["rolling"] * rolling)


def test_vans_of_which_little_is_known_meet_their_certified_consumption_in_the_mean() -> None:
    """Each maker has one vote; the committed factor closes the mean, and the scatter is what is left."""
    vans = [name for name, row in catalogue().items() if "body" in row and row["body"][0].value == "van"]
    cars = {name: unanchored(name) for name in vans}
    figures = {name: certified_figures(name, car) for name, car in cars.items()}
    found = class_anchors(cars, figures, anchors()[CLASS])[class_of("van")]
    assert found.entries == pytest.approx(anchors()[class_of("van")].entries, rel=1e-4)
    left: dict[str, list[float]] = {}
    for name, car in cars.items():
        power_kw = car.drivetrain.motor_max_power_w / 1000.0
        same = describe_car(mass_kg=car.body.curb_mass_kg, motor_power_kw=power_kw, body="van")
        error = math.log(10.0 * wltp(same) * charging_efficiency() / figures[name][0].wh_per_km)
        left.setdefault(car.title.split()[0], []).append(error)
    assert len(left) >= 4
    assert abs(np.mean([np.mean(own) for own in left.values()])) < 0.01, left
    assert describe_car(body="van").anchor == "class"


def test_heavier_larger_and_stronger_cars_use_more() -> None:
    base = wltp(describe_car(mass_kg=1700, body="hatchback", motor_power_kw=150))
    assert wltp(describe_car(mass_kg=2000, body="hatchback", motor_power_kw=150)) > base
    assert wltp(describe_car(mass_kg=1700, body="pickup", motor_power_kw=150)) > base
    assert wltp(describe_car(mass_kg=1700, body="sedan", motor_power_kw=150)) < base


def test_the_interval_narrows_with_what_is_known() -> None:
    known = {"body": "suv", "mass_kg": 1900.0}
    widths = []
    for given in ({"body": "suv"}, known, known | {"consumption_kwh_per_100km": 17.0}):
        found = certified_interval(describe_car(**given))
        assert found.low < found.middle < found.high
        assert found.low * found.high == pytest.approx(found.middle**2)
        widths.append(math.log(found.high / found.low))
    assert widths[0] > 1.02 * widths[1] > 1.5 * widths[2]
    car = describe_car(**known)
    narrow, wide = certified_interval(car, level=0.5), certified_interval(car, level=0.95)
    assert wide.low < narrow.low < narrow.high < wide.high
    assert certified_interval(describe_car(body="van", mass_kg=1900)).high > certified_interval(car).high


def test_all_faults_of_the_figures_come_together() -> None:
    with pytest.raises(InvalidInput) as error:
        describe_car(
            mass_kg=-1,
            usable_battery_kwh=math.nan,
            consumption_kwh_per_100km=True,
            motor_power_kw=1e9,
            body="boat",
            heat_pump="yes",  # type: ignore[arg-type]
            procedure="nedc",
        )
    assert [fault.where for fault in error.value.faults] == [
        "mass_kg",
        "usable_battery_kwh",
        "consumption_kwh_per_100km",
        "motor_power_kw",
        "body",
        "heat_pump",
        "procedure",
    ]


@pytest.mark.parametrize(("consumption", "words"), [(45.0, "at most"), (6.5, "at least")])
def test_a_consumption_that_no_such_car_has_is_refused(consumption: float, words: str) -> None:
    with pytest.raises(InvalidInput, match=words) as error:
        describe_car(mass_kg=1900, body="suv", consumption_kwh_per_100km=consumption)
    (fault,) = error.value.faults
    assert fault.where == "consumption_kwh_per_100km"
    assert "kWh/100 km" in str(fault.got)


@pytest.mark.parametrize(("consumption", "words"), [(20.0, "at most"), (4.5, "at least")])
def test_a_quadricycle_has_the_consumption_of_a_town_and_no_impossible_one(
    consumption: float, words: str
) -> None:
    """Renault, technical data of the Twizy: 6.3 kWh/100 km in the urban cycle; Citroën, Ami: 5.5 kWh for 75 km."""
    low, high = (describe_car(body="quadricycle", consumption_kwh_per_100km=c) for c in (6.3, 7.3))
    trace = schedule("town")
    assert max(trace[1]) == pytest.approx(50.0 / 3.6)
    found = [driven_wh_per_km(car, trace, car.body.test_mass_kg) for car in (low, high)]
    assert found == pytest.approx([10.0 * c * charging_efficiency() for c in (6.3, 7.3)], rel=0.01)
    assert "TOWN 6.3 kWh/100 km" in low.title
    with pytest.raises(InvalidInput, match=words):
        describe_car(body="quadricycle", consumption_kwh_per_100km=consumption)


def test_cars_that_differ_have_different_names() -> None:
    first, second = describe_car(**SIX), describe_car(**{**SIX, "heat_pump": False})
    assert first.name != second.name
    assert first.name == describe_car(**SIX).name


def test_a_described_car_is_written_read_and_forecast(tmp_path) -> None:
    car = describe_car(**SIX)
    path = tmp_path / f"{car.name}.toml"
    path.write_text(render_vehicle(car), encoding="utf-8")
    assert load_vehicle(path) == car
    plan = tw.read_route([{"length_m": 30_000.0, "speed_m_s": 20.0}])
    at = tw.Departure(soc=0.8, ambient_temperature_degc=15)

    def width(vehicle) -> float:
        low, high = tw.forecast(plan, at, car=vehicle).interval(0.9)
        return (high - low) / low

    # measured road load < certification alone < class
    assert width("vw_id4_pro") < width(path and load_vehicle(path)) < width(describe_car())


def test_a_car_beyond_the_library_is_titled_flagged_and_widened() -> None:
    """No class reaches 474 kg: the farther a car is from the library, the wider its interval."""
    low, high = mass_range_kg()
    plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])

    def found(mass_kg: float) -> tuple[str, list[str], float, float]:
        car = describe_car(mass_kg=mass_kg)
        forecast = tw.forecast(plan, tw.Departure(soc=0.9, ambient_temperature_degc=20.0), car=car)
        certified = certified_interval(car)
        codes = [flag.code for flag in forecast.flags]
        return car.title, codes, forecast.sd_wh / forecast.energy_wh, certified.high / certified.low

    title, codes, width, certified = found(474.0)
    assert "extrapolated" in title
    assert not title.startswith("suv")
    assert "outside_classes" in codes
    for mass_kg in (low + 1.0, 0.5 * (low + high), high - 1.0):
        title, codes, inside, inside_certified = found(mass_kg)
        assert title.startswith("suv")
        assert "outside_classes" not in codes
        assert inside < width
        assert inside_certified < certified
    widths = [found(mass)[2] for mass in (low, 0.8 * low, 0.6 * low)]
    assert widths == sorted(widths)
    widths = [found(mass)[2] for mass in (high, 1.4 * high, 1.8 * high)]
    assert widths == sorted(widths)
