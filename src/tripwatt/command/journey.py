"""Commands of journeys: plan a journey, show the area of reach, find places, build a map and show what it holds."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import tripwatt as tw
from tripwatt import trips
from tripwatt.command import shared
from tripwatt.command.options import Answer, argument, flag, make_group, option
from tripwatt.command.printing import kwh, print_notes, print_table, say
from tripwatt.command.sentences import chance, chance_to_arrive, journey_in_words
from tripwatt.errors import Check, percent
from tripwatt.trips.showing import period

if TYPE_CHECKING:
    from tripwatt.roads.journey import ChargingPlan, Reach
    from tripwatt.roads.maps.folder import MapFolder

COSTS: Final = {"climate": "Climate control", "wind": "Wind", "speed": "Speeds above 100 km/h on motorways"}
"""Key of `costs_wh` -> words for what costs energy on a journey."""

OTHER_ROADS: Final = 2
"""Number of other roads that a plan compares with the first."""


def plan(
    stops: Annotated[list[str], argument("FROM [VIA...] TO", "Places: names, or latitude and longitude.")],
    departure: shared.Departing,
    on_map: shared.OnMap,
    reserve: shared.Reserve = 0.1,
    round_trip: Annotated[bool, flag("--round-trip", "Return to the start.")] = False,
    pause: Annotated[float, option("S", "Time before the way back of a round trip.", "--pause")] = 0.0,
    vehicle: shared.Car = None,
    model: shared.Model = None,
    no_charge: Annotated[bool, flag("--no-charge", "Plan no stops to charge.")] = False,
    preheat_battery: Annotated[
        bool, flag("--preheat-battery", "The car heats its battery for a stop.")
    ] = False,
) -> Answer:
    """Plan a journey from place to place: charge at arrival, what to leave with, stops to charge where they are needed.

    Usual traffic is included. Nothing leaves this machine unless an option names the URL of a server.

    For example:

      # build a map once
      tripwatt map build liechtenstein.osm.pbf --out map
      # plan a journey
      tripwatt plan Vaduz Buchs --map map --soc 0.8 --depart 07:30 --reserve 0.1
      # there and back
      tripwatt plan Vaduz Malbun --map map --round-trip --ambient -5 --car vw_id3
      # with a router's server and coordinates
      tripwatt plan '47.14, 9.52' '47.37, 8.54' --map osrm=http://localhost:5000 --soc 0.9
    """
    from tripwatt.roads.journey import JourneyOptions, open_atlas

    named = {f"stops[{k}]": "VIA" for k in range(len(stops))} | {f"stops[{len(stops) - 1}]": "TO"}
    with shared.options_named(**named | {"stops[0]": "FROM", "stops": "FROM [VIA...] TO"}):
        with Check() as check:
            atlas, known = check(open_atlas, on_map.settings()), check(departure)
            model_and_car = check(shared.model_and_car, model, vehicle)
            options = check(
                JourneyOptions,
                reserve,
                OTHER_ROADS,
                round_trip,
                pause,
                charge=not no_charge,
                preheat_battery=preheat_battery,
            )
        journey = tw.plan_journey(stops, known, atlas=atlas, options=options, **model_and_car)
    return Answer(journey.to_dict, partial(_show, journey))


def reach(
    start: Annotated[str, argument("FROM", "A place: a name, or latitude and longitude.")],
    departure: shared.Departing,
    map_: shared.Map = "",
    reserve: shared.Reserve = 0.1,
    vehicle: shared.Car = None,
    model: shared.Model = None,
    places_url: shared.Places = "",
) -> Answer:
    """Show how far a charge carries in every direction, with a probability of 95 % and of 50 %.

    For example:

      # where a charge of 20 % carries
      tripwatt reach Vaduz --map map --soc 0.2
    """
    from tripwatt.roads.journey import AtlasSettings, RoadForecaster, find_reach, open_atlas

    with shared.options_named():
        atlas = open_atlas(AtlasSettings(map_, places_url))
        fitted = tw.for_car(**shared.model_and_car(model, vehicle))
        place = atlas.find(start, "FROM")
        area = find_reach(RoadForecaster(fitted, departure()), place, atlas, reserve=reserve)
    return Answer(area.to_dict, partial(_show_reach, area))


def _show_reach(area: Reach) -> None:
    rows = []
    for level, corners in area.outlines.items():
        away_km = [area.start.distance_m(corner) / 1000.0 for corner in corners]
        rows.append((f"{100.0 * level:.0f} %", f"{min(away_km):.0f} km", f"{max(away_km):.0f} km"))
    columns = ("probability", "nearest", "farthest")
    print_table(f"Reach from {area.start.title}", columns, rows, numbers=columns[1:])
    print_notes([*([trips.Flag("map_ends", "reach")] if area.map_ends else []), area.attribution])


def places(
    text: Annotated[list[str], argument("TEXT", "Start of a name, a street, a house.")],
    map_: shared.Map = "",
    places_url: shared.Places = "",
) -> Answer:
    """Find places by the start of their names, also with typing mistakes and by names in other languages.

    For example:

      # find places by the start of their names
      tripwatt places landstr --map map
    """
    from tripwatt.roads.maps.folder import ATTRIBUTION, open_map
    from tripwatt.roads.search import open_search

    folder = None if places_url else open_map(map_.partition("@")[0])
    search = open_search(places_url) if folder is None else folder.index
    matches = search.search(" ".join(text))

    def shown() -> None:
        rows = [
            (p.title, p.kind.replace("_", " "), p.also_called, f"{p.latitude_deg:.5f}, {p.longitude_deg:.5f}")
            for p in matches
        ]
        print_table("Places", ("place", "kind", "also called", "latitude, longitude"), rows)
        outside = [f"this map covers {folder.covers}"] if folder is not None and not matches else []
        print_notes([*outside, ATTRIBUTION])

    return Answer({"places": [place.to_dict() for place in matches], "attribution": ATTRIBUTION}, shown)


def _show(journey: tw.Journey) -> None:
    say(f"From {' to '.join(place.described for place in journey.stops)}.")
    say(*journey_in_words(journey), "")
    rows = [
        (
            way["labels"] or "road",
            f"{way['distance_m'] / 1000.0:.1f} km",
            period(way["duration_s"]),
            str(way["charges"]),
            kwh(way["energy_wh"]),
            f"{percent(way['soc_arrival'])} ({percent(way['soc_low'])[:-2]} to {percent(way['soc_high'])})",
            *_chances(plan),
        )
        for way, plan in zip(journey.to_frame().to_dict("records"), journey.ways, strict=True)
    ]
    rows = [row for k, row in enumerate(rows) if row[:-2] not in [before[:-2] for before in rows[:k]]]
    with_reserve = f"{100.0 * journey.reserve:g} % or more"
    columns = ("way", "length", "time", "stops", "energy", "arrival with", "arrives", with_reserve)
    print_table(f"Ways, given {journey.forecast.given}", columns, rows, numbers=columns[1:5])
    for name, wh in journey.costs_wh.items():
        if abs(wh) >= 1.0:
            say(f"{COSTS[name]}: {kwh(wh)}")
    print_notes([*journey.forecast.flags, *journey.flags, journey.attribution])


def _chances(plan: ChargingPlan) -> tuple[str, ...]:
    if plan.stops:
        return chance(plan.p_arrive), chance(plan.p_reserve)
    return tuple(chance_to_arrive(plan.legs[0].forecast, least) for least in (0.0, plan.reserve))


def build(
    extract: Annotated[Path, argument("REGION.osm.pbf", "An OpenStreetMap extract.")],
    out: shared.OutFolder = Path("map"),
    elevation: shared.Tiles = None,
) -> Answer:
    """Build a map of an OpenStreetMap extract: roads for Valhalla, an index of places, charging stations.

    The command requires the extra `tripwatt[routing]`. FOLDER is complete or not there; a map that it replaces stays until the new one is complete.

    For example:

      # roads, places and charging stations
      tripwatt map build liechtenstein.osm.pbf --out map
      # with elevation tiles (N47E009.hgt, N47E009.hgt.zip, GeoTIFF)
      tripwatt map build region.osm.pbf --elevation srtm --out map
    """
    from tripwatt.roads.maps.folder import build_map

    def progress(step: str) -> None:
        print_notes([f"building: {step}"])

    return _described(build_map(extract, out, elevation=elevation, progress=progress))


def info(folder: Annotated[Path, argument("FOLDER", "Folder of the map.")]) -> Answer:
    """Show what a map holds.

    For example:

      # what a map holds
      tripwatt map info map
    """
    from tripwatt.roads.maps.folder import open_map

    return _described(open_map(folder))


def _described(folder: MapFolder) -> Answer:
    from tripwatt.roads.maps.elevation import without_tiles

    about, terrain = folder.info, folder.info["terrain"]
    rows = [
        ("extract", str(about["extract"])),
        ("covers", folder.covers or "no place"),
        ("places", str(about["places"])),
        ("charging stations", str(about["stations"])),
        ("heights", f"{terrain['source']} ({terrain['tiles']})" if terrain["known"] else "unknown"),
    ]

    def shown() -> None:
        print_table("Map", ("map", ""), rows)
        print_notes(filter(None, (without_tiles(terrain["missing"]), str(about["attribution"]))))

    return Answer(about | {"covers": folder.covers}, shown)


MAP = make_group("Maps of a region on this machine.", (build, info))
