"""The departure: one table of fields, from which come checks, options, requests and docs; and the weather that it names."""

from __future__ import annotations

import copy
import dataclasses
import datetime as dt
import pickle
import subprocess
import sys
from dataclasses import replace
from typing import Annotated

import numpy as np
import pandas as pd
import pytest
import typer
from pydantic import BaseModel, create_model
from typer.testing import CliRunner

import tripwatt as tw
from tripwatt.command import shared
from tripwatt.command.options import spread
from tripwatt.routes import parse_route
from tripwatt.server.http.schemas import ForecastRequest, departure_field
from tripwatt.trips import ASKED, COLUMNS, FIELDS, Departure, Field, Plan
from tripwatt.trips.messages import name_of

WINDY = Departure(soc=0.8, ambient_temperature_degc=10.0, wind_speed_m_s=8.0)


def eastward(speed_m_s: float = 25.0, heading_deg: float | None = 90.0) -> Plan:
    samples = pd.DataFrame({"time_s": np.arange(0.0, 1200.0), "speed_m_s": speed_m_s, "grade": 0.0})
    heading = None if heading_deg is None else np.full(1200, heading_deg)
    return replace(Plan.from_trace("east", samples), heading_deg=heading)


def test_each_field_is_an_entry_of_the_table():
    assert list(FIELDS) == [field.name for field in dataclasses.fields(Departure)]
    assert all(field.label for field in ASKED.values())
    kinds = [bool(field.column) + bool(field.choices) + bool(field.type) for field in FIELDS.values()]
    assert kinds == [1] * len(FIELDS)


def test_a_new_field_is_one_entry(monkeypatch):
    """Its option, its check, its field in a request with unit and help, and its name in flags come from the entry."""
    field = Field(
        "Share of the sky that clouds cover.",
        label="clouds",
        column=replace(COLUMNS["soc"]),
        option="--clouds",
        metavar="0..1",
    )
    table = {**ASKED, "clouds": field}
    monkeypatch.setattr(shared, "ASKED", table)
    made = []
    monkeypatch.setattr(shared, "Departure", lambda **known: made.append(known))
    app = typer.Typer(rich_markup_mode=None)

    asked_for = shared.departure_options()

    def command(departure) -> None:
        departure()

    command.__annotations__["departure"] = Annotated[shared.DepartureOf, asked_for]
    app.command()(spread(command))
    helped = CliRunner().invoke(app, ["--help"]).output
    assert "--clouds" in helped
    assert "Share of the sky that clouds cover." in " ".join(helped.split())
    assert CliRunner().invoke(app, ["--clouds", "0.5"]).exit_code == 0
    assert made == [{"clouds": 0.5}]
    assert [fault.what for fault in field.faults("clouds", 2.0)] == ["value out of range"]
    request: type[BaseModel] = create_model("Request", clouds=departure_field("clouds", field))
    schema = request.model_json_schema()["properties"]["clouds"]
    assert (schema["x-label"], schema["anyOf"][0]["maximum"]) == ("clouds", 1.0)


def test_what_a_person_gives_is_a_field_of_a_request():
    names = {name for name in ASKED if name != "departs_at"}
    assert names < set(ForecastRequest.model_fields)
    schema = ForecastRequest.model_fields["rain_mm_h"]
    assert schema.description == "Rain [mm/h]"


def test_flags_have_the_names_of_the_table():
    assert [name_of(name) for name in ("soc", "wind_from_deg")] == [
        "state of charge at departure",
        "wind from",
    ]


def test_the_table_is_there_without_pandas():
    code = "import sys, tripwatt.trips.departure; sys.exit(bool({'numpy', 'pandas'} & {*sys.modules}))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_time_of_departure_is_text_in_a_document():
    departure = Departure(departs_at=dt.datetime(2026, 2, 1, 7, 30))
    assert departure.to_dict() == {"departs_at": "2026-02-01T07:30:00"}


def test_a_field_that_there_is_not_is_named_with_the_one_that_was_meant():
    with pytest.raises(
        tw.InvalidInput, match=r"unknown field: Departure: got 'sco'.*did you mean 'soc'"
    ) as error:
        Departure(sco=0.5, trafic=1, ambient=5)  # type: ignore[call-arg]
    assert len(error.value.faults) == 3
    assert error.value.faults[0].fix == "did you mean 'ambient_temperature_degc'?"
    departure = Departure(soc=0.5, covariates={"traffic": 1.0})
    assert copy.deepcopy(departure) == pickle.loads(pickle.dumps(departure)) == departure


def test_a_headwind_costs_and_a_tailwind_helps():
    energy = {
        origin: tw.forecast(eastward(), replace(WINDY, wind_from_deg=origin)).energy_wh
        for origin in (90.0, 270.0)
    }
    calm = tw.forecast(eastward(), replace(WINDY, wind_speed_m_s=None)).energy_wh
    assert energy[270.0] < calm < energy[90.0]
    rain = tw.forecast(eastward(), replace(WINDY, wind_speed_m_s=None, rain_mm_h=2.0)).energy_wh
    assert rain > calm
    thin = tw.forecast(eastward(), replace(WINDY, wind_speed_m_s=None, pressure_pa=90_000.0)).energy_wh
    assert thin < calm


def test_a_wind_from_an_unknown_side_is_a_variance():
    sides = [
        tw.forecast(eastward(), replace(WINDY, wind_from_deg=side)) for side in np.arange(0.0, 360.0, 30.0)
    ]
    energy = np.array([side.drive.simulation.simulated_energy_wh for side in sides])
    for heading, origin in ((None, 90.0), (90.0, None), (None, None)):
        plan = eastward(heading_deg=heading)
        calm = tw.forecast(plan, replace(WINDY, wind_speed_m_s=None))
        windy = tw.forecast(plan, replace(WINDY, wind_from_deg=origin))
        _check_side(calm, windy, energy)


def _check_side(calm, windy, energy):
    assert windy.drive.simulation.simulated_energy_wh == pytest.approx(energy.mean(), rel=2e-3)
    extra = np.sqrt(windy.state_sd_wh**2 - calm.state_sd_wh**2)
    assert extra == pytest.approx(energy.std(), rel=0.02)
    assert [flag.value for flag in windy.flags if flag.code == "wind_direction_unknown"] == [8.0]


def test_a_track_has_its_direction():
    line = parse_route(b'{"type": "LineString", "coordinates": [[11.5, 48.1], [11.6, 48.1]]}')
    plan = line.plan(speed_m_s=20.0)
    assert plan.heading_deg == pytest.approx(90.0, abs=0.1)
    points = "".join(
        f'<trkpt lat="{48 + k / 1e4:.4f}" lon="11"><time>2026-05-01T08:00:{k:02d}Z</time></trkpt>'
        for k in range(30)
    )
    north = parse_route(f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>".encode()).plan()
    assert north.heading_deg == pytest.approx(0.0, abs=1e-6)
    assert len(north.heading_deg) == len(north)


def test_other_weather_takes_the_place_of_that_of_the_departure():
    plan = eastward().with_departure(replace(WINDY, wind_from_deg=90.0, rain_mm_h=1.0))
    assert plan.air.headwind_m_s == pytest.approx(4.0)
    calm = plan.with_weather(plan.air.calm())
    assert calm.air.headwind_m_s == pytest.approx(0.0)
    assert calm.air.rain_mm_h == 1.0
    assert eastward().air is None
