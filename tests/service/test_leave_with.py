"""The charge to leave with, asked over HTTP: seeded cars, roads, charges and probabilities."""

import pytest
from benchmarks.leave_with import OVER_HTTP, RESERVE, WORST, over_http
from tests.support.service_process import Service

from tripwatt.trips.messages import leave_in_words


def test_who_leaves_with_the_charge_arrives_with_the_probability_asked_for(service: Service) -> None:
    found = list(over_http(service, OVER_HTTP))
    assert [one for one in found if one.off > WORST] == []
    for one in found:
        assert one.message == leave_in_words(one.soc, RESERVE, one.probability)
        assert one.message.startswith("A full battery does not suffice") == (one.exception == "not even full")
    assert 0.5 * OVER_HTTP < sum(not one.exception for one in found) < OVER_HTTP


@pytest.mark.parametrize("probability", [0.49, 1.0, 95])
def test_a_probability_that_cannot_be_asked_for_is_refused(service: Service, probability: float) -> None:
    request = {"links": [{"length_m": 5000.0, "speed_m_s": 12.0}], "probability": probability}
    answer = service.forecast(request)
    assert answer.status_code == 422
    assert answer.json()["faults"][0]["where"] == "probability"
