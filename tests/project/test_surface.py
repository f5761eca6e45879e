"""The list of what users can name."""

from tests.support import ROOT
from tools.quality import surface


def test_commands_routes_and_names_are_listed_with_options_and_fields() -> None:
    lines = surface.of_checkout(ROOT)
    for line in (
        "command tripwatt plan",
        "option tripwatt forecast --soc",
        "argument tripwatt fit data",
        "route POST /v1/forecast",
        "request POST /v1/forecast soc",
        "response POST /v1/forecast energy_wh",
        "parameter GET /v1/places q",
        "door load_model",
    ):
        assert line in lines, line


def test_fields_of_alternatives_are_found() -> None:
    one = {"properties": {"a": {}, "b": {}}}
    document = {"components": {"schemas": {"One": one}}}
    schema = {"anyOf": [{"$ref": "#/components/schemas/One"}, {"properties": {"c": {}}}]}
    assert surface.fields(schema, document) == {"a", "b", "c"}
