"""Roads that are made, on the straight lines between places."""

import itertools
from dataclasses import dataclass, replace

import numpy as np

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.roads.journey import Atlas, JourneyOptions, Place, plan_journey
from tripwatt.roads.maps.stations import Station
from tripwatt.roads.routers import Edges, Road, join_edges

A, B = Place(47.0, 9.0, "A"), Place(47.0, 9.8, "B")


KM_H = 1.0 / 3.6


def straight(start, end, speed_km_h=100.0, kind="primary", factor=1.0, level=False, south_deg=0.0):
    """A road on the straight line between two places, or south of it, its heights unknown or all alike."""
    length = factor * start.distance_m(end)
    n = max(round(length / 2000.0), 1)
    edges = Edges(
        np.full(n, length / n),
        np.full(n, length / n / (speed_km_h * KM_H)),
        np.full(n, np.nan),
        np.full(n, np.nan),
        (kind,) * n,
        np.zeros(n, dtype=bool),
        np.zeros(n, dtype=bool),
    )
    links, kinds = join_edges(edges)
    if level:
        links = replace(
            links, elevation_position_m=np.array([0.0, length]), elevation_m=np.zeros(2), flags=()
        )
    line = np.linspace(0.0, 1.0, n + 1)
    latitude = start.latitude_deg + line * (end.latitude_deg - start.latitude_deg)
    latitude -= south_deg * np.sin(np.pi * line)
    longitude = start.longitude_deg + line * (end.longitude_deg - start.longitude_deg)
    return Road(links, kinds, latitude, longitude, line * length)


@dataclass
class MadeRouter:
    """A motorway between any two places, and a slower and shorter road beside it."""

    name: str = "made"
    fails_at: float = 90.0

    def roads(self, stops, *, alternatives=0):
        if max(stop.latitude_deg for stop in stops) > self.fails_at:
            raise InvalidInput([])
        legs = [straight(a, b, 130.0, "motorway", 1.05) for a, b in itertools.pairwise(stops)]
        road = legs[0] if len(legs) == 1 else joined(legs)
        if not alternatives:
            return (road,)
        return (straight(stops[0], stops[-1], 80.0), road)

    def outline(self, start, minutes):
        return ()


def joined(legs):
    from tests.support.joined import join_routes

    links = join_routes([leg.links for leg in legs])
    starts = np.cumsum([0.0, *(leg.distance_m for leg in legs)])
    return Road(
        links,
        tuple(kind for leg in legs for kind in leg.road_class),
        np.concatenate([leg.latitude_deg for leg in legs]),
        np.concatenate([leg.longitude_deg for leg in legs]),
        np.concatenate([leg.position_m + at for leg, at in zip(legs, starts[:-1], strict=True)]),
        tuple(starts[1:-1].tolist()),
    )


MADE = Atlas(MadeRouter(), stations=(Station(47.0, 9.4, "Halbweg", 100_000.0, direct_current=True),))


COLD = tw.Departure(soc=0.9, ambient_temperature_degc=0.0)


def journey(model, departure=COLD, stops=(A, B), atlas=MADE, **options):
    return plan_journey(stops, departure, atlas=atlas, model=model, options=JourneyOptions(**options))
