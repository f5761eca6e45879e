"""The index of places of a map: what is matched, and in which order."""

import sqlite3
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from tests.support.refusals import refuses
from tests.support.router_server import OBJECTS, SETTLEMENTS

from tripwatt.roads.maps.extract import Height, Named
from tripwatt.roads.maps.index import PlaceIndex, write_index
from tripwatt.roads.maps.near_words import mistakes, near_words
from tripwatt.roads.maps.stations import Plug, Station
from tripwatt.roads.search import find_place
from tripwatt.routes.places import Place


def written(path, objects, settlements=()):
    write_index(path / "i.sqlite", list(settlements), objects)
    return PlaceIndex(path / "i.sqlite")


def names(found):
    return [place.name for place in found]


def test_the_most_places_of_a_search(tmp_path):
    made = written(tmp_path, [Named("poi", f"Halt {k:03d}", 47.0, 9.0) for k in range(201)])
    assert names(made.search("halt")) == [f"Halt {k:03d}" for k in range(10)]
    assert len(made.search("halt", limit=49)) == 49
    assert len(made.search("halt", limit=50)) == 50
    assert len(made.search("halt", limit=99)) == 50
    assert made.search("halt", limit=0) == ()


def test_two_hundred_matches_are_compared(tmp_path):
    """The best match is the last in the index, behind all streets."""
    for streets, first in ((199, "Ring"), (200, "Ring 000")):
        objects = [Named("street", f"Ring {k:03d}", 47.0, 9.0) for k in range(streets)]
        made = written(tmp_path, [*objects, Named("poi", "Ring", 47.0, 9.0)])
        assert names(made.search("ring", limit=1)) == [first]


def test_ten_words_of_two_hundred_characters_are_searched(tmp_path):
    words = " ".join("abcdefghij")
    made = written(tmp_path, [Named("poi", words, 47.0, 9.0), Named("poi", "q" * 250, 47.0, 9.0)])
    assert names(made.search(f"{words} zz")) == [words]
    assert made.search("j i h g f e d c b zz") == ()
    assert names(made.search("q" * 200 + "z")) == ["q" * 250]
    assert made.search("q" * 199 + "z") == ()


def test_the_order_of_matches(tmp_path):
    """The whole name, what begins with the text, the kind, short names."""
    made = written(
        tmp_path,
        [
            Named("town", "Neu Ring", 47.0, 9.0),
            Named("poi", "Ring", 47.0, 9.0),
            Named("poi", "Ringlokal", 47.0, 9.0),
            Named("poi", "Ringbad", 47.0, 9.0),
            Named("street", "Ringstraße", 47.0, 9.0),
            Named("village", "Ober-Ring", 47.0, 9.0),
        ],
    )
    assert names(made.search("ring")) == [
        "Ring",
        "Ringstraße",
        "Ringbad",
        "Ringlokal",
        "Neu Ring",
        "Ober-Ring",
    ]


def test_the_settlement_of_an_object(tmp_path):
    """0.3 degrees of latitude away at most; a degree of longitude is half as long at 60 degrees."""
    towns = [Named("town", "Stadt", 60.0, 9.0), Named("hamlet", "Hof", 60.0, 9.4)]
    objects = [
        Named("poi", "Inside", 60.0, 9.59),
        Named("poi", "Outside", 60.0, 9.61),
        Named("poi", "Own", 60.0, 9.0, city="Vorort"),
        Named("poi", "Stadt", 60.0, 9.0),
        Named("house", "7", 60.0, 9.0, "Stadt"),
    ]
    made = written(tmp_path, objects, towns)
    found = [names(made.search(text)) for text in ("inside", "outside", "own")]
    assert found == [["Inside, Stadt"], ["Outside"], ["Own, Vorort"]]
    assert names(made.search("stadt"))[:2] == ["Stadt", "Stadt 7, Stadt"]
    only = written(tmp_path, objects[:1], towns[1:])
    assert names(only.search("inside")) == ["Inside, Hof"]


def test_a_settlement_is_near_up_to_a_bound(tmp_path):
    objects = [Named("poi", "On", 0.2967, 0.0), Named("poi", "Beyond", 0.2968, 0.0)]  # 33 km are 0.29678°
    made = written(tmp_path, objects, [Named("town", "Stadt", 0.0, 0.0)])
    assert names(made.search("on")) == ["On, Stadt"]
    assert names(made.search("beyond")) == ["Beyond"]


@pytest.mark.parametrize("longitude", [0.0, 170.0, -180.0])
def test_the_nearest_settlement_is_the_same_at_any_longitude(tmp_path, longitude):
    towns = [Named("town", "North", 60.15, longitude), Named("town", "East", 60.0, longitude + 0.35)]
    made = written(tmp_path, [Named("poi", "Hut", 60.0, longitude)], towns)
    assert names(made.search("hut")) == ["Hut, North"]


