"""Conversion of fitted objects to plain values and arrays and back; a stored model gives bit-identical corrections.

Dataclasses are converted by their annotated fields; each kind of corrector has a name. A tree of such values is stored as one
JSON document and one archive of arrays, in which each array is named by its place in the tree.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final, TypeVar, get_args, get_origin

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput, excerpt, first_faults, raise_faults
from tripwatt.hybrid.covariates import CovariateCorrector
from tripwatt.hybrid.factors import FactorCorrector
from tripwatt.hybrid.familiarity import Familiarity
from tripwatt.hybrid.outside import Corrector, TableCorrector, fitted_outside
from tripwatt.hybrid.power import (
    EnsembleCorrector,
    GPCorrector,
    LearnerCorrector,
    PowerCorrector,
    SplitCorrector,
)
from tripwatt.hybrid.segments import SegmentTable
from tripwatt.learners.gp import KernelTerm
from tripwatt.learners.outside import OutsideRegressor
from tripwatt.learners.treetable import TreeTable
from tripwatt.modelfile import Part

if TYPE_CHECKING:
    from cattrs import Converter

T = TypeVar("T")

_ARRAY: Final = "array"
_NUMBER: Final = "number"
"""Keys of a reference to an array, and of a number that JSON cannot hold."""

OUTSIDE: Final = "outside"
"""Kind of a corrector around an object from outside."""

REFIT: Final = "fit the model again with this version of tripwatt"


MAX_MEMBERS: Final = 20
"""Largest number of members of an ensemble; the ensembles of the package have 2."""

RANGES: Final[Mapping[str, tuple[float, float]]] = {
    r"sds?(_w|_factor)?|variances?(_m)?|wh2|noise|onset|trips|least_share": (0.0, math.inf),
    r"(constant|limit)_w|drifts\.\d+\.0|(scale|scores)\.values": (0.0, math.inf),
    r"time_s|length(_m)?|speed_m_s|factors\.factor|wh_per_display|drifts\.\d+\.1": (1e-9, math.inf),
    r"shrinkage\.(climate|drive|joint|off)": (0.0, 1.0),
    r"zero_soc": (-0.5, 0.5),
    r"full_soc": (0.5, 1.5),
}
"""Regular expression for the end of a value's place in a stored model -> least and largest meaningful value."""

ASCENDING: Final = r"scores\.values|length_m|factors\.speed_m_s|process\.ranges"


