"""The computing part of a model: fit, predict, leave groups out."""

from __future__ import annotations

from collections.abc import Collection, Container, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, Self, TypeAlias

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.stats import norm

from tripwatt_gamm.arrays import BoolArray, FloatArray, Index
from tripwatt_gamm.covariates import missing_columns, named_column, numbers, response, row_values
from tripwatt_gamm.design import Design, build_design
from tripwatt_gamm.errors import Fault, InvalidInput, NotFittedError, raise_faults
from tripwatt_gamm.families import FAMILIES, Family, Response, ScaledT
from tripwatt_gamm.fitted_terms import Extrapolation, FittedTerm
from tripwatt_gamm.formula import nearest, parse_formula
from tripwatt_gamm.leaveout import Work, leave_out
from tripwatt_gamm.results import results
from tripwatt_gamm.solve import FitSettings, Method
from tripwatt_gamm.terms import Formula, RandomEffect, Smooth, Tensor

Scale: TypeAlias = Literal["response", "link"]

DRAWS = 10_000
"""Draws for simultaneous intervals: a choice, which leaves an error of some 0.2 % in their coverage."""

PREDICT_ROWS = 8192
"""Rows whose model matrix is formed at a time; a choice that bounds the memory."""


@dataclass(eq=False)
class Estimator:
    """Base class of `tripwatt_gamm.GAMM`: fit, predict, leave groups out; parameters are documented there."""

    formula: str | Formula
    family: str | Family = "gaussian"
    method: Method = "fREML"
    discretise: bool = True
    extrapolation: Extrapolation = "linear"
    smoothing_parameters: Sequence[float] | None = None
    ar1_rho: float | Literal["estimate"] | None = None
    tolerance: float = 1e-3
    max_iter: int = 400
    select: bool = False

    def __getattr__(self, name: str) -> Any:
        """Raise, because this attribute is not set; those with a trailing underscore are results of a fit."""
        if name.endswith("_") and not name.startswith("_"):
            raise NotFittedError.of("not fitted", f"GAMM.{name}", "no fit", "a model after fit()")
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def fit(
        self,
        frame: pd.DataFrame,
        y: object = None,
        groups: object = None,
        weights: object = None,
        offset: object = None,
    ) -> Self:
        """Choose smoothing parameters and estimate everything.

        Parameters
        ----------
        frame : DataFrame
            Columns that the formula names.
        y : array-like (n,), optional
            Response; default: the formula's left side. A Series is aligned with the index of the frame.
        groups : array-like (n,) or str, optional
            Groups (or their column) within which successive rows are correlated, for `ar1_rho`.
        weights : array-like (n,) or str, optional
            Prior weights (or their column), above 0: the variance of a row is divided by its weight. For shares of
            successes, the numbers of trials.
        offset : array-like (n,) or str, optional
            Known part of the linear predictor (or its column, which predictions then read too).

        Returns
        -------
        Self
            The model.

        Raises
        ------
        InvalidInput
            Names every faulty column, or the term that cannot be fitted.
        """
        offset = self._offset(offset)
        data, work, settings = self._work(frame, y, groups, weights, offset)
        all_rows = np.arange(len(frame), dtype=np.intp)
        where = work.design.formula.response or "y"
        design, active, which, solution = work.fit(all_rows, work.sums(all_rows), settings, where)
        for block in design.penalty_stack(active)[0].loaded(solution.loadings).blocks:
            if block.sizes is not None:
                owner = next(fitted for fitted in design.terms if fitted.start == active[block.start])
                owner.matrices = block.matrices
        for name, value in results(design, data, settings.family, solution, active, which).items():
            setattr(self, name + "_", value)
        self.offset_ = offset
        return self

    def _work(
        self, frame: pd.DataFrame, y: object, groups: object, weights: object, offset: object
    ) -> tuple[Response, Work, FitSettings]:
        """Return the response, the rows to fit, and the settings of the fit.

        A fit starts from the least squares of a rough linear predictor; for additive errors these are those of the
        response and the rows, times the roots of their weights.
        """
        formula, family = self._formula(), self._family()
        values = response(frame, y, formula.response)
        outside = (values < family.limits[0]) | (values > family.limits[1])
        if outside.any():
            got = f"{values[outside][0]} at row {int(np.argmax(outside))}"
            raise InvalidInput.of("impossible response", f"family {family.name}", got, family.allowed)
        prior = np.ones(len(frame)) if weights is None else row_values(frame, weights, "weights=")
        if (prior <= 0).any():
            got, fix = f"{prior.min()} at row {int(np.argmin(prior))}", "leave such rows out"
            raise InvalidInput.of("invalid weights", "weights=", got, "numbers above 0", fix)
        known = np.zeros(len(frame)) if offset is None else row_values(frame, offset, "offset=")
        lagged = self.ar1_rho is not None
        options = self.discretise, self.extrapolation, self.select, not lagged
        design = build_design(formula, frame, *options)
        settings = self._settings(family, _given_logs(self.smoothing_parameters, design))
        data, codes = Response(values, prior, known), self._groups(frame, groups)
        if not family.scaled_rows:
            return data, Work(design, family.start(values) - known, codes, lagged, data), settings
        if weights is not None:
            design = replace(design, rows=design.rows.scaled(np.sqrt(prior)))
        return data, Work(design, np.sqrt(prior) * (values - known), codes, lagged, None), settings

    def predict(
        self,
        frame: pd.DataFrame,
        exclude: Collection[str] = (),
        offset: object = None,
        scale: Scale = "response",
    ) -> FloatArray:
        """Predict the mean of the response, or the linear predictor.

        Parameters
        ----------
        frame : DataFrame
            Columns of the terms; the column of a random effect may be missing.
        exclude : collection of str
            Labels of terms to leave out.
        offset : array-like (n,) or str, optional
            Offset of these rows, or its column; default: the column that `fit` had as offset.
        scale : {"response", "link"}
            Whether to return the mean, or the linear predictor.

        Returns
        -------
        ndarray, shape (n,)

        Notes
        -----
        A factor level without training rows has the mean effect of the training rows. An unknown level of a random
        effect, or of curves of a factor, has the effect 0. Covariates outside their range follow `extrapolation`.
        """
        parts = [X @ self.coef_ for _, X in self._matrices(frame, exclude)]
        eta = np.concatenate([np.zeros(0), *parts]) + self._known(frame, offset)
        return np.asarray(self.family_.link.mean(eta)) if scale == "response" else eta

    def intervals(
        self,
        frame: pd.DataFrame,
        level: float = 0.95,
        exclude: Collection[str] = (),
        offset: object = None,
        simultaneous: bool = False,
    ) -> pd.DataFrame:
        """Compute intervals of the mean, from the posterior distribution of the coefficients.

        If the level of a random effect or of curves of a factor is unknown, or its column is missing, the variance of the effect is in
        them. Exclude the term for the interval at an effect of 0.

        Parameters
        ----------
        frame, exclude, offset
            As for `predict`; a single smooth is left by excluding all other terms.
        level : float
            Coverage, between 0 and 1.
        simultaneous : bool
            Whether the intervals hold for all rows together: their width is that of the largest deviation among
            the rows in 10,000 draws of the coefficients (Ruppert, Wand & Carroll 2003, Semiparametric Regression,
            section 6.5). Otherwise each holds for its row.

        Returns
        -------
        DataFrame
            ``predictor`` and ``std_error`` of the linear predictor; ``mean``, ``lower`` and ``upper`` of the mean.
        """
        predictor, link = self.predict(frame, exclude, offset, "link"), self.family_.link
        draws = DRAWS if simultaneous else 0
        errors, largest = [np.zeros(0)], np.zeros(draws)
        for error, deviations in self._deviations(frame, exclude, draws, seed=0):
            errors.append(error)
            relative = np.abs(deviations) / np.maximum(error, 1e-300)
            largest = np.maximum(largest, relative.max(axis=1, initial=0.0))
        error = np.concatenate(errors)
        half = error * (np.quantile(largest, level) if simultaneous else norm.ppf((1 + level) / 2))
        columns = {"predictor": predictor, "std_error": error, "mean": link.mean(predictor)}
        columns |= {"lower": link.mean(predictor - half), "upper": link.mean(predictor + half)}
        return pd.DataFrame(columns, frame.index)

    def posterior(self, n: int = 1000, seed: int = 0) -> FloatArray:
        """Draw coefficients from their posterior distribution, normal with covariance `Vp_`.

        Parameters
        ----------
        n : int
            Number of draws.
        seed : int
            Seed of the draws.

        Returns
        -------
        ndarray, shape (n, p)
        """
        rng = np.random.default_rng(seed)
        return rng.multivariate_normal(self.coef_, self.Vp_, n, check_valid="ignore", method="eigh")

    def sample(self, frame: pd.DataFrame, n: int = 1000, seed: int = 0, offset: object = None) -> FloatArray:
        """Draw predictions of the mean from their posterior distribution; an unknown level has a drawn effect.

        Parameters
        ----------
        frame, offset
            As for `predict`.
        n, seed : int
            As for `posterior`.

        Returns
        -------
        ndarray, shape (n, rows)
        """
        parts = [deviations for _, deviations in self._deviations(frame, (), n, seed)]
        eta = self.predict(frame, offset=offset, scale="link") + np.hstack([np.zeros((n, 0)), *parts])
        return np.asarray(self.family_.link.mean(eta))

    def _deviations(
        self, frame: pd.DataFrame, exclude: Collection[str], n: int, seed: int
    ) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Yield the standard errors of the linear predictor of successive rows, and `n` draws (n, rows) of its deviations.

        The effects of an unknown level have their distribution in the model; rows of one level share their draws.
        """
        draws = self.posterior(n, seed) - self.coef_ if n else np.zeros((0, len(self.coef_)))
        for rows, X in self._matrices(frame, exclude):
            variance, deviations = np.einsum("ij,ij->i", X @ self.Vp_, X), draws @ X.T
            parameters = iter(self.smoothing_parameters_.values())
            for fitted in self.terms_:
                precision = sum(next(parameters) * S for S in fitted.matrices) / self.reml_scale_
                for level, at, columns in fitted.new_levels(rows) if fitted.label not in exclude else ():
                    new = np.linalg.solve(np.linalg.cholesky(precision), columns.T)
                    variance[at] += (new**2).sum(axis=0)
                    rng = np.random.default_rng([seed, *f"{fitted.label} {level}".encode()])
                    deviations[:, at] += rng.standard_normal((n, len(new))) @ new
            yield np.sqrt(np.maximum(variance, 0.0)), deviations

    def _known(self, frame: pd.DataFrame, offset: object) -> FloatArray:
        """Offset (n,) of the rows of a prediction; raise if the fit had one that the frame does not have."""
        given = self.offset_ if offset is None else offset
        if given is None:
            return np.zeros(len(frame))
        if offset is None and not isinstance(given, str):
            fix = "offset=, or its column as the offset of fit()"
            raise InvalidInput.of(
                "no offset", "predict(offset=)", "None, but the fit had one", "numbers", fix
            )
        return row_values(frame, given, "offset=")

    def predict_terms(self, frame: pd.DataFrame) -> pd.DataFrame:
        """Predict the contribution of each term to the linear predictor.

        Parameters
        ----------
        frame : DataFrame
            As for `predict`.

        Returns
        -------
        DataFrame, shape (n, terms)
            Contributions by label of the term, which add up to the linear predictor without its offset.
        """
        parts = [
            np.stack([X[:, fitted.slice] @ self.coef_[fitted.slice] for fitted in self.terms_], axis=1)
            for _, X in self._matrices(frame, ())
        ]
        labels = [fitted.label for fitted in self.terms_]
        return pd.DataFrame(np.concatenate([np.zeros((0, len(labels))), *parts]), frame.index, labels)

    def _matrices(
        self, frame: pd.DataFrame, exclude: Collection[str]
    ) -> Iterator[tuple[pd.DataFrame, FloatArray]]:
        """Yield successive rows, at most `PREDICT_ROWS`, and their model matrix; columns of excluded terms are 0."""
        included = self._checked(frame, exclude)
        if self.extrapolation == "clamp":
            frame = self.training_.clamp_frame(frame)
        for start in range(0, len(frame), PREDICT_ROWS):
            rows = frame.iloc[start : start + PREDICT_ROWS]
            X = np.zeros((len(rows), len(self.coef_)))
            for fitted in included:
                X[:, fitted.slice] = fitted.matrix(rows)
            yield rows, X

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
        weights: object = None,
        offset: object = None,
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
        weights, offset : array-like (n,) or str, optional
            As for `fit`; with `at`, an offset is a column.

        Returns
        -------
        ndarray (n,), or (m,) with `at`
            Held-out predictions; a held-out group's random effect is 0.

        Raises
        ------
        InvalidInput
            Names every faulty column, missing groups, or rows of `at` without a unit.
        """
        if groups is None:
            raise InvalidInput.of("no groups", "leave_groups_out", "groups=None", "groups, or a column")
        offset = self._offset(offset)
        _, work, settings = self._work(frame, y, groups, weights, offset)
        units = work.groups if folds is None else self._groups(frame, folds)
        place, at_units = frame, units
        if at is not None:
            labels = np.asarray(named_column(frame, groups if folds is None else folds))
            raise_faults(_column_faults(at, work.design.terms, work.design.training.levels))
            place, at_units = at, _codes(at, at_folds, labels, "at_folds=")
        known = 0.0 if offset is None else row_values(place, offset, "offset=")
        eta, self.folds_ = leave_out(work, units, settings, place, at_units)
        return settings.family.link.mean(eta + known)

    def _formula(self) -> Formula:
        return self.formula if isinstance(self.formula, Formula) else parse_formula(self.formula)

    def _offset(self, given: object) -> object:
        """The offset that was given, or its column in the formula; raise if there are both."""
        named = self._formula().offset
        if given is not None and named is not None:
            raise InvalidInput.of("two offsets", "fit(offset=)", f"one beside offset({named})", "one of them")
        return named if given is None else given

    def _family(self) -> Family:
        """The given family, or that of a given name; raise if an option is unknown."""
        families = dict.fromkeys([self.family]) if isinstance(self.family, Family) else FAMILIES
        options = {
            "family": (self.family, families),
            "method": (self.method, ("fREML", "REML")),
            "extrapolation": (self.extrapolation, ("clamp", "linear")),
        }
        raise_faults(
            Fault(f"unknown {name}", f"GAMM({name}=)", repr(got), ", ".join(map(str, allowed)))
            for name, (got, allowed) in options.items()
            if got not in allowed
        )
        return self.family if isinstance(self.family, Family) else FAMILIES[self.family]

    def _settings(self, family: Family, rho: FloatArray | None) -> FitSettings:
        """Settings of a fit with log smoothing parameters `rho`; raise if `method` or `ar1_rho` cannot be used."""
        correlated = any(isinstance(term, RandomEffect) and term.correlated for term in self._formula().terms)
        searched = correlated or self.ar1_rho == "estimate"
        faults = []
        if searched and isinstance(family, ScaledT) and self.method != "REML":
            got = f"{self.method} with {'correlated random effects' if correlated else 'ar1_rho'} to estimate"
            fix = "method='REML', whose score can be compared between correlations"
            faults.append(Fault("no score for a correlation", "GAMM(method=)", got, "REML", fix))
        if self.ar1_rho is not None and not family.scaled_rows:
            faults.append(Fault("no autocorrelation", "GAMM(ar1_rho=)", family.name, "gaussian or scat"))
        if not (self.ar1_rho in (None, "estimate") or -1 < float(self.ar1_rho or 0) < 1):
            allowed = "'estimate' or within -1 to 1"
            faults.append(Fault("invalid autocorrelation", "GAMM(ar1_rho=)", repr(self.ar1_rho), allowed))
        raise_faults(faults)
        return FitSettings(family, self.method, rho, self.ar1_rho, self.tolerance, self.max_iter)

    def _groups(self, frame: pd.DataFrame, groups: object) -> Index:
        """Codes (n,) of groups given as labels or as a column; if `groups` is None, all rows form one group."""
        if groups is None:
            return np.zeros(len(frame), dtype=np.intp)
        return _codes(frame, groups, np.asarray(named_column(frame, groups)), "groups=")

    def _checked(self, frame: pd.DataFrame, exclude: Collection[str]) -> list[FittedTerm]:
        """Return the terms of a prediction from a frame; raise if the model is not fitted, or a term or a column is faulty."""
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


def _codes(frame: pd.DataFrame, labels: object, known: npt.NDArray[Any], where: str) -> Index:
    """Position (n,) of the label of each row among the `known` ones; raise if one is missing or unknown."""
    given = np.empty(0) if labels is None else np.asarray(named_column(frame, labels))
    codes = pd.Index(pd.factorize(known)[1]).get_indexer(pd.Index(given))
    if len(codes) != len(frame) or (codes < 0).any():
        got = f"{len(codes)} labels, {int((codes < 0).sum())} missing or unknown"
        allowed = f"a label of the fit for each of the {len(frame)} rows"
        raise InvalidInput.of("invalid groups", where, got, allowed)
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