def test_an_index_is_read_by_several_threads(tmp_path):
    made = written(tmp_path, [Named("poi", "Halt", 47.0, 9.0)])
    with ThreadPoolExecutor(1) as other:
        assert names(other.submit(made.search, "halt").result()) == ["Halt"]


def test_settlements_without_a_limit_of_their_kind(tmp_path):
    kinds = ("city", "town", "village", "suburb", "quarter", "hamlet", "neighbourhood", "isolated_dwelling")
    objects = [Named(kind, kind, 47.0, 9.0) for kind in (*reversed(kinds), "street", "poi")]
    found = written(tmp_path, objects).settlements(46.0, 8.0, 48.0, 10.0, 99)
    assert tuple(place.name for place in found) == kinds


@pytest.fixture(scope="module")
def index(tmp_path_factory):
    path = tmp_path_factory.mktemp("index") / "places.sqlite"
    written_down = write_index(path, SETTLEMENTS, OBJECTS)
    assert (written_down["places"], written_down["stations"]) == (5, 1)
    return PlaceIndex(path)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("west", ["Westend", "Westend Arena, Westend", "Hauptstraße, Westend", "Hauptstraße 12a, Westend"]),
        (
            "Westend",
            ["Westend", "Westend Arena, Westend", "Hauptstraße, Westend", "Hauptstraße 12a, Westend"],
        ),
        ("haupt 12 west", ["Hauptstraße 12a, Westend"]),
        ("HAUPTSTRASSE", ["Hauptstraße, Westend", "Hauptstraße 12a, Westend"]),
        ("hauptstraße", ["Hauptstraße, Westend", "Hauptstraße 12a, Westend"]),
        ("ost", ["Ostheim"]),
        ("heim", []),
        ("", []),
        ("' OR 1=1 --", []),
        ('"*(', []),
        ("NEAR(west", []),
    ],
)
def test_places_are_found_by_the_start_of_their_words(index, text, names):
    assert [place.name for place in index.search(text)] == names


def test_a_place_has_its_kind_and_its_coordinates(index):
    assert index.search("ostheim") == (Place(47.0, 9.1, "Ostheim", "village"),)
    assert len(index.search("west", limit=2)) == 2


def test_the_stations_are_as_they_were_written(index):
    assert index.stations() == (OBJECTS[-1],)


def test_settlements_inside_of_bounds_the_largest_first(index):
    names = lambda *bounds, limit=9: [place.name for place in index.settlements(*bounds, limit)]  # noqa: E731
    assert names(46.0, 8.0, 48.0, 10.0) == ["Westend", "Ostheim"]  # no street, house or arena
    assert names(46.0, 8.0, 48.0, 10.0, limit=1) == ["Westend"]
    assert names(47.0, 9.1, 47.0, 9.1) == ["Ostheim"]  # bounds belong to it
    assert names(46.0, 9.01, 48.0, 9.09) == []
    assert names(47.01, 8.0, 48.0, 10.0) == names(46.0, 8.0, 46.99, 10.0) == []
    (town,) = index.settlements(47.0, 9.0, 47.0, 9.0, 9)
    assert town == Place(47.0, 9.0, "Westend", "town")


def test_an_index_without_streets_has_all_its_settlements(tmp_path):
    write_index(tmp_path / "i.sqlite", SETTLEMENTS, SETTLEMENTS)
    found = PlaceIndex(tmp_path / "i.sqlite").settlements(-90.0, -180.0, 90.0, 180.0, 9)
    assert [place.kind for place in found] == ["town", "village"]


def test_pieces_of_a_street_in_one_settlement_are_one_place(tmp_path):
    path = tmp_path / "i.sqlite"
    pieces = [Named("street", "Ring", 47.0 + k / 1000.0, 9.0) for k in range(3)]
    far = Named("street", "Ring", 47.0, 9.1)
    bounds_deg = [47.0, 9.0, 47.001, 9.1]
    assert write_index(path, SETTLEMENTS, [*pieces, far]) == {
        "places": 2,
        "stations": 0,
        "bounds_deg": bounds_deg,
    }
    found = PlaceIndex(path).search("ring")
    assert {(place.name, round(place.latitude_deg, 6)) for place in found} == {
        ("Ring, Westend", 47.001),
        ("Ring, Ostheim", 47.0),
    }


def test_far_from_any_settlement_a_place_has_its_name_alone(tmp_path):
    path = tmp_path / "i.sqlite"
    write_index(path, SETTLEMENTS, [Named("poi", "Hut", 47.5, 9.0), Named("poi", "Inn", 47.29, 9.0)])
    assert [place.name for place in PlaceIndex(path).search("hut")] == ["Hut"]
    assert [place.name for place in PlaceIndex(path).search("inn")] == ["Inn, Westend"]
    write_index(path, [], [Named("poi", "Hut", 47.5, 9.0)])
    assert [place.name for place in PlaceIndex(path).search("hut")] == ["Hut"]


