"""Correctors of power as arrays and plain values, and back, so that a stored model corrects to the last bit alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Final, NoReturn

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput
from tripwatt.hybrid.car_corrector import HierarchicalCorrector
from tripwatt.hybrid.familiarity import FADING, Familiarity
from tripwatt.hybrid.hierarchy import Members
from tripwatt.hybrid.power import (
    EnsembleCorrector,
    GPCorrector,
    LearnerCorrector,
    PowerCorrector,
    fading_columns,
)
from tripwatt.hybrid.segments import SegmentTable
from tripwatt.hybrid.split import SplitCorrector
from tripwatt.learners.gp import KernelTerm
from tripwatt.learners.treetable import TreeTable

Arrays = Mapping[str, npt.NDArray[Any]]
Stored = tuple[dict[str, Any], dict[str, dict[str, npt.NDArray[Any]]]]
"""Plain values, and arrays by the name of their part."""

_SHAPE: Final = "shape"


@dataclass(frozen=True, eq=False)
class StoredTrees:
    """Trees that were fitted once: the boosting's sum or the forest's mean, evaluated without the learner.

    Attributes
    ----------
    trees : TreeTable
    columns : tuple of str
        Features that the trees split on, in their order.
    start, rest : float
        Added before and after the sum of the trees [W].
    divisor : int or None
        Number of trees of a mean; None for a sum.
    familiarity : Familiarity
        Where the correction is known; models of older versions have none and fade nowhere.
    """

    trees: TreeTable
    columns: tuple[str, ...]
    start: float
    rest: float
    divisor: int | None
    familiarity: Familiarity = field(default_factory=Familiarity)

    def __post_init__(self) -> None:
        if len(self.trees) and int(self.trees.split_feature.max()) >= len(self.columns):
            got = f"column {int(self.trees.split_feature.max())}"
            raise InvalidInput(
                Fault("wrong column of a split", "trees", got, f"0 to {len(self.columns) - 1}")
            )

    def fit(self, table: SegmentTable) -> NoReturn:
        """Not possible: only what prediction needs was stored."""
        raise InvalidInput(Fault("stored corrector cannot be fitted", "fit", fix="fit a new ForecastModel"))

    def clone_tuned(self) -> NoReturn:
        """Not possible, as `fit`."""
        raise InvalidInput(
            Fault("stored corrector cannot be fitted", "clone_tuned", fix="fit a new ForecastModel")
        )

    def predict(self, table: SegmentTable) -> FloatArray:
        """Residual power [W]."""
        values, names = table.features.to_numpy(dtype=np.float64), table.features.columns.tolist()
        X = values[:, [names.index(c) for c in self.columns]]
        total = self.trees.sum(X) + self.rest
        found = self.start + total if self.divisor is None else total / self.divisor
        return np.asarray(found * self.familiarity.share(table.features))

    def uncertainty_factor(self, table: SegmentTable) -> FloatArray:
        """Zeros: trees have no uncertainty of their own."""
        return np.zeros((len(table.hours), 1))

    def outside_factor(self, table: SegmentTable) -> FloatArray:
        """No columns: trees fade outside of their range and have no variance of their own."""
        return np.zeros((len(table.hours), 0))

    def predict_with_uncertainty(self, table: SegmentTable) -> tuple[FloatArray, FloatArray]:
        """`predict` and `uncertainty_factor`."""
        return self.predict(table), self.uncertainty_factor(table)

    def predict_climate(self, table: SegmentTable) -> FloatArray | None:
        """None: the trees correct climate control and driving jointly."""
        return None


def corrector_parts(corrector: PowerCorrector, name: str = "corrector") -> Stored:
    """A fitted corrector as plain values and arrays.

    Parameters
    ----------
    corrector : PowerCorrector
    name : str
        Begins the names of the parts with arrays.

    Raises
    ------
    InvalidInput
        For a corrector that cannot be stored.
    """
    if isinstance(corrector, EnsembleCorrector):
        stored = [corrector_parts(member, f"{name}-{i}") for i, member in enumerate(corrector.members)]
        arrays = {part: values for _, parts in stored for part, values in parts.items()}
        return {"kind": "ensemble", "members": [about for about, _ in stored]}, arrays
    if isinstance(corrector, SplitCorrector):
        if not corrector.split_:
            return corrector_parts(corrector.joint, name)
        both = ("climate", corrector.climate), ("drive", corrector.drive)
        stored_both = {key: corrector_parts(one, f"{name}-{key}") for key, one in both}
        arrays = {part: values for _, parts in stored_both.values() for part, values in parts.items()}
        return {"kind": "channels", **{key: about for key, (about, _) in stored_both.items()}}, arrays
    part = f"{name}.npz"
    if isinstance(corrector, GPCorrector):
        about: dict[str, Any] = {"kind": "kriging", "arrays": part, "share_column": corrector.share_column}
        about["parts"] = [asdict(t) | {"columns": list(t.columns)} for t in corrector.terms]
        about["familiar"] = corrector.familiarity.to_dict()
        return about, {part: {**corrector.model.to_arrays(), _SHAPE: corrector.shape}}
    if isinstance(corrector, HierarchicalCorrector):
        members, arrays = members_parts(corrector.base, f"{name}-base")
        about = {"kind": "transferred", "arrays": part, "base": members, "shares": list(corrector.shares)}
        own: dict[str, npt.NDArray[Any]] = {
            "scales": corrector.scales,
            "mean": corrector.mean,
            "factor": corrector.factor.astype(np.float32),
        }
        return about, {**arrays, part: own}
    trees = corrector if isinstance(corrector, StoredTrees) else _trees(corrector)
    about = {
        "kind": "trees",
        "arrays": part,
        "columns": list(trees.columns),
        "start": trees.start,
        "rest": trees.rest,
        "divisor": trees.divisor,
        "familiar": trees.familiarity.to_dict(),
    }
    return about, {part: trees.trees.to_arrays()}


def corrector_of_parts(about: Mapping[str, Any], parts: Mapping[str, Arrays]) -> PowerCorrector:
    """Reverse of `corrector_parts`.

    Raises
    ------
    InvalidInput
        For an unknown kind of corrector.
    """
    kind = about["kind"]
    if kind == "ensemble":
        return EnsembleCorrector([corrector_of_parts(member, parts) for member in about["members"]])
    if kind == "channels":
        climate, drive = (corrector_of_parts(about[key], parts) for key in ("climate", "drive"))
        return SplitCorrector(climate, drive, drive, True)
    if kind == "kriging":
        terms = tuple(KernelTerm(**{**p, "columns": tuple(p["columns"])}) for p in about["parts"])
        corrector = GPCorrector(terms, about["share_column"])
        arrays = dict(parts[about["arrays"]])
        corrector.shape = arrays.pop(_SHAPE)
        corrector.model.load_arrays(arrays)
        corrector.familiarity = _familiarity(about, corrector)
        if corrector.shape.shape != corrector.model.weights_.shape:
            got, allowed = f"{corrector.shape.shape}", f"{corrector.model.weights_.shape}"
            raise InvalidInput(Fault("wrong shape of an array", f"{about['arrays']}, shape", got, allowed))
        return corrector
    if kind == "transferred":
        base = members_of_parts(about["base"], parts)
        own = parts[about["arrays"]]
        factor = own["factor"].astype(np.float64)
        one = [about["share"]] * len(base.correctors) if "share" in about else about["shares"]  # before 0.2
        shares = tuple(float(share) for share in one)
        return HierarchicalCorrector(base, own["scales"], own["mean"], factor, shares)
    if kind == "trees":
        return StoredTrees(
            TreeTable.from_arrays(parts[about["arrays"]]),
            tuple(about["columns"]),
            float(about["start"]),
            float(about["rest"]),
            about["divisor"],
            Familiarity.from_dict(about.get("familiar", {})),
        )
    raise InvalidInput(
        Fault(
            "unknown kind of corrector",
            "model",
            repr(kind),
            "channels, ensemble, kriging, transferred, trees",
        )
    )


def _familiarity(about: Mapping[str, Any], corrector: GPCorrector) -> Familiarity:
    """Where a stored process is known; models of older versions keep the ranges of the smooth terms' columns alone."""
    if "familiar" in about:
        return Familiarity.from_dict(about["familiar"])
    model, smooth = corrector.model, fading_columns(corrector.terms)
    ranges: dict[str, list[float]] = {
        name: [*model.ranges_[name], model.sds_[name]]
        for name in FADING
        if name in smooth and name in model.ranges_
    }
    return Familiarity.from_dict(ranges)


