"""Bounds of every field of a request, at the bound and beyond it, and the checks of samples and links."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic.json_schema import models_json_schema
from tests.support.refusals import refuses

import tripwatt as tw
from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecasting.document import ForecastResponse
from tripwatt.forecasting.leaving import leave_with
from tripwatt.server.http.journey_schemas import (
    NeedQuery,
    PlanRequest,
    ReachRequest,
)
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.schemas import (
    MIN_DURATION_S,
    Elevation,
    ForecastRequest,
    Link,
    UpdateRequest,
    VehicleFigures,
    check_request,
    parse_json,
    parse_links,
    parse_observed,
    parse_samples,
    require_duration,
    with_elevation,
)
from tripwatt.server.http.settings import Limits


def faults_of(model: type[BaseModel], document: Any) -> tuple[Fault, ...]:
    with pytest.raises(InvalidInput) as caught:
        check_request(document, model)
    return caught.value.faults


def is_valid(model: type[BaseModel], document: dict[str, Any]) -> bool:
    try:
        check_request(document, model)
    except InvalidInput:
        return False
    return True


PLACE = {"latitude_deg": 47.0, "longitude_deg": 9.0}
PLAN: dict[str, Any] = {"stops": [PLACE, "Ostheim"]}
REACH: dict[str, Any] = {"start": PLACE}


@pytest.mark.parametrize("value", ["1500", True, float("inf")])
def test_numbers_are_numbers(value: Any) -> None:
    assert not is_valid(VehicleFigures, {"mass_kg": value})
    assert not is_valid(ForecastRequest, {"payload_mass_kg": value})
    assert not is_valid(Elevation, {"position_m": [0.0], "elevation_m": [value]})


def test_unknown_fields_are_faults() -> None:
    for model, others in (
        (VehicleFigures, {}),
        (UpdateRequest, {}),
        (Elevation, {}),
        (Link, {}),
        (PlanRequest, PLAN),
    ):
        assert "colour" in {fault.where for fault in faults_of(model, {**others, "colour": 1})}


def test_a_departure_is_a_text_with_a_time_zone() -> None:
    found = check_request(PLAN | {"departs_at": "2026-02-01T07:30:00+01:00"}, PlanRequest)
    assert found.departs_at is not None
    assert found.departs_at.isoformat() == "2026-02-01T07:30:00+01:00"
    for other in ("2026-02-01T07:30:00", "2026-02-01", 1769927400, "1769927400", "07:30"):
        assert not is_valid(PlanRequest, PLAN | {"departs_at": other}), other


def test_a_forecast_as_data_is_the_documented_answer() -> None:
    """Its document has every field that the schema requires and no other; the descriptions are those of the fields."""
    answer = TypeAdapter(ForecastResponse)
    plan = tw.read_route([{"length_m": 9000.0, "speed_m_s": 15.0}])
    found = tw.load_model().forecast(plan)
    document: Any = found.to_dict(0.1, leave_with(found, 0.1, 0.9))
    assert answer.validate_python(document) == document
    with pytest.raises(ValidationError, match="colour"):
        answer.validate_python({**document, "colour": 1})
    del document["series"]["time_s"]
    with pytest.raises(ValidationError, match=r"series.time_s"):
        answer.validate_python(document)
    described = answer.json_schema()["properties"]["by_cause_wh"]["description"]
    assert described == "energy by cause [Wh]; the sum is energy_wh"


def test_the_defaults_of_a_request() -> None:
    assert ForecastRequest().model_dump(exclude_none=True) == {"trip": "trip", "reserve": 0.1}
    assert VehicleFigures().model_dump(exclude_none=True) == {"procedure": "wltp"}
    assert Link(length_m=1.0).model_dump(exclude_none=True) == {"length_m": 1.0}
    usual = check_request({}, NeedQuery)
    assert (usual.trips, usual.probability, usual.plug_w) == (1, 0.95, 7400.0)
    assert (usual.kind, usual.reserve, usual.distance_km) == ("mixed", 0.1, None)
    plan = check_request(PLAN, PlanRequest).model_dump(exclude_none=True)
    assert plan.pop("stops") == [PLACE | {"name": "", "kind": ""}, "Ostheim"]
    assert [plan.pop(name) for name in ("avoid", "networks")] == [[], []]
    assert [plan.pop(name) for name in ("reserve", "alternatives", "stop_overhead_s")] == [0.1, 0, 300.0]
    assert plan.pop("pause_s") == 0.0
    assert plan == {"round_trip": False, "answers": True, "charge": True, "preheat_battery": False}
    for kind, more in ((ForecastRequest, {}), (ReachRequest, REACH)):
        assert check_request({**more, "reserve": None}, kind).reserve == 0.1


def properties_of(model: type[BaseModel]) -> dict[str, Any]:
    """The fields of a model in a document that has its links as well."""
    template = "#/components/schemas/{model}"
    models = [(model, "validation"), (Link, "validation")]
    _, found = models_json_schema(models, ref_template=template)  # type: ignore[arg-type]
    return dict(found["$defs"][model.__name__]["properties"])


def test_the_schema_of_samples_has_the_bounds_of_the_columns() -> None:
    schema = properties_of(ForecastRequest)["samples"]["anyOf"][0]
    assert schema["required"] == ["time_s", "speed_m_s"]
    assert schema["additionalProperties"] is False
    columns = schema["properties"]
    assert columns["time_s"]["items"] == {"type": "number", "minimum": 0.0}
    assert columns["speed_m_s"]["items"] == {"type": "number", "minimum": 0.0, "maximum": 90.0}
    assert columns["bms_soc"]["items"] == {"type": ["number", "null"], "minimum": 0.0, "maximum": 1.0}
    assert columns["time_s"]["minItems"] == 3
    assert columns["time_s"]["description"] == "time of the sample, increasing [s]"


def test_the_charge_of_the_battery_management_has_a_name_of_its_own() -> None:
    columns = {"time_s": [0.0, 1.0, 2.0], "speed_m_s": [0.0, 1.0, 0.0]}
    charges = [0.5, 0.5, 0.4]
    assert parse_samples({**columns, "bms_soc": charges}, Limits())["soc"].tolist() == charges
    refuses("did you mean 'bms_soc'", parse_samples, {**columns, "soc": charges}, Limits())


def test_what_is_no_json_is_said() -> None:
    assert parse_json(b'{"a": [1, null]}') == {"a": [1, None]}
    for body in (b"", b"NaN", b"1e999", b"{"):
        with pytest.raises(Problem) as caught:
            parse_json(body)
        assert caught.value.kind == "not-json"


def test_names_and_values_in_faults_are_cut_after_80_characters() -> None:
    (fault,) = faults_of(ForecastRequest, {"x" * 90: "y" * 90})
    assert fault.where == "x" * 80
    assert fault.got == "'" + "y" * 79
    (at_the_bound,) = faults_of(ForecastRequest, {"x" * 80: 1})
    assert at_the_bound.where == "x" * 80


def test_ten_unknown_fields_get_a_suggestion() -> None:
    document = {f"reserve{k}": 1 for k in range(12)}
    fixes = [fault.fix for fault in faults_of(ForecastRequest, document)]
    assert fixes == ["did you mean 'reserve'?"] * 10 + [""] * 2


SAMPLES = {"time_s": [5.0, 6.0, 7.0, 8.0], "speed_m_s": [0, 1.5, 2, 1]}


def sample_faults(value: Any, **limits: Any) -> tuple[Fault, ...]:
    with pytest.raises(InvalidInput) as caught:
        parse_samples(value, Limits(**limits))
    return caught.value.faults


def test_samples_become_a_table() -> None:
    found = parse_samples(SAMPLES | {"elevation_m": [1, None, 3, 4]}, Limits(samples=4, duration_s=3.0))
    assert found["speed_m_s"].tolist() == [0.0, 1.5, 2.0, 1.0]
    assert found["elevation_m"].isna().tolist() == [False, True, False, False]


def test_samples_have_at_most_their_limit() -> None:
    faults = sample_faults(SAMPLES, samples=3)
    assert faults == (
        Fault("too many samples", "samples.time_s", "4", "at most 3"),
        Fault("too many samples", "samples.speed_m_s", "4", "at most 3"),
    )


def test_the_first_value_that_is_no_number_is_named() -> None:
    (fault,) = sample_faults(SAMPLES | {"speed_m_s": [0, 1, True, "x"]})
    assert fault == Fault("not a number", "samples.speed_m_s[2]", "True", "a number, or null where unknown")


def test_what_is_no_list_is_named_with_at_most_80_characters() -> None:
    (fault,) = sample_faults({"x" * 100: 1})
    assert fault == Fault("not a list", "samples." + "x" * 72, "1", "a list of numbers")
    assert sample_faults([1]) == (Fault("not an object", "samples", "[1]", "an object of lists of numbers"),)


def test_the_duration_of_samples_is_that_between_first_and_last() -> None:
    assert len(parse_samples(SAMPLES, Limits(duration_s=3.0))) == 4
    (fault,) = sample_faults(SAMPLES, duration_s=2.9)
    assert fault == Fault("duration out of range", "samples", "3 s", "1 to 2.9 s")


def test_two_measurements_are_enough() -> None:
    observed = {"time_s": [0.0, 1.0], "bms_soc": [0.5, 0.5]}
    assert len(parse_observed(observed, Limits())) == 2
    with pytest.raises(InvalidInput):
        parse_observed({"time_s": [0.0], "bms_soc": [0.5]}, Limits())
    refuses(r"observed\.time_s", parse_observed, observed, Limits(samples=1))


def test_a_trip_takes_a_second_or_more_and_the_limit_or_less() -> None:
    limits = Limits(duration_s=3600.0)
    assert MIN_DURATION_S == 1.0
    require_duration(1.0, "links", limits)
    require_duration(3600.0, "links", limits)
    for duration_s, got in ((0.999, "0.999 s"), (3600.5, "3600.5 s"), (float("nan"), "nan s")):
        with pytest.raises(InvalidInput) as caught:
            require_duration(duration_s, "links", limits)
        assert caught.value.faults == (Fault("duration out of range", "links", got, "1 to 3600 s"),)


LINKS = [{"length_m": 100.0, "speed_m_s": 10.0}, {"length_m": 50.0, "speed_m_s": 10.0}]


def elevation_of(position_m: list[float], elevation_m: list[float]) -> Elevation:
    return Elevation(position_m=position_m, elevation_m=elevation_m)


def link_faults(given: Any, elevation: Elevation | None = None, **limits: Any) -> list[str]:
    bounds = Limits(**limits)
    with pytest.raises(InvalidInput) as caught:
        with_elevation(parse_links(given, bounds), elevation or elevation_of([0.0], [0.0]), bounds)
    return [f"{fault.what}: {fault.got}" for fault in caught.value.faults]


def test_links_are_a_list_within_its_limit_and_duration() -> None:
    assert len(parse_links(LINKS, Limits(links=2, duration_s=15.0))) == 2
    assert link_faults(LINKS, links=1) == ["too many links: 2"]
    assert link_faults(LINKS, duration_s=14.9) == ["duration out of range: 15 s"]
    assert link_faults("x") == ["not a list: 'x'"]


def test_an_elevation_takes_the_place_of_the_flat_road() -> None:
    flat = parse_links(LINKS, Limits())
    hilly = with_elevation(flat, elevation_of([0.0, 150.0], [10.0, 20.0]), Limits(samples=2))
    assert ([flag.code for flag in flat.flags], hilly.flags) == (["no_elevation"], ())
    assert hilly.elevation_m is not None
    assert hilly.elevation_position_m is not None
    assert (hilly.elevation_position_m.tolist(), hilly.elevation_m.tolist()) == ([0.0, 150.0], [10.0, 20.0])


def test_positions_may_stay_and_not_decrease() -> None:
    for sound in ([0.0, 5.0, 5.0, 150.0], [0.5, 5.0, 6.0, 150.0]):
        assert (
            with_elevation(parse_links(LINKS, Limits()), elevation_of(sound, [1.0] * 4), Limits()) is not None
        )
    assert link_faults(LINKS, elevation_of([0.0, 5.0, 4.5], [1.0] * 3)) == ["position decreases: "]
    assert link_faults(LINKS, elevation_of([-0.5, 5.0], [1.0] * 2)) == ["position decreases: "]


def test_positions_and_elevations_are_as_many_and_within_the_limit() -> None:
    unequal = "positions and elevations differ in number"
    found = link_faults(LINKS, elevation_of([0.0, 5.0], [1.0]))
    assert found == [f"{unequal}: 2 positions and 1 elevations"]
    found = link_faults(LINKS, elevation_of([0.0, 5.0, 9.0], [1.0] * 3), samples=2)
    assert found == [f"{unequal}: 3 positions and 3 elevations"]


@pytest.mark.parametrize("height", [{"grade": 0.0}, {"start_elevation_m": 1.0, "end_elevation_m": 1.0}])
def test_an_elevation_is_given_once(height: dict[str, float]) -> None:
    links = [{**LINKS[0], **height}, {**LINKS[1], **height}]
    found = link_faults(links, elevation_of([0.0, 150.0], [1.0, 2.0]))
    assert found == ["elevation given twice: links with elevations or grades"]
