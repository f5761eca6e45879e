"""Every published result rests on the code, the data and the settings as they are now: its stamp is current."""

import importlib
import json
import re
from pathlib import Path
from types import ModuleType

import pytest
from tools.docs import make_results, pages, write_figures
from tools.quality import probe

from tripwatt.vehicles import load_vehicle

NAMES = [result.name for result in make_results.RESULTS]
CHAIN, SIMULATE, CABIN = (
    importlib.import_module(f"tripwatt.physics.{name}") for name in ("chain", "simulate", "cabin")
)
TENTH_OF_A_PERCENT = 1.001


@pytest.fixture(scope="module")
def now() -> probe.Probe:
    return probe.computed()


@pytest.mark.parametrize("name", NAMES)
def test_a_published_result_is_of_this_code_and_these_data(name: str, now: probe.Probe) -> None:
    result = make_results.RESULTS[NAMES.index(name)]
    reasons = list(
        make_results.stale(
            result, make_results.read(make_results.STAMPS), now, make_results.read(make_results.PROBE)
        )
    )
    assert not reasons, f"{name} is stale: {'; '.join(reasons)}; {make_results.RENEW}"
    missing = [data for data in result.data if not make_results.source(data).exists()]
    if missing:
        pytest.skip(f"code, settings and files are current; data not at hand: {', '.join(missing)}")


def test_the_stamps_are_of_results_that_there_are() -> None:
    assert set(make_results.read(make_results.STAMPS)) <= set(NAMES)
    assert len(set(NAMES)) == len(NAMES)


def test_a_file_of_results_is_in_the_table() -> None:
    listed = {place for result in make_results.RESULTS for place in result.files}
    found = {f"docs/results/{file.name}" for file in make_results.PROBE.parent.glob("*.json")}
    assert found - {f"docs/results/{name}.json" for name in ("probe", "stamps")} <= listed


FOLLOWS = {
    "README.md": {"example"},
    "docs/explanation/results.md": {"paper", "forecast", "links"},
    "docs/explanation/paper.md": {"paper-page"},
    "docs/reference/citing.md": {"bibtex"},
    "docs/explanation/uncertainty.md": {"coverage"},
    "docs/explanation/car-model.md": {"parameters"},
    "docs/reference/vehicles.md": {"licences"},
    "docs/howto/fleet.md": {"costs"},
    "docs/explanation/peers.md": {"growth"},
    "docs/reference/forecast.md": {"departure"},
}
"""Parts of pages that follow from stamped files or from the code alone, each with a test of its own; and times of a machine."""


def test_every_generated_part_of_a_page_has_a_stamp_or_follows_from_one() -> None:
    listed = {place for result in make_results.RESULTS for place in result.files}
    for page in write_figures.pages():
        name, text = page.relative_to(make_results.ROOT).as_posix(), page.read_text("utf-8")
        for part in pages.names(text):
            assert pages.part(text, part)
            assert f"{name}#{part}" in listed or part in FOLLOWS.get(name, ()), (
                f"{name}: {part} is in no table"
            )
        marks = re.findall(r"<!-- (?!fig:|/fig)(.+?) -->", text)
        assert name in listed or len(marks) == 2 * len(pages.names(text)), name


@pytest.fixture(scope="module")
def simulated() -> probe.Probe:
    return probe.simulated()


