"""The front door: `import tripwatt as tw`. A change of its names needs a line in the change log."""

import json
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from tests.support import ROOT
from tests.support.refusals import refuses

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import COLUMNS, QUANTITIES, Flag, Log, Plan
from tripwatt.trips.messages import catalogue, flag_to_dict, message

NAMES = {
    "Advice",
    "Departure",
    "Forecast",
    "ForecastModel",
    "InvalidInput",
    "Journey",
    "Need",
    "Plan",
    "Range",
    "Trip",
    "adapt",
    "audit",
    "advise",
    "create_car",
    "create_store",
    "describe_car",
    "evaluate",
    "fit",
    "for_car",
    "forecast",
    "leaving_with",
    "load_model",
    "load_vehicle",
    "need",
    "open_car",
    "open_store",
    "plan_journey",
    "range_km",
    "read_logs",
    "read_route",
    "read_trips",
    "sample_trips",
    "save_model",
    "simulate",
    "soc_needed",
    "sweep",
}
LINKS = [{"length_m": 6000.0, "speed_m_s": 15.0, "grade": 0.01}, {"length_m": 4000.0, "speed_m_s": 25.0}]


def python(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    return done.stdout.strip()


def test_names_of_the_door_are_listed_and_in_the_change_log():
    assert set(tw.__all__) - {"__version__"} == NAMES
    assert set(dir(tw)) >= NAMES
    log = (ROOT / "CHANGELOG.md").read_text("utf-8")
    assert not [name for name in NAMES if f"`{name}`" not in log]
    with pytest.raises(AttributeError, match="No tripwatt attribute forcast"):
        tw.forcast  # noqa: B018


def test_importing_is_lazy():
    code = "import sys, tripwatt; print(sorted({m.split('.')[0] for m in sys.modules} & {'numpy', 'pandas', 'typer'}))"
    assert python(code) == "[]"


def imported(*arguments):
    """Modules that a command imports."""
    code = f"""
import sys
from tripwatt.command import main
sys.argv = ["tripwatt", *{arguments!r}]
try:
    main()
except SystemExit:
    print("modules", *sys.modules)
"""
    return set(python(code).rpartition("modules")[2].split())


def test_help_imports_no_numbers_and_no_other_command():
    numbers = {"numpy", "scipy", "pandas", "pyarrow"}
    listed = imported("--help")
    assert {name for name in listed if name.startswith("tripwatt.command.")} <= {
        "tripwatt.command.options",
        "tripwatt.command.printing",
    }
    assert not listed & numbers
    assert not imported("forecast", "--help") & numbers


def test_a_forecast_imports_what_it_needs(tmp_path):
    trip = tmp_path / "trip.csv"
    tw.sample_trips().trips[0].samples.to_csv(trip, index=False)
    needless = {
        "scipy",
        "sklearn",
        "lightgbm",
        "matplotlib",
        "joblib",
        "importlib.metadata",
        "tripwatt.hybrid.identification",
    }
    needless |= {
        "tripwatt.auditing.logs",
        "tripwatt.population.adapting",
        "tripwatt.routes.responses",
        "tripwatt.server",
    }
    read = imported("forecast", str(trip), "--soc", "0.8")
    assert "tripwatt.forecasting.leaving" in read
    assert not read & needless


def test_a_missing_trip_is_told_before_the_model_is_loaded():
    assert "cattrs" not in imported("forecast", "nowhere.csv")  # it makes the model of its values


def test_each_name_is_the_same_object_after_all_submodules_are_imported():
    code = """
import importlib, pkgutil, tripwatt as tw
before = {name: getattr(tw, name) for name in tw.__all__ if name != "__version__"}
for module in pkgutil.walk_packages(tw.__path__, "tripwatt."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
print([name for name, it in before.items() if getattr(tw, name) is not it])
fresh = {name: getattr(tw, name) for name in before}
print([name for name, it in fresh.items() if type(it).__name__ == "module"])
"""
    assert python(code).splitlines() == ["[]", "[]"]


@pytest.fixture(scope="module")
def model():
    return tw.load_model("bmw_i3_tum")


def test_each_noun_shows_itself(model):
    plan = tw.read_route(LINKS, trip_id="commute")
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=-5)
    forecast = model.forecast(plan, departure)
    trip = synthetic_fleet(1).trips[0]
    for noun in (plan, departure, forecast, trip, model):
        assert "\n" not in repr(noun)
        assert 10 < len(repr(noun)) < 150
        html = noun._repr_html_()
        assert html.startswith("<table><caption>")
        assert html.endswith("</table>")
        assert noun in (departure, model) or isinstance(noun.plot(), Figure)
        assert noun is model or isinstance(noun.to_frame(), pd.DataFrame)
        assert json.loads(json.dumps(noun.to_dict())) == noun.to_dict()
    assert repr(departure) == "Departure(soc=0.8, ambient_temperature_degc=-5)"
    assert repr(plan) == "<Plan commute: 10.0 km in 9 min, links of 5200 m>"
    assert repr(model) == f"<ForecastModel BMW i3 60 Ah, split corrector, {len(model.trip_ids_)} trips>"
    assert f"{forecast.energy_wh / 1000.0:.2f} kWh" in repr(forecast)


