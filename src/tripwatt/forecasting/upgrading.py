"""Models of version 1 of the format, which tripwatt 0.1 and 0.2 wrote: their parts as the tree that is stored today.

The tables below hold the names of that version. What a model of tripwatt 0.1 lacks gets the value that its forecasts had.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np

from tripwatt.errors import InvalidInput
from tripwatt.hybrid.familiarity import FADING
from tripwatt.modelfile import Part

_NAMES: Final = {
    "apart": "split",
    "whole": "joint",
    "apart_spread": "split_sd_factor",
    "whole_spread": "joint_sd_factor",
}
"""Name in version 1 -> name of the field."""

_CORRECTORS: Final = {"kriging": "gp", "channels": "split"}
"""Name of a corrector in version 1 -> its name."""

_COLUMNS: Final = {"hvac_w": "climate_w"}
"""Name of a feature in version 1 -> its name."""

ADAPT_AGAIN: Final = "adapt the base again with this version of tripwatt"

_INFINITE: Final = {"low": -np.inf, "high": np.inf, "climate_limit_w": np.inf}
"""What an empty entry stands for."""


def version_1_tree(parts: Mapping[str, Part]) -> dict[str, Any]:
    """The tree of a model, as `tripwatt.hybrid.stored.parts_tree` gives it, from parts of version 1.

    Raises
    ------
    InvalidInput
        For a model that was adapted to a car.
    LookupError, TypeError, ValueError or AttributeError
        When they are no such parts.
    """
    values: Mapping[str, Any] = parts["model.json"]
    return {
        "segment_s": values["block_s"],
        "vehicle": _vehicle(parts["vehicle.json"]),
        "corrector": _CORRECTORS.get(values["corrector"], values["corrector"]),
        "seed": values["seed"],
        "corrector_": _corrector(values["fitted"], parts),
        "uncertainty_": {
            "process": with_bounds(_renamed(values["process"])),
            "scale": _scale(values),
            "scores": _scores(values),
            "shrinkage": {k: np.array(v, dtype=np.float64) for k, v in _renamed(values["gain"]).items()},
            "route": _with_arrays(values.get("route_doubt"), ("length_m", "variance")),
            "charge": values.get("charge"),
            "free_flow": _free_flow(values.get("free_flow")),
        },
        "ranges_": {name: range_values(seen) for name, seen in values["ranges"].items()},
        "trip_ids_": values["trip_ids"],
    }


def _renamed(values: Mapping[str, Any]) -> dict[str, Any]:
    return {_NAMES.get(name, name): value for name, value in values.items()}


def with_bounds(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values with what an empty entry stands for."""
    return {name: _INFINITE.get(name) if value is None else value for name, value in values.items()}


def range_values(values: Iterable[float | None]) -> dict[str, Any]:
    """The fields of a `Range` from its values in their order."""
    return with_bounds(dict(zip(("low", "high", "sd"), values, strict=True)))


def _with_arrays(values: Mapping[str, Any] | None, names: Iterable[str]) -> dict[str, Any] | None:
    if values is None:
        return None
    return {**values, **{name: np.array(values[name], dtype=np.float64) for name in names}}


def _scale(values: Mapping[str, Any]) -> dict[str, Any]:
    """Errors of power are constant over a trip in models of tripwatt 0.1."""
    return {
        "values": np.array(values["scale"], dtype=np.float64),
        "course": values.get("course", {"constant_w": 1.0, "drifts": []}),
        "least_share": values.get("least_share", 0.0),
    }


def _scores(values: Mapping[str, Any]) -> dict[str, Any]:
    return {"values": np.array(values["scores"], dtype=np.float64)}


def _free_flow(values: Mapping[str, Any] | None) -> dict[str, Any] | None:
    arrays = ("speed_m_s", "factor")
    flat = _with_arrays(values, arrays)
    return None if flat is None else {"factors": {name: flat.pop(name) for name in arrays}, **flat}


def _vehicle(part: Mapping[str, Any]) -> dict[str, Any]:
    """Cars were first stored without licences and anchors."""
    about = {"name": part["title"], "licence": "not-stated", "anchor": part.get("anchor", "published")}
    return {"name": part["name"], "preset": part["preset"], "document": {**part["document"], **about}}


def _corrector(about: Mapping[str, Any], parts: Mapping[str, Any]) -> dict[str, Any]:
    kind = _CORRECTORS.get(about["kind"], about["kind"])
    if kind == "ensemble":
        return {"kind": kind, "members": [_corrector(member, parts) for member in about["members"]]}
    if kind == "split":
        return {"kind": kind, **{name: _corrector(about[name], parts) for name in ("climate", "drive")}}
    arrays = dict(parts[about["arrays"]])
    if "columns" in arrays:
        arrays["columns"] = np.array(_columns(arrays["columns"].tolist()))
    if kind == "gp":
        shape = arrays.pop("shape")
        seen = about.get("familiar") or _kept_ranges(about["parts"], arrays)
        return {
            "kind": kind,
            "terms": [{**term, "columns": _columns(term["columns"])} for term in about["parts"]],
            "share_column": _columns([about["share_column"]])[0],
            "familiarity": {"ranges": {name: range_values(values) for name, values in seen.items()}},
            "shape": shape,
            "process": arrays,
        }
    if kind == "trees":
        rest = {"columns": _columns(about["columns"])}
        rest |= {name: about[name] for name in ("start", "rest", "divisor")}
        seen = {name: range_values(values) for name, values in about.get("familiar", {}).items()}
        return {"kind": kind, "trees": arrays, "familiarity": {"ranges": seen}, **rest}
    got, allowed = "a model that was adapted to a car", "a fitted model"
    raise InvalidInput.of("model of an older version", "model.json, fitted", got, allowed, ADAPT_AGAIN)


def _columns(names: Iterable[str]) -> list[str]:
    return [_COLUMNS.get(name, name) for name in names]


def _kept_ranges(terms: Iterable[Mapping[str, Any]], arrays: Mapping[str, Any]) -> dict[str, list[float]]:
    """Where a process of tripwatt 0.1 fades: outside of the ranges of the columns of its smooth terms."""
    smooth = {name for term in terms if term["kind"] == "smooth" for name in term["columns"]} or set(FADING)
    columns = zip(arrays["columns"].tolist(), arrays["ranges"].tolist(), arrays["sds"].tolist(), strict=True)
    seen = {name: [*ends, sd] for name, ends, sd in columns if name in smooth}
    return {name: seen[name] for name in FADING if name in seen}
