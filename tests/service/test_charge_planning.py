"""The page on charge planning: its requests, its answer and the fields that its configurations read."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

from tests.service.test_live import Served, jobs, message, served
from tests.support import ROOT

__all__ = ["jobs", "served"]

PAGE = ROOT / "docs" / "howto" / "charge-planning.md"


def blocks(kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```$", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL)


def answered(served: Served) -> dict[str, Any]:
    """The answer to the requests of the page, of the car of the tests."""
    put, get = (shlex.split(line) for line in blocks("sh")[0].splitlines())
    served.send(message(0.0, speed=0, soc=30.0))
    served.put(json.loads(put[put.index("--json") + 1]))
    path, _, query = get[-1].replace("my-leaf", "leaf").removeprefix("localhost:8000").partition("?")
    found = served(path, params={name: values[0] for name, values in parse_qs(query).items()})
    assert found.status_code == 200, found.text
    return {**found.json(), "vehicle": "my-leaf"}


def test_the_answer_of_the_page_is_that_of_the_service(served: Served) -> None:
    (shown,) = map(json.loads, blocks("json"))
    found = answered(served)
    assert list(shown) == list(found)
    for name, value in shown.items():
        digits = len(f"{value}".partition(".")[2])
        assert value == (round(found[name], digits) if isinstance(value, float) else found[name]), name


def test_every_field_that_the_page_reads_is_in_the_answer(served: Served) -> None:
    text = "\n".join([*blocks("yaml"), *blocks("sh")])
    attributes = re.search(r"json_attributes:\n((?:\s+- \w+\n)+)", text)
    assert attributes is not None
    read = {*re.findall(r"value_json\.(\w+)", text), *re.findall(r"- (\w+)", attributes[1])}
    read |= set(re.findall(r"jq '\[\.(\w+)", text))
    assert read == {"soc_needed", "charge_wh", "plan", "usual_trip", "energy_wh"}
    assert read <= set(answered(served))


def test_every_request_of_the_page_asks_what_the_service_takes(served: Served) -> None:
    asked = re.findall(r"/v1/need\?([^\s'\"]+)", PAGE.read_text("utf-8"))
    assert len(asked) == 3
    answered(served)
    for query in asked:
        parameters = {name: values[0] for name, values in parse_qs(query.replace("my-leaf", "leaf")).items()}
        assert set(parameters) <= {"vehicle", "probability", "reserve"}
        assert served("/v1/need", params=parameters).status_code == 200


def test_the_payload_for_emhass_is_json() -> None:
    (payload,) = re.findall(r"payload: >-\n(.*?)^```", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    body, replaced = re.subn(r"\{\{.*?\}\}", "2.5", payload)
    assert replaced == 1
    lists = [value for value in json.loads(body).values() if isinstance(value, list)]
    assert [len(value) for value in lists] == [1, 1, 1]


def test_names_of_sensors_follow_from_their_titles() -> None:
    text = "\n".join(blocks("yaml"))
    titles = {"sensor." + name.lower().replace(" ", "_") for name in re.findall(r"- name: (.+)", text)}
    assert set(re.findall(r"sensor\.\w+", text)) == titles


def test_the_page_has_its_place() -> None:
    assert "howto/charge-planning.md" in Path(ROOT / "docs" / "index.md").read_text("utf-8")