def test_what_verbs_give_is_one_line():
    fleet = synthetic_fleet(2)
    run = tw.simulate(tw.read_route(LINKS, trip_id="commute"), "vw_id3")
    lines = {
        repr(fleet): "<TripSet synthetic: 2 logs>",
        repr(tw.audit(fleet)): "<Audit 2 sound drives of 2 logs, 0 set aside>",
        repr(tw.load_vehicle("vw_id3")): "<Vehicle vw_id3: Volkswagen ID.3 58 kWh, preset default>",
        repr(
            run
        ): f"<Simulation 9 min, {run.simulated_energy_wh / 1000.0:.2f} kWh, {len(run.time_s)} samples>",
    }
    assert list(lines) == list(lines.values())


def test_answers_without_a_road_and_advice_are_one_line():
    advice = tw.advise(tw.read_route(LINKS, trip_id="commute"), tw.Departure(soc=0.8, extras=("roof_box",)))
    energy = tw.need(100)
    far = tw.range_km(0.8)
    chance = f"chance of {100 * advice.p_arrive:.0f} % to arrive with 10 %, {100 * advice.charge_to:.0f} % to leave with"
    assert repr(advice).startswith(f"<Advice commute: {chance}, {len(advice.singly)} action")
    assert repr(energy).startswith(
        f"<Need 100.0 km, mixed: {energy.energy_wh / 1000.0:.2f} kWh, 90 % interval "
    )
    assert repr(energy).endswith(f" kWh, {100 * energy.soc_needed:.0f} % to leave with>")
    low, high = (f"{end / 1000.0:.0f}" for end in far.interval_m)
    shown = f"{far.range_m / 1000.0:.0f} km, 90 % interval {low} to {high} km, from 80 % to 10 %"
    assert repr(far) == f"<Range {shown}>"
    assert max(map(len, map(repr, (advice, energy, far)))) < 150


def test_a_fleet_of_files_has_what_was_read_in_its_line(tmp_path):
    (tmp_path / "a.csv").write_text(synthetic_fleet(1).logs[0].samples.to_csv(index=False))
    (tmp_path / "b.csv").write_text("")
    fleet = tw.read_logs(tmp_path, "table")
    assert repr(fleet) == f"<TripSet {fleet.name}: 1 logs from {fleet.report}>"
    assert repr(fleet.report) == f"<ReadingReport {fleet.report}>"
    assert "2 files: 1 read, 1 left out" in repr(fleet)


def test_a_forecast_and_a_simulation_have_energies_by_cause_of_one_kind(model):
    plan = tw.read_route(LINKS)
    forecast, run = model.forecast(plan), tw.simulate(plan, model.vehicle)
    assert list(forecast.by_cause_wh) == [*run.by_cause_wh, "correction"]
    for found, total in ((forecast, forecast.energy_wh), (run, run.simulated_energy_wh)):
        assert {type(energy) for energy in found.by_cause_wh.values()} == {float}
        assert sum(found.by_cause_wh.values()) == pytest.approx(total)
    ends = {cause: energy[-1] for cause, energy in run.cumulative_by_cause_wh.items()}
    assert run.by_cause_wh == pytest.approx(ends)


