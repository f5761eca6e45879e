"""The real Home Assistant, headless, in a process of its own: its folder, its REST interface, its WebSocket."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import httpx
from tests.support import ROOT
from tests.support.service_process import free_port, wait_for

COMPONENTS: Final = ROOT / "integrations" / "home_assistant" / "custom_components"
START_S: Final = 240.0
"""Longest start [s]: the first one installs what the parts that are always there need."""

CONFIGURATION: Final = """
homeassistant:
  name: Home
  latitude: 47.0
  longitude: 9.0
  time_zone: Europe/Berlin
  country: DE
  unit_system: metric
http:
  server_host: 127.0.0.1
  server_port: {port}
api:
config:
diagnostics:
weather:
  - platform: template
    name: Frost
    unique_id: frost
    condition_template: cloudy
    temperature_template: "{{{{ -4 }}}}"
    humidity_template: "{{{{ 80 }}}}"
    temperature_unit: "°C"
    forecast_hourly_template: >-
      {{{{ [{{"datetime": (now() + timedelta(hours=21)).isoformat(), "condition": "cloudy", "temperature": -7}},
            {{"datetime": (now() + timedelta(hours=22)).isoformat(), "condition": "cloudy", "temperature": -9}}] }}}}
recorder:
compile_statistics:
logger:
  default: warning
  logs:
    custom_components.tripwatt: info
"""

COMPILER: Final = """
from homeassistant.components.recorder import get_instance
from homeassistant.components.recorder.tasks import StatisticsTask
from homeassistant.util import dt