def test_what_is_no_index_is_refused(tmp_path):
    (tmp_path / "i.sqlite").write_bytes(b"no database")
    refuses("no index of places", PlaceIndex, tmp_path / "i.sqlite")
    refuses("no index of places", PlaceIndex, tmp_path / "missing.sqlite")


def test_the_index_is_read_only(index):
    with pytest.raises(sqlite3.OperationalError, match="readonly"):
        index.database.execute("DELETE FROM places")


@pytest.mark.parametrize("text", ["Westendd", "Wetsend", "Vestend", "westnd"])
def test_a_misspelt_settlement_is_found_as_the_most_similar_one(index, text):
    assert [place.name for place in index.search(text, limit=1)] == ["Westend"]
    refuses(r"did you mean 'Westend' \(\w+\)", find_place, text, index, "from")


HELSINKI = [
    Named("city", "Helsinki", 60.17, 24.94, also=("Helsingfors",), population=600_000),
    Named("street", "Aleksanterinkatu", 60.169, 24.95, also=("Alexandersgatan",)),
    Named("house", "5", 60.169, 24.951, "Aleksanterinkatu"),
    Named("town", "Mäntsälä", 60.63, 25.32),
    Named("town", "Łódź", 60.9, 25.0),
]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("alexandersgatan", Place(60.169, 24.95, "Alexandersgatan, Helsinki", "street", "Aleksanterinkatu")),
        ("Alexandersgtan", Place(60.169, 24.95, "Alexandersgatan, Helsinki", "street", "Aleksanterinkatu")),
        ("alexand 5", Place(60.169, 24.951, "Alexandersgatan 5, Helsinki", "house", "Aleksanterinkatu 5")),
        ("Aleksanterin", Place(60.169, 24.95, "Aleksanterinkatu, Helsinki", "street")),
        ("helsingfors", Place(60.17, 24.94, "Helsingfors", "city", "Helsinki")),
        ("Hels", Place(60.17, 24.94, "Helsinki", "city")),
        ("Heslinki", Place(60.17, 24.94, "Helsinki", "city")),
        ("Aleksanterinkatu Heslinki", Place(60.169, 24.95, "Aleksanterinkatu, Helsinki", "street")),
        ("mantsala", Place(60.63, 25.32, "Mäntsälä", "town")),
        ("maentsaelae", Place(60.63, 25.32, "Mäntsälä", "town")),
        ("Mantsla", Place(60.63, 25.32, "Mäntsälä", "town")),
        ("lodz", Place(60.9, 25.0, "Łódź", "town")),
    ],
)
def test_another_language_accents_and_typing_mistakes(tmp_path, text, found):
    assert written(tmp_path, HELSINKI, HELSINKI[:1]).search(text)[0] == found


def test_a_place_is_taken_by_its_name_in_another_language(tmp_path):
    made = written(tmp_path, HELSINKI, HELSINKI[:1])
    assert find_place("Helsingfors", made, "x").described == "Helsingfors (city, also called Helsinki)"


def test_a_mistyped_settlement_is_shown_among_many_names_that_begin_so(tmp_path):
    towns = [Named("village", "Schaan", 47.16, 9.51)]
    streets = [Named("street", f"Schanzenweg {k:02d}", 47.0, 9.0) for k in range(30)]
    found = names(written(tmp_path, [*streets, *towns]).search("schan", limit=5))
    assert found == [*(f"Schanzenweg {k:02d}" for k in range(3)), "Schaan", "Schanzenweg 03"]


def test_a_place_as_node_as_area_and_as_halt_is_one(tmp_path):
    kinds = ("village", "suburb", "poi")
    objects = [Named(kind, "Vaduz", 47.14 + k / 100.0, 9.52) for k, kind in enumerate(kinds)]
    assert written(tmp_path, objects, objects[:1]).search("vaduz") == (
        Place(47.14, 9.52, "Vaduz", "village"),
    )


def test_settlements_of_one_name_are_told_apart_by_the_town_beside_them(tmp_path):
    towns = [Named("town", "Westend", 47.0, 9.0), Named("town", "Ostheim", 47.0, 11.0)]
    twins = [Named("village", "Neukirch", 47.0, 9.1), Named("village", "Neukirch", 47.0, 10.9)]
    made = written(tmp_path, [*towns, *twins], [*towns, *twins])
    assert sorted(names(made.search("neukirch"))) == ["Neukirch, Ostheim", "Neukirch, Westend"]
    refuses(r"several places have this name.*Ostheim.*Westend", find_place, "Neukirch", made, "x")
    assert find_place("Neukirch Ostheim", made, "x").longitude_deg == 10.9
    assert names(written(tmp_path, [*towns, twins[0]], [*towns, twins[0]]).search("neukirch")) == ["Neukirch"]