def test_the_table_of_a_model_has_units(model):
    rows = model._repr_html_()
    seen = model.ranges_["ambient_temperature_degc"]
    assert f"{seen.low:.3g} to {seen.high:.3g} °C" in rows
    assert "km/h</td>" in rows
    assert "e+03" not in rows


def test_text_of_a_file_is_escaped_in_a_notebook():
    log = Log.from_samples("<script>", pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": [0.0, 1.0]}))
    assert "<script>" not in log._repr_html_()
    assert "&lt;script&gt;" in log._repr_html_()


def test_the_departure_counts_before_what_the_file_holds(model):
    samples = pd.DataFrame(
        {"time_s": np.arange(300.0), "speed_m_s": 14.0, "soc": 0.5, "ambient_temperature_degc": 20.0}
    )
    plan = Plan.from_samples(samples, "drive")
    assert plan.departure == tw.Departure(bms_soc=0.5, ambient_temperature_degc=20.0)
    given = model.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=-5))
    assert given.plan.departure == tw.Departure(soc=0.8, ambient_temperature_degc=-5)
    assert given.energy_wh > model.forecast(plan).energy_wh
    assert given.to_frame()["displayed_soc"][0] == pytest.approx(0.8)


def test_one_forecast_in_one_call_is_that_of_the_model(model):
    plan, departure = tw.read_route(LINKS), tw.Departure(soc=0.8, ambient_temperature_degc=3)
    assert tw.forecast(plan, departure).to_dict() == model.forecast(plan, departure).to_dict()
    other = tw.forecast(plan, departure, model=model, car="vw_id3")
    assert other.flags[0] == Flag("no_trips_of_car", model.vehicle.title)
    assert message(other.flags[0]).endswith(f" and trips of another car, {model.vehicle.title}")
    assert other.vehicle.name == "vw_id3"


def test_what_the_simulation_takes_is_bounded_by_the_schema_alone():
    car = tw.load_vehicle("bmw_i3_60ah")
    time = np.arange(3.0)
    limits = {"ambient_temperature_degc": COLUMNS["ambient_temperature_degc"], **QUANTITIES}
    from tripwatt.physics import DriveConditions, simulate

    with pytest.raises(
        InvalidInput, match=f"speed_m_s: got 90.1; allowed: 0 to {COLUMNS['speed_m_s'].maximum:g}"
    ):
        simulate(car, time, [0.0, 90.1, 0.0])
    for name in ("ambient_temperature_degc", "payload_mass_kg"):
        simulate(car, time, np.zeros(3), conditions=DriveConditions(**{name: limits[name].maximum}))
        with pytest.raises(InvalidInput, match=name):
            simulate(car, time, np.zeros(3), conditions=DriveConditions(**{name: limits[name].maximum + 1.0}))
        with pytest.raises(InvalidInput, match=name):
            tw.Departure(**{name: limits[name].maximum + 1.0})


@pytest.mark.parametrize("code", sorted(catalogue()["flags"]))
def test_every_flag_has_a_sentence(code):
    said = message(Flag(code, "battery_temperature_degc", 3.0, "m_s"))
    assert said == said.strip()
    assert not said.endswith(".")
    assert " sd" not in said
    assert "standard deviation" not in said


@pytest.mark.parametrize(
    ("flag", "said"),
    [
        (Flag("soc_assumed", "soc", 0.804, "1"), "state of charge at departure is unknown: 80 % is assumed"),
        (Flag("motor_torque_limit", "motor", 4023.0, "s"), "the car cannot reach the speed of the trace for 1 h 07 min: motor torque limit"),
        (Flag("speed_assumed", "track", 13.8889, "m_s"), "50 km/h is assumed where the track has no speed"),
        (Flag("links_too_long", "links", 30_000.4, "m"), "neighbouring links of equal speed count as one: they are 30.0 km long in the mean, longer than those with which the error of planned routes was measured"),
        (Flag("outside_training", "ambient_temperature_degc", 0.4, "sd", (-3.0, 31.0)), "outside temperature is outside the range of the training trips, -3 to 31 °C: the error there is not known from trips"),
        (Flag("first_of_several", "routes", 3.0, "1"), "the first of 3 routes is used"),
    ],
)  # fmt: skip
def test_sentences_have_the_figures_of_their_flags(flag, said):
    assert message(flag) == said
    assert flag_to_dict(flag) == {
        "code": flag.code,
        "subject": flag.subject,
        "value": flag.value,
        "unit": flag.unit,
        "message": said,
    }