async def async_setup(hass, config):
    async def now(call):
        time = dt.utcnow().replace(second=0, microsecond=0)
        get_instance(hass).queue_task(StatisticsTask(time.replace(minute=time.minute // 5 * 5), False))
        await get_instance(hass).async_block_till_done()

    hass.services.async_register("compile_statistics", "now", now)
    return True
"""
"""The action `compile_statistics.now`: what the recorder does every five minutes, for the present ones."""


def environment() -> tuple[Path | None, str]:
    """The environment with Home Assistant, or why there is none."""
    named = os.environ.get("TRIPWATT_HASS", "")
    folder = Path(named or ROOT / ".venv-hass")
    if (folder / "bin" / "hass").exists():
        return folder, ""
    return None, f"no Home Assistant at {folder}: .ci/run makes it where there are an index and Python 3.13"


class HomeAssistant:
    """A running Home Assistant.

    Attributes
    ----------
    folder : Path
        Its configuration, with what it stores.
    """

    def __init__(self, python: Path, folder: Path, port: int) -> None:
        self.python, self.folder, self.token = python, folder, ""
        self.url = f"http://127.0.0.1:{port}"
        self.client = httpx.Client(base_url=self.url, timeout=60.0)
        self.process: subprocess.Popen[bytes] | None = None
        self._asker: subprocess.Popen[str] | None = None

    def start(self) -> None:
        """Start it, and wait until it runs."""
        command = [self.python.parent / "hass", "--config", self.folder, "--log-no-color"]
        alone = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "TRIPWATT", "VIRTUAL"))}
        with (self.folder / "output").open("ab") as output:
            self.process = subprocess.Popen(command, stdout=output, stderr=output, env=alone)
        assert wait_for(self._runs, START_S), (self.folder / "output").read_text()[-2000:]

    def _runs(self) -> bool:
        assert self.process is not None
        assert self.process.poll() is None, (self.folder / "output").read_text()[-2000:]
        try:
            if not self.token and self.client.get("/api/onboarding").status_code == 200:
                self._onboard()
            answer = self.client.get("/api/config", headers=self.headers)
        except httpx.TransportError:
            return False
        return answer.status_code == 200 and answer.json()["state"] == "RUNNING"

    def stop(self) -> None:
        """End it as a service manager does: it writes what it stores."""
        if self._asker is not None:
            self._asker.communicate()
            self._asker = None
        if self.process is not None and self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            self.process.wait(60)

    @property
    def headers(self) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.token}"}

    def _onboard(self) -> None:
        """Make the first user, and keep its token."""
        about = {"client_id": f"{self.url}/"}
        person = {"name": "Test", "username": "test", "password": "for-tests-only", "language": "en"}
        code = self.client.post("/api/onboarding/users", json=about | person).json()["auth_code"]
        grant = {"grant_type": "authorization_code", "code": code}
        self.token = self.client.post("/auth/token", data=about | grant).json()["access_token"]

    def __call__(self, path: str, body: Any = None, method: str = "", **more: Any) -> Any:
        """The answer of the REST interface; it has to be a good one."""
        method = method or ("GET" if body is None else "POST")
        answer = self.client.request(method, f"/api{path}", json=body, headers=self.headers, **more)
        assert answer.status_code in (200, 201), f"{path}: {answer.status_code} {answer.text}"
        return answer.json()

    def websocket(self, kind: str, **more: Any) -> Any:
        """The result of a command of the WebSocket; it has to be a good one."""
        answer = self.asked(kind, **more)
        assert answer["success"], answer
        return answer["result"]

    def removed(self, device_id: str, entry: str) -> bool:
        """Whether a device could be removed by hand."""
        answer = self.asked(
            "config/device_registry/remove_config_entry", device_id=device_id, config_entry_id=entry
        )
        return bool(answer["success"])

    def asked(self, kind: str, **more: Any) -> dict[str, Any]:
        """The answer to a command of the WebSocket."""
        if self._asker is None:
            command = [self.python, Path(__file__).with_name("ask_websocket.py"), self.url, self.token]
            self._asker = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
            )
        assert self._asker.stdin is not None
        assert self._asker.stdout is not None
        self._asker.stdin.write(json.dumps({"type": kind, **more}) + "\n")
        answer: dict[str, Any] = json.loads(self._asker.stdout.readline())
        return answer

    def flow(self, handler: str, *inputs: Mapping[str, Any], kind: str = "flow") -> dict[str, Any]:
        """The last step of a dialogue: of a new entry, or of the options of one."""
        step: dict[str, Any] = self(f"/config/config_entries/{kind}", {"handler": handler})
        for given in inputs:
            step = self(f"/config/config_entries/{kind}/{step['flow_id']}", given)
        return step

    def entries(self, domain: str = "tripwatt") -> list[dict[str, Any]]:
        """The entries of an integration."""
        listed: list[dict[str, Any]] = self(f"/config/config_entries/entry?domain={domain}")
        return listed

    def registered(self) -> dict[str, dict[str, Any]]:
        """The entities of the integration by their unique ids."""
        listed = self.websocket("config/entity_registry/list")
        return {one["unique_id"]: one for one in listed if one["platform"] == "tripwatt"}

    def devices(self) -> dict[str, dict[str, Any]]:
        """The devices of the integration by their names."""
        listed = self.websocket("config/device_registry/list")
        ours = [one for one in listed if any(domain == "tripwatt" for domain, _ in one["identifiers"])]
        return {one["name"]: one for one in ours}

    def states(self, car: str) -> dict[str, dict[str, Any]]:
        """The states of a car by the keys of their descriptions."""
        all_states = {one["entity_id"]: one for one in self("/states")}
        split = ((unique.split("_", 1)[1], one["entity_id"]) for unique, one in self.registered().items())
        return {
            key.removeprefix(f"{car}_"): all_states[entity_id]
            for key, entity_id in split
            if key.startswith(f"{car}_") and entity_id in all_states
        }

    def figures(self, car: str) -> dict[str, str]:
        """The values of a car by the keys of their descriptions."""
        return {key: state["state"] for key, state in self.states(car).items()}

    def action(self, domain: str, name: str, **data: Any) -> dict[str, Any]:
        """The response of an action."""
        answer = self(f"/services/{domain}/{name}?return_response", data)
        response: dict[str, Any] = answer["service_response"]
        return response

    def log(self) -> str:
        """What it logged since it was made."""
        return (self.folder / "output").read_text()


@contextmanager
def running(python: Path, folder: Path) -> Iterator[HomeAssistant]:
    """Home Assistant with the integration in its folder, and with a first user."""
    folder.mkdir()
    compiler = folder / "custom_components" / "compile_statistics"
    compiler.mkdir(parents=True)
    manifest = {"domain": compiler.name, "name": "Statistics", "dependencies": ["recorder"], "version": "1"}
    (compiler / "manifest.json").write_text(json.dumps(manifest))
    (compiler / "__init__.py").write_text(COMPILER)
    (compiler.parent / "tripwatt").symlink_to(COMPONENTS / "tripwatt")
    port = free_port()
    (folder / "configuration.yaml").write_text(CONFIGURATION.format(port=port))
    made = HomeAssistant(python, folder, port)
    try:
        made.start()
        yield made
    finally:
        made.stop()
        made.client.close()
