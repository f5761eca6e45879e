"""Places by name, of Photon and Nominatim; the answers follow their public formats."""

import httpx
import pytest
from tests.support.roads import client, mutated

from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.routes.places import Place
from tripwatt.routes.search import NominatimSearch, PhotonSearch, find_place, open_search

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
    assert len(search.search("Vad", limit=1)) == 1


def test_places_of_nominatim():
    seen = []
    search = NominatimSearch(client(lambda r: seen.append(r) or httpx.Response(200, json=NOMINATIM)))
    assert search.search("Vaduz") == (Place(47.141, 9.5209, "Vaduz, Liechtenstein", "town"),)
    assert seen[0].url.params["format"] == "jsonv2"
    assert seen[0].url.params["q"] == "Vaduz"


def test_a_long_text_is_cut():
    seen = []
    PhotonSearch(client(lambda r: seen.append(r) or httpx.Response(200, json=PHOTON))).search("a" * 500)
    assert seen[0].url.params["q"] == "a" * 200


@pytest.mark.parametrize(("kind", "document"), [(PhotonSearch, PHOTON), (NominatimSearch, NOMINATIM)])
def test_a_mutated_answer_is_places_or_one_clear_error(kind, document):
    outcomes = set()
    for answer in mutated(document, 150, seed=3):
        try:
            outcomes.add(all(isinstance(place, Place) for place in kind(client(answer)).search("x")))
        except RemoteError as error:
            outcomes.add(str(error)[:0])
    assert outcomes == {True, ""}


def test_coordinates_need_no_search():
    assert find_place("47.1, 9.5", None, "stops[0]") == Place(47.1, 9.5)


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


def test_the_best_match_is_taken():
    assert find_place("Vaduz", PhotonSearch(client(PHOTON)), "x").name == "Vaduz, Liechtenstein"


def test_a_search_is_named_by_kind_and_url():
    assert isinstance(open_search("nominatim=https://h"), NominatimSearch)
    assert isinstance(open_search("https://h"), PhotonSearch)
    with pytest.raises(InvalidInput, match="unknown kind of server: --places"):
        open_search("x=https://h")
