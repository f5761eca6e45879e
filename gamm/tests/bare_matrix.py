"""A fit from a bare model matrix, for designs that were made elsewhere."""

import numpy as np

from tripwatt_gamm.families import Gaussian
from tripwatt_gamm.moments import Moments
from tripwatt_gamm.penalties import PenaltyStack
from tripwatt_gamm.solve import FitSettings, Problem, solve
from tripwatt_gamm.tables import IndexedColumns, TableRows


def table_rows(X):
    """A model matrix (n, p) as the rows of one table."""
    n, p = X.shape
    return TableRows([IndexedColumns(np.arange(p), X, np.arange(n))], n, p)


def fit_matrix(X, penalties, y, family=None, method="fREML", smoothing_parameters=None):
    """Fit a penalised model given as X (n, p), penalties (first, stop, S) in order, y (n,) and smoothing parameters."""
    n, p = X.shape
    terms = {}
    for first, _, S in penalties:
        terms.setdefault(first, []).append(S)
    rho = None if smoothing_parameters is None else np.log(np.asarray(smoothing_parameters))
    settings = FitSettings(family if family is not None else Gaussian(), method, rho)
    sums = Moments((X.T @ X)[None], (X.T @ y)[None], np.array([y @ y]), float(n), 1.0)
    return solve(
        Problem(table_rows(X), y, sums, PenaltyStack(p, list(terms.items())), np.arange(p), settings)
    )
