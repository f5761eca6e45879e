"""A forecaster as a model directory and back: what is loaded forecasts to the last bit as what was stored.

The car is stored with all its values and their sources, so that a later change of the bundled cars changes no stored
model. Meaning of the parts: `model.json` holds the plain values, `vehicle.json` the car, `corrector*.npz` arrays.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, fields, replace
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecasting.donor import DonorModel
from tripwatt.forecasting.model import ForecastModel
from tripwatt.hybrid.familiarity import Range
from tripwatt.hybrid.segments import SEGMENT_S
from tripwatt.hybrid.stored import (
    Stored,
    corrector_of_parts,
    corrector_parts,
    members_of_parts,
    members_parts,
)
from tripwatt.modelfile import Part, read_metadata, read_model, write_model
from tripwatt.routes.free_flow import TravelTimeFactors
from tripwatt.trips import (
    COLUMNS,
    QUANTITIES,
    REQUIRED_COLUMNS,
    ROUTE_COLUMNS,
    SIGNALS,
    Flag,
    plan_from_samples,
)
from tripwatt.uncertainty import (
    ChargeScale,
    ConformalScores,
    ResidualProcess,
    RouteUncertainty,
    TotalScale,
    UncertaintyModel,
    UpdateShrinkage,
)
from tripwatt.uncertainty.free_flow import FreeFlowUncertainty
from tripwatt.uncertainty.residual_power import ComponentProcess
from tripwatt.uncertainty.scale import TimeCourse
from tripwatt.vehicles import Vehicle, vehicle_from_document

GIVEN: Final = "given the driven speed trace"
"""What every figure of a forecast is on condition of."""

_SHRINKAGE: Final = {
    "climate": "climate",
    "drive": "drive",
    "whole": "joint",
    "apart_spread": "split_sd_factor",
    "whole_spread": "joint_sd_factor",
    "off": "off",
}
"""Key in the file -> field of `UpdateShrinkage`."""

_OLD_CORRECTORS: Final = {"kriging": "gp", "channels": "split"}
"""Name in older files -> name of the corrector."""

DEFAULT_MODEL: Final = "bmw_i3_tum"
"""The model that comes with the package."""


def model_parts(model: ForecastModel) -> dict[str, Part]:
    """Everything that the forecasts of a fitted model depend on, by the name of its part.

    Raises
    ------
    InvalidInput
        For a model that is not fitted, or whose corrector cannot be stored.
    """
    corrector, uncertainty = model.fitted_parts("store")
    about, arrays = corrector_parts(corrector)
    process = asdict(uncertainty.process)
    process["apart"] = process.pop("split")
    shrinkage = uncertainty.shrinkage
    values = {
        "corrector": model.corrector,
        "seed": model.seed,
        "block_s": SEGMENT_S,
        "fitted": about,
        "process": process | {"climate_limit_w": _finite(uncertainty.process.climate_limit_w)},
        **_scale_part(uncertainty.scale),
        "scores": uncertainty.scores.values.tolist(),
        "gain": {key: getattr(shrinkage, name).tolist() for key, name in _SHRINKAGE.items()},
        "route_doubt": _route_part(uncertainty.route),
        "free_flow": _free_flow_part(uncertainty.free_flow),
        "charge": None if uncertainty.charge is None else asdict(uncertainty.charge),
        "ranges": {n: [_finite(r.low), _finite(r.high), r.sd] for n, r in model.ranges_.items()},
        "trip_ids": list(model.trip_ids_),
    }
    if model.flags:
        values["flags"] = [asdict(flag) for flag in model.flags]
    if model.donor_ is not None:
        values["elsewhere"], more = _donor_part(model.donor_)
        arrays |= more
    return {"model.json": values, "vehicle.json": vehicle_part(model.vehicle), **arrays}


def model_of_parts(parts: Mapping[str, Part]) -> ForecastModel:
    """Reverse of `model_parts`.

    Raises
    ------
    InvalidInput
        For parts that do not make a model of this version, with the reason.
    """
    try:
        values: Mapping[str, Any] = parts["model.json"]
        if values["block_s"] != SEGMENT_S:
            got, allowed = f"segments of {values['block_s']} s", f"segments of {SEGMENT_S:g} s"
            raise InvalidInput(
                Fault("model of an older version", "model.json, block_s", got, allowed, "fit the model again")
            )
        process = values["process"]
        ranges = {
            n: Range(_bound(low, -math.inf), _bound(high, math.inf), sd)
            for n, (low, high, sd) in values["ranges"].items()
        }
        return ForecastModel(
            vehicle=vehicle_of_part(parts["vehicle.json"]),
            corrector=_OLD_CORRECTORS.get(values["corrector"], values["corrector"]),
            seed=values["seed"],
            corrector_=corrector_of_parts(values["fitted"], parts),
            uncertainty_=UncertaintyModel(
                process=ResidualProcess(
                    drive=ComponentProcess(**process["drive"]),
                    climate=ComponentProcess(**process["climate"]),
                    climate_limit_w=_bound(process["climate_limit_w"], math.inf),
                    split=process["apart"],
                ),
                scale=_scale_of_part(values),
                scores=ConformalScores(np.array(values["scores"], dtype=np.float64)),
                shrinkage=UpdateShrinkage(
                    **{
                        n: np.array(values["gain"][k], dtype=np.float64)
                        for k, n in _SHRINKAGE.items()
                        if k in values["gain"]  # models of older versions have no `off`
                    }
                ),
                route=_route_of_part(values.get("route_doubt")),
                free_flow=_free_flow_of_part(values.get("free_flow")),
                charge=ChargeScale(**values["charge"]) if values.get("charge") else None,
            ),
            ranges_=ranges,
            trip_ids_=tuple(values["trip_ids"]),
            donor_=_donor_of_part(values["elsewhere"], parts) if "elsewhere" in values else None,
            flags=tuple(Flag(**flag) for flag in values.get("flags", ())),
        )
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError) as error:
        got = f"{type(error).__name__}: {error}"[:200]
        fix = "fit the model again with this version of tripwatt"
        raise InvalidInput(Fault("parts do not make a forecast model", "model", got, "", fix)) from error


def save_model(
    model: ForecastModel,
    folder: Path | str,
    *,
    provenance: Mapping[str, Any] | None = None,
    evaluation: Mapping[str, Any] | None = None,
) -> None:
    """Write a fitted model as a directory, whole or not at all.

    Parameters
    ----------
    model : ForecastModel
        Fitted.
    folder : path
        A new or empty folder, or one that holds a model, which is replaced.
    provenance : mapping, optional
        Where it comes from, such as `trained` gives: data, audit, trips, versions.
    evaluation : mapping, optional
        Its figures.

    Raises
    ------
    InvalidInput
        When the model cannot be stored or the folder cannot be used.

    Examples
    --------
    >>> import tempfile
    >>> from tripwatt.synthetic import synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> trips = synthetic_fleet(n_trips=9).trips
    >>> model = ForecastModel(load_vehicle("bmw_i3_60ah"), corrector="linear").fit(trips[:8])
    >>> with tempfile.TemporaryDirectory() as place:
    ...     save_model(model, Path(place) / "model")
    ...     again = load_model(Path(place) / "model")
    >>> again.forecast(trips[8]).energy_wh == model.forecast(trips[8]).energy_wh
    True
    """
    parts = model_parts(model)
    metadata = {
        "tripwatt": version("tripwatt"),
        "given": GIVEN,
        "model": {
            "corrector": model.corrector,
            "seed": model.seed,
            "vehicle": model.vehicle.name,
            "vehicle_title": model.vehicle.title,
            "vehicle_preset": model.vehicle.preset,
            "trips": len(model.trip_ids_),
        },
        "contract": contract(model),
        "provenance": dict(provenance or {}),
        "evaluation": dict(evaluation or {}),
    }
    write_model(folder, metadata, parts)


def load_model(folder: Path | str | None = None) -> ForecastModel:
    """A stored model, or without a folder the one that comes with the package.

    Parameters
    ----------
    folder : path, optional
        Where `save_model` or `tripwatt fit` wrote it.

    Returns
    -------
    ForecastModel
        Fitted.

    Raises
    ------
    InvalidInput
        When there is no model, it is damaged or altered, its format is not known, or it does not give finite forecasts.

    Examples
    --------
    >>> import tripwatt as tw
    >>> tw.load_model().vehicle.title
    'BMW i3 60 Ah'
    """
    place = model_folder(folder)
    model = model_of_parts(read_model(place).parts)
    if folder is not None:
        require_usable(model, f"{place}")
    return model


def require_usable(model: ForecastModel, where: str) -> None:
    """Whether a model from outside gives finite numbers, by a forecast of three minutes and an update of it.

    Parts that fit each other in shape may still hold values with which nothing can be computed.

    Raises
    ------
    InvalidInput
        When the forecast fails or a number of it is not finite.
    """
    time = np.arange(181.0)
    speed = 12.0 - 12.0 * np.cos(time * (2.0 * math.pi / 60.0))
    drive = pd.DataFrame({"time_s": time, "speed_m_s": speed, "elevation_m": 500.0})
    observed = pd.DataFrame({"time_s": time[:61], "voltage_v": 350.0, "current_a": 30.0})
    try:
        with np.errstate(all="ignore"):
            before = model.forecast(plan_from_samples(drive, "trial"))
            found = [before.to_dict(), before.update(observed).to_dict()]
            planned = replace(before.plan, link_m=250.0)
            found.append(model.forecast(planned).to_dict())
            sound = all(math.isfinite(sum(_numbers(document))) for document in found)
    except InvalidInput as error:
        got = error.faults[0].what
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        got = f"{type(error).__name__}: {error}"[:200]
    else:
        if sound:
            return
        got = "numbers that are not finite"
    fix = "fit the model again with this version of tripwatt"
    raise InvalidInput(Fault("model gives no forecast", where, got, "a finite forecast of a trial trip", fix))


def _numbers(value: Any) -> Iterator[float]:
    """Every number of a document."""
    if isinstance(value, Mapping):
        value = list(value.values())
    if isinstance(value, list | tuple):
        for entry in value:
            yield from _numbers(entry)
    elif isinstance(value, int | float):
        yield float(value)


def load_metadata(folder: Path | str | None = None, *, check_parts: bool = True) -> dict[str, Any]:
    """Read the metadata of a stored model, or of the one that comes with the package.

    Parameters
    ----------
    folder : path, optional
        Of the stored model.
    check_parts : bool
        Whether every part is read and checked as well.

    Returns
    -------
    dict
        As `save_model` wrote it.

    Raises
    ------
    InvalidInput
        As `load_model`.

    Examples
    --------
    >>> sorted(load_metadata(check_parts=False))[:2]
    ['contract', 'evaluation']
    """
    place = model_folder(folder)
    return dict(read_model(place).metadata) if check_parts else read_metadata(place)


def model_folder(folder: Path | str | None = None) -> Path:
    """The folder itself, or that of the model that comes with the package: without a folder, or by its name."""
    packaged = Path(__file__).parents[1] / "models" / DEFAULT_MODEL
    if folder is None or (str(folder) == DEFAULT_MODEL and not Path(folder).exists()):
        return packaged
    return Path(folder)


def contract(model: ForecastModel) -> dict[str, Any]:
    """What a model takes in and gives: names, units, bounds, and what training saw.

    Returns
    -------
    dict
        `inputs`: for each column of a trip, and for the payload, its unit, bounds, meaning, whether it is required,
        which samples count, and the range of the training trips where it is watched. `outputs`: name -> unit.
    """
    inputs = []
    for name in (*ROUTE_COLUMNS, *SIGNALS.values()):
        column = COLUMNS[name]
        entry: dict[str, Any] = {
            "name": name,
            "unit": column.unit,
            "minimum": _finite(column.minimum) if name != "time_s" else 0.0,
            "maximum": _finite(column.maximum),
            "required": name in REQUIRED_COLUMNS,
            "samples": "all" if name in ROUTE_COLUMNS else "first",
            "meaning": column.meaning,
        }
        seen = model.ranges_.get(name)
        if seen is not None:
            entry["training"] = [_finite(seen.low), _finite(seen.high)]
        inputs.append(entry)
    low, high = QUANTITIES["payload_mass_kg"].bounds
    inputs.append(
        {
            "name": "payload_mass_kg",
            "unit": "kg",
            "minimum": low,
            "maximum": high,
            "required": False,
            "samples": "trip",
            "meaning": "load on top of the car's test mass; 0 when not given",
        }
    )
    outputs = {
        "energy_wh": "Wh",
        "quantiles_wh": "Wh",
        "soc_arrival": "1, displayed",
        "soc_quantiles": "1, displayed, by probability",
        "wh_per_display": "Wh",
        "empty_at_m": "m, early, expected and late",
        "missing_wh": "Wh, least, expected and most",
        "p_arrive": "1, by displayed state of charge at the end",
        "leave_with": "soc_needed, reserve, probability, message",
        "series": "by column",
        "by_cause_wh": "Wh",
        "flags": "code, subject, value, unit, message",
    }
    return {"inputs": inputs, "outputs": outputs}


def vehicle_part(vehicle: Vehicle) -> dict[str, Any]:
    """A car as the document that gives the same car, with the source of every value."""
    document: dict[str, dict[str, Any]] = {}
    for key, entry in vehicle.entries.items():
        section, _, name = key.partition(".")
        value = list(entry.value) if isinstance(entry.value, tuple) else entry.value
        stored: dict[str, Any] = {"value": value, "unit": entry.unit, "source": entry.source}
        stored["licence"] = entry.licence
        stored |= {k: v for k, v in (("estimated", entry.estimated), ("scale", entry.scale)) if v}
        if entry.published is not None:
            stored["published"] = entry.published
        document.setdefault(section, {})[name] = stored
    part: dict[str, Any] = {
        "name": vehicle.name,
        "title": vehicle.title,
        "preset": vehicle.preset,
        "document": document,
        "anchor": vehicle.anchor,
    }
    if vehicle_of_part(part) != vehicle:  # some values were replaced after the car was loaded
        _take_values(document, vehicle)
    return part


def vehicle_of_part(part: Mapping[str, Any]) -> Vehicle:
    """Reverse of `vehicle_part`.

    Raises
    ------
    InvalidInput
        With every unknown or missing entry.
    """
    # Models stored before licences were recorded have none in their entries.
    sections, published = _without_published(part["document"])
    document = {**sections, "name": part["title"], "licence": "not-stated"}
    document["anchor"] = part.get(
        "anchor", "book"
    )  # nor has any of those been held against certified figures
    vehicle = vehicle_from_document(document, part["name"], "vehicle.json")
    entries = dict(vehicle.entries)
    entries |= {key: replace(entries[key], published=value) for key, value in published.items()}
    return replace(vehicle, preset=part["preset"], entries=MappingProxyType(entries))


def _without_published(document: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The sections of a stored car as a vehicle file has them, and the published values of entries that trips changed."""
    sections = {
        name: {key: dict(entry) for key, entry in section.items()} for name, section in document.items()
    }
    published = {}
    for name, section in sections.items():
        for key, entry in section.items():
            value = entry.pop("published", None)
            if value is not None:
                published[f"{name}.{key}"] = tuple(value) if isinstance(value, list) else value
    return sections, published


