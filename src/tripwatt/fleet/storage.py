"""A model of a fleet as a folder: plain arrays and JSON with checksums, as every model of the package."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np

from tripwatt.errors import Fault, InvalidInput
from tripwatt.fleet.corrector import FleetTrees
from tripwatt.fleet.model import FleetModel
from tripwatt.hybrid.familiarity import Range
from tripwatt.hybrid.groups import GroupPosterior, Sums
from tripwatt.modelfile import read_model, write_model
from tripwatt.uncertainty import ChargeScale, ConformalScores, UncertaintyModel
from tripwatt.uncertainty.process import ResidualProcess
from tripwatt.uncertainty.residual_power import ComponentProcess
from tripwatt.uncertainty.scale import TimeCourse, TotalScale
from tripwatt.uncertainty.shrinkage import UpdateShrinkage

KIND: Final = "fleet"
PACKAGES: Final = ("tripwatt", "numpy", "scipy", "pandas", "pyarrow", "lightgbm")


def save_fleet(model: FleetModel, folder: Path | str) -> None:
    """Write a model as a folder, whole or not at all.

    Raises
    ------
    InvalidInput
        When the folder cannot be used.
    """
    limit = model.uncertainty.process.climate_limit_w
    values = {
        "process": asdict(model.uncertainty.process)
        | {"climate_limit_w": None if math.isinf(limit) else limit},
        "scale": {
            "values": model.uncertainty.scale.values.tolist(),
            "course": asdict(model.uncertainty.scale.course),
        },
        "charges": {name: asdict(charge) for name, charge in model.charges.items()},
        "ranges": {
            n: [v if math.isfinite(v) else None for v in (r.low, r.high)] + [r.sd]
            for n, r in model.ranges.items()
        },
        "trees": model.trees.text,
        "sampled": model.sampled,
        "about": model.about,
    }
    scores = {"all": model.uncertainty.scores, **model.scores}
    shrinkage = model.uncertainty.shrinkage
    write_model(
        folder,
        {
            "kind": KIND,
            "tripwatt": version("tripwatt"),
            "fleet": {
                "trips": model.trips,
                "vehicles": len(model.vehicles()),
                "car_models": sorted({group[0] for group in model.sums.groups}),
                "sampled": model.sampled,
                **model.about,
            },
            "packages": {name: version(name) for name in PACKAGES},
        },
        {
            "fleet.json": values,
            "sums.npz": model.sums.to_arrays(),
            "posterior.npz": model.posterior.to_arrays(),
            "scores.npz": {name: s.values for name, s in scores.items()},
            "shrinkage.npz": {f.name: np.asarray(getattr(shrinkage, f.name)) for f in fields(shrinkage)},
            "digests.npz": {"digests": _packed(sorted(model.digests))},
        },
    )


def load_fleet(folder: Path | str) -> FleetModel:
    """Read a model that `save_fleet` wrote, and check every byte.

    Raises
    ------
    InvalidInput
        When it is damaged, or no model of a fleet.
    """
    found = read_model(folder)
    if found.metadata.get("kind") != KIND:
        got, fix = "a model of one car", "fit one with `tripwatt fleet fit`"
        raise InvalidInput(Fault("no model of a fleet", f"{folder}", got, "a model of a fleet", fix))
    try:
        return _model(found.parts)
    except (KeyError, TypeError) as error:
        got, fix = f"{type(error).__name__}: {error}", "fit the fleet again with this version of tripwatt"
        raise InvalidInput(
            Fault("parts do not make a model of a fleet", f"{folder}", got, "", fix)
        ) from error


def _model(parts: Mapping[str, Any]) -> FleetModel:
    values = parts["fleet.json"]
    process = dict(values["process"])
    limit = process["climate_limit_w"]
    course = values["scale"]["course"]
    scores = {name: ConformalScores(a) for name, a in parts["scores.npz"].items()}
    uncertainty = UncertaintyModel(
        ResidualProcess(
            **process
            | {
                "drive": ComponentProcess(**process["drive"]),
                "climate": ComponentProcess(**process["climate"]),
                "climate_limit_w": math.inf if limit is None else limit,
            }
        ),
        TotalScale(
            np.array(values["scale"]["values"]),
            TimeCourse(course["constant_w"], tuple((float(a), float(b)) for a, b in course["drifts"])),
        ),
        scores.pop("all"),
        UpdateShrinkage(**parts["shrinkage.npz"]),
    )
    return FleetModel(
        Sums.from_arrays(parts["sums.npz"]),
        GroupPosterior.from_arrays(parts["posterior.npz"]),
        FleetTrees(values["trees"]),
        uncertainty,
        scores,
        {name: ChargeScale(**charge) for name, charge in values["charges"].items()},
        {
            name: Range(-math.inf if low is None else low, math.inf if high is None else high, sd)
            for name, (low, high, sd) in values["ranges"].items()
        },
        frozenset(row.tobytes().hex() for row in parts["digests.npz"]["digests"]),
        values["sampled"],
        dict(values["about"]),
    )


def _packed(digests: Sequence[str]) -> Any:
    """Digests as bytes, shape (digests, 32)."""
    return np.frombuffer(bytes.fromhex("".join(digests)), dtype=np.uint8).reshape(-1, 32)