@pytest.mark.parametrize(
    ("module", "name"),
    [
        (CHAIN, "rolling_resistance_force"),
        (CHAIN, "aero_drag_force"),
        (CHAIN, "grade_force"),
        (CHAIN, "inertia_force"),
        (SIMULATE, "air_density"),
        (CABIN, "HEAT_PUMP_HEAT_PER_K"),
    ],
)
def test_a_change_of_a_thousandth_in_the_physics_is_seen(
    module: ModuleType, name: str, simulated: probe.Probe, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = getattr(module, name)
    changed = (
        (lambda *args, **kwargs: TENTH_OF_A_PERCENT * old(*args, **kwargs))
        if callable(old)
        else TENTH_OF_A_PERCENT * old
    )
    monkeypatch.setattr(module, name, changed)
    assert list(probe.differences(simulated, probe.simulated()))


@pytest.mark.parametrize("name", probe.CARS)
@pytest.mark.parametrize(
    "key",
    [
        "body.curb_mass_kg",
        "drivetrain.gearbox_efficiency",
        "auxiliaries.moving_load_w",
        "battery.capacity_ah",
        "climate.shell_w_k",
    ],
)
def test_a_change_of_a_thousandth_in_a_car_is_seen(name: str, key: str, simulated: probe.Probe) -> None:
    book = load_vehicle(name)
    car = load_vehicle(name, overrides={key: TENTH_OF_A_PERCENT * float(book.entries[key].value)})
    found = {f"simulation {name}": [probe.of_simulation(car, plan) for plan in probe.plans()]}
    assert list(probe.differences({n: simulated[n] for n in found}, probe.rounded(found)))


def test_noise_is_not_seen(simulated: probe.Probe) -> None:
    noisy = {name: [[x * (1.0 + 3e-6) for x in row] for row in rows] for name, rows in simulated.items()}
    assert not list(probe.differences(simulated, noisy))
    assert list(probe.differences(simulated, {**simulated, "more": [[1.0]]}))


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project with one result, made of one file of data."""
    (tmp_path / "docs" / "results").mkdir(parents=True)
    (tmp_path / "docs" / "page.md").write_text("<!-- table:begin -->\n7.0 %\n<!-- table:end -->\n", "utf-8")
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "trip.csv").write_text("1,2\n", "utf-8")
    monkeypatch.setattr(make_results, "ROOT", tmp_path)
    return tmp_path


RESULT = make_results.Result("one", ("-m one",), ("docs/page.md#table",), ("logs",), 1)
AT = {"simulation": [[1.0, 2.0]]}


def reasons(stamps: dict, now: probe.Probe = AT, result: object = RESULT) -> str:
    return "; ".join(make_results.stale(result, {"one": stamps} if stamps else {}, now, AT))


def test_a_stamp_is_broken_by_code_data_settings_and_by_hand(project: Path) -> None:
    made = make_results.stamp(RESULT, probe.digest(AT))
    assert json.loads(json.dumps(made)) == made
    assert reasons(made) == ""
    assert "no stamp" in reasons({})
    assert "computes something else" in reasons(made, {"simulation": [[1.0, 2.002]]})
    assert reasons(made, {"simulation": [[1.0, 2.00001]]}) == ""
    assert "another probe" in reasons({**made, "probe": "0"})
    assert "command" in reasons(made, result=RESULT._replace(commands=("-m two",)))
    page = project / "docs" / "page.md"
    page.write_text(page.read_text("utf-8").replace("7.0", "6.9"), "utf-8")
    assert "docs/page.md" in reasons(made)
    page.write_text("before\n" + page.read_text("utf-8").replace("6.9", "7.0"), "utf-8")
    assert reasons(made) == ""
    (project / "logs" / "trip.csv").write_text("1,3\n", "utf-8")
    assert "data" in reasons(made)


def test_data_that_are_not_at_hand_are_not_looked_at(project: Path) -> None:
    made = make_results.stamp(RESULT, probe.digest(AT))
    (project / "logs" / "trip.csv").unlink()
    (project / "logs").rmdir()
    assert reasons(made) == ""


def test_every_part_of_a_page_that_is_stamped_is_there() -> None:
    for result in make_results.RESULTS:
        for place in result.files:
            assert make_results.written(place) != "missing", place


def test_a_result_without_other_cars_does_not_rest_on_their_forecasts(project: Path) -> None:
    at = {"simulation": [[1.0, 2.0]], "forecast own trips": [[1.0]], "forecast bmw_i3_60ah": [[1.0]]}
    own, others = RESULT, RESULT._replace(other_cars=True)
    assert set(make_results.resting(own, at)) == {"simulation", "forecast bmw_i3_60ah"}
    assert set(make_results.resting(others, at)) == set(at)
    now = at | {"forecast own trips": [[2.0]]}
    for result, changed in ((own, ""), (others, "the code computes something else")):
        made = make_results.stamp(result, probe.digest(make_results.resting(result, at)))
        assert changed in "; ".join(make_results.stale(result, {"one": made}, now, at))
        if not changed:
            assert not list(make_results.stale(result, {"one": made}, now, at))