def _donor_part(donor: DonorModel) -> Stored:
    about, arrays = members_parts(donor.members, "corrector-elsewhere")
    values = {
        "fitted": about,
        **_scale_part(donor.scale),
        "scores": donor.scores.values.tolist(),
        "hidden": list(donor.masked_inputs),
    }
    return values, arrays


def _donor_of_part(values: Mapping[str, Any], parts: Mapping[str, Part]) -> DonorModel:
    return DonorModel(
        members_of_parts(values["fitted"], parts),
        _scale_of_part(values),
        ConformalScores(np.array(values["scores"], dtype=np.float64)),
        tuple(values["hidden"]),
    )


def _take_values(document: dict[str, dict[str, Any]], vehicle: Vehicle) -> None:
    """Put the values of the car's parts in place of those of its entries."""
    for section, entries in list(document.items()):
        part = getattr(vehicle, section)
        if part is None:
            del document[section]
            continue
        for field in fields(part):
            value, entry = getattr(part, field.name), entries.get(field.name)
            plain = list(value) if isinstance(value, tuple) else value
            if value is None or (entry is not None and entry["value"] == plain and "scale" not in entry):
                continue
            source, licence = "set after the car was loaded", "user"
            if entry is not None and entry["value"] == plain:
                source, licence = entry["source"], entry["licence"]
            scale = {"scale": "soc"} if field.metadata.get("scaled") else {}
            entries[field.name] = {
                "value": plain,
                "unit": field.metadata["unit"],
                "source": source,
                "licence": licence,
                **scale,
            }


