"""Winter tyres, a roof box, a trailer, headlights and the pressure of the tyres."""

import pytest

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.trips import EXTRAS, Departure
from tripwatt.vehicles import load_vehicle, with_extras
from tripwatt.vehicles.extras import effects


def test_every_extra_has_an_effect_and_a_source() -> None:
    assert set(effects()) == set(EXTRAS)
    assert all(extra["source"] for extra in effects().values())


@pytest.mark.parametrize("name", ["vw_id3", "nissan_leaf_24"])  # a coast-down, and coefficients
def test_extras_change_what_they_say(name: str) -> None:
    car = load_vehicle(name)
    constant, linear = car.road_load.rolling_coefficients
    winter = with_extras(car, ["winter_tyres"])
    assert winter.road_load.rolling_coefficients == pytest.approx((1.1 * constant, 1.1 * linear))
    assert winter.road_load.drag_area_m2 == car.road_load.drag_area_m2
    assert winter.body == car.body
    box = with_extras(car, ["roof_box"])
    assert box.road_load.drag_area_m2 == pytest.approx(car.road_load.drag_area_m2 + 0.12)
    assert box.road_load.rolling_coefficients == car.road_load.rolling_coefficients
    assert box.body.curb_mass_kg == car.body.curb_mass_kg + 20.0
    every = with_extras(car, ("trailer", "roof_box", "winter_tyres", "trailer"))
    assert every.body.curb_mass_kg == car.body.curb_mass_kg + 520.0
    assert every.road_load.drag_area_m2 == pytest.approx(car.road_load.drag_area_m2 + 0.72)
    assert every.road_load.rolling_coefficients[0] == pytest.approx(1.1 * constant)
    assert every.auxiliaries == car.auxiliaries
    lit = with_extras(car, ["headlights"])
    assert lit.auxiliaries.base_load_w == car.auxiliaries.base_load_w + 100.0
    assert (lit.body, lit.road_load) == (car.body, car.road_load)
    assert with_extras(car, ()) is car


def test_soft_tyres_roll_harder_by_the_share_of_the_source() -> None:
    car = load_vehicle("vw_id3")
    assert with_extras(car, (), 1.0) is car
    # 1 psi of 30 is 1.4 %
    one_psi = with_extras(car, (), 29.0 / 30.0).road_load
    assert one_psi.rolling_coefficients[0] / car.road_load.rolling_coefficients[0] - 1.0 == pytest.approx(
        0.014, abs=0.001
    )
    assert one_psi.drag_area_m2 == car.road_load.drag_area_m2
    plan = tw.read_route([{"length_m": 30_000.0, "speed_m_s": 20.0}])
    energies = [
        tw.simulate(plan, "vw_id3", Departure(soc=0.8, tyre_pressure=p)).simulated_energy_wh
        for p in (1.2, None, 0.8)
    ]
    assert energies == sorted(energies)
    assert tw.simulate(
        plan, "vw_id3", Departure(soc=0.8, tyre_pressure=1.0)
    ).simulated_energy_wh == pytest.approx(energies[1])


def test_a_departure_takes_known_extras_and_merges_them() -> None:
    assert Departure(extras=["roof_box"]).extras == ("roof_box",)  # type: ignore[arg-type]
    assert Departure(soc=0.5).extras is None
    assert Departure(soc=0.5).merge(Departure(extras=("trailer",))).extras == ("trailer",)
    assert Departure(extras=("trailer",)).to_dict() == {"extras": ("trailer",)}
    for wrong in (("sled",), "trailer", 3):
        with pytest.raises(InvalidInput, match="unknown extra"):
            Departure(extras=wrong)  # type: ignore[arg-type]


def test_forecasts_and_simulations_take_the_extras() -> None:
    plan = tw.read_route([{"length_m": 30_000.0, "speed_m_s": 27.0}])
    energies = [
        tw.simulate(plan, "vw_id3", Departure(soc=0.8, extras=extras)).simulated_energy_wh
        for extras in (None, ("headlights",), ("winter_tyres",), ("roof_box",), ("trailer",))
    ]
    assert energies == sorted(energies)
    # at 27 m/s the box takes 0.5 x 1.2 x 0.12 x 27² N over 30 km, some 440 Wh at the wheel
    assert 1.0 < (energies[3] - energies[0]) / 440.0 < 1.6
    # 100 W for 30 km at 27 m/s
    assert energies[1] - energies[0] == pytest.approx(100.0 * 30_000.0 / 27.0 / 3600.0, rel=0.05)
    own, boxed = (
        tw.forecast(plan, Departure(soc=0.8, extras=extras)).energy_wh for extras in (None, ("roof_box",))
    )
    assert boxed > own + 300.0
