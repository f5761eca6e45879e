"""The command line as a new user meets it: every bad input is one message, outputs appear whole or not at all."""

import json
import os
import pickle
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pytest
from tests.support.command import Answer, answered

from tripwatt.study.report.words import model_label
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Trip

FAST = "constant,physics-paper,physics"


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "tripwatt.command", *map(str, arguments)]


def tum_text(trip: Trip, rows: int = 400) -> str:
    """A trip in the layout of the TUM files."""
    columns = {
        "Time [s]": trip.array("time_s"),
        "Velocity [km/h]": trip.array("speed_m_s") * 3.6,
        "Elevation [m]": trip.array("elevation_m"),
        "Battery Voltage [V]": trip.array("voltage_v"),
        "Battery Current [A]": -trip.array("current_a"),
        "SoC [%]": trip.array("soc") * 100,
        "Ambient Temperature [°C]": trip.array("ambient_temperature_degc"),
    }
    rows_of_cells = zip(*(v[:rows] for v in columns.values()), strict=True)
    lines = [";".join(f"{v:.3f}" for v in cells) for cells in rows_of_cells]
    return "\r\n".join([";".join(columns), *lines]) + "\r\n"


@pytest.fixture(scope="session")
def trips() -> Sequence[Trip]:
    return synthetic_fleet(4, seed=3).trips


@pytest.fixture
def tum(tmp_path: Path, trips: Sequence[Trip]) -> Path:
    """A folder of four trips in the TUM layout, on three days, with its sheet."""
    folder = tmp_path / "tum"
    folder.mkdir()
    book = openpyxl.Workbook()
    book.active.append(["Trip", "Date", "Route/Area", "Weather", "Target Cabin Temperature", "Note"])
    for i, trip in enumerate(trips):
        name = f"TripA{i + 1:02d}"
        (folder / f"{name}.csv").write_text(tum_text(trip), encoding="latin-1")
        book.active.append(
            [name, f"2019-06-2{min(i, 2)}_10-0{i}-00", "city", ("sunny", "cloudy")[i % 2], 21, ""]
        )
    book.save(folder / "Overview.xlsx")
    return folder


@pytest.fixture(scope="session")
def tables(tmp_path_factory: pytest.TempPathFactory, trips: Sequence[Trip]) -> Path:
    """A folder of tables with our own column names."""
    folder = tmp_path_factory.mktemp("tables")
    for trip in trips:
        trip.samples.iloc[:400].to_csv(folder / f"{trip.trip_id}.csv", index=False)
    return folder


def untouched(folder: Path) -> bool:
    return not [p for p in folder.iterdir() if p.name.startswith("out")]


def comparable(results: dict[str, Any]) -> dict[str, Any]:
    """Results without wall times."""
    copy: dict[str, Any] = json.loads(json.dumps(results))
    for evaluation in copy["evaluations"]:
        for score in evaluation["models"].values():
            score.pop("fit_s")
            score.pop("predict_ms")
    return copy


# --- what a new user gets wrong


def test_faults_of_options_and_data_come_in_one_message(run: Callable[..., Answer], tmp_path: Path) -> None:
    (tmp_path / "a_file").write_text("x")
    answer = run(
        "evaluate", tmp_path / "nowhere", "--out", tmp_path / "a_file", "--protocol", "papper", "--car", "leaf",
        "--set", "mass", "--jobs", 0,
    )  # fmt: skip
    assert answer.code == 2
    assert answer.err.startswith("error: 6 faults:\n")
    for word in ("papper", "leaf", "nowhere", "a_file", "--set", "--jobs"):
        assert word in answer.err
    assert answer.out == ""
    assert (tmp_path / "a_file").read_text() == "x"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (
            ["--models", "physics,forrest", "--set", "mass=-5", "--mapping", "nowhere.toml"],
            ["forrest", "mass", "nowhere.toml"],
        ),
        (["--models", ",", "--dataset", "tumm", "--set", "wings=2"], ["--models", "tumm", "wings"]),
        (["--dataset", "ved", "--car", "no/such.toml"], ["tum", "such.toml"]),
        (["--modles", "physics"], ["--modles"]),
    ],
)
def test_a_wrong_option_names_itself_and_leaves_nothing(
    run: Callable[..., Answer], tum: Path, tmp_path: Path, arguments: list[str], named: list[str]
) -> None:
    answer = run("evaluate", tum, "--out", tmp_path / "out", *arguments)
    assert answer.code == 2
    assert all(name in answer.err for name in named), answer.err
    assert "Traceback" not in answer.err
    assert untouched(tmp_path)


