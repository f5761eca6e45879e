"""Store a forecast model as a directory and load it again; the loaded model gives bit-identical forecasts.

The car is stored with all its values and their sources, so that a later change of the bundled cars changes no stored
model. `model.json` is the model, field by field, and `model.npz` its arrays.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, get_origin, get_type_hints

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.errors import DAMAGE, InvalidInput, damage, excerpt, raise_faults, require_type
from tripwatt.forecasting.document import ForecastResponse
from tripwatt.forecasting.model import ForecastModel
from tripwatt.forecasting.plausible import impossible_faults
from tripwatt.hybrid import Corrector, segment_table
from tripwatt.hybrid.correctors import corrector_name
from tripwatt.hybrid.outside import fitted_outside
from tripwatt.hybrid.segments import SEGMENT_S
from tripwatt.hybrid.stored import REFIT, new_converter, parts_tree, structured, tree_parts, with_outside
from tripwatt.modelfile import Part, read_metadata, read_model, write_model
from tripwatt.physics import simulate_trip
from tripwatt.trips import (
    COLUMNS,
    QUANTITIES,
    REQUIRED_COLUMNS,
    ROUTE_COLUMNS,
    SIGNALS,
    Departure,
    Plan,
)
from tripwatt.vehicles import Vehicle, vehicle_document, vehicle_from_document, vehicle_names

if TYPE_CHECKING:
    from cattrs import Converter

GIVEN: Final = "given the driven speed trace"
"""Condition under which the figures of a model hold."""

TRIAL: Final = "trial_w"
"""Key of the correction that a corrector from outside gives on the trial trip."""

TRIAL_DEGC: Final = (-15.0, 40.0)
"""Outside temperatures of trial trips [°C], besides the one assumed for a departure of which nothing is known."""

DEFAULT_MODEL: Final = "bmw_i3_tum"
"""The model that comes with the package."""


def model_of_parts(parts: Mapping[str, Part], outside: Corrector | None = None) -> ForecastModel:
    """The model of the parts that `save_model` wrote; `outside` is the fitted object from outside.

    Raises
    ------
    InvalidInput
        If the parts do not make a model, with every reason, or if the object from outside is missing or is not the
        one that was fitted with the model.
    """
    with damage("model", "", REFIT, "parts do not make a forecast model"):
        tree = parts_tree(parts)
        segment_s, before_w = tree.pop("segment_s"), tree.pop(TRIAL, None)
    if segment_s != SEGMENT_S:
        got, allowed = f"segments of {excerpt(segment_s)} s", f"segments of {SEGMENT_S:g} s"
        raise InvalidInput.of("model of an older version", "model.json, segment_s", got, allowed, REFIT)
    model = structured(tree, ForecastModel, _converter(), "a forecast model")
    if model.corrector_ is not None:
        model.corrector_ = with_outside(model.corrector_, outside)
    if outside is not None:
        model.corrector = outside
        try:
            same = np.allclose(_trial_correction_w(model), before_w, rtol=1e-6, atol=1e-6)
        except DAMAGE:  # the object is not fitted, or was fitted to another input
            same = False
        if not same:
            allowed = "the object that was fitted with the model"
            raise InvalidInput.of("another corrector", "corrector", f"{outside!r}"[:80], allowed)
    return model


def _trial_correction_w(model: ForecastModel) -> FloatArray:
    """Correction on a trial trip at -5 °C and at 25 °C [W], by which a stored corrector from outside the package is recognised."""
    corrector, _ = model.fitted_parts("a trial")
    plan = Plan.from_samples(_trial_drive(), "trial")
    plans = [plan.with_departure(Departure(ambient_temperature_degc=degc)) for degc in (-5.0, 25.0)]
    tables = (segment_table(known, simulate_trip(model.vehicle, known)) for known in plans)
    return np.concatenate([corrector.predict(table) for table in tables])


@cache
def _converter() -> Converter:
    from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn, override

    converter = new_converter()
    converter.register_unstructure_hook(Vehicle, vehicle_values)
    converter.register_structure_hook(Vehicle, lambda values, _: vehicle_of_values(values))
    without = override(omit=True)  # the scores of the held-out trips are part of the metadata
    named = override(unstruct_hook=corrector_name, struct_hook=lambda name, _: converter.structure(name, str))
    converter.register_unstructure_hook_factory(  # made for the first model that is stored
        lambda kind: kind is ForecastModel,
        lambda kind: make_dict_unstructure_fn(kind, converter, held_out_=without, corrector=named),
    )
    structure = make_dict_structure_fn(
        ForecastModel, converter, _cattrs_forbid_extra_keys=True, held_out_=without, corrector=named
    )
    converter.register_structure_hook(ForecastModel, structure)
    return converter


def vehicle_values(vehicle: Vehicle) -> dict[str, Any]:
    """Return a car as plain values, with the source of every value."""
    return {"name": vehicle.name, "preset": vehicle.preset, "document": vehicle_document(vehicle)}


def vehicle_of_values(values: Mapping[str, Any]) -> Vehicle:
    """Reverse of `vehicle_values`.

    Raises
    ------
    InvalidInput
        Lists every unknown or missing entry.
    """
    vehicle = vehicle_from_document(values["document"], str(values["name"]), "vehicle")
    return replace(vehicle, preset=str(values["preset"]))


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
        A fitted model.
    folder : path
        A new or empty folder, or one that holds a model, which is replaced.
    provenance : mapping, optional
        Origin of the model, as from `fitting.fit_with_provenance`: data, audit, trips, versions.
    evaluation : mapping, optional
        Errors of the model on held-out trips.

    Raises
    ------
    InvalidInput
        If the model cannot be stored or the folder cannot be used.

    Examples
    --------
    >>> import tempfile
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> trips = synthetic_fleet(n_trips=9).trips
    >>> model = ForecastModel(load_vehicle("bmw_i3_60ah"), corrector="linear").fit(trips[:8])
    >>> with tempfile.TemporaryDirectory() as place:
    ...     save_model(model, Path(place) / "model")
    ...     again = load_model(Path(place) / "model")
    >>> again.forecast(trips[8]).energy_wh == model.forecast(trips[8]).energy_wh
    True
    """
    from importlib.metadata import version  # reads files of the installation

    require_type("model", model, ForecastModel, "a ForecastModel")
    corrector, _ = model.fitted_parts("store")
    tree = {"segment_s": SEGMENT_S, **_converter().unstructure(model)}
    if fitted_outside(corrector) is not None:
        tree[TRIAL] = _trial_correction_w(model)
    about = model.to_dict()
    del about["training"]  # the contract has it
    metadata = {
        "tripwatt": version("tripwatt"),
        "given": GIVEN,
        "model": {**about, "vehicle_preset": model.vehicle.preset},
        "contract": contract(model),
        "provenance": dict(require_type("provenance", provenance or {}, Mapping, "a Mapping")),
        "evaluation": dict(require_type("evaluation", evaluation or {}, Mapping, "a Mapping")),
    }
    write_model(folder, metadata, tree_parts(tree))


