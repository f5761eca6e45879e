"""Places by name, of servers and of what a person types."""

from functools import partial

import httpx
import pytest
from tests.support.roads import client, mutated

from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.roads.search import ServerSearch, find_place, open_search
from tripwatt.routes.places import Place

PhotonSearch, NominatimSearch = (partial(ServerSearch, kind=kind) for kind in ("photon", "nominatim"))


PHOTON = {
    "features": [
        {
            "geometry": {"coordinates": [9.5209, 47.141], "type": "Point"},
            "properties": {"name": "Vaduz", "country": "Liechtenstein", "osm_value": "town"},
        },
        {
            "geometry": {"coordinates": [9.53, 47.15], "type": "Point"},
            "properties": {
                "street": "Landstrasse",
                "housenumber": "12",
                "city": "Vaduz",
                "osm_value": "house",
            },
        },
    ]
}


NOMINATIM = [
    {"lat": "47.141", "lon": "9.5209", "display_name": "Vaduz, Liechtenstein", "addresstype": "town"}
]


def test_places_of_photon():
    seen = []
    search = PhotonSearch(client(lambda r: seen.append(r) or httpx.Response(200, json=PHOTON)))
    assert search.search("Vad", limit=2) == (
        Place(47.141, 9.5209, "Vaduz, Liechtenstein", "town"),
        Place(47.15, 9.53, "Landstrasse 12, Vaduz", "house"),
    )
    assert str(seen[0].url) == "http://router.test/base/api?q=Vad&limit=2"
    assert len(search.search("a" * 500, limit=1)) == 1
    assert seen[1].url.params["q"] == "a" * 200


def test_places_of_nominatim():
    seen = []
    search = NominatimSearch(client(lambda r: seen.append(r) or httpx.Response(200, json=NOMINATIM)))
    assert search.search("Vaduz") == (Place(47.141, 9.5209, "Vaduz, Liechtenstein", "town"),)
    assert seen[0].url.params["format"] == "jsonv2"
    assert seen[0].url.params["q"] == "Vaduz"


@pytest.mark.parametrize(("kind", "document"), [(PhotonSearch, PHOTON), (NominatimSearch, NOMINATIM)])
def test_a_mutated_answer_is_places_or_one_clear_error(kind, document):
    outcomes = set()
    for answer in mutated(document, 150, seed=3):
        try:
            outcomes.add(all(isinstance(place, Place) for place in kind(client(answer)).search("x")))
        except RemoteError as error:
            outcomes.add(str(error)[:0])
    assert outcomes == {True, ""}


@pytest.mark.parametrize(
    ("text", "search", "message"),
    [
        ("Vaduz", None, r"names of places are not known: stops\[0\]: got Vaduz"),
        ("  ", None, r"no place: stops\[0\]: got an empty text"),
        ("Nowhere", PhotonSearch(client({"features": []})), r"unknown place: stops\[0\]: got Nowhere"),
    ],
)
def test_an_unknown_place_is_named(text, search, message):
    with pytest.raises(InvalidInput, match=message):
        find_place(text, search, "stops[0]")


def test_a_search_is_named_by_kind_and_url():
    assert open_search("nominatim=https://h").kind == "nominatim"
    assert open_search("https://h").kind == "photon"
    with pytest.raises(InvalidInput, match="unknown kind of server: --places"):
        open_search("x=https://h")
    with pytest.raises(InvalidInput, match="unknown kind of server") as caught:
        open_search("k" * 50 + "=https://h")
    assert caught.value.faults[0].got == "k" * 40
    assert find_place("47.1, 9.5", None, "stops[0]") == Place(47.1, 9.5)


def photon(*properties):
    return {
        "features": [
            {"geometry": {"coordinates": [9.5 + k / 100.0, 47.0, 500.0]}, "properties": about}
            for k, about in enumerate(properties)
        ]
    }


def first(document, kind=PhotonSearch):
    return kind(client(document)).search("x")[0]


@pytest.mark.parametrize("kind", [PhotonSearch, NominatimSearch])
def test_ten_places_are_asked_for_and_fifty_are_the_most(kind):
    many = photon(*[{"name": f"P{k}"} for k in range(60)])
    if kind is NominatimSearch:
        many = [{"lat": "47", "lon": "9", "display_name": f"P{k}"} for k in range(60)]
    seen = []
    search = kind(client(lambda r: seen.append(r) or httpx.Response(200, json=many)))
    assert [place.name for place in search.search("x")] == [f"P{k}" for k in range(10)]
    assert seen[0].url.params["limit"] == "10"
    assert [len(search.search("x", limit=limit)) for limit in (1, 49, 50, 51)] == [1, 49, 50, 50]


