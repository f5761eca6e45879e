"""Write and read a model of a fleet as a folder of plain arrays and JSON with checksums, as every model of the package."""

from __future__ import annotations

from collections.abc import Collection
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from tripwatt.errors import InvalidInput, damage
from tripwatt.fleet.model import FleetModel
from tripwatt.hybrid.groups import GroupPosterior, Sums
from tripwatt.hybrid.stored import REFIT, new_converter, parts_tree, structured, tree_parts
from tripwatt.modelfile import read_model, write_model

if TYPE_CHECKING:
    from cattrs import Converter

KIND: Final = "fleet"
PACKAGES: Final = ("tripwatt", "numpy", "scipy", "pandas", "pyarrow", "lightgbm")


def save_fleet(model: FleetModel, folder: Path | str) -> None:
    """Write a model as a folder, whole or not at all.

    Raises
    ------
    InvalidInput
        If the folder cannot be used.
    """
    about = {
        "trips": model.trips,
        "vehicles": len(model.vehicles()),
        "car_models": sorted({group[0] for group in model.sums.groups}),
        "sampled": model.sampled,
        **model.about,
    }
    packages = {name: version(name) for name in PACKAGES}
    metadata = {"kind": KIND, "tripwatt": version("tripwatt"), "fleet": about, "packages": packages}
    write_model(folder, metadata, tree_parts(_converter().unstructure(model), KIND))


def load_fleet(folder: Path | str) -> FleetModel:
    """Read a model that `save_fleet` wrote, and check every byte.

    Raises
    ------
    InvalidInput
        If the folder is damaged or holds no model of a fleet.
    """
    stored = read_model(folder)
    if stored.metadata.get("kind") != KIND:
        got, fix = "a model of one car", "fit one with `tripwatt fleet fit`"
        raise InvalidInput.of("no model of a fleet", f"{folder}", got, "a model of a fleet", fix)
    with damage(folder, "", REFIT, "parts do not make a model of a fleet"):
        tree = parts_tree(stored.parts, KIND)
    return structured(tree, FleetModel, _converter(), "a model of a fleet")


@cache
def _converter() -> Converter:
    """Return the converter between a model and plain arrays; digests are kept as rows of bytes."""
    converter = new_converter()

    def from_arrays(arrays: Any, kind: Any) -> Any:
        return kind.from_arrays(converter.structure(arrays, dict[str, npt.NDArray[Any]]))

    for kind in (Sums, GroupPosterior):
        converter.register_unstructure_hook(kind, kind.to_arrays)
        converter.register_structure_hook(kind, from_arrays)
    converter.register_unstructure_hook_func(lambda kind: kind == frozenset[str], _bytes_of)
    converter.register_structure_hook_func(lambda kind: kind == frozenset[str], _digests_of)
    return converter


def _digests_of(rows: npt.NDArray[np.uint8], _: Any) -> frozenset[str]:
    return frozenset(row.tobytes().hex() for row in rows)


def _bytes_of(digests: Collection[str]) -> npt.NDArray[np.uint8]:
    """Return the digests as bytes, sorted, shape (digests, 32)."""
    return np.frombuffer(bytes.fromhex("".join(sorted(digests))), dtype=np.uint8).reshape(-1, 32)
