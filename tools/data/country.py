"""A synthetic country as an OpenStreetMap extract with elevation tiles: `python -m tools.data.country --out FOLDER --size small`.

It lies in the open Atlantic, where no road is, and everything in it is invented: the extract is called `synthetic-country.osm.pbf`.
Settlements stand on a jittered grid; cities, towns and villages differ in the size of their street grids. Country roads join
neighbours, motorways with ramps cross the country, and charging stations stand beside ramps and in towns. Heights are a sum of
waves: long ones are high, short ones low. The same seed makes the same country.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from tools.command import run
from tripwatt.arrays import FloatArray, IntArray

SOUTH_DEG: Final = 44.1
WEST_DEG: Final = -34.0
KM_PER_DEG: Final = 111.195
EXTRACT_NAME: Final = "synthetic-country.osm.pbf"
EXAMPLE: Final = Path(__file__).parents[2] / "src" / "tripwatt" / "server" / "http" / "demo"
EXAMPLE_SEED: Final = 42
TILE_ROWS: Final = 1201
"""Rows of an elevation tile of 3 arc-seconds."""

MOTORWAY_PIECE_KM: Final = 1.0
CARRIAGEWAY_KM: Final = 0.03
RAMP_KM: Final = 0.6
STATION_EVERY: Final = 2
"""Every so many interchanges of a motorway have a charging station."""

LIMIT_KMH: Final = MappingProxyType(
    {
        "motorway": 130,
        "motorway_link": 60,
        "primary": 100,
        "secondary": 80,
        "unclassified": 60,
        "residential": 30,
    }
)
ENDS: Final = ("berga", "vik", "stadt", "dorf", "mere", "ford", "heim", "sund", "löv", "brück", "ås", "ham")
STARTS: Final = (
    "Al",
    "Bran",
    "Cor",
    "Del",
    "Ener",
    "Fal",
    "Grön",
    "Hol",
    "Is",
    "Jor",
    "Kal",
    "Lin",
    "Mar",
    "Nor",
    "Ost",
    "Ven",
)
MIDDLES: Final = ("", "a", "en", "ing", "ola", "un", "er", "ins", "wal", "ö")
STREETS: Final = (
    "Linden",
    "Kirch",
    "Storm",
    "Mühl",
    "Sjö",
    "Alexanders",
    "Birken",
    "Markt",
    "Hafen",
    "Ängs",
    "Schul",
    "Wald",
)
STREET_ENDS: Final = MappingProxyType({"de": "strasse", "sv": "gatan"})
POWERS_KW: Final = (300, 150, 150, 75, 50)


@dataclass(frozen=True)
class Size:
    """Extent of a country: columns and rows of settlements with their distance, and streets along one side of their grids."""

    columns: int
    rows: int
    spacing_km: float
    streets: dict[str, int]
    town_every: int
    city_every: int
    motorway_rows: tuple[int, ...]
    motorway_columns: tuple[int, ...] = ()
    side_roads: int = 8
    """Side roads of a country road."""


SIZES: Final = MappingProxyType(
    {
        "small": Size(44, 2, 12.0, {"city": 9, "town": 5, "village": 3}, 7, 29, (0,), side_roads=2),
        "example": Size(6, 6, 12.0, {"city": 9, "town": 5, "village": 3}, 5, 17, (2,), side_roads=2),
        "large": Size(
            76, 50, 8.0, {"city": 80, "town": 30, "village": 9}, 23, 379, (8, 25, 42), (12, 38, 63)
        ),
    }
)


@dataclass
class Drawing:
    """Nodes and ways as they are drawn, in kilometres from the south-western corner."""

    x_km: list[float] = field(default_factory=list)
    y_km: list[float] = field(default_factory=list)
    tags: dict[int, dict[str, str]] = field(default_factory=dict)
    ways: list[tuple[list[int], dict[str, str]]] = field(default_factory=list)

    def node(self, x_km: float, y_km: float, **tags: str) -> int:
        """Draw a node; its number."""
        self.x_km.append(x_km)
        self.y_km.append(y_km)
        if tags:
            self.tags[len(self.x_km) - 1] = tags
        return len(self.x_km) - 1

    def way(self, nodes: Sequence[int], highway: str, **tags: str) -> None:
        """Draw a road along nodes."""
        limit = {"maxspeed": str(LIMIT_KMH[highway])} if highway in LIMIT_KMH else {}
        self.ways.append(([*nodes], {"highway": highway, **limit, **tags}))

    @property
    def edges(self) -> int:
        """Number of pieces of road between junctions and ends."""
        used = np.concatenate([nodes for nodes, _ in self.ways])
        ends = np.concatenate([[nodes[0], nodes[-1]] for nodes, _ in self.ways])
        count = np.bincount(used, minlength=len(self.x_km))
        is_border = count > 1
        is_border[ends] = True
        return int(is_border[used].sum()) - len(self.ways)


@dataclass(frozen=True)
class Heights:
    """Heights of the country: waves of random direction, the long ones the highest."""

    seed: int
    waves: int = 40
    mean_m: float = 350.0

    @cached_property
    def _waves(self) -> FloatArray:
        rng = np.random.default_rng((self.seed, 1))
        length_km = np.geomspace(4.0, 160.0, self.waves)
        direction = rng.uniform(0.0, 2.0 * np.pi, self.waves)
        per_deg = 2.0 * np.pi * KM_PER_DEG / length_km
        amplitude_m = 9.0 * np.sqrt(length_km)
        return np.stack(
            [
                per_deg * np.cos(direction),
                per_deg * np.sin(direction),
                rng.uniform(0.0, 2.0 * np.pi, self.waves),
                amplitude_m,
            ]
        )

    def grid_m(self, latitude_deg: FloatArray, longitude_deg: FloatArray) -> FloatArray:
        """Heights at all pairs, shape (latitudes, longitudes); the sea level is the lowest."""
        north, east, phase, amplitude = self._waves
        south_north = np.exp(1j * np.outer(latitude_deg - SOUTH_DEG, north)) * amplitude * np.exp(1j * phase)
        west_east = np.exp(1j * np.outer(longitude_deg - WEST_DEG, east) * math.cos(math.radians(SOUTH_DEG)))
        return np.asarray(np.maximum(self.mean_m + np.real(south_north @ west_east.T), 0.0))


class Country:
    """Draws a country of a size."""

    def __init__(self, size: Size, seed: int) -> None:
        self.size, self.seed = size, seed
        self.rng = np.random.default_rng((seed, 0))
        self.drawing = Drawing()
        shape = (size.rows, size.columns)
        column, row = np.meshgrid(np.arange(size.columns), np.arange(size.rows))
        jitter = self.rng.uniform(-0.2, 0.2, (2, *shape))
        self.x_km = (column + 0.5 + jitter[0]) * size.spacing_km
        self.y_km = (row + 0.5 + jitter[1]) * size.spacing_km
        number = column + row * size.columns
        middle = number + size.city_every // 2 if size.rows > 2 else number
        self.kind = np.where(
            middle % size.city_every == 0, "city", np.where(number % size.town_every == 3, "town", "village")
        )
        self.centres = np.zeros(shape, dtype=np.int64)
        self.names: set[str] = set()

    def draw(self) -> Drawing:
        """Draw everything."""
        rows, columns = self.centres.shape
        for row in range(rows):
            for column in range(columns):
                self.centres[row, column] = self._settlement(row, column)
        for row in range(rows):
            for column in range(columns):
                if column + 1 < columns:
                    self._country_road(self.centres[row, column], self.centres[row, column + 1])
                if row + 1 < rows and (column % 4 == 0 or self.rng.random() < 0.7):
                    self._country_road(self.centres[row, column], self.centres[row + 1, column])
        for number, row in enumerate(self.size.motorway_rows):
            self._motorway(f"A {number + 1}", self.centres[row, :], along_x=True)
        for number, column in enumerate(self.size.motorway_columns):
            self._motorway(f"A {number + 11}", self.centres[:, column], along_x=False)
        return self.drawing

    def _name(self, repeated: bool) -> str:
        """A new name; now and then one that another settlement has."""
        while True:
            parts = (STARTS, MIDDLES, MIDDLES, ENDS) if len(self.names) > 800 else (STARTS, MIDDLES, ENDS)
            name = "".join(str(self.rng.choice(part)) for part in parts)
            if repeated or name not in self.names:
                self.names.add(name)
                return name

    def _settlement(self, row: int, column: int) -> int:
        """A grid of streets around a centre; the node of the centre."""
        kind, draw, rng = str(self.kind[row, column]), self.drawing, self.rng
        name = self._name(repeated=kind == "village" and rng.random() < 0.03)
        tags = {"place": kind, "name": name, "source": "synthetic"}
        if rng.random() < 0.3:
            tags["name:sv"] = f"{name[:3]}borg"
        if rng.random() < 0.1:
            tags["old_name"] = f"{name[:2]}tun"
        x, y = float(self.x_km[row, column]), float(self.y_km[row, column])
        side, gap = self.size.streets[kind], 0.12
        offset = (np.arange(side) - side // 2) * gap
        moved = rng.normal(0.0, 0.01, (2, side, side))
        nodes = np.array(
            [
                [
                    draw.node(x + offset[j] + moved[0, i, j], y + offset[i] + moved[1, i, j])
                    for j in range(side)
                ]
                for i in range(side)
            ]
        )
        draw.node(x + 0.01, y + 0.01, **tags)
        language = "sv" if rng.random() < 0.3 else "de"
        for k in range(side):
            for across, line in enumerate((nodes[k, :], nodes[:, k])):
                middle = k == side // 2
                stem = STREETS[(2 * k + across) % len(STREETS)] + ("" if 2 * k < len(STREETS) else str(k))
                street = (
                    stem + STREET_ENDS[language] if not middle else ("Hauptstrasse", "Bahnhofstrasse")[across]
                )
                draw.way(
                    line.tolist(),
                    "primary" if middle and kind != "village" else "residential",
                    name=street,
                    maxspeed="50" if middle else "30",
                )
                if kind != "village" and k < 6:
                    draw.node(
                        draw.x_km[line[0]] + 0.02,
                        draw.y_km[line[0]] + 0.02,
                        **{"addr:housenumber": str(2 * k + 1), "addr:street": street, "addr:city": name},
                    )
        if kind != "village":
            draw.node(
                x + 0.05,
                y + 0.05,
                **_station(22 if kind == "town" else 50, f"Stadtwerke {name}", direct=kind == "city"),
            )
        return int(nodes[side // 2, side // 2])

    def _between(self, start: int, end: int, pieces: int, bend_km: float) -> list[int]:
        """New nodes between two: a line with a gentle bend."""
        draw = self.drawing
        x, y = ([values[start], values[end]] for values in (draw.x_km, draw.y_km))
        length = math.hypot(x[1] - x[0], y[1] - y[0])
        share = np.arange(1, pieces) / pieces
        off = bend_km * np.sin(np.pi * share * 2.0) / length
        return [
            draw.node(
                x[0] + s * (x[1] - x[0]) - o * (y[1] - y[0]), y[0] + s * (y[1] - y[0]) + o * (x[1] - x[0])
            )
            for s, o in zip(share.tolist(), off.tolist(), strict=True)
        ]

    def _country_road(self, start: int, end: int) -> None:
        """A road to the neighbour with side roads."""
        draw, rng = self.drawing, self.rng
        pieces = 3 * self.size.side_roads + 3
        inner = self._between(int(start), int(end), pieces, float(rng.normal(0.0, 0.4)))
        draw.way([int(start), *inner, int(end)], "secondary", ref=f"L {len(draw.ways)}")
        for node in inner[2::3][: self.size.side_roads]:
            angle, length = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.2, 0.6)
            farm = draw.node(
                draw.x_km[node] + length * math.cos(angle), draw.y_km[node] + length * math.sin(angle)
            )
            draw.way([node, farm], "unclassified")

    def _motorway(self, ref: str, centres: IntArray, *, along_x: bool) -> None:
        """Two carriageways beside a row of settlements, with ramps at each of them."""
        draw = self.drawing
        along, off = (draw.x_km, draw.y_km) if along_x else (draw.y_km, draw.x_km)
        stops = [float(along[c]) + 1.0 for c in centres]
        base = float(np.mean([off[c] for c in centres])) - 0.45 * self.size.spacing_km
        ramps = sorted({round(s + sign * RAMP_KM, 6) for s in stops for sign in (-1.0, 1.0)})
        free = np.arange(stops[0] - 2.0, stops[-1] + 2.0, MOTORWAY_PIECE_KM)
        position = sorted({*ramps, *np.round(free, 6).tolist()})

        def node(at: float, side: float, **tags: str) -> int:
            beside = base + 0.8 * math.sin(at / 9.0) + side
            x_km, y_km = (at, beside) if along_x else (beside, at)
            return draw.node(x_km, y_km, **tags)

        forward = {at: node(at, -CARRIAGEWAY_KM) for at in position}
        backward = {at: node(at, CARRIAGEWAY_KM) for at in position}
        about = {"ref": ref, "oneway": "yes"}
        draw.way([*forward.values()], "motorway", **about)
        draw.way([*backward.values()][::-1], "motorway", **about)
        first, last = position[0], position[-1]
        draw.way([backward[first], forward[first]], "motorway_link", oneway="yes")
        draw.way([forward[last], backward[last]], "motorway_link", oneway="yes")
        for number, (stop, centre) in enumerate(zip(stops, centres, strict=True)):
            below, above = node(stop, -0.25), node(stop, 0.25)
            before, after = round(stop - RAMP_KM, 6), round(stop + RAMP_KM, 6)
            for pair in (
                (forward[before], below),
                (below, forward[after]),
                (backward[after], above),
                (above, backward[before]),
            ):
                draw.way(pair, "motorway_link", oneway="yes")
            draw.way([below, above], "secondary", bridge="yes", layer="1")
            draw.way([above, *self._between(above, int(centre), 4, 0.1), int(centre)], "secondary")
            if number % STATION_EVERY == 0:
                power = POWERS_KW[number // STATION_EVERY % len(POWERS_KW)]
                yard = node(stop + 0.1, -0.35)
                draw.way([below, yard], "service")
                node(stop + 0.11, -0.36, **_station(power, f"Synthetic Charge {ref} {number}", direct=True))


def _station(power_kw: int, operator: str, *, direct: bool) -> dict[str, str]:
    socket = "socket:type2_combo" if direct else "socket:type2"
    return {
        "amenity": "charging_station",
        "operator": operator,
        socket: "4",
        f"{socket}:output": f"{power_kw} kW",
    }


def degrees(drawing: Drawing) -> tuple[FloatArray, FloatArray]:
    """Latitude and longitude of the nodes."""
    latitude = SOUTH_DEG + np.array(drawing.y_km) / KM_PER_DEG
    east = KM_PER_DEG * np.cos(np.radians(SOUTH_DEG + 0.5 * max(drawing.y_km) / KM_PER_DEG))
    return latitude, WEST_DEG + np.array(drawing.x_km) / east


def write_extract(path: Path, drawing: Drawing) -> None:
    """Write a drawing in the format of the name of the file."""
    import osmium

    header = osmium.io.Header()
    header.set("generator", "tripwatt synthetic country: no place of it exists")
    latitude, longitude = (values.round(7).tolist() for values in degrees(drawing))
    stamp: dict[str, Any] = {"version": 1, "timestamp": "2000-01-01T00:00:00Z"}
    with osmium.SimpleWriter(str(path), header=header, overwrite=True) as writer:
        for k, where in enumerate(zip(longitude, latitude, strict=True)):
            tags = drawing.tags.get(k, {})
            writer.add_node(osmium.osm.mutable.Node(id=k + 1, location=where, tags=tags, **stamp))
        for k, (nodes, tags) in enumerate(drawing.ways):
            refs = [node + 1 for node in nodes]
            writer.add_way(osmium.osm.mutable.Way(id=k + 1, nodes=refs, tags=tags, **stamp))


def write_elevation(folder: Path, drawing: Drawing, heights: Heights) -> int:
    """Write the elevation tiles of a drawing; their number."""
    folder.mkdir(parents=True, exist_ok=True)
    latitude, longitude = degrees(drawing)
    step = np.arange(TILE_ROWS) / (TILE_ROWS - 1)
    corners = [
        (south, west)
        for south in range(math.floor(latitude.min()), math.floor(latitude.max()) + 1)
        for west in range(math.floor(longitude.min()), math.floor(longitude.max()) + 1)
    ]
    for south, west in corners:
        tile = heights.grid_m(south + 1.0 - step, west + step)
        name = f"{'N' if south >= 0 else 'S'}{abs(south):02d}{'E' if west >= 0 else 'W'}{abs(west):03d}.hgt"
        (folder / name).write_bytes(np.round(tile).astype(">i2").tobytes())
    return len(corners)


def write_country(folder: Path, size: str = "small", seed: int = 38) -> tuple[Path, Path, int]:
    """Write a country: its extract, the folder of its elevation tiles, and the number of its edges."""
    folder.mkdir(parents=True, exist_ok=True)
    drawing = Country(SIZES[size], seed).draw()
    write_extract(folder / EXTRACT_NAME, drawing)
    write_elevation(folder / "elevation", drawing, Heights(seed))
    return folder / EXTRACT_NAME, folder / "elevation", drawing.edges


def write_example(folder: Path = EXAMPLE) -> None:
    """Write the country of `tripwatt demo`: its extract, and its heights every 30 arc-seconds as whole metres."""
    drawing = Country(SIZES["example"], EXAMPLE_SEED).draw()
    latitude, longitude = degrees(drawing)
    assert max(latitude) < math.floor(SOUTH_DEG) + 1.0
    assert max(longitude) < math.floor(WEST_DEG) + 1.0
    step = np.arange(121) / 120.0
    grid = Heights(EXAMPLE_SEED).grid_m(math.floor(SOUTH_DEG) + 1.0 - step, math.floor(WEST_DEG) + step)
    folder.mkdir(parents=True, exist_ok=True)
    write_extract(folder / "example-country.osm.pbf", drawing)
    np.save(folder / "heights.npy", np.round(grid).astype(np.int16))


def main(out: Path = Path("country"), size: str = "small", seed: int = 38) -> int:
    """Write a synthetic country into a folder; `--size example` writes that of `tripwatt demo`."""
    if size == "example":
        write_example()
        return 0
    extract, elevation, edges = write_country(out, size, seed)
    print(
        f"{extract}: {edges} edges, {extract.stat().st_size / 1e6:.1f} MB; {len([*elevation.iterdir()])} elevation tiles"
    )
    return 0


if __name__ == "__main__":
    run(main)
