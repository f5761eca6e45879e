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
    from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn, override

    converter = new_converter()

    def from_arrays(arrays: Any, kind: Any) -> Any:
        return kind.from_arrays(converter.structure(arrays, dict[str, npt.NDArray[Any]]))

    for kind in (Sums, GroupPosterior):
        converter.register_unstructure_hook(kind, kind.to_arrays)
        converter.register_structure_hook(kind, from_arrays)
    digests = override(
        unstruct_hook=_bytes_of, struct_hook=lambda rows, _: frozenset(row.tobytes().hex() for row in rows)
    )
    unstructure = make_dict_unstructure_fn(FleetModel, converter, digests=digests)
    converter.register_unstructure_hook(FleetModel, unstructure)
    structure = make_dict_structure_fn(FleetModel, converter, digests=digests)
    converter.register_structure_hook(FleetModel, structure)
    return converter


def _bytes_of(digests: Collection[str]) -> npt.NDArray[np.uint8]:
    """Return the digests as bytes, sorted, shape (digests, 32)."""
    return np.frombuffer(bytes.fromhex("".join(sorted(digests))), dtype=np.uint8).reshape(-1, 32)
