"""Clients that generators make of the OpenAPI document, as `docs/howto/build-on-it.md` shows them, with a real service."""

from __future__ import annotations

import importlib
import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import orjson
import pytest
from tests.support import ROOT
from tests.support.front_end import run
from tests.support.service_process import TOKEN, Service, serving

from tripwatt.server.http.example_requests import GPX, JOURNEY, PLANNED_REQUEST

PAGE = (ROOT / "docs" / "howto" / "build-on-it.md").read_text(encoding="utf-8")
ADDRESS = "http://127.0.0.1:8000"
OBSERVED = {"time_s": [0.0, 60.0, 120.0], "voltage_v": [370.0, 365.0, 366.0], "current_a": [2.0, 40.0, 38.0]}
PLACES = [{"latitude_deg": 47.0, "longitude_deg": 9.0}, {"latitude_deg": 47.0, "longitude_deg": 9.1}]
GENERATOR = Path(os.environ.get("TRIPWATT_OPENAPI", ROOT / ".venv-openapi")) / "bin" / "openapi-generator-cli"
OF_GENERATOR = (
    "OpenAPI 3.1 support is still in beta",
    "Failed to get the schema name: null",  # a number that may be null, as OpenAPI 3.1 has it
    "'application/x-ndjson' for operation '/v1/forecast/batch' is not support",
    "'application/octet-stream' for operation '/v1/cars/{car}/uploads/{upload}/{file}' is not support",
)
"""Warnings that name a limit of the generator, not of the document."""
SITE = "https://tripwatt.example.org"