def broken(what: str, good: bytes) -> bytes:
    match what:
        case "truncated":
            return good[: len(good) // 2].rstrip(b"\r\n0123456789.;") + b";"
        case "decimal comma":
            lines = good.split(b"\r\n")
            return b"\r\n".join([lines[0], *(line.replace(b".", b",") for line in lines[1:])])
        case "empty":
            return b""
        case "binary":
            return np.random.default_rng(0).bytes(5000)
    raise AssertionError(what)


@pytest.mark.parametrize("verb", ["evaluate", "audit", "simulate"])
def test_broken_files_are_named_and_nothing_is_written(
    run: Callable[..., Answer], tum: Path, tmp_path: Path, verb: str
) -> None:
    (tum / "TripA05.csv").write_bytes(b"")
    damaged = {"TripA02": "truncated", "TripA03": "decimal comma", "TripA04": "binary", "TripA05": "empty"}
    for name, what in damaged.items():
        path = tum / f"{name}.csv"
        path.write_bytes(broken(what, path.read_bytes()))
    out = ["--out", str(tmp_path / "out")] if verb == "evaluate" else []
    answer = run(verb, tum, *out, *(["--strict"] if verb == "audit" else []))
    assert answer.code == 2, answer
    assert answer.out == ""
    assert all(f"{name}.csv" in answer.err for name in damaged)
    assert "TripA01" not in answer.err
    assert untouched(tmp_path)


def test_a_folder_without_trips_says_where_to_get_them(run: Callable[..., Answer], tmp_path: Path) -> None:
    (tmp_path / "notes.csv").write_text("a,b\n1,2\n")
    for verb in ("evaluate", "audit", "simulate"):
        answer = run(verb, tmp_path)
        assert answer.code == 2
        assert "no trips" in answer.err
        assert "doi.org/10.21227/6jr9-5235" in answer.err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["notes.csv"]


def test_too_few_trips_leave_no_folder_behind(run: Callable[..., Answer], tum: Path, tmp_path: Path) -> None:
    for name in ("TripA02", "TripA03", "TripA04"):
        (tum / f"{name}.csv").unlink()
    answer = run("evaluate", tum, "--out", tmp_path / "out", "--models", FAST)
    assert answer.code == 2
    assert "too few trips" in answer.err
    assert untouched(tmp_path)


def test_output_below_a_file_is_refused_before_any_work(run: Callable[..., Answer], tum: Path) -> None:
    answer = run("evaluate", tum, "--out", tum / "TripA01.csv" / "out")
    assert answer.code == 2
    assert "no permission to write into" in answer.err
    assert " read (" not in answer.err


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write anywhere")
def test_output_without_permission_is_refused_before_any_work(
    run: Callable[..., Answer], tum: Path, tmp_path: Path
) -> None:
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    answer = run("evaluate", tum, "--out", locked / "out")
    assert answer.code == 2
    assert "no permission" in answer.err


# --- the main job


@pytest.fixture(scope="session")
def evaluated(tables: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Answer]:
    """One run to its end, drawn, in a folder that does not exist yet."""
    out = tmp_path_factory.mktemp("evaluated") / "new" / "out"
    models = (
        "constant,linear4,physics-paper",
        "--models",
        "physics",
    )  # an option that is given twice counts twice
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tripwatt.study.report.html.PNG_DPI", 40)
        patch.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", lambda self, figure: None)
        answer = answered(
            "evaluate", tables, "--dataset", "table", "--car", "bmw_i3_94ah", "--set", "mass=1250",
            "--models", *models, "--out", out, "--json", "--jobs", 1,
        )  # fmt: skip
    return out, answer


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are laid out but not drawn: for tests of numbers and files."""
    monkeypatch.setattr("tripwatt.study.report.html.svg_text", lambda figure: "<svg></svg>")
    monkeypatch.setattr("tripwatt.study.report.html.png_bytes", lambda figure: b"")


def test_evaluate_writes_all_its_files_and_nothing_else(evaluated: tuple[Path, Answer]) -> None:
    out, answer = evaluated
    assert answer.code == 0, answer.err
    assert sorted(p.name for p in out.iterdir()) == ["figures", "folds.csv", "report.html", "results.json"]
    assert [p.name for p in out.parent.iterdir()] == ["out"]
    assert (out / "report.html").read_text(encoding="utf-8").rstrip().endswith("</html>")
    assert {p.suffix for p in (out / "figures").iterdir()} == {".png", ".svg"}
    rows = (out / "folds.csv").read_text().splitlines()
    results = json.loads((out / "results.json").read_text())
    assert len(rows) == 1 + sum(e["n_trips"] * len(e["models"]) for e in results["evaluations"])


def test_json_is_the_file_and_notes_tell_of_car_and_dropped_covariates(
    evaluated: tuple[Path, Answer],
) -> None:
    out, answer = evaluated
    results = json.loads(answer.out)
    assert results == json.loads((out / "results.json").read_text())
    assert results["vehicle"] == "bmw_i3_94ah"
    assert "bmw_i3_94ah with mass = 1250.0" in results["notes"]
    assert {f"covariate {name} dropped: no trip has it" for name in ("season", "weather")} <= set(
        results["notes"]
    )


@pytest.mark.usefixtures("undrawn")
def test_the_run_on_the_sample_says_that_it_is_one(run: Callable[..., Answer], tmp_path: Path) -> None:
    few = ("--models", "constant,physics-paper", "--hold-outs", "leave_one_trip_out:audited", "--jobs", 1)
    answer = run("evaluate", "--out", tmp_path / "out", *few)
    assert "note: 15 of 58 trips of the TUM set, 1 Hz: a sample" in answer.err
    assert re.search(r"Mean error \[%\] +95 % interval of it +Mean error in the paper \[%\]", answer.out)


@pytest.mark.usefixtures("undrawn")
def test_a_second_run_without_the_sheet_replaces_its_files_and_keeps_the_users(
    run: Callable[..., Answer], tum: Path, tmp_path: Path
) -> None:
    (tum / "Overview.xlsx").unlink()
    out = tmp_path / "out"
    (out / "figures").mkdir(parents=True)
    (out / "figures" / "stale.png").write_text("old")
    (out / "results.json").write_text("old")
    (out / "my notes.txt").write_text("mine")
    asked = f"{FAST},linear4,linear6,physics4"
    answer = run("evaluate", tum, "--out", out, "--models", asked, "--jobs", 1)
    assert answer.code == 0, answer.err
    labels = {model_label(name) for name in asked.split(",")}
    assert len(labels) == 6
    assert all(label in answer.out for label in labels), answer.out
    assert "4 reference" in answer.out
    assert (out / "my notes.txt").read_text() == "mine"
    assert not (out / "figures" / "stale.png").exists()
    results = json.loads((out / "results.json").read_text())
    assert results["dataset"] == "tum"
    notes = " ".join(results["notes"])
    assert all(words in notes for words in ("Overview.xlsx", "season", "covariate weather dropped"))
    assert not (tmp_path / "out.unfinished").exists()


# --- whole or not at all


def mark(fold: Path) -> None:
    """Give a kept fold a fit time that no run has, to see it again."""
    fold.write_bytes(pickle.dumps(replace(pickle.loads(fold.read_bytes()), fit_s=12345.0)))


@pytest.fixture
def interruptible() -> Iterator[None]:
    """A shell starts commands in the background with SIGINT ignored, which their processes inherit."""
    inherited = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, inherited)


@pytest.mark.usefixtures("undrawn", "interruptible")
def test_a_run_that_is_interrupted_resumes_to_the_identical_table(
    run: Callable[..., Answer], tables: Path, tmp_path: Path
) -> None:
    def arguments(out: Path, jobs: int = 1) -> list[object]:
        models = "constant,physics-paper,forest"
        return ["evaluate", tables, "--dataset", "table", "--models", models, "--jobs", jobs, "--out", out]

    out = tmp_path / "out"
    process = subprocess.Popen(
        command(*arguments(out, jobs=2)),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 300
    while len(kept := list(tmp_path.glob("out.unfinished/folds/*/0.constant.*.fold"))) < 4:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=300)
    assert process.returncode == 130
    assert "continue with the same command and --resume" in said
    assert "Traceback" not in said
    assert not out.exists()

    for fold in kept:
        mark(fold)
    other = run("evaluate", tables, "--dataset", "table", "--models", "constant", "--out", out, "--resume")
    assert other.code == 2
    assert "nothing to resume: --resume: got folds of another run" in other.err
    assert all(fold.exists() for fold in kept)
    resumed = run(*arguments(out), "--resume", "--json")
    fresh = run(*arguments(tmp_path / "fresh"), "--json")
    assert resumed.code == fresh.code == 0
    folds = len((out / "folds.csv").read_text().splitlines()) - 1
    told = re.search(r"--resume: (\d+) of (\d+) folds of this run were finished before", resumed.err)
    assert told is not None
    assert len(kept) <= int(told[1]) < int(told[2]) <= folds
    again = run(*arguments(out), "--resume")  # of a run that has ended nothing is kept
    assert f"--resume: 0 of {told[2]} folds of this run were finished before" in again.err
    assert "--resume" not in fresh.err
    results = json.loads(resumed.out)
    assert results["evaluations"][0]["models"]["constant"]["fit_s"] == 12345.0, (
        "a finished fold was run again"
    )
    assert comparable(results) == comparable(json.loads(fresh.out))
    assert (out / "folds.csv").read_bytes() == (tmp_path / "fresh" / "folds.csv").read_bytes()
    assert not (tmp_path / "out.unfinished").exists()


# --- the other commands


def test_audit_tells_the_finding_to_people_and_machines(
    run: Callable[..., Answer], tum: Path, trips: Sequence[Trip]
) -> None:
    lines = (tum / "TripA01.csv").read_text(encoding="latin-1").splitlines()
    frozen = [";".join([f"{k}.000", *lines[250].split(";")[1:]]) for k in range(250, 400)]
    (tum / "TripA01.csv").write_text("\n".join([*lines[:251], *frozen]), encoding="latin-1")
    people, machines = run("audit", tum), run("audit", tum, "--json")
    assert people.code == machines.code == 0
    said = json.loads(machines.out)
    assert said["read"] == 4
    found = [f for f in said["findings"] if f["trip"] == "TripA01" and f["consequence"] == "trimmed"]
    assert len(found) == 1
    assert found[0]["what"] in people.out
    assert set(found[0]) == {"trip", "from_s", "to_s", "what", "consequence"}


def test_vehicles_lists_shows_and_refuses(run: Callable[..., Answer], tmp_path: Path) -> None:
    names = [car["name"] for car in json.loads(run("vehicles", "--json").out)]
    assert {"bmw_i3_60ah", "nissan_leaf_24", "vw_id3"} <= set(names)
    listed = run("vehicles").out
    assert all(name in listed for name in names)
    shown = json.loads(run("vehicles", "nissan_leaf_24", "--set", "mass=1620", "--json").out)
    mass = next(e for e in shown["entries"] if e["key"] == "body.curb_mass_kg")
    assert mass == {
        "key": "body.curb_mass_kg",
        "value": "1620",
        "unit": "kg",
        "source": "given by the caller",
        "licence": "user",
    }
    assert all(e["source"] for e in shown["entries"])
    assert {"facts", "Apache-2.0"} <= {e["licence"] for e in shown["entries"]}
    assert "(licence: user)" in run("vehicles", "nissan_leaf_24", "--set", "mass=1620").out
    assert "body.curb_mass_kg = 1515 kg" in run("vehicles", "nissan_leaf_24").out
    refused = run("vehicles", "nisan_leaf_24")
    assert refused.code == 2
    assert "did you mean 'nissan_leaf_24'" in refused.err
    (tmp_path / "car.toml").write_text('name = "half"\n[body]\n')
    refused = run("vehicles", tmp_path / "car.toml")
    assert refused.code == 2
    assert "missing entry" in refused.err
    assert run("vehicles", "vw_id3", "--out", tmp_path / "x.toml").code == 2
    assert not (tmp_path / "x.toml").exists()


def test_simulate_says_what_the_energy_went_into(run: Callable[..., Answer], tum: Path, tables: Path) -> None:
    answer = json.loads(run("simulate", tum, "--trip", "TripA02", "--json").out)
    assert answer["trip"] == "TripA02"
    assert sum(answer["by_cause_wh"].values()) == pytest.approx(answer["simulated_energy_wh"], rel=1e-9)
    assert answer["observed_energy_wh"] > 0
    heavier = json.loads(run("simulate", tum, "--trip", "TripA02", "--set", "mass=1900", "--json").out)
    assert heavier["simulated_energy_wh"] > answer["simulated_energy_wh"]
    refused = run("simulate", tum)
    assert refused.code == 2
    assert "TripA01, TripA02" in refused.err
    people = run("simulate", tables / "S001.csv")
    assert people.code == 0
    assert "rolling" in people.out
    assert "with bmw_i3_60ah, no value fitted to trips" in people.out
    assert "state of charge of the battery management, not as displayed: " in people.out
    assert "--car" in people.err, "a table does not say which car it is"


def test_mapping_is_proposed_written_used_and_listed(
    run: Callable[..., Answer], trips: Sequence[Trip], tmp_path: Path
) -> None:
    table = trips[0].samples.iloc[:400]
    logged = {
        "Timestamp (ms)": table["time_s"] * 1000 + 1.7e12,
        "Vehicle Speed (km/h)": table["speed_m_s"] * 3.6,
        "HV Battery Voltage (V)": table["voltage_v"],
        "HV Battery Current (A)": -table["current_a"],
    }
    csv = tmp_path / "drive.csv"
    type(table)(logged).to_csv(csv, index=False)
    printed = run("mapping", "suggest", csv)
    assert printed.code == 0, printed.err
    toml = tmp_path / "my.toml"
    assert run("mapping", "suggest", csv, "--out", toml).code == 0
    assert toml.read_text(encoding="utf-8") == printed.out
    direct = trips[0].between(0.0, 399.0).observed_energy_wh
    answer = json.loads(run("simulate", csv, "--mapping", toml, "--json").out)
    assert answer["observed_energy_wh"] == pytest.approx(direct, rel=1e-6)

    csv.write_text("Speed (km/h)\n1\n2\n")
    gaps = run("mapping", "suggest", csv)
    assert gaps.code == 1
    assert "time_s" in gaps.err
    assert run("mapping", "suggest", tmp_path / "nowhere.csv").code == 2

    names = [m["name"] for m in json.loads(run("mapping", "list", "--json").out)]
    assert {"torque", "abrp"} <= set(names)
    assert "[columns]" in run("mapping", "show", "torque").out
    assert run("mapping", "show", "nowhere").code == 2


def test_version_and_the_module_are_the_command(run: Callable[..., Answer]) -> None:
    import tripwatt

    assert run("--version").out == f"tripwatt {tripwatt.__version__}\n"
    done = subprocess.run(command("--version"), capture_output=True, text=True, check=True)
    assert done.stdout == f"tripwatt {tripwatt.__version__}\n"