def load_model(folder: Path | str | None = None, *, corrector: Corrector | None = None) -> ForecastModel:
    """Load a stored model, or the one that comes with the package if no folder is given.

    Parameters
    ----------
    folder : path, optional
        Folder that `save_model` or `tripwatt fit` wrote.
    corrector : Corrector, optional
        The fitted object from outside, if the model has one (`ForecastModel.outside`). It is not stored with the model: keep
        it as its own package advises.

    Returns
    -------
    ForecastModel
        The fitted model.

    Raises
    ------
    InvalidInput
        If there is no model, or the model is damaged, altered, of another format, or gives forecasts that are not finite.
        Also if `corrector` is missing for a model that needs one, or is not the one fitted with the model.

    Examples
    --------
    >>> import tripwatt as tw
    >>> tw.load_model().vehicle.title
    'BMW i3 60 Ah'
    """
    place = model_folder(folder)
    stored = read_model(place)
    model = model_of_parts(stored.parts, corrector)
    if folder is not None:
        require_usable(model, f"{place}")
    return model


def require_usable(model: ForecastModel, where: str) -> None:
    """Raise InvalidInput if a loaded model gives no usable forecast of trial trips of three minutes or of an update on the way.

    Parts of a model may have the right shapes and still hold values with which no trip can be forecast.

    Raises
    ------
    InvalidInput
        If a forecast fails, has a number that is not finite or quantiles that cross, or exceeds what battery and motor can give.
    """
    drive = _trial_drive()
    observed = pd.DataFrame({"time_s": drive["time_s"][:61], "voltage_v": 350.0, "current_a": 30.0})
    try:
        with np.errstate(all="ignore"):
            before = model.forecast(Plan.from_samples(drive, "trial"))
            trials = [replace(before.plan, link_m=250.0)]
            trials += [before.plan.with_departure(Departure(ambient_temperature_degc=t)) for t in TRIAL_DEGC]
            forecasts = [before, *map(model.forecast, trials)]
            for forecast in forecasts:
                raise_faults(impossible_faults(forecast.interval(0.9)[1], forecast.drive))
            documents = [forecast.to_dict() for forecast in (*forecasts, before.update(observed))]
            quantiles = [list(document["quantiles_wh"].values()) for document in documents]
            json.dumps(documents, allow_nan=False)
    except InvalidInput as error:
        got = error.faults[0].what
    except DAMAGE as error:
        got = f"{type(error).__name__}: {error}"[:200]
    else:
        if quantiles == [*map(sorted, quantiles)]:
            return
        got = "quantiles that cross"
    raise InvalidInput.of("model gives no forecast", where, got, "a finite forecast of a trial trip", REFIT)