def test_forecast_takes_what_read_route_reads(model):
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=-5)
    plan = tw.read_route(LINKS)
    assert tw.forecast(LINKS, departure).energy_wh == model.forecast(plan, departure).energy_wh
    for call in (tw.forecast, model.forecast, lambda *given: tw.simulate(plan, "vw_id3", given[1])):
        refuses(r"departure: got \{'soc': 0\.7\}; allowed: a Departure", call, plan, {"soc": 0.7})
    refuses(r"trip: got DataFrame; allowed: a Plan or a Trip", model.forecast, pd.DataFrame(LINKS))


def test_a_table_of_links_is_the_plan_of_its_rows(model):
    links = pd.DataFrame(LINKS)  # NaN where a link has no grade
    plan = tw.read_route(links, trip_id="commute")
    assert plan.to_dict() == tw.read_route(LINKS, trip_id="commute").to_dict()
    assert tw.forecast(links).to_dict() == model.forecast(tw.read_route(LINKS)).to_dict()


def test_a_table_of_samples_is_a_speed_trace_with_its_departure():
    samples = synthetic_fleet(1).trips[0].samples
    plan = tw.read_route(samples.iloc[5:], trip_id="drive")
    assert plan.to_dict() == Plan.from_samples(samples.iloc[5:], "drive").to_dict()
    assert plan.link_m is None
    assert plan.departure.bms_soc == samples["soc"][5]
    refuses(r"speed has no effect: .* route contains times or speeds", tw.read_route, samples, speed_m_s=10.0)


WRONG_TABLES = {
    "a unit of links": (pd.DataFrame(LINKS * 25).rename(columns={"speed_m_s": "speed_km_h"}), ["unknown column", "missing column"]),
    "a missing length": (pd.DataFrame({"speed_m_s": [12.0] * 50}), ["missing column"]),
    "a text of links": (pd.DataFrame(LINKS * 25).assign(speed_m_s="fast"), ["not a number"]),
    "links without names": (pd.DataFrame([[1.0], [2.0]]), ["unknown column", "missing column", "missing column"]),
    "a unit of samples": (pd.DataFrame({"time_s": [0.0, 1.0, 2.0], "speed_km_h": 5.0}), ["unknown column or unit", "missing column"]),
    "a text of samples": (pd.DataFrame({"time_s": [0.0, 1.0, 2.0], "speed_m_s": "fast"}), ["not a number"]),
    "samples without times": (pd.DataFrame({"speed_m_s": [5.0] * 3, "voltage_v": 350.0, "current_a": 9.0}), ["missing column"]),
    "links with a value of a log": (pd.DataFrame(LINKS).assign(soc=0.8), ["unknown column"]),
    "a column twice": (pd.DataFrame([[0.0, 1.0, 1.0]] * 3, columns=["time_s", "speed_m_s", "speed_m_s"]), ["duplicate column"]),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG_TABLES)
def test_a_wrong_column_of_a_table_is_named_once(case):
    table, faults = WRONG_TABLES[case]
    with pytest.raises(tw.InvalidInput) as refused:
        tw.read_route(table)
    assert [fault.what for fault in refused.value.faults] == faults


def test_a_speed_has_no_effect_on_a_track_with_times():
    points = "".join(
        f'<trkpt lat="{48 + k / 1000:.3f}" lon="11"><time>2026-05-01T08:0{k}:00Z</time></trkpt>'
        for k in range(5)
    )
    with pytest.raises(tw.InvalidInput, match="speed has no effect"):
        tw.read_route(f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>".encode(), speed_m_s=14.0)
