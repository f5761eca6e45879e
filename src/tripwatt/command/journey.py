"""Commands of journeys: plan one, show the area of reach, find places."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from tripwatt.command.departing import Departing
from tripwatt.command.options import Answer, argument, option, options_named
from tripwatt.command.printing import print_notes, print_table
from tripwatt.command.sentences import chance, chance_to_arrive, journey_in_words
from tripwatt.errors import Check
from tripwatt.trips.showing import period

if TYPE_CHECKING:
    from tripwatt.roads.journey import AtlasSettings, Journey, Reach

COSTS: Final = {"climate": "Climate control", "wind": "Wind", "speed": "Speeds above 100 km/h on motorways"}
"""What a journey would take less energy without."""

OTHER_ROADS: Final = 2
"""Roads that a plan compares with the first one."""

MapOption = Annotated[
    str,
    option(
        "FOLDER|KIND=URL",
        "Folder of a map (see `tripwatt map build`), or a router's server: valhalla=URL, osrm=URL, graphhopper=URL or "
        "openrouteservice=URL. FOLDER@KIND=URL takes the places of a map and the roads of a server. Default: TRIPWATT_MAP.",
        "--map",
        envvar="TRIPWATT_MAP",
        show_envvar=False,
    ),
]
PlacesOption = Annotated[
    str,
    option(
        "KIND=URL",
        "Server that finds places: photon=URL or nominatim=URL. Default: the index of the map.",
        "--places",
    ),
]
WeatherOption = Annotated[
    str, option("URL", "Server with the interface of Open-Meteo. Default: no server is asked.", "--weather")
]
StationsOption = Annotated[
    Path | None,
    option(
        "FILE",
        "Charging stations as CSV: latitude_deg, longitude_deg, power_kw, name. Default: those of the map.",
        "--stations",
    ),
]


@dataclass(frozen=True)
class OnMap:
    """The map of a command, and the servers that it may ask."""

    map_: MapOption = ""
    places: PlacesOption = ""
    weather: WeatherOption = ""
    stations: StationsOption = None

    def settings(self) -> AtlasSettings:
        """Settings of an atlas."""
        from tripwatt.roads.journey import AtlasSettings

        stations = "" if self.stations is None else str(self.stations)
        return AtlasSettings(self.map_, self.places, self.weather, stations)


ModelOption = Annotated[
    Path | None, option("FOLDER", "Folder of a model. Default: the bundled model.", "--model")
]
CarOption = Annotated[
    str | None,
    option(
        "NAME|FILE",
        "Another car: a name from `tripwatt vehicles`, or a TOML file. Without its own trips the interval is wider.",
        "--vehicle",
    ),
]


def plan(
    stops: Annotated[list[str], argument("FROM [VIA...] TO", "Places: names, or latitude and longitude.")],
    departure: Departing,
    on_map: OnMap,
    reserve: Annotated[float, option("0..1", "Required state of charge at arrival, as displayed.")] = 0.1,
    round_trip: Annotated[bool, typer.Option("--round-trip", help="Back to the start.")] = False,
    vehicle: CarOption = None,
    model: ModelOption = None,
    no_charge: Annotated[bool, typer.Option("--no-charge", help="Plan no stops to charge.")] = False,
    preheat_battery: Annotated[
        bool, typer.Option("--preheat-battery", help="The car can heat its battery on the way to a stop.")
    ] = False,
) -> Answer:
    """Plan a journey from place to place: charge at arrival, what to leave with, stops to charge where they are needed.

    Nothing leaves this machine unless an option names the URL of a server. Travel times are those of an empty road.

    For example:

      # build a map once
      tripwatt map build liechtenstein.osm.pbf --out map
      # plan a journey
      tripwatt plan Vaduz Buchs --map map --soc 0.8 --depart 07:30 --reserve 0.1
      # there and back
      tripwatt plan Vaduz Malbun --map map --round-trip --ambient -5 --vehicle vw_id3
      # with a router's server and coordinates
      tripwatt plan '47.14, 9.52' '47.37, 8.54' --map osrm=http://localhost:5000 --soc 0.9
    """
    from tripwatt.roads.journey import JourneyOptions, open_atlas, plan_journey

    charging: dict[str, Any] = {"charge": not no_charge, "preheat_battery": preheat_battery}
    with options_named():
        with Check() as check:
            got: dict[str, Any] = {
                "atlas": check(open_atlas, on_map.settings()),
                "departure": check(departure),
            }
            got["options"] = check(JourneyOptions, reserve, OTHER_ROADS, round_trip, **charging)
        journey = plan_journey(stops, model=model, vehicle=vehicle, **got)
    return Answer(journey.to_dict, partial(_show, journey))


def reach(
    start: Annotated[str, argument("FROM", "A place: a name, or latitude and longitude.")],
    departure: Departing,
    map_: MapOption = "",
    reserve: Annotated[float, option("0..1", "State of charge to keep.", min=0.0, max=1.0)] = 0.0,
    vehicle: CarOption = None,
    model: ModelOption = None,
    places_url: PlacesOption = "",
) -> Answer:
    """Show how far a charge carries in every direction, with a probability of 95 % and of 50 %.

    For example:

      # where a charge of 20 % carries
      tripwatt reach Vaduz --map map --soc 0.2
    """
    from tripwatt.population import for_car
    from tripwatt.roads.journey import AtlasSettings, RoadForecaster, find_reach, open_atlas

    with options_named():
        atlas = open_atlas(AtlasSettings(map_, places_url))
        own = for_car(model, vehicle)
        place = atlas.find(start, "FROM")
        area = find_reach(RoadForecaster(own, departure()), place, atlas, reserve=reserve)
    return Answer(area.to_dict, partial(_show_reach, area))


def _show_reach(area: Reach) -> None:
    from tripwatt.trips import Flag

    rows = []
    for level, corners in area.outlines.items():
        away_m = [area.start.distance_m(corner) for corner in corners]
        ends = (f"{distance_m / 1000.0:.0f} km" for distance_m in (min(away_m), max(away_m)))
        rows.append((f"{100.0 * level:.0f} %", *ends))
    columns = ("probability", "nearest", "farthest")
    print_table(f"Reach from {area.start.title}", columns, rows, numbers=columns[1:])
    print_notes([*([Flag("map_ends", "reach")] if area.map_ends else []), area.attribution])


def places(
    text: Annotated[list[str], argument("TEXT", "Start of a name, a street, a house.")],
    map_: MapOption = "",
    places_url: PlacesOption = "",
    limit: Annotated[int, option("N", "Most places.", min=1, max=50)] = 10,
) -> Answer:
    """Find places by the start of their names, also with typing mistakes and by names in other languages.

    For example:

      # find places by the start of their names
      tripwatt places landstr --map map
    """
    from tripwatt.roads.maps import ATTRIBUTION, open_map
    from tripwatt.roads.search import open_search

    folder = None if places_url else open_map(map_.partition("@")[0])
    search = open_search(places_url) if folder is None else folder.index
    matches = search.search(" ".join(text), limit=limit)

    def shown() -> None:
        rows = [
            (p.title, p.kind.replace("_", " "), p.also_called, f"{p.latitude_deg:.5f}, {p.longitude_deg:.5f}")
            for p in matches
        ]
        print_table("Places", ("place", "kind", "also called", "latitude, longitude"), rows)
        outside = [f"this map covers {folder.covers}"] if folder is not None and not matches else []
        print_notes([*outside, ATTRIBUTION])

    return Answer({"places": [place.to_dict() for place in matches], "attribution": ATTRIBUTION}, shown)


def _show(journey: Journey) -> None:
    typer.echo(f"From {' to '.join(place.described for place in journey.stops)}.")
    for sentence in journey_in_words(journey):
        typer.echo(sentence)
    typer.echo("")
    if journey.charging is not None:
        _show_stops(journey)
    reserve = journey.reserve
    words: list[tuple[str, ...]] = [
        (chance(plan.p_arrive), chance(plan.p_reserve)) for plan in journey.charging_plans
    ]
    words += [
        tuple(chance_to_arrive(road.forecast, least) for least in (0.0, reserve)) for road in journey.roads
    ]
    rows = [
        (
            way["labels"] or "road",
            f"{way['distance_m'] / 1000.0:.1f} km",
            period(way["duration_s"]),
            str(way["charges"]),
            f"{way['energy_wh'] / 1000.0:.2f} kWh",
            f"{100.0 * way['soc_arrival']:.0f} % ({100.0 * way['soc_low']:.0f} to {100.0 * way['soc_high']:.0f} %)",
            *chances,
        )
        for way, chances in zip(journey.to_frame().to_dict("records"), words, strict=True)
    ]
    with_reserve = f"{100.0 * reserve:g} % or more"
    columns = ("way", "length", "time", "stops", "energy", "arrival with", "arrives", with_reserve)
    print_table(f"Ways, given {journey.forecast.given}", columns, rows, numbers=columns[1:5])
    for name, wh in journey.costs_wh.items():
        if abs(wh) >= 1.0:
            typer.echo(f"{COSTS[name]}: {wh / 1000.0:.2f} kWh")
    print_notes([*journey.forecast.flags, *journey.flags, journey.attribution])


def _show_stops(journey: Journey) -> None:
    """The stops to charge of the fastest plan."""
    plan, leaves = journey.charging_plans[0], journey.verdict.departs_at
    rows = [
        (
            stop.station.place.title,
            f"{stop.position_m / 1000.0:.0f} km",
            _clock(leaves, stop.arrives_after_s) if leaves else period(stop.arrives_after_s),
            f"{100.0 * stop.soc_arrival:.0f} % ({100.0 * stop.soc_interval[0]:.0f} to {100.0 * stop.soc_interval[1]:.0f} %)",
            f"{100.0 * stop.soc_leave:.0f} %",
            period(stop.charging_s),
            chance(stop.p_reach),
            f"{full.station.place.title}, {period(full.more_s)} more" if (full := stop.if_full) else "-",
        )
        for stop in plan.stops
    ]
    columns = (
        "stop",
        "after",
        "at",
        "arrival with",
        "leave with",
        "charge for",
        "reached",
        "if it is occupied",
    )
    ends = f", at the end at {_clock(leaves, plan.duration_s)}" if leaves else ""
    print_table(f"Stops to charge, {period(plan.duration_s)} in all{ends}", columns, rows)


def _clock(leaves: dt.datetime, after_s: float) -> str:
    return f"{leaves + dt.timedelta(seconds=after_s):%H:%M}"
