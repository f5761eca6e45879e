"""Sun by the words of a weather report, and why each value is what it is."""

import pytest

from tripwatt.physics.cabin import SUN_W_M2, UNKNOWN_SUN_W_M2, WINTER_SUN, irradiance

CLEAR = 600.0


def under_cloud(share: float) -> float:
    """Global irradiance under a share of cloud (Kasten and Czeplak 1980)."""
    return CLEAR * (1.0 - 0.75 * share**3.4)


@pytest.mark.parametrize(
    ("report", "expected"),
    [
        ("sunny", CLEAR),
        ("clear sky", CLEAR),
        ("overcast", under_cloud(1.0)),
        ("cloudy", under_cloud(1.0)),
        ("Partly cloudy", 400.0),
        ("slightly cloudy", 400.0),
        ("rainy", 100.0),
        ("snow", 100.0),
        ("light snow, cloudy", 100.0),
        ("fog", 100.0),
        ("sunset", 50.0),
        ("sunrise", 50.0),
        ("dark", 0.0),
        ("night, clear", 0.0),
        ("hail of frogs", UNKNOWN_SUN_W_M2),
        (None, UNKNOWN_SUN_W_M2),
    ],
)
def test_sun_of_a_report(report, expected):
    assert irradiance(report) == pytest.approx(expected)
    winter = expected if report is None else expected * WINTER_SUN
    assert irradiance(report, "winter") == pytest.approx(winter)
    assert irradiance(report, "summer") == pytest.approx(expected)


def test_values_have_their_reasons():
    sun = dict(SUN_W_M2)
    # observers call three to seven eighths of cloud partly cloudy
    assert under_cloud(7 / 8) < sun["partly cloudy"] < under_cloud(3 / 8)
    assert sun["snow"] == sun["rain"] == sun["fog"] < under_cloud(1.0)
    assert sun["dark"] < sun["sunset"] < sun["rain"]
    # a noon sun at 18 to 20 degrees against 60 to 65 in summer: sin is 0.33 against 0.89, through twice the air
    assert 0.3 < WINTER_SUN < 0.6
    assert UNKNOWN_SUN_W_M2 == CLEAR / 2