def _scale_part(scale: TotalScale) -> dict[str, Any]:
    return {"scale": scale.values.tolist(), "course": asdict(scale.course), "least_share": scale.least_share}


def _scale_of_part(values: Mapping[str, Any]) -> TotalScale:
    """Errors of power are constant over a trip in models of older versions."""
    course = values.get("course", {"constant_w": 1.0, "drifts": []})
    drifts = tuple((float(sd_w), float(time_s)) for sd_w, time_s in course["drifts"])
    return TotalScale(
        np.array(values["scale"], dtype=np.float64),
        TimeCourse(float(course["constant_w"]), drifts),
        float(values.get("least_share", 0.0)),
    )


def _free_flow_part(found: FreeFlowUncertainty | None) -> dict[str, Any] | None:
    if found is None:
        return None
    return {
        "speed_m_s": found.factors.speed_m_s.tolist(),
        "factor": found.factors.factor.tolist(),
        "scale_variance": found.scale_variance,
        "local_variance_m": found.local_variance_m,
        "trips": found.trips,
    }


def _free_flow_of_part(part: Mapping[str, Any] | None) -> FreeFlowUncertainty | None:
    if part is None:
        return None
    factors = TravelTimeFactors(np.array(part["speed_m_s"]), np.array(part["factor"]))
    return FreeFlowUncertainty(factors, part["scale_variance"], part["local_variance_m"], part["trips"])


def _route_part(route: RouteUncertainty | None) -> dict[str, Any] | None:
    if route is None:
        return None
    lengths, variances = route.length_m.tolist(), route.variance.tolist()
    return {"length_m": lengths, "variance": variances, "trips": route.trips}


def _route_of_part(part: Mapping[str, Any] | None) -> RouteUncertainty | None:
    """Models of older versions have none."""
    if part is None:
        return None
    length, variance = (np.array(part[name], dtype=np.float64) for name in ("length_m", "variance"))
    return RouteUncertainty(length, variance, part["trips"])


def _finite(value: float) -> float | None:
    """None for an infinite value, which JSON cannot hold."""
    return value if math.isfinite(value) else None


def _bound(value: float | None, unbounded: float) -> float:
    return unbounded if value is None else value