def members_parts(
    members: Members, name: str
) -> tuple[list[dict[str, Any]], dict[str, dict[str, npt.NDArray[Any]]]]:
    """Gaussian processes as plain values and arrays."""
    stored = [corrector_parts(member, f"{name}-{i}") for i, member in enumerate(members.correctors)]
    return [about for about, _ in stored], {k: v for _, parts in stored for k, v in parts.items()}


def members_of_parts(about: Sequence[Mapping[str, Any]], parts: Mapping[str, Arrays]) -> Members:
    """Reverse of `members_parts`."""
    found = [corrector_of_parts(member, parts) for member in about]
    return Members(tuple(c for c in found if isinstance(c, GPCorrector)))


def _trees(corrector: PowerCorrector) -> StoredTrees:
    if not isinstance(corrector, LearnerCorrector) or not hasattr(corrector.model, "booster_"):
        got = type(corrector).__name__
        allowed = "linear, gp, boosting, forest, ensemble or split"
        raise InvalidInput(Fault("corrector cannot be stored", "corrector", got, allowed))
    model = corrector.model
    lone = model.position_ < 0
    n_trees = int((~lone).sum())
    text = "" if model.booster_ is None else model.booster_.model_to_string(num_iteration=-1)
    trees = TreeTable.from_text(text, n_trees)
    columns, familiar = corrector.features, corrector.familiarity
    if hasattr(model, "steps_"):
        rest = float(model.steps_[lone].sum())
        return StoredTrees(trees, columns, float(model.start_), rest, None, familiar)
    rest = float(model.values_[lone, 0].sum())
    return StoredTrees(trees, columns, 0.0, rest, len(model.position_), familiar)
