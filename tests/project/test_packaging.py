"""What is installed: the files of the wheel, the commands, the dependencies, and which warnings are errors."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import textwrap
import tomllib
import zipfile
from pathlib import Path

import pytest
from tests.support import ROOT
from tests.support.cars import some_cars
from tools.release import MAX_WHEEL_BYTES

import tripwatt
from tripwatt.errors import install
from tripwatt.vehicles import LICENCES, load_vehicle, vehicle_names
from tripwatt.vehicles.loading import file_names

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
# Of the extra `service`, without pydantic, which recent releases of typer need as well.
SERVICE = ("fastapi", "starlette", "uvicorn", "uvloop", "httptools", "orjson", "prometheus_client")


def python(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, check=False, timeout=120)


# ------------------------------------------------------------------------------------------------ commands


@pytest.mark.parametrize("module", ["tripwatt", "tripwatt.command"])
def test_the_command_runs_as_a_module(module: str) -> None:
    done = python("-m", module, "--version")
    assert (done.returncode, done.stdout) == (0, f"tripwatt {tripwatt.__version__}\n"), done.stderr


def test_a_module_run_names_itself_tripwatt_and_passes_the_exit_code_on() -> None:
    done = python("-m", "tripwatt", "vehicles", "no_such_car")
    assert done.returncode == 2
    assert "no_such_car" in done.stderr
    assert "Traceback" not in done.stderr
    assert "Usage: tripwatt " in python("-m", "tripwatt", "--help").stdout


def test_without_the_extra_service_the_rest_works_and_serve_says_what_is_missing() -> None:
    script = textwrap.dedent(
        f"""
        import sys
        for name in {SERVICE!r}:
            sys.modules[name] = None  # importing it raises ImportError
        import tripwatt.study.evaluation, tripwatt.forecasting, tripwatt.study.report
        from tripwatt.command import main
        sys.argv = ["tripwatt", "vehicles", "--json"]
        try:
            main()
        except SystemExit as end:
            assert not end.code
        sys.argv = ["tripwatt", "serve"]
        main()
        """
    )
    done = python("-c", script)
    assert done.returncode == 2
    assert install("service") in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert {car["name"] for car in json.loads(done.stdout)} == set(vehicle_names())


# ------------------------------------------------------------------------------------------------ dependencies


def test_the_gamm_engine_has_the_version_of_tripwatt() -> None:
    engine = tomllib.loads((ROOT / "gamm" / "pyproject.toml").read_text("utf-8"))["project"]
    assert engine["version"] == PROJECT["project"]["version"]
    extras = PROJECT["project"]["optional-dependencies"]
    assert extras["gamm"] == [f"{engine['name']}=={engine['version']}"]
    assert set(engine["dependencies"]) <= set(PROJECT["project"]["dependencies"])
    assert (ROOT / "gamm" / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()


# ------------------------------------------------------------------------------------------------ warnings

WARNER = "import warnings\ndef warn():\n    warnings.warn('from here', {category}, stacklevel={level})\n"
WARNERS = {
    "tripwatt/physics.py": ("RuntimeWarning", 1, "FAILED"),
    "tripwatt/__init__.py": ("UserWarning", 1, "FAILED"),
    "tripwatt/learners.py": ("DeprecationWarning", 1, "FAILED"),
    "benchmarks/gam.py": ("FutureWarning", 1, "FAILED"),
    "tripwatt_gamm/fit.py": ("RuntimeWarning", 1, "FAILED"),
    "tools/docs/pages.py": ("FutureWarning", 1, "FAILED"),
    "tripwattish/__init__.py": ("UserWarning", 1, "PASSED"),
    "numpyish/tripwatt.py": ("DeprecationWarning", 1, "PASSED"),
    "numpyish/__init__.py": ("RuntimeWarning", 1, "PASSED"),
    "numpyish/blames_its_caller.py": ("UserWarning", 2, "FAILED"),
}
"""Module -> the category that it warns with, the level that the warning is attributed to, how a test that calls it ends."""


def test_warnings_of_our_modules_and_tests_fail_a_test_and_others_are_listed(tmp_path: Path) -> None:
    (tmp_path / "tests").mkdir()
    for number, (module, (category, level, _)) in enumerate(WARNERS.items()):
        file = tmp_path / "src" / module
        file.parent.mkdir(parents=True, exist_ok=True)
        (file.parent / "__init__.py").touch()
        file.write_text(WARNER.format(category=category, level=level))
        name = module.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
        test = f"from {name} import warn\n\ndef test_it():\n    warn()\n"
        (tmp_path / "tests" / f"test_{number}.py").write_text(test)
    lines = "".join(f"\n    {line}" for line in PROJECT["tool"]["pytest"]["ini_options"]["filterwarnings"])
    (tmp_path / "pytest.ini").write_text(
        f"[pytest]\naddopts = --import-mode=importlib\npythonpath = src\nfilterwarnings ={lines}\n"
    )
    options = ("-q", "-rA", "-p", "no:cacheprovider", "-p", "no:schemathesis")
    done = python("-m", "pytest", *options, "tests", cwd=tmp_path)
    found = re.findall(r"^(PASSED|FAILED) tests/test_(\d)", done.stdout, re.MULTILINE)
    ends = [end for end, _ in sorted(found, key=lambda row: int(row[1]))]
    assert ends == [end for *_, end in WARNERS.values()], done.stdout
    listed = done.stdout.partition("warnings summary")[2].partition("short test summary")[0]
    assert listed.count("Warning: from here") == sum(end == "PASSED" for *_, end in WARNERS.values())


# ------------------------------------------------------------------------------------------------ the wheel


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    pytest.importorskip("hatchling", reason="no hatchling: `make check` installs it to build the wheel")
    out = tmp_path_factory.mktemp("wheel")
    done = python("-m", "hatchling", "build", "-t", "wheel", "-d", str(out), cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return zipfile.ZipFile(next(out.glob("*.whl")))


def test_the_wheel_carries_licence_notice_and_everything_that_the_package_needs(
    wheel: zipfile.ZipFile,
) -> None:
    names = wheel.namelist()
    (notice,) = [n for n in names if n.endswith("/licenses/NOTICE")]
    (licence,) = [n for n in names if n.endswith("/licenses/LICENSE")]
    assert wheel.read(notice) == (ROOT / "NOTICE").read_bytes()
    assert wheel.read(licence) == (ROOT / "LICENSE").read_bytes()
    assert {"tripwatt/py.typed", "tripwatt/server/http/page/licences.txt"} <= set(names)
    assert {f"tripwatt/vehicles/data/{name}.toml" for name in file_names()} <= set(names)
    assert {f"tripwatt/vehicles/data/table/{name}.csv" for name in ("cars", "sources", "anchors")} <= set(
        names
    )
    # 130,000: the wheel of the engine
    assert sum(part.compress_size for part in wheel.infolist()) < MAX_WHEEL_BYTES - 130_000
    sources = {f.relative_to(ROOT / "src").as_posix() for f in (ROOT / "src" / "tripwatt").rglob("*.py")}
    assert sources <= set(names)
    assert not [n for n in names if not n.startswith(("tripwatt/", "tripwatt-"))]


def test_the_notice_names_what_licences_ask_to_be_named() -> None:
    text = " ".join((ROOT / "NOTICE").read_text("utf-8").split())
    model = json.loads((ROOT / "src/tripwatt/models/bmw_i3_tum/metadata.json").read_text("utf-8"))
    assert "10.21227/6jr9-5235" in json.dumps(model)  # what the stored model says that it was fitted on
    for words in (
        "10.21227/6jr9-5235",
        "CC BY 4.0",
        "Steinstraeter",
        "bmw_i3_tum",
        "10.1109/TITS.2020.3035596",
    ):
        assert words in text, words
    bundle = (ROOT / "src/tripwatt/server/http/page/licences.txt").read_text("utf-8")
    parts = re.findall(r"^(\S+) \d[\d.]* \(([^)]+)\)$", bundle, re.MULTILINE)
    assert len(parts) >= 4
    for name, _ in parts:
        assert name.rpartition("/")[2].lower() in text.lower() or name in text, name


# ------------------------------------------------------------------------------------------------ values of cars


@pytest.mark.parametrize("name", some_cars(20))
def test_every_value_of_the_library_has_a_licence_that_allows_shipping(name: str) -> None:
    shipped = set(LICENCES) - {"user", "as-source-file", "not-stated"}
    for preset in ("default", "paper"):
        for key, entry in load_vehicle(name, preset).entries.items():
            assert set(entry.licence.split(" AND ")) <= shipped, f"{key}: {entry.licence}"
