"""`tripwatt fit`, `forecast`, `inspect`, `example-trip` as a new user meets them."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from tests.support.command import Run
from tests.support.drives import example_trip

from tripwatt.forecasting.storage import model_folder
from tripwatt.server.cars.folder import create_car
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import COLUMNS
from tripwatt.units import GRAVITY_M_S2
from tripwatt.vehicles import load_vehicle, render_vehicle


@pytest.fixture(scope="session")
def table() -> pd.DataFrame:
    return example_trip()


@pytest.fixture
def trip(tmp_path: Path, table: pd.DataFrame) -> Path:
    table.to_csv(tmp_path / "trip.csv", index=False)
    return tmp_path / "trip.csv"


def test_forecast_answers_with_the_keys_of_the_contract(run: Run, trip: Path) -> None:
    answer = run("forecast", trip, "--soc", 0.8, "--ambient", -5, "--reserve", 0.3, "--json")
    assert answer.code == 0
    found = json.loads(answer.out)
    assert {
        "energy_wh",
        "quantiles_wh",
        "soc_arrival",
        "p_arrive_by_soc",
        "series",
        "by_cause_wh",
        "flags",
    } <= set(found)
    assert found["given"] == "the driven speed trace"
    assert found["series"]["displayed_soc"][0] == pytest.approx(0.8)
    assert found["series"]["displayed_soc"][-1] == pytest.approx(found["soc_arrival"])
    assert found["p_arrive_by_soc"]["0"] >= found["p_arrive_by_soc"]["0.3"]
    assert sum(found["by_cause_wh"].values()) == pytest.approx(found["energy_wh"])
    mild = json.loads(run("forecast", trip, "--soc", 0.8, "--ambient", 20, "--json").out)
    heavy = json.loads(run("forecast", trip, "--soc", 0.8, "--ambient", 20, "--payload", 300, "--json").out)
    assert mild["energy_wh"] < found["energy_wh"]
    assert mild["by_cause_wh"]["rolling"] < heavy["by_cause_wh"]["rolling"]


def test_every_figure_for_people_is_given_the_speed_trace(run: Run, trip: Path) -> None:
    answer = run("forecast", trip, "--soc", 0.8)
    assert answer.code == 0
    assert "given the driven speed trace" in answer.out
    assert "9 in 10 such trips take" in answer.out
    assert "The probability to arrive with 10 % or more is " in answer.out
    low = run("forecast", trip, "--soc", 0.02, "--ambient", -5, "--reserve", 0)
    assert low.out.count("The probability to arrive") == 1


def test_what_was_measured_moves_the_forecast(
    run: Run, trip: Path, table: pd.DataFrame, tmp_path: Path
) -> None:
    late = table.assign(time_s=table["time_s"] + 60.0)
    late.to_csv(tmp_path / "late.csv", index=False)
    late[late["time_s"] < 700.0].to_parquet(tmp_path / "so-far.parquet")
    late.loc[late["time_s"] < 700.0, ["time_s", "soc"]].to_csv(tmp_path / "soc.csv", index=False)
    before = json.loads(run("forecast", tmp_path / "late.csv", "--json").out)
    assert before["energy_wh"] == json.loads(run("forecast", trip, "--json").out)["energy_wh"]
    for name in ("so-far.parquet", "soc.csv"):
        answer = run("forecast", tmp_path / "late.csv", "--observed", tmp_path / name, "--json")
        after = json.loads(answer.out)
        assert after["energy_wh"] != before["energy_wh"]
        assert after["measured_until_s"] == pytest.approx(639.0)
    early = table.iloc[:50]
    early.to_csv(tmp_path / "early.csv", index=False)
    answer = run("forecast", tmp_path / "late.csv", "--observed", tmp_path / "early.csv")
    assert answer.code == 2
    assert "before departure" in answer.err


def test_the_folder_of_my_car_is_its_model_and_its_car(run: Run, trip: Path, tmp_path: Path) -> None:
    own = create_car(tmp_path / "car", "vw_id3").folder
    for command in ("forecast", "advise"):
        as_car = run(command, "--car", own, trip, "--json")
        assert as_car.code == 0, as_car.err
        assert as_car.out == run(command, own, trip, "--json").out != run(command, trip, "--json").out
        assert "option has no effect: MODEL" in run(command, "--car", own, own, trip).err
        assert run(command, "--car", tmp_path, trip).code == 2, "no car"


def test_the_file_of_a_logger_is_read_as_simulate_reads_it(
    run: Run, trip: Path, table: pd.DataFrame, tmp_path: Path
) -> None:
    names = {"time_s": "Time (s)", "speed_m_s": "Speed (km/h)", "soc": "SOC (%)", "elevation_m": "Height (m)"}
    names |= {"voltage_v": "Pack V", "current_a": "Pack A"}
    drive = table[[*names]].assign(speed_m_s=3.6 * table["speed_m_s"], soc=100.0 * table["soc"])
    drive.rename(columns=names).to_csv(tmp_path / "logger.csv", index=False)
    table[[*names]].to_csv(tmp_path / "ours.csv", index=False)
    raw, ours = (
        json.loads(run("forecast", tmp_path / f"{name}.csv", "--json").out) for name in ("logger", "ours")
    )
    assert raw["energy_wh"] == pytest.approx(ours["energy_wh"], rel=1e-9)
    assert raw["series"]["displayed_soc"] == pytest.approx(ours["series"]["displayed_soc"])
    assert [flag["code"] for flag in raw["flags"]] == [flag["code"] for flag in ours["flags"]]
    assert run("advise", tmp_path / "logger.csv").code == 0
    drive[["speed_m_s", "soc"]].to_csv(tmp_path / "untimed.csv", index=False)
    assert "missing column" in run("forecast", tmp_path / "untimed.csv").err


def test_unknown_charge_is_said(run: Run, table: pd.DataFrame, tmp_path: Path) -> None:
    table[["time_s", "speed_m_s"]].to_csv(tmp_path / "bare.csv", index=False)
    flags = json.loads(run("forecast", tmp_path / "bare.csv", "--json").out)["flags"]
    assert [(flag["subject"], flag["unit"]) for flag in flags if flag["code"] == "soc_assumed"] == [
        ("soc", "1")
    ]
    assert any("state of charge at departure is unknown" in flag["message"] for flag in flags)
    flags = json.loads(run("forecast", tmp_path / "bare.csv", "--soc", 0.5, "--json").out)["flags"]
    assert "soc_assumed" not in {flag["code"] for flag in flags}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.rename(columns={"speed_m_s": "speed_km_h"}), "did you mean speed_m_s in m/s?"),
        (lambda t: t.rename(columns={"speed_m_s": "v"}), "did you mean speed_m_s in m/s?"),
        (lambda t: t.rename(columns={"time_s": "t"}), "did you mean time_s in s?"),
        (lambda t: t.assign(time_s=t["time_s"].to_numpy()[::-1]), "time does not increase"),
        (lambda t: t.drop(columns="time_s"), "missing column"),
    ],
)
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_table_that_is_no_trip_is_one_message(
    run: Run, table: pd.DataFrame, tmp_path: Path, change: Callable[..., pd.DataFrame], said: str, suffix: str
) -> None:
    bad = change(table.copy())
    path = tmp_path / f"bad.{suffix}"
    bad.to_csv(path, index=False) if suffix == "csv" else bad.to_parquet(path)
    answer = run("forecast", path)
    assert answer.code == 2, answer.out
    assert said in answer.err
    assert "Traceback" not in answer.err
    assert answer.out == ""


def test_faults_of_options_model_and_trip_come_in_one_message(run: Run, tmp_path: Path) -> None:
    options = ("--soc", 1.2, "--ambient", "nan", "--payload", -5, "--reserve", 2)
    answer = run("forecast", tmp_path / "no-model", tmp_path / "nowhere.csv", *options)
    assert answer.code == 2
    for said in ("6 faults", "no-model", "nowhere.csv", "--soc", "--ambient", "--payload", "--reserve"):
        assert said in answer.err
    assert not list(tmp_path.iterdir())
    assert run("forecast", tmp_path / "nowhere.gpx").err.endswith(
        "nowhere.gpx: got no such file; allowed: a file\n"
    )


def test_a_damaged_model_is_refused(run: Run, trip: Path, tmp_path: Path) -> None:
    shutil.copytree(model_folder(), tmp_path / "model")
    file = tmp_path / "model" / "model.npz"
    raw = bytearray(file.read_bytes())
    raw[len(raw) // 2] ^= 1
    file.write_bytes(raw)
    for command in (("forecast", tmp_path / "model", trip), ("inspect", tmp_path / "model")):
        answer = run(*command)
        assert answer.code == 2
        assert file.name in answer.err
        assert "damaged or altered" in answer.err


def test_fit_writes_a_model_that_forecast_and_inspect_take(run: Run, trip: Path, tmp_path: Path) -> None:
    out = tmp_path / "model"
    answer = run("fit", "--out", out, "--corrector", "linear", "--set", "mass=1300")
    assert answer.code == 0
    assert "fitted on 15 trips (TUM sample)" in answer.out
    assert "given the driven speed trace" in answer.out
    assert "15 of 58 trips of the TUM set, 1 Hz: a sample" in answer.err
    own = json.loads(run("forecast", out, trip, "--json").out)
    default = json.loads(run("forecast", trip, "--json").out)
    assert own["energy_wh"] != default["energy_wh"]
    about = json.loads(run("inspect", out, "--json").out)
    assert about["model"]["corrector"] == "linear"
    assert about["provenance"]["data"]["name"] == "TUM sample"
    shown = run("inspect", out)
    assert shown.code == 0
    assert "linear, seed 0, 15 trips" in shown.out


def test_fit_names_everything_that_is_wrong_and_writes_nothing(run: Run, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("x")
    options = ("--out", tmp_path / "taken", "--corrector", "gamm", "--car", "leaf")
    answer = run("fit", tmp_path / "nowhere", *options)
    assert answer.code == 2
    for said in ("taken", "gamm", "leaf", "nowhere"):
        assert said in answer.err
    assert (tmp_path / "taken").read_text() == "x"


def test_the_example_is_a_trip(run: Run, tmp_path: Path) -> None:
    answer = run("example-trip", "--out", tmp_path / "e.csv")
    assert answer.code == 0
    assert "TripB37 of M. Steinstraeter" in answer.err
    assert run("forecast", tmp_path / "e.csv").code == 0
    assert "TripA01, TripA05" in run("example-trip", "--out", tmp_path / "f.csv", "--trip", "TripA02").err
    for dataset, name in {"ved": "VED10-1601", "synthetic": "S001"}.items():
        assert json.loads(run("simulate", "--dataset", dataset, "--json").out)["trip"] == name
    assert "no trips in the package" in run("simulate", "--dataset", "twizy").err


def test_a_changed_copy_of_the_models_car_is_forecast_with_its_own_values(run: Run, tmp_path: Path) -> None:
    links = tmp_path / "links.json"
    links.write_text('[{"length_m": 5000, "speed_m_s": 15, "grade": 0.05}]')
    car = load_vehicle("bmw_i3_60ah")
    copy = tmp_path / "bmw_i3_60ah.toml"
    copy.write_text(render_vehicle(car))
    departure = ("--soc", 0.9, "--ambient", 20)
    own = json.loads(run("forecast", links, *departure, "--json").out)
    assert json.loads(run("forecast", links, *departure, "--car", copy, "--json").out) == own
    known = f"curb_mass_kg = {{ value = {car.body.curb_mass_kg}"
    copy.write_text(render_vehicle(car).replace(known, "curb_mass_kg = { value = 2500.0"))
    heavy = json.loads(run("forecast", links, *departure, "--car", copy, "--json").out)
    lift_wh = (2500.0 - car.body.curb_mass_kg) * GRAVITY_M_S2 * 250.0 / 3600.0
    assert heavy["energy_wh"] - own["energy_wh"] > lift_wh
    assert heavy["flags"][0]["code"] == "changed_car"
    shown = run("forecast", links, *departure, "--car", copy)
    assert "body.curb_mass_kg is 2500 kg in place of 1281 kg" in " ".join((shown.out + shown.err).split())


def test_columns_of_ones_own_are_fitted_and_given(run: Run, tmp_path: Path) -> None:
    for number, trip in enumerate(synthetic_fleet(9).trips):
        driver = "ben" if number % 2 else "anna"
        trip.samples.assign(traffic=float(number % 3), driver=driver).to_csv(
            tmp_path / f"{trip.trip_id}.csv", index=False
        )
    mapping, model = tmp_path / "map.toml", tmp_path / "model"
    columns = "".join(
        f'{name} = {{ column = "{name}", unit = "{COLUMNS[name].unit}" }}\n'
        for name in trip.samples
        if name in COLUMNS
    )
    mapping.write_text(f'[columns]\n{columns}[covariates]\ntraffic = "traffic"\ndriver = "driver"\n')
    asked: tuple[object, ...] = ("--covariate", "traffic", "--covariate", "driver", "--out", model)
    fitted = run("fit", tmp_path, "--mapping", mapping, "--corrector", "linear", "--published", *asked)
    assert fitted.code == 0, fitted.err
    trip.samples.to_csv(tmp_path / "trip.csv", index=False)
    forecast = (
        "forecast",
        model,
        tmp_path / "trip.csv",
        "--json",
        "--covariate",
        "driver=anna",
        "--covariate",
    )
    codes = {
        value: [
            (f["code"], f["subject"]) for f in json.loads(run(*forecast, f"traffic={value}").out)["flags"]
        ]
        for value in (1, 9)
    }
    assert ("outside_training", "traffic") in codes[9]
    assert not {("outside_training", "traffic"), ("covariate_unknown", "driver")} & {*codes[1]}
    wrong = run(*forecast, "trafic=1")
    assert wrong.code == 2
    assert "did you mean 'traffic'" in wrong.err
    wrong = run("fit", tmp_path, "--mapping", mapping, "--covariate", "trafic", "--corrector", "linear")
    assert "unknown covariate" in wrong.err
    both = run(*forecast, "traffic", "--covariate", "driver=ben")
    assert "not NAME=VALUE" in both.err
    assert "name given twice" in both.err
