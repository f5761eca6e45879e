"""Maps of a region on this machine: roads, elevation, places and charging stations, made from an OpenStreetMap extract."""

from tripwatt.roads.maps.elevation import Elevation
from tripwatt.roads.maps.folder import ATTRIBUTION, MapFolder, build_map, open_map
from tripwatt.roads.maps.heights import KnownHeights
from tripwatt.roads.maps.index import PlaceIndex
from tripwatt.roads.maps.stations import Plug, Station, near, read_stations, within

__all__ = [
    "ATTRIBUTION",
    "Elevation",
    "KnownHeights",
    "MapFolder",
    "PlaceIndex",
    "Plug",
    "Station",
    "build_map",
    "near",
    "open_map",
    "read_stations",
    "within",
]
