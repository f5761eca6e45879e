"""The computing part of a model: fit, predict, leave groups out."""

from __future__ import annotations

import math
from collections.abc import Collection, Container, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Self, overload

import numpy as np
import numpy.typing as npt
import pandas as pd

from tripwatt_gamm.arrays import BoolArray, FloatArray
from tripwatt_gamm.covariates import Index, missing_columns, numbers, response
from tripwatt_gamm.design import Design, build_design
from tripwatt_gamm.errors import Fault, InvalidInput, raise_faults
from tripwatt_gamm.families import Family, Gaussian, ScaledT
from tripwatt_gamm.fit import Solution
from tripwatt_gamm.fitted_terms import Extrapolation, FittedTerm
from tripwatt_gamm.formula import nearest, parse_formula
from tripwatt_gamm.identify import require_rows
from tripwatt_gamm.leaveout import grouped_moments, identified_moments, leave_out
from tripwatt_gamm.results import results
from tripwatt_gamm.solve import FitSettings, Method, Problem, solve
from tripwatt_gamm.tables import previous_rows
from tripwatt_gamm.terms import Formula, RandomEffect, Smooth, Tensor

PREDICT_ROWS = 8192
"""Rows whose model matrix is formed at a time; a choice that bounds the memory."""


@dataclass(eq=False)
class Estimator:
    """Base class of `tripwatt_gamm.GAMM`: fit, predict, leave groups out; parameters are documented there."""

    formula: str | Formula
    family: str | Family = "gaussian"
    method: Method = "fREML"
    discretise: bool | int = True
    extrapolation: Extrapolation = "clamp"
    smoothing_parameters: Sequence[float] | None = None
    ar1_rho: float | Literal["estimate"] | None = None
    tolerance: float = 1e-3
    max_iter: int = 400

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Type of the attributes that `fit` sets from the names in `results`."""

    def fit(self, frame: pd.DataFrame, y: object = None, groups: object = None) -> Self:
        """Choose smoothing parameters and estimate everything.

        Parameters
        ----------
        frame : DataFrame
            Columns that the formula names.
        y : array-like (n,), optional
            Response; default: the formula's left side.
        groups : array-like (n,) or str, optional
            Groups (or their column) within which successive rows are correlated, for `ar1_rho`.

        Returns
        -------
        Self
            The model.

        Raises
        ------
        InvalidInput
            Names every faulty column, or the term that cannot be fitted.
        """
        formula, family = self._formula(), self._family()
        values = response(frame, y, formula.response)
        codes = self._groups(frame, groups)
        previous = None if self.ar1_rho is None else previous_rows(codes)
        design = build_design(formula, frame, self.discretise, self.extrapolation)
        all_rows = np.arange(len(values), dtype=np.intp)
        sums = grouped_moments(design, values, codes, all_rows, self.ar1_rho is not None)
        design, sums = identified_moments(design, sums, values, codes, all_rows)
        active = design.active(np.diag(sums.gram[0]))
        stack, which = design.penalty_stack(active)
        require_rows(len(frame), stack, "frame")
        given = _given_logs(self.smoothing_parameters, design)
        settings = self._settings(family, None if given is None else given[which])
        rows = design.rows.subset(columns=active)
        problem = Problem(rows, values, sums, stack, active, settings, previous)
        solution = solve(problem, formula.response or "y")
        loaded = dict(stack.loaded(solution.loadings).terms)
        for fitted in design.terms:
            if fitted.scales is not None:
                fitted.penalties = loaded[int(np.searchsorted(active, fitted.start))]
        self._keep(design, results(design, values, family, solution, active), family, active)
        self._keep_penalties(design, solution, which)
        return self

    @overload
    def predict(
        self, frame: pd.DataFrame, exclude: Collection[str] = ..., se: Literal[False] = ...
    ) -> FloatArray: ...
    @overload
    def predict(
        self, frame: pd.DataFrame, exclude: Collection[str] = ..., *, se: Literal[True]
    ) -> tuple[FloatArray, FloatArray]: ...
    def predict(
        self, frame: pd.DataFrame, exclude: Collection[str] = (), se: bool = False
    ) -> FloatArray | tuple[FloatArray, FloatArray]:
        """Predict the response.

        Parameters
        ----------
        frame : DataFrame
            Columns of the terms; the column of a random effect may be missing.
        exclude : collection of str
            Labels of terms to leave out.
        se : bool
            Whether to return standard errors too.

        Returns
        -------
        ndarray, shape (n,)
            The response; with `se` a pair of the response and its standard errors.

        Notes
        -----
        A factor level without training rows has the mean effect of the training rows. An unknown level of a random
        effect has the effect 0. Covariates outside their range follow `extrapolation`.
        """
        values, errors = [np.zeros(0)], [np.zeros(0)]
        for X in self._matrices(frame, exclude):
            values.append(X @ self.coef_)
            if se:
                errors.append(np.sqrt(np.maximum(np.einsum("ij,ij->i", X @ self.Vp_, X), 0.0)))
        return (np.concatenate(values), np.concatenate(errors)) if se else np.concatenate(values)

    def predict_terms(self, frame: pd.DataFrame) -> pd.DataFrame:
        """Predict the contribution of each term to the response.

        Parameters
        ----------
        frame : DataFrame
            As for `predict`.

        Returns
        -------
        DataFrame, shape (n, terms)
            Contributions by label of the term, which add up to the response.
        """
        parts = [
            np.stack([X[:, fitted.slice] @ self.coef_[fitted.slice] for fitted in self.terms_], axis=1)
            for X in self._matrices(frame, ())
        ]
        labels = [fitted.label for fitted in self.terms_]
        return pd.DataFrame(np.concatenate([np.zeros((0, len(labels))), *parts]), frame.index, labels)

    def _matrices(self, frame: pd.DataFrame, exclude: Collection[str]) -> Iterator[FloatArray]:
        """Yield the model matrix of successive rows (at most `PREDICT_ROWS`, p); columns of excluded terms are 0."""
        included = self._checked(frame, exclude)
        if self.extrapolation == "clamp":
            frame = self.training_.clamp_frame(frame)
        for start in range(0, len(frame), PREDICT_ROWS):
            rows = frame.iloc[start : start + PREDICT_ROWS]
            X = np.zeros((len(rows), len(self.coef_)))
            for fitted in included:
                X[:, fitted.slice] = fitted.matrix(rows)
            yield X

    def extrapolation_mask(self, frame: pd.DataFrame) -> BoolArray:
        """Mark rows with a covariate outside its training range or a level that training did not have.

        Parameters
        ----------
        frame : DataFrame
            Columns of the terms; the column of a random effect may be missing.

        Returns
        -------
        ndarray of bool, shape (n,)
            A new level of a random effect does not count.
        """
        self._checked(frame, ())
        out = np.zeros(len(frame), dtype=bool)
        for names, support in self.training_.supports.items():
            out |= support.outside(frame[list(names)].to_numpy(dtype=np.float64))
        for (names, by, level), support in self.training_.within.items():
            member = self.training_.members(frame, by, level)
            out |= support.outside(frame[list(names)].to_numpy(dtype=np.float64)) & member
        random = {":".join(fitted.groups) for fitted in self.terms_}
        for name, levels in self.training_.levels.items():
            if name not in random:
                codes = levels.codes(frame[name])
                out |= (codes < 0) | (levels.share[codes] == 0)
        return out

    def leave_groups_out(
        self,
        frame: pd.DataFrame,
        y: object = None,
        groups: object = None,
        folds: object = None,
        at: pd.DataFrame | None = None,
        at_folds: object = None,
    ) -> FloatArray:
        """Predict every row from a fit without its group.

        Smoothing parameters, shape and scale are estimated anew in every fold, from a start that does not depend on
        the rows held out; bases and their knots come from the covariates of all rows. `folds_` reports each fold.

        Parameters
        ----------
        frame : DataFrame
            Columns that the formula names.
        y : array-like (n,), optional
            Response; default: the formula's left side.
        groups : array-like (n,) or str
            Group of each row, or its column.
        folds : array-like (n,) or str, optional
            Larger units to leave out at once, e.g. days; default: the groups.
        at : DataFrame (m, ...), optional
            Rows to predict instead of those of `frame`, for a fit to thinned rows.
        at_folds : array-like (m,) or str, optional
            Unit of each row of `at`, or its column; labels are those of `folds` (or of `groups` if `folds` is not
            given).

        Returns
        -------
        ndarray (n,), or (m,) with `at`
            Held-out predictions; a held-out group's random effect is 0.

        Raises
        ------
        InvalidInput
            Names every faulty column, missing groups, or rows of `at` without a unit.
        """
        formula, family = self._formula(), self._family()
        values = response(frame, y, formula.response)
        if groups is None:
            raise InvalidInput.of("no groups", "leave_groups_out", "groups is None", "a group for each row")
        group_codes = self._groups(frame, groups)
        design = build_design(formula, frame, self.discretise, self.extrapolation)
        given_logs = _given_logs(self.smoothing_parameters, design)
        settings = self._settings(family, given_logs)
        units = group_codes if folds is None else self._groups(frame, folds)
        at_rows = None
        if at is not None:
            labels = _labels(frame, groups if folds is None else folds)
            raise_faults(_column_faults(at, design.terms, design.training.levels))
            at_rows = at, _units_at(at, at_folds, labels)
        predictions, self.folds_ = leave_out(design, frame, values, group_codes, units, settings, at_rows)
        return predictions

    def _formula(self) -> Formula:
        if isinstance(self.formula, Formula):
            return self.formula
        return parse_formula(self.formula)

    def _family(self) -> Family:
        """The given family, or that of a given name; raise if the name or, beside a name, `method` is unknown."""
        if isinstance(self.family, Gaussian | ScaledT):
            return self.family
        known: dict[str, Family] = {"gaussian": Gaussian(), "scat": ScaledT()}
        faults = []
        if self.family not in known:
            got = repr(self.family)
            faults.append(
                Fault("unknown family", "GAMM(family=)", got, ", ".join(known), nearest(got, known))
            )
        if self.method not in ("fREML", "REML"):
            faults.append(Fault("unknown method", "GAMM(method=)", repr(self.method), "fREML or REML"))
        raise_faults(faults)
        return known[self.family]

    def _settings(self, family: Family, rho: FloatArray | None) -> FitSettings:
        """Settings of a fit with log smoothing parameters `rho`; raise if `extrapolation`, `method` or `ar1_rho` cannot be used."""
        correlated = any(isinstance(term, RandomEffect) and term.correlated for term in self._formula().terms)
        searched = correlated or self.ar1_rho == "estimate"
        faults = []
        if self.extrapolation not in ("clamp", "linear"):
            got = repr(self.extrapolation)
            faults.append(Fault("unknown extrapolation", "GAMM(extrapolation=)", got, "clamp or linear"))
        if searched and not isinstance(family, Gaussian) and self.method != "REML":
            got = f"{self.method} with {'correlated random effects' if correlated else 'ar1_rho'} to estimate"
            fix = "method='REML', whose score can be compared between correlations"
            faults.append(Fault("no score for a correlation", "GAMM(method=)", got, "REML", fix))
        if not (self.ar1_rho in (None, "estimate") or -1 < float(self.ar1_rho or 0) < 1):
            allowed = "'estimate' or within -1 to 1"
            faults.append(Fault("invalid autocorrelation", "GAMM(ar1_rho=)", repr(self.ar1_rho), allowed))
        raise_faults(faults)
        return FitSettings(family, self.method, rho, self.ar1_rho, self.tolerance, self.max_iter)

    def _groups(self, frame: pd.DataFrame, groups: object) -> Index:
        """Codes (n,) of groups given as labels or as a column; if `groups` is None, all rows form one group."""
        if groups is None:
            return np.zeros(len(frame), dtype=np.intp)
        codes = pd.factorize(_labels(frame, groups))[0].astype(np.intp)
        if len(codes) != len(frame) or (codes < 0).any():
            got = f"{len(codes)} labels, {int((codes < 0).sum())} missing"
            raise InvalidInput.of(
                "invalid groups", "groups=", got, f"a label for each of the {len(frame)} rows"
            )
        return codes

    def _keep_penalties(self, design: Design, solution: Solution, which: list[int]) -> None:
        """Set the smoothing parameters and the covariance of their logs; NaN for a term without data."""
        names = design.penalty_names
        logs = np.full(len(names), math.nan)
        logs[which] = solution.rho
        self.smoothing_parameters_ = {name: float(np.exp(v)) for name, v in zip(names, logs, strict=True)}
        self.log_sp_covariance_ = np.full((len(names), len(names)), math.nan)
        if solution.hessian.size:
            inverse = np.linalg.pinv(solution.hessian, hermitian=True)
            self.log_sp_covariance_[np.ix_(which, which)] = inverse[: len(which), : len(which)]

    def _keep(self, design: Design, outcome: dict[str, Any], family: Family, active: Index) -> None:
        """Set the fitted attributes."""
        for name, value in outcome.items():
            setattr(self, name + "_", value)
        self.formula_, self.family_, self.terms_ = design.formula, family, design.terms
        self.training_ = design.training
        self.coef_names_ = [name for fitted in design.terms for name in fitted.names]
        self.term_slices_ = {fitted.label: fitted.slice for fitted in design.terms}
        kept = set(active.tolist())
        self.empty_columns_ = [name for i, name in enumerate(self.coef_names_) if i not in kept]
        supports = design.training.supports
        self.ranges_ = {
            name: (float(support.low[j]), float(support.high[j]))
            for names_, support in supports.items()
            for j, name in enumerate(names_)
        }
        self.levels_ = {name: levels.names for name, levels in design.training.levels.items()}
        self.notes_ = list(design.notes)

    def _checked(self, frame: pd.DataFrame, exclude: Collection[str]) -> list[FittedTerm]:
        """Return the terms of a prediction from a frame; raise if the model is not fitted, or a term or a column is faulty."""
        if not hasattr(self, "coef_"):
            raise InvalidInput.of("not fitted", "GAMM", "", "a model after fit()")
        labels = [fitted.label for fitted in self.terms_]
        faults = [
            Fault("unknown term", "predict(exclude=)", repr(label), ", ".join(labels), nearest(label, labels))
            for label in exclude
            if label not in labels
        ]
        included = [fitted for fitted in self.terms_ if fitted.label not in exclude]
        raise_faults([*faults, *_column_faults(frame, included, self.levels_)])
        return included


def _given_logs(given: Sequence[float] | None, design: Design) -> FloatArray | None:
    """Return the logs of given smoothing parameters, in the order of the design, or None if none are given."""
    if given is None:
        return None
    names = design.penalty_names
    values = np.asarray(given, dtype=np.float64).ravel()
    if len(values) != len(names) or not (np.isfinite(values) & (values > 0)).all():
        got = f"{len(values)} values"
        allowed = f"{len(names)} positive numbers for {', '.join(names)}"
        raise InvalidInput.of("invalid smoothing parameters", "GAMM(smoothing_parameters=)", got, allowed)
    return np.log(values)


def _labels(frame: pd.DataFrame, labels: object) -> npt.NDArray[Any]:
    """Labels (n,) given as an array or as a column."""
    if isinstance(labels, str):
        raise_faults(missing_columns(frame, [labels]))
        labels = frame[labels]
    return np.asarray(labels)


def _units_at(at: pd.DataFrame, at_folds: object, known: npt.NDArray[Any]) -> Index:
    """Code of the unit of each row of `at`; `known` are the labels of the rows of the fit."""
    labels = np.empty(0) if at_folds is None else _labels(at, at_folds)
    codes = pd.Index(pd.factorize(known)[1]).get_indexer(pd.Index(labels))
    if len(codes) != len(at) or (codes < 0).any():
        got = f"{len(codes)} labels for {len(at)} rows, {int((codes < 0).sum())} unknown"
        allowed = "a unit of the fit for each row of at="
        raise InvalidInput.of("invalid groups", "at_folds=", got, allowed)
    return np.asarray(codes, dtype=np.intp)


def _column_faults(frame: pd.DataFrame, terms: list[FittedTerm], levels: Container[str]) -> list[Fault]:
    """Return the faults of the columns that a prediction of these terms reads: missing, not numeric or not finite."""
    faults = missing_columns(frame, dict.fromkeys(name for fitted in terms for name in fitted.needed))
    for fitted in terms:
        term = fitted.term
        for name in fitted.needed:
            assert term is not None
            smoothed = isinstance(term, Smooth | Tensor) and name in term.names
            if name in frame.columns and (smoothed or name not in levels):
                faults += numbers(frame, name, term.label)[1]
    return faults