def test_streets_of_one_name_in_one_city_are_told_apart_by_quarters(tmp_path):
    around = [Named("city", "Bigtown", 47.0, 9.0), Named("suburb", "North", 47.1, 9.0)]
    streets = [Named("street", "Ring", 47.0, 9.0), Named("street", "Ring", 47.1, 9.0)]
    found = written(tmp_path, [*around, *streets], around).search("ring")
    assert {(place.name, place.context) for place in found} == {
        ("Ring, Bigtown", "Bigtown"),
        ("Ring, North, Bigtown", "North, Bigtown"),
    }


def test_large_settlements_come_before_small_ones_of_their_kind(tmp_path):
    towns = [
        Named("town", "Halla", 47.0, 9.0, population=5_000),
        Named("town", "Hallberg", 47.0, 9.5, population=50_000),
    ]
    assert names(written(tmp_path, towns).settlements(-90, -180, 90, 180, 9)) == ["Hallberg", "Halla"]


def test_every_word_with_one_mistake_is_near(tmp_path):
    """Random words; one letter added, left out, changed, or two swapped."""
    rng = np.random.default_rng(5)
    letters = list("abcdefghijklmnopqrstuvwxyz")
    words = ["".join(rng.choice(letters, rng.integers(6, 12))) for _ in range(60)]
    made = written(tmp_path, [Named("village", word, 47.0, 9.0) for word in words])
    for word in words:
        at, letter = int(rng.integers(0, len(word) - 1)), str(rng.choice(letters))
        swapped = word[:at] + word[at + 1] + word[at] + word[at + 2 :]
        for typed in (
            word[:at] + letter + word[at:],
            word[:at] + word[at + 1 :],
            word[:at] + letter + word[at + 1 :],
            swapped,
        ):
            assert word in names(made.search(typed)), (typed, word)
            assert mistakes(typed, word)[1] <= 1


def test_the_work_for_a_word_is_bounded_by_the_index(tmp_path):
    made = written(tmp_path, [Named("village", f"neukirch{k:04d}x", 47.0, 9.0) for k in range(3000)])
    asked: list[str] = []
    made.database.set_trace_callback(asked.append)
    assert len(near_words(made.database, "neukrch")) == 5
    assert len(asked) == 6  # one question for each key, with a limit


def test_the_heights_of_places_show_the_terrain_around_a_journey(tmp_path):
    """Two regions: a plain, in which one height is wrong, and a valley between mountains; elsewhere nothing is known."""
    steps = np.linspace(0.0, 0.1, 30)
    plain = [Height(47.0 + at, 9.0, 400.0 + 90.0 * at) for at in steps]
    valley = [Height(47.0 + at, 12.0, 400.0 + 9000.0 * at) for at in steps]
    made = written(tmp_path, [*plain, replace(plain[3], height_m=1400.0), *valley])
    around = [made.heights_around([Place(47.0, at), Place(47.1, at)]) for at in (9.0, 12.0, 15.0)]
    assert [heights and heights.terrain for heights in around] == ["flat", "mountains", None]


def test_bus_stops_with_the_height_of_their_municipality_do_not_count(tmp_path):
    """953 m is that of a municipality at stops of three villages; two stops of one village share their height rightly."""
    town = [Height(47.1 + at, 9.54, 953.0, at_stop=True) for at in (0.0, 0.01, 0.03)]
    village = [Height(47.2 + at, 9.5, 433.0, at_stop=True) for at in (0.0, 0.002)]
    elsewhere, place = Height(48.2, 9.5, 433.0, at_stop=True), Height(47.11, 9.54, 953.0)
    made = written(tmp_path, [*town, *village, elsewhere, place])
    rows = made.database.execute("SELECT latitude, height FROM heights ORDER BY latitude").fetchall()
    assert rows == [(47.11, 953.0), (47.2, 433.0), (47.2 + 0.002, 433.0), (48.2, 433.0)]


def test_an_index_without_plugs_is_a_fault_with_a_fix(tmp_path):
    station = Station.with_plugs(47.0, 9.0, "A", Plug("type2", 11e3, power_known=False), Plug("chademo", 5e4))
    station = replace(station, networks=("Netz; Nord", "Strom"))
    made = written(tmp_path, [station])
    assert made.stations() == (station,)
    with closing(sqlite3.connect(made.path)) as database, database:
        database.execute("ALTER TABLE stations DROP COLUMN plugs")
    refuses("tripwatt map build", PlaceIndex(made.path).stations)
