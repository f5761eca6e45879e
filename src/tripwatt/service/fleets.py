"""Models of fleets: a registry whose version in use is followed, and the model of one of its vehicles."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from tripwatt.errors import InvalidInput, places_named
from tripwatt.fleet.model import COLD_DEGC, FleetModel
from tripwatt.fleet.registry import FollowedModel, Registry
from tripwatt.forecasting import ForecastModel, load_metadata
from tripwatt.vehicles import load_vehicle


def is_registry(folder: Path | None) -> bool:
    """Whether a folder holds the versions of a fleet's model."""
    return folder is not None and (folder / "versions").is_dir()


def followed(name: str, folder: Path, log: Callable[..., None]) -> FollowedModel:
    """The model in use of a registry; the log has every change, and why one was refused, with its name in the service."""

    def on_change(version: str, error: InvalidInput | None) -> None:
        refused = {} if error is None else {"reason": f"{error}"}
        log(event="model refused" if refused else "model changed", model=name, version=version, **refused)

    return FollowedModel(Registry(folder), on_change)


def model_summary(folder: Path | None, fleet: FollowedModel | None) -> dict[str, Any]:
    """What `/v1/models` has of a model, beside its name."""
    if fleet is None:
        return load_metadata(folder)
    metadata = load_metadata(fleet.folder)
    about, provenance = metadata.pop("fleet"), {name: metadata[name] for name in ("tripwatt", "packages")}
    first = about["car_models"][0]
    model = {"vehicle": first, "vehicle_title": load_vehicle(first).title, "version": fleet.version, **about}
    return {"model": model, "contract": {}, "provenance": provenance, "evaluation": {}}


def vehicle_model(fleet: FleetModel, document: Mapping[str, Any]) -> ForecastModel:
    """The model of the vehicle that a request names; without any, of a new one of the fleet's first car model.

    Raises
    ------
    InvalidInput
        When the vehicle is not known, or is another car model.
    """
    if document.get("vehicle_figures") is not None:
        got, allowed = "figures of a car", "vehicle_id, or vehicle for a new one"
        raise InvalidInput.of("not for a fleet", "vehicle_figures", got, allowed)
    vehicle_id, vehicle, driver = (document.get(name) for name in ("vehicle_id", "vehicle", "driver"))
    if not all(isinstance(name, str | None) for name in (vehicle_id, vehicle, driver)):
        raise InvalidInput([])  # another type is a fault of its field
    if vehicle_id is None and vehicle is None:
        vehicle = min(fleet.vehicles().values())
    ambient = document.get("ambient_temperature_degc")
    cold = ambient < COLD_DEGC if isinstance(ambient, int | float) else None
    with places_named({"car_model": "vehicle"}):
        return fleet.of_vehicle(vehicle_id, car_model=vehicle, driver=driver, cold=cold)