@dataclass(frozen=True, eq=False)
class StoredTrees(PowerCorrector):
    """Fitted trees, evaluated without the learner: the sum of a boosting or the mean of a forest.

    Attributes
    ----------
    trees : TreeTable
    columns : tuple of str
        Features that the trees split on, in order.
    start, rest : float
        Power besides that of the trees [W]; `rest` is part of the mean.
    divisor : int or None
        Number of trees of a mean; None for a sum.
    familiarity : Familiarity
        Training ranges outside of which the correction fades.
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
            raise InvalidInput.of("wrong column of a split", "trees", got, f"0 to {len(self.columns) - 1}")

    @classmethod
    def from_learner(cls, corrector: LearnerCorrector) -> StoredTrees:
        """Take the trees of a fitted learner.

        Raises
        ------
        InvalidInput
            If the learner has no trees.
        """
        model = corrector.model
        if not hasattr(model, "trees_"):
            raise InvalidInput(_unstorable(corrector))
        booster, n_trees, rest = model.trees_
        trees = TreeTable.from_text(
            "" if booster is None else booster.model_to_string(num_iteration=-1), n_trees
        )
        return cls(trees, corrector.features, model.start_, rest, model.divisor_, corrector.familiarity)

    def predict(self, table: SegmentTable) -> FloatArray:
        """Residual power [W]."""
        X = np.column_stack([table.columns[c] for c in self.columns])
        power = self.start + (self.trees.sum(X) + self.rest) / (self.divisor or 1)
        return np.asarray(power * self.familiarity.share(table.columns))


KINDS: Final[Mapping[str, type]] = {
    "gp": GPCorrector,
    "ensemble": EnsembleCorrector,
    "split": SplitCorrector,
    "factors": FactorCorrector,
    "trees": StoredTrees,
    "covariates": CovariateCorrector,
}
"""Name of each kind of corrector in a stored model."""


@dataclass(frozen=True, slots=True)
class Missing:
    """Placeholder for an object from outside; `name` is the name of its class."""

    name: str


def new_converter() -> Converter:
    """Make a converter of correctors, arrays and strict plain values; packages that use it add hooks for their own classes."""
    from cattrs import Converter  # slow to import
    from cattrs.strategies import configure_union_passthrough

    converter = Converter(forbid_extra_keys=True)
    for kind, types in {float: (float, int), int: (int,), str: (str,), bool: (bool,)}.items():
        converter.register_structure_hook(kind, partial(_strict, kind, types))
    configure_union_passthrough(float | str | None, converter)
    converter.register_structure_hook_func(_is_array, _array)
    converter.register_unstructure_hook_func(_is_array, lambda array: array)
    converter.register_unstructure_hook(GPCorrector, lambda gp: _gp_values(gp, converter))
    converter.register_structure_hook(GPCorrector, lambda values, _: _gp(values, converter))

    def is_any(kind: Any) -> bool:
        return kind is PowerCorrector

    converter.register_unstructure_hook_func(is_any, lambda fitted: _corrector_values(fitted, converter))
    converter.register_structure_hook_func(is_any, lambda values, _: _corrector(values, converter))
    return converter


def _strict(kind: type[T], types: tuple[type, ...], value: Any, _: Any) -> T:
    """Accept a plain value of given types only: neither text nor a truth value counts as a number."""
    if not isinstance(value, types) or (isinstance(value, bool) and kind is not bool):
        raise TypeError(f"got {excerpt(value)}, not {kind.__name__}")
    return kind(value)  # type: ignore[call-arg]


def _is_array(kind: Any) -> bool:
    return kind is np.ndarray or get_origin(kind) is np.ndarray


def _array(value: Any, kind: Any) -> npt.NDArray[Any]:
    """Convert an array to its annotated type; stored floats may be in single precision."""
    if not isinstance(value, np.ndarray):
        raise TypeError(f"got {excerpt(value)}, not an array")
    wanted = next(iter(get_args(get_args(kind)[1])), Any)
    if wanted is Any:
        return value.astype(np.float64) if value.dtype.kind == "f" else value
    if value.dtype.kind != np.dtype(wanted).kind:
        raise TypeError(f"got an array of {value.dtype}, not of {np.dtype(wanted)}")
    return value.astype(wanted)


def _gp_values(corrector: GPCorrector, converter: Converter) -> dict[str, Any]:
    return {
        "terms": converter.unstructure(corrector.terms),
        "share_column": corrector.share_column,
        "familiarity": converter.unstructure(corrector.familiarity),
        "shape": corrector.shape,
        "process": corrector.model.to_arrays(),
    }


def _gp(values: Mapping[str, Any], converter: Converter) -> GPCorrector:
    terms = converter.structure(values["terms"], tuple[KernelTerm, ...])
    corrector = GPCorrector(terms, converter.structure(values["share_column"], str))
    corrector.familiarity = converter.structure(values["familiarity"], Familiarity)
    arrays = converter.structure(values["process"], dict[str, npt.NDArray[Any]])
    corrector.model.load_arrays(arrays)
    corrector.shape = converter.structure(values["shape"], FloatArray)
    if corrector.shape.shape != corrector.model.weights_.shape:
        got, allowed = f"{corrector.shape.shape}", f"{corrector.model.weights_.shape}"
        raise InvalidInput.of("wrong shape of an array", "shape", got, allowed)
    return corrector


def _corrector_values(corrector: PowerCorrector, converter: Converter) -> dict[str, Any]:
    if isinstance(corrector, SplitCorrector) and not corrector.split_:
        return _corrector_values(corrector.joint, converter)
    if not isinstance(corrector, CovariateCorrector) and fitted_outside(corrector) is not None:
        return _outside_values(corrector, converter)
    if isinstance(corrector, LearnerCorrector):
        corrector = StoredTrees.from_learner(corrector)
    kind = next((name for name, known in KINDS.items() if type(corrector) is known), None)
    if kind is None:
        raise InvalidInput(_unstorable(corrector))
    if isinstance(corrector, SplitCorrector):
        parts = {"climate": corrector.climate, "drive": corrector.drive}
        return {"kind": kind, **{name: _corrector_values(part, converter) for name, part in parts.items()}}
    return {"kind": kind, **converter.unstructure(corrector)}


def _corrector(values: Mapping[str, Any], converter: Converter) -> PowerCorrector:
    kind, inner = values["kind"], {name: value for name, value in values.items() if name != "kind"}
    if kind == OUTSIDE:
        return _awaiting(inner, converter)
    if kind not in KINDS:
        raise InvalidInput(Fault.unknown("unknown kind of corrector", "kind", kind, KINDS))
    if kind == "split":
        climate, drive = (_corrector(inner[name], converter) for name in ("climate", "drive"))
        return SplitCorrector(climate, drive, drive, True)
    corrector: PowerCorrector = converter.structure(inner, KINDS[kind])
    return corrector


def _outside_values(corrector: PowerCorrector, converter: Converter) -> dict[str, Any]:
    """Values of a corrector around an object from outside; the object itself is not stored."""
    values: dict[str, Any] = {"kind": OUTSIDE, "name": type(fitted_outside(corrector)).__name__}
    values["familiarity"] = converter.unstructure(corrector.familiarity)
    if isinstance(corrector, LearnerCorrector):
        values["features"] = list(corrector.features)
        values["medians"] = corrector.model.medians_
    return values


def _awaiting(values: Mapping[str, Any], converter: Converter) -> PowerCorrector:
    """Make a corrector with a placeholder, which `with_outside` replaces by the object from outside."""
    missing = Missing(converter.structure(values["name"], str))
    corrector: PowerCorrector = TableCorrector(missing)
    if "medians" in values:
        around = OutsideRegressor(missing)
        around.medians_ = converter.structure(values["medians"], dict[str, float])
        corrector = LearnerCorrector(around, converter.structure(values["features"], tuple[str, ...]))
    corrector.familiarity = converter.structure(values["familiarity"], Familiarity)
    return corrector


def with_outside(corrector: PowerCorrector, fitted: Corrector | None) -> PowerCorrector:
    """Return a corrector that was read, with its fitted object from outside put back.

    Raises
    ------
    InvalidInput
        If the corrector needs an object and none is given, or needs none and one is given.
    """
    if isinstance(corrector, CovariateCorrector):
        return replace(corrector, base=with_outside(corrector.base, fitted))
    missing = corrector.model.regressor if isinstance(corrector, LearnerCorrector) else None
    missing = corrector.model if isinstance(corrector, TableCorrector) else missing
    if not isinstance(missing, Missing):
        if fitted is None:
            return corrector
        got = type(fitted).__name__
        raise InvalidInput.of("corrector has no effect", "corrector", got, "the model is whole")
    if fitted is None:
        fix = "load_model(FOLDER, corrector=FITTED), with the `outside` of the model that was stored"
        allowed = f"a fitted {missing.name}"
        raise InvalidInput.of("model lacks its corrector", "corrector", "none", allowed, fix)
    if isinstance(corrector, TableCorrector):
        corrector.unfitted = corrector.model = fitted
        return corrector
    assert isinstance(corrector, LearnerCorrector)
    corrector.model.regressor = corrector.model.regressor_ = fitted
    return corrector


def _unstorable(corrector: object) -> Fault:
    allowed = "linear, gp, boosting, forest, ensemble or split"
    return Fault("corrector cannot be stored", "corrector", type(corrector).__name__, allowed)


def tree_parts(tree: Mapping[str, Any], name: str = "model") -> dict[str, Part]:
    """Split a tree of plain values and arrays into the parts of a model; `parts_tree` is the reverse."""
    arrays: dict[str, npt.NDArray[Any]] = {}

    def plain(value: Any, place: str) -> Any:
        if isinstance(value, np.ndarray):
            arrays[place] = value
            return {_ARRAY: place}
        if isinstance(value, Mapping):
            return {key: plain(inner, f"{place}.{key}".lstrip(".")) for key, inner in value.items()}
        if isinstance(value, list | tuple):
            return [plain(inner, f"{place}.{i}") for i, inner in enumerate(value)]
        return {_NUMBER: repr(value)} if isinstance(value, float) and math.isinf(value) else value

    return {f"{name}.json": plain(tree, ""), f"{name}.npz": arrays}


def parts_tree(parts: Mapping[str, Part], name: str = "model") -> dict[str, Any]:
    """Reverse of `tree_parts`.

    Raises
    ------
    LookupError
        If a part or an array is missing.
    """
    arrays = parts[f"{name}.npz"]

    def whole(value: Any) -> Any:
        if isinstance(value, Mapping):
            if value.keys() == {_ARRAY}:
                return arrays[value[_ARRAY]]
            if value.keys() == {_NUMBER}:
                return float(value[_NUMBER])
            return {key: whole(inner) for key, inner in value.items()}
        return [whole(inner) for inner in value] if isinstance(value, list) else value

    tree: dict[str, Any] = whole(parts[f"{name}.json"])
    return tree


def structured(values: Any, kind: type[T], converter: Converter, what: str) -> T:
    """Make an object from plain values.

    Parameters
    ----------
    values : mapping or list
        Values from `parts_tree`.
    kind : type
        Type of the object.
    converter : Converter
    what : str
        Name of the object in messages.

    Raises
    ------
    InvalidInput
        Lists every value that does not fit or is out of range, with its place.
    """
    raise_faults(first_faults(list(value_faults(values)), what))
    try:
        return converter.structure(values, kind)
    except Exception as error:
        raise InvalidInput(list(_faults(error, what, ""))) from error


def value_faults(values: Any, place: str = "") -> Iterator[Fault]:
    """Yield faults for numbers of a stored model that are out of range or out of order. O(values).

    Examples
    --------
    >>> for fault in value_faults({"drive": {"drift_time_s": -70.0}, "range": {"low": 3.0, "high": 1.0}}):
    ...     print(fault)
    value out of range: model.drive.drift_time_s: got -70; allowed: 1e-09 to inf; fit the model again with this version of tripwatt
    values out of order: model.range: got low and high [3.0, 1.0]; allowed: ascending; fit the model again with this version of tripwatt
    """
    where = f"model{place}"
    if isinstance(values, Mapping):
        ends = [values.get(name) for name in ("low", "high")]
        if all(isinstance(end, int | float) for end in ends) and ends != sorted(ends):  # type: ignore[type-var]
            yield Fault("values out of order", where, f"low and high {ends}", "ascending", REFIT)
        for name, value in values.items():
            if name != "vehicle":  # checked as the file of a car is
                yield from value_faults(value, f"{place}.{name}")
    elif isinstance(values, list | tuple):
        if place.endswith("members") and len(values) > MAX_MEMBERS:
            yield Fault("too many members", where, f"{len(values)}", f"at most {MAX_MEMBERS}", REFIT)
            return
        for number, value in enumerate(values):
            yield from value_faults(value, f"{place}.{number}")
    elif (array := np.asarray(values)).dtype.kind in "fi":
        for names, (least, most) in RANGES.items():
            if _ends(place, names) and (wrong := (array < least) | (array > most)).any():
                got, allowed = f"{array[wrong][0]:g}", f"{least:g} to {most:g}"
                yield Fault("value out of range", where, got, allowed, REFIT)
        if _ends(place, ASCENDING) and array.ndim and (np.diff(array) < 0.0).any():
            yield Fault("values out of order", where, "a value below the one before", "ascending", REFIT)


def _ends(place: str, names: str) -> bool:
    return re.search(rf"[._]({names})$", place) is not None


def _faults(error: BaseException, what: str, place: str) -> Iterator[Fault]:
    """Yield the faults of an error and of the errors in its group; the notes of cattrs name their places."""
    for note in getattr(error, "__notes__", ()):
        step = getattr(note, "name", getattr(note, "index", ""))
        place = f"{place}.{step}".lstrip(".")
    if isinstance(error, BaseExceptionGroup):
        for inner in error.exceptions:
            yield from _faults(inner, what, place)
    elif isinstance(error, InvalidInput):
        yield from error.faults
    else:
        got = f"{type(error).__name__}: {error}"[:200]
        yield Fault(f"parts do not make {what}", place or "model", got, "", REFIT)