def test_the_name_of_a_place_of_photon():
    street = {"street": "Ring", "housenumber": "7", "city": "Vaduz", "country": "Liechtenstein"}
    assert first(photon(street)).name == "Ring 7, Vaduz, Liechtenstein"
    assert first(photon({**street, "name": "Vaduz"})).name == "Vaduz, Liechtenstein"
    assert first(photon({"street": "Ring"})) == Place(47.0, 9.5, "Ring")
    assert first(photon({"name": "n" * 250, "osm_value": "v" * 50})) == Place(47.0, 9.5, "n" * 200, "v" * 40)
    with pytest.raises(RemoteError, match="too few entries"):
        first({"features": [{"geometry": {"coordinates": [9.5]}, "properties": {}}]})


def test_the_name_of_a_place_of_nominatim():
    at = {"lat": "47", "lon": "9.5"}
    long = {**at, "display_name": "n" * 250, "addresstype": "v" * 50, "type": "x"}
    assert first([long], NominatimSearch) == Place(47.0, 9.5, "n" * 200, "v" * 40)
    assert first([{**at, "type": "town"}], NominatimSearch) == Place(47.0, 9.5, "", "town")
    for wrong in ("x" * 50, None, "nan"):
        with pytest.raises(RemoteError, match="not a number: ") as caught:
            first([{**at, "lat": wrong}], NominatimSearch)
        assert len(caught.value.faults[0].got) <= 40
    with pytest.raises(RemoteError, match=r"\[0\], lat") as caught:
        first([{**at, "lat": "x" * 50}], NominatimSearch)
    assert caught.value.faults[0].got == "'" + "x" * 39


def test_ten_places_are_asked_for_a_name_and_long_names_are_cut_in_messages():
    seen = []
    search = PhotonSearch(client(lambda r: seen.append(r) or httpx.Response(200, json=photon())))
    with pytest.raises(InvalidInput, match="unknown place") as caught:
        find_place("z" * 99, search, "x")
    assert seen[0].url.params["limit"] == "10"
    assert caught.value.faults[0].got == "z" * 60
    with pytest.raises(InvalidInput, match="names of places are not known") as caught:
        find_place("z" * 99, None, "x")
    assert caught.value.faults[0].got == "z" * 60


@pytest.mark.parametrize(
    ("text", "name", "called"),
    [
        ("Vaduz", "Vaduz", True),
        ("  vaduz ", "Vaduz, Liechtenstein", True),
        ("Vaduz Liechtenstein", "Vaduz, Liechtenstein", True),
        ("Liechtenstein", "Vaduz, Liechtenstein", False),
        ("Vad", "Vaduz", False),
        ("Feldkirch", "Feldkircherstrasse, Nendeln", False),
        ("Vaduz", "Vaduz VP Bank, Vaduz", False),
        ("Vaduz Landstrasse 12", "Landstrasse 12, Vaduz", True),
        ("Landstrasse 1", "Landstrasse 12, Vaduz", False),
        ("Landstrasse 12", "12, Landstrasse, Vaduz, Liechtenstein", True),
        ("hauptstrasse", "Hauptstraße, Gänsdorf", True),
        ("Hauptstraße Gaensdorf", "Hauptstraße, Gänsdorf", True),
        ("Hauptstraße Gansdorf", "Hauptstraße, Gänsdorf", True),
        ("Zurich", "Zürich", True),
        ("Zuerich", "Zürich", True),
        ("", "", False),
        ("-", "Vaduz", False),
    ],
)
def test_a_whole_name(text: str, name: str, called: bool) -> None:
    assert Place(47.0, 9.0, name).is_called(text) is called


class Known:
    """A search that gives the same places for every text."""

    def __init__(self, *places):
        self.places = places

    def search(self, text, *, limit=10):
        return self.places[:limit]


STREET = Place(47.2, 9.55, "Feldkircherstrasse, Nendeln", "street")


BALZERS, SCHAAN = (
    Place(47.07, 9.51, "Landstrasse, Balzers", "street"),
    Place(47.16, 9.51, "Landstrasse, Schaan", "street"),
)


def test_a_part_of_a_name_is_asked_back_with_kinds_and_the_region() -> None:
    with pytest.raises(InvalidInput, match="unknown place: stops") as caught:
        find_place("Feldkirch", Known(STREET), "stops[1]", "this map covers Liechtenstein")
    assert caught.value.faults[0].fix == (
        "did you mean 'Feldkircherstrasse, Nendeln' (street)?; this map covers Liechtenstein"
    )


def test_a_name_of_several_places_is_asked_back() -> None:
    search = Known(BALZERS, SCHAAN)
    with pytest.raises(InvalidInput, match=r"several places have this name.*Balzers' \(street\) or .*Schaan"):
        find_place("Landstrasse", search, "x")
    assert find_place("Landstrasse Schaan", search, "x") == SCHAAN


def test_a_whole_name_is_taken_after_others_and_before_other_kinds() -> None:
    village, office = Place(47.1, 9.5, "Vaduz", "village"), Place(47.2, 9.6, "Vaduz", "poi")
    assert find_place("Vaduz", Known(STREET, village, office), "x") == village
