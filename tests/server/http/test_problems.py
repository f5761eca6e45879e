"""Problem documents: the status and type of every kind, and how much of an input they repeat."""

from __future__ import annotations

import orjson
import pytest
from tests.support import ROOT

from tripwatt.errors import Fault
from tripwatt.server.http.problems import TITLES, Problem, fault_document

STATUSES = {
    "not-json": 400,
    "bad-request": 400,
    "host-not-served": 400,
    "token-needed": 401,
    "not-found": 404,
    "no-such-car": 404,
    "no-plan": 404,
    "method-not-allowed": 405,
    "body-late": 408,
    "too-large": 413,
    "media-type": 415,
    "invalid-input": 422,
    "internal": 500,
    "no-live": 501,
    "no-map": 501,
    "name-taken": 409,
    "foreign-site": 403,
    "remote": 502,
    "busy": 503,
    "timeout": 504,
}


def test_every_kind_has_a_status() -> None:
    assert STATUSES.keys() == TITLES.keys()


@pytest.mark.parametrize(("kind", "status"), STATUSES.items())
def test_a_problem_has_the_status_and_type_of_its_kind(kind: str, status: int) -> None:
    problem = Problem(kind)
    assert problem.status == status
    assert problem.document() == {"type": f"/problems/{kind}", "title": TITLES[kind][1], "status": status}


def test_a_server_that_answers_wrongly_is_not_said_to_be_silent() -> None:
    said = TITLES["remote"][1].partition(" that was asked ")[2]
    assert said == "did not answer correctly"
    assert f"server {said}" in (ROOT / "docs" / "reference" / "service.md").read_text("utf-8")


def test_detail_and_instance_are_told_where_there_are_any() -> None:
    document = Problem("busy", "too many batches").document("my-id")
    assert (document["detail"], document["instance"]) == ("too many batches", "my-id")


def test_fifty_faults_are_listed_and_further_ones_counted() -> None:
    faults = [Fault("wrong", f"f{k}", at=(f"f{k}",)) for k in range(52)]
    fifty = Problem("invalid-input", faults=faults[:50]).document()
    assert (len(fifty["faults"]), "more_faults" in fifty) == (50, False)
    one_more = Problem("invalid-input", faults=faults[:51]).document()
    assert (len(one_more["faults"]), one_more["more_faults"]) == (50, 1)
    assert one_more["faults"][49] == {"code": "wrong", "what": "wrong", "where": "f49", "pointer": "/f49"}
    assert Problem("invalid-input", faults=faults).document()["more_faults"] == 2


def test_a_parameter_has_its_name_and_each_problem_an_address() -> None:
    (fault,) = Problem(
        "invalid-input", faults=(Fault("out of range", "query.distance_km", "-5"),)
    ).document()["faults"]
    assert (fault["parameter"], fault["code"], "pointer" in fault) == ("distance_km", "out-of-range", False)


def test_the_detail_names_the_first_three_faults() -> None:
    faults = [Fault("wrong", f"f{k}") for k in range(4)]
    assert Problem("invalid-input", faults=faults).document()["detail"] == "f0: wrong; f1: wrong; f2: wrong"
    assert Problem("invalid-input", faults=faults[:1]).document()["detail"] == "f0: wrong"


def test_a_text_of_a_fault_is_cut_after_300_characters() -> None:
    found = fault_document(Fault("w" * 300, "x" * 301, "\ud800"))
    assert found == {"code": "w" * 60, "what": "w" * 300, "where": "x" * 300, "got": "?"}


def test_the_response_has_headers_and_media_type() -> None:
    response = Problem("busy", headers={"Retry-After": "5"}).response("my-id")
    assert (response.status_code, response.media_type) == (503, "application/problem+json")
    assert response.headers["retry-after"] == "5"
    assert response.headers["content-type"] == "application/problem+json"
    assert orjson.loads(response.body) == Problem("busy").document("my-id")