def shown(language: str) -> list[str]:
    """The blocks of code in a language on the page."""
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture(scope="module")
def document(complete: Service, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("document") / "openapi.json"
    file.write_bytes(complete.client.get("/openapi.json").content)
    return file


@pytest.fixture(scope="module")
def raw(complete: Service) -> dict[str, Any]:
    """The responses without a client."""
    trip = PLANNED_REQUEST | {"soc": 0.8}
    update = {**trip, "observed": OBSERVED}
    post, put = complete.client.post, complete.client.put
    return {
        "trip": trip,
        "forecast": post("/v1/forecast", json=trip).json(),
        "update": post("/v1/forecast/update", json=update).json(),
        "plan": post("/v1/journeys", json=JOURNEY | {"stops": PLACES}).json(),
        "need": complete.client.get("/v1/need", params={"distance_km": 30}).json(),
        "live": put("/v1/live/leaf/plan", json=trip).json(),
    }


def test_a_python_client_has_every_operation(
    complete: Service,
    document: Path,
    raw: dict[str, Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("openapi_python_client")
    (tmp_path / "client.yml").write_text(*shown("yaml"))
    made = subprocess.run(
        [
            *(sys.executable, "-m", "openapi_python_client", "generate", "--path", f"{document}"),
            *("--config", f"{tmp_path / 'client.yml'}", "--output-path", f"{tmp_path / 'client'}"),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stdout
    # nothing is left out, and there is no warning
    assert "".join(made.stdout.split()) == f"Generating{tmp_path / 'client'}"
    monkeypatch.syspath_prepend(f"{tmp_path / 'client'}")
    client = importlib.import_module("tripwatt_client").Client(complete.url)
    models: Any = importlib.import_module("tripwatt_client.models")

    def ask(module: str, **more: Any) -> Any:
        found = importlib.import_module(f"tripwatt_client.api.{module}").sync_detailed(client=client, **more)
        assert found.status_code == 200, found.content
        return found.parsed

    trip, observed = models.ForecastRequest.from_dict(raw["trip"]), raw["trip"] | {"observed": OBSERVED}
    assert ask("forecast.forecast", body=trip).to_dict() == raw["forecast"]
    update = ask("forecast.update", body=models.UpdateRequest.from_dict(observed))
    assert update.to_dict() == raw["update"]
    assert update.measured_until_s == 120.0
    plan = ask("journeys.plan", body=models.PlanRequest.from_dict(JOURNEY | {"stops": PLACES}))
    assert plan.to_dict() == raw["plan"]
    assert ask("journeys.get_need", distance_km=30.0).to_dict() == raw["need"]
    live = ask("live.put_plan", car="leaf", body=models.LivePlanRequest.from_dict(raw["trip"]))
    assert (live.car, live.plan) == ("leaf", "given")
    assert ask("live.get_live", car="leaf").plan == "given"
    types: Any = importlib.import_module("tripwatt_client.types")
    lines = types.File(payload=b"\n".join(orjson.dumps(raw["trip"] | {"trip": name}) for name in "ab"))
    answers: Any = importlib.import_module("tripwatt_client.api.forecast.batch").sync_detailed(
        client=client, body=lines, fields="trip,energy_wh"
    )
    read = [orjson.loads(line) for line in answers.content.splitlines()]
    assert read == [{"trip": name, "energy_wh": raw["forecast"]["energy_wh"]} for name in "ab"]
    track = types.File(payload=GPX.encode())
    assert ask("routes.route", body=track).duration_s == 90.0
    links = models.RouteJsonBody.from_dict({"links": PLANNED_REQUEST["links"]})
    assert ask("routes.route", body=links, speed_m_s=14.0).distance_m == pytest.approx(12_800.0, rel=1e-3)
    assert models.ProblemDocumentType.NAME_TAKEN == "/problems/name-taken"
    rest = {key: value for key, value in raw["forecast"].items() if key != "energy_wh"}
    with pytest.raises(KeyError):
        models.ForecastResponse.from_dict(rest)
    cars = importlib.import_module("tripwatt_client.api.library.get_models")
    first = cars.sync_detailed(client=client)
    again = cars.sync_detailed(client=client, if_none_match=first.headers["etag"])
    assert (again.status_code, again.content) == (304, b"")
    *examples, with_token = shown("python")
    names: dict[str, Any] = {}
    for example in examples:
        exec(example.replace(ADDRESS, complete.url), names)
    clients = [client, names["client"]]
    assert capsys.readouterr().out.splitlines()[-1] == f"{names['answer'].energy_wh}"
    with pytest.raises(TypeError, match="amient_temperature_degc"):
        models.ForecastRequest(amient_temperature_degc=-5.0)
    (tmp_path / "logs").mkdir()
    with serving(tmp_path / "logs", "--workers", "1", token=TOKEN) as private:
        monkeypatch.setenv("TRIPWATT_TOKEN", TOKEN)
        (get,) = (line for block in shown("sh") for line in block.splitlines() if line.startswith("curl"))
        subprocess.run(
            ["bash", "-c", get.replace(SITE, private.url)], cwd=tmp_path, check=True, capture_output=True
        )
        told = orjson.loads((tmp_path / "openapi.json").read_bytes())
        assert told["paths"].keys() == orjson.loads(document.read_bytes())["paths"].keys()
        exec(with_token.replace(SITE, private.url), names)
    for opened in (*clients, names["client"]):
        opened.get_httpx_client().close()
    assert "ForecastResponse(" in capsys.readouterr().out


def test_a_typescript_client_is_typed_and_runs(
    complete: Service, document: Path, raw: dict[str, Any], tmp_path: Path, web: Path
) -> None:
    place = tmp_path / "client"
    place.mkdir()
    found = run(web, "node_modules/.bin/openapi-typescript", f"{document}", "--output", f"{place / 'api.ts'}")
    assert found.returncode == 0, found.stderr
    more = f"""
const updated = await post("/v1/forecast/update", {orjson.dumps(raw["trip"] | {"observed": OBSERVED}).decode()});
const journey = await post("/v1/journeys", {orjson.dumps(JOURNEY | {"stops": PLACES}).decode()});
type Get<P extends "/v1/need" | "/v1/live/{{car}}"> = paths[P]["get"]["responses"][200]["content"]["application/json"];
const need = (await (await fetch("{ADDRESS}/v1/need?distance_km=30")).json()) as Get<"/v1/need">;
const live = (await (await fetch("{ADDRESS}/v1/live/leaf")).json()) as Get<"/v1/live/{{car}}">;
const until: number = updated.measured_until_s;
const road: number = journey.roads[0]!.distance_m;
console.log(JSON.stringify([answer.energy_wh, until, road, need.soc_needed, live.plan, rows]));
"""
    source = place / "client.ts"
    source.write_text(("".join(shown("typescript")) + more).replace(ADDRESS, complete.url))
    options = {
        "strict": True,
        "noEmit": True,
        "target": "es2022",
        "module": "esnext",
        "moduleResolution": "bundler",
    }
    of_project = {
        "compilerOptions": {**options, "lib": ["es2022", "dom"], "types": []},
        "files": [f"{source}"],
    }
    (place / "tsconfig.json").write_bytes(orjson.dumps(of_project))
    checked = run(web, "node_modules/.bin/tsc", "--project", f"{place / 'tsconfig.json'}")
    assert checked.returncode == 0, checked.stdout
    run(web, "node_modules/.bin/esbuild", f"{source}", "--format=esm", f"--outfile={place / 'client.mjs'}")
    done = run(place, "node", "client.mjs")
    assert done.returncode == 0, done.stderr
    energy, until, road, needed, plan, lines = orjson.loads(done.stdout.splitlines()[-1])
    assert (until, road, needed) == (
        raw["update"]["measured_until_s"],
        raw["plan"]["roads"][0]["distance_m"],
        raw["need"]["soc_needed"],
    )
    printed = done.stdout.splitlines()
    assert energy == pytest.approx(float(printed[0].split()[0]))
    assert printed[1].startswith("/soc ")
    assert plan == "given"
    assert lines == [{"trip": "trip", "energy_wh": energy}] * 2


@cache
def told(document: Path, *command: str) -> str:
    """What the generator says of a document, asked once."""
    done = subprocess.run([GENERATOR, *command, "-i", document], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


@pytest.mark.skipif(
    not GENERATOR.exists(), reason=f"no OpenAPI Generator at {GENERATOR}: .ci/run installs it"
)
@pytest.mark.parametrize(("language", "suffix"), [("dart", "dart"), ("kotlin", "kt")])
def test_a_client_for_a_phone_is_generated_without_a_warning(
    document: Path, tmp_path: Path, language: str, suffix: str
) -> None:
    assert "No validation issues detected" in told(document, "validate", "--recommend")
    lines = told(document, "generate", "-g", language, "-o", f"{tmp_path}").splitlines()
    warnings = [line for line in lines if "WARN" in line or "ERROR" in line]
    assert [line for line in warnings if not any(known in line for known in OF_GENERATOR)] == []
    written = "".join(path.read_text("utf-8") for path in tmp_path.rglob(f"*.{suffix}"))
    for path, operations in orjson.loads(document.read_bytes())["paths"].items():
        if not all(operation.get("x-internal") for operation in operations.values()):
            assert path.partition("{")[0].rstrip("/") in written, path
