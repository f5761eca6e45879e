"""Logs of many vehicles in Delta tables: `create_store`, `open_store`; with the extra `tripwatt[fleet]`."""

from tripwatt.fleet.store.adding import add_files, read_by_vehicle
from tripwatt.fleet.store.store import Added, TripStore, create_store, open_store, read_file

__all__ = [
    "Added",
    "TripStore",
    "add_files",
    "create_store",
    "open_store",
    "read_by_vehicle",
    "read_file",
]