def _trial_drive() -> pd.DataFrame:
    time = np.arange(181.0)
    speed = 12.0 - 12.0 * np.cos(time * (2.0 * math.pi / 60.0))
    return pd.DataFrame({"time_s": time, "speed_m_s": speed, "elevation_m": 500.0})


def load_metadata(folder: Path | str | None = None, *, check_parts: bool = True) -> dict[str, Any]:
    """Read the metadata of a stored model, or of the one that comes with the package.

    Parameters
    ----------
    folder : path, optional
        Folder of the stored model.
    check_parts : bool
        Whether every part is read and checked as well.

    Returns
    -------
    dict
        The metadata as `save_model` wrote them.

    Raises
    ------
    InvalidInput
        If there is no model, or it is damaged, altered or of another format.

    Examples
    --------
    >>> sorted(load_metadata(check_parts=False))[:2]
    ['contract', 'evaluation']
    """
    place = model_folder(folder)
    return dict(read_model(place).metadata) if check_parts else read_metadata(place)


def model_folder(folder: Path | str | None = None) -> Path:
    """Find the folder of a model.

    Parameters
    ----------
    folder : path, optional
        Folder of a stored model, or the name of the model that comes with the package.

    Returns
    -------
    Path
        The given folder, or that of the model that comes with the package if none is given.

    Raises
    ------
    InvalidInput
        If the folder is neither a path nor a text, or does not exist and cars of the library have such names.

    Examples
    --------
    >>> model_folder().name
    'bmw_i3_tum'
    """
    allowed = "a ForecastModel, or the folder of one"
    place = Path(require_type("model", DEFAULT_MODEL if folder is None else folder, str | Path, allowed))
    if folder is None or (f"{place}" == DEFAULT_MODEL and not place.exists()):
        return Path(__file__).parents[1] / "models" / DEFAULT_MODEL
    cars = () if place.exists() else [name for name in vehicle_names() if name.startswith(f"{place}")]
    if cars:
        fix = f"{cars[0]} is a car of the library: pass car='{cars[0]}', on the command line --car {cars[0]}"
        raise InvalidInput.of("no model", f"{place}", "the name of a car", allowed, fix)
    return place


def contract(model: ForecastModel) -> dict[str, Any]:
    """Inputs and outputs of a model: names, units, bounds, and training ranges.

    Returns
    -------
    dict
        `inputs`: for each column of a trip, and for the payload, its unit, bounds, meaning, whether it is required, and
        which samples count; also the range of the training trips, if the model has one. `outputs`: name -> unit.
    """
    payload = {"payload_mass_kg": QUANTITIES["payload_mass_kg"]}
    inputs = []
    known = {name: COLUMNS[name] for name in (*ROUTE_COLUMNS, *SIGNALS.values())} | payload
    for name, column in known.items():
        entry: dict[str, Any] = {
            "name": name,
            "unit": column.unit,
            "minimum": _finite(column.minimum) if name != "time_s" else 0.0,
            "maximum": _finite(column.maximum),
            "required": name in REQUIRED_COLUMNS,
            "samples": "all" if name in ROUTE_COLUMNS else "trip" if name in payload else "first",
            "meaning": column.meaning,
        }
        seen = model.ranges_.get(name)
        if seen is not None:
            entry["training"] = [_finite(seen.low), _finite(seen.high)]
        inputs.append(entry)
    answer = get_type_hints(ForecastResponse, include_extras=True)
    outputs = {name: kind.__metadata__[0] for name, kind in answer.items() if get_origin(kind) is Annotated}
    return {"inputs": inputs, "outputs": outputs}


def _finite(value: float) -> float | None:
    """Return the value, or None if it is not finite, which JSON cannot hold."""
    return value if math.isfinite(value) else None
