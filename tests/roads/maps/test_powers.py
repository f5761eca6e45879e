"""The power of a station by a text: read as it is meant, or not at all."""

import itertools

import pytest

from tripwatt.roads.maps.powers import power_w

POWERS_KW = (2.3, 3.7, 7.4, 11.0, 22.0, 43.0, 50.0, 62.5, 100.0, 150.0, 350.0, 400.0, 1000.0, 1500.0)
WRITTEN = {
    "as a figure": lambda kw: f"{kw:g}" if kw <= 400.0 else f"{1e3 * kw:.0f}",
    "in kW": lambda kw: f"{kw:g} kW",
    "without a space": lambda kw: f"{kw:g}kW",
    "with a decimal comma": lambda kw: f"{kw:.1f} kW".replace(".", ","),
    "with thousands": lambda kw: f"{kw:,.0f} kW" if kw == round(kw) else f"{kw} kW",
    "with points": lambda kw: f"{1e3 * kw:,.0f} W".replace(",", "."),
    "with spaces": lambda kw: f"{1e3 * kw:,.0f} W".replace(",", " "),
    "with apostrophes": lambda kw: f"{1e3 * kw:,.0f} W".replace(",", "'"),
    "in watts": lambda kw: f"{1e3 * kw:.0f} W",
    "in watts without a unit": lambda kw: f"{1e3 * kw:.0f}",
    "in MW": lambda kw: f"{kw / 1e3:g} MW",
    "in kVA": lambda kw: f"{kw:g} kVA",
}
BESIDE = ("{}", "max. {}", "2x {}", "4 x {}", "{} x 2", "{} 24/7", "{};{}", "{}/{}", "up to {}", " {} ")


@pytest.mark.parametrize("written", WRITTEN)
def test_a_power_is_read_in_every_way_of_writing_it_or_not_at_all(written):
    read = 0
    for kw, beside in itertools.product(POWERS_KW, BESIDE):
        text = WRITTEN[written](kw)
        found = power_w(beside.format(text, text))
        assert found in (0.0, pytest.approx(1e3 * kw)), (beside, text)
        read += found > 0.0
    assert read >= 0.9 * len(POWERS_KW) * len(BESIDE)


@pytest.mark.parametrize("kw", POWERS_KW)
@pytest.mark.parametrize(
    "beside",
    [
        "{} kW; 500 V; 125 A",
        "{} kW, 125 amps, 500 volts",
        "230 V; 16 A; {} kW",
        "{} kW @ 500 V",
        "{} kW 3-phase 400V",
        "{} kW (32A)",
        "{} kW until 22:00",
        "2 kW;{} kW;2000 kW",
        "400 V 63 A {} kW 50 Hz",
    ],
)
def test_other_quantities_beside_a_power_are_no_power(kw, beside):
    assert power_w(beside.format(f"{kw:g}")) == pytest.approx(1e3 * kw)


@pytest.mark.parametrize(
    ("text", "watt"),
    [
        ("22+11+3,7 kW", 22e3),
        ("11 to 22 kW", 22e3),
        ("150kW DC, 22kW AC", 150e3),
        ("DC50 kW", 50e3),
        ("CCS2 50 kW", 50e3),
        ("150 kWh", 150e3),
        ("1.000 kW", 1e6),
        ("3.680 kW", 3680.0),
        ("1,000,000 W", 1e6),
        ("400V 32A", 22e3),
        ("230 V; 16 A", 3.7e3),
        ("240 V, 30 A", 7.2e3),
        *dict.fromkeys(
            ("32 A", "3x32A", "400 V", "400 V, 16 A, 32 A", "800 V 30 A", "400 V 200 A"), 0.0
        ).items(),
        *dict.fromkeys(
            ("", "yes", "5x", "24/7", "2024", "800", "1600 kW", "2 kW", "50 Hz", "22 kWp"), 0.0
        ).items(),
        *dict.fromkeys(("1 150 kW", "1 kW", "see sign 22", "500 V 125 A", "x" * 199 + " 22 kW"), 0.0).items(),
    ],
)
def test_texts_that_were_read_wrongly(text, watt):
    assert power_w(text) == pytest.approx(watt)


def test_a_power_is_that_of_the_plug_or_none():
    """A household socket has 3.7 kW at most, whatever its text says; 1.400 is 1.4 kW there, and 1,400 kW on a rapid charger."""
    assert [power_w(text, 1e3, 3.7e3) for text in ("11 kW", "16", "3.7", "1.400 kW", "2300")] == [
        0.0,
        0.0,
        3.7e3,
        1.4e3,
        2.3e3,
    ]
    assert power_w("1.400 kW", 5e3, 1.5e6, alternating=False) == 1.4e6
    assert [power_w(text, 1e3, 44e3) for text in ("16", "32", "22", "230", "400")] == [
        0.0,
        0.0,
        22e3,
        0.0,
        0.0,
    ]
    assert power_w("400 V 32 A", 5e3, 1.5e6, alternating=False) == 0.0
