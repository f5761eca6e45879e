"""A fit from a bare model matrix: for designs that were made elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput, raise_faults
from tripwatt.gam.families import Family, Gaussian
from tripwatt.gam.fit import DenseRows, Solution
from tripwatt.gam.moments import Moments
from tripwatt.gam.penalties import PenaltyStack
from tripwatt.gam.solve import FitSettings, Method, solve


def fit_matrix(
    X: FloatArray,
    penalties: Sequence[tuple[int, int, FloatArray]],
    y: FloatArray,
    family: Family | None = None,
    method: Method = "fREML",
    smoothing_parameters: Sequence[float] | None = None,
    tolerance: float = 1e-3,
    max_iter: int = 400,
) -> Solution:
    """Fit a penalised model given as matrices.

    Parameters
    ----------
    X : ndarray (n, p)
        Model matrix, full rank where nothing is penalised.
    penalties : sequence of (first, stop, S)
        S (stop - first, stop - first) acts on the coefficients first to stop - 1; several may act on the same ones.
    y : ndarray (n,)
        Response.
    family : Family, optional
        Default gaussian.
    method, tolerance, max_iter
        As in `GAMM`.
    smoothing_parameters : sequence of float, optional
        Given values, one for each penalty.

    Returns
    -------
    Solution

    Raises
    ------
    InvalidInput
        Where the matrices do not fit together or the model is not identifiable.

    Examples
    --------
    >>> x = np.linspace(0, 1, 30)
    >>> X = np.column_stack([np.ones(30), x, x**2])
    >>> fit = fit_matrix(X, [(2, 3, np.eye(1))], x + 0.01 * np.cos(40 * x))
    >>> fit.beta.shape
    (3,)
    """
    n, p = X.shape
    faults = [
        Fault(
            "penalty does not fit", f"penalty {j}", f"{S.shape} for {first}:{stop}", f"square, within 0:{p}"
        )
        for j, (first, stop, S) in enumerate(penalties)
        if not (0 <= first < stop <= p and S.shape == (stop - first, stop - first))
    ]
    if len(y) != n:
        faults.append(Fault("wrong length", "y", f"{len(y)} values", f"{n} rows of X"))
    raise_faults(faults)
    terms: dict[int, list[FloatArray]] = {}
    order: dict[int, list[int]] = {}
    for j, (first, _, S) in enumerate(penalties):
        terms.setdefault(first, []).append(np.asarray(S, dtype=np.float64))
        order.setdefault(first, []).append(j)
    stack = PenaltyStack(p, list(terms.items()))
    place = np.array([j for js in order.values() for j in js], dtype=np.intp)
    rho = (
        None
        if smoothing_parameters is None
        else np.log(np.asarray(smoothing_parameters, dtype=np.float64))[place]
    )
    chosen = family if family is not None else Gaussian()
    sums = Moments((X.T @ X)[None], (X.T @ y)[None], np.array([y @ y]), float(n), 1.0)
    settings = FitSettings(chosen, method, rho, None, tolerance, max_iter)
    solution = solve(DenseRows(X), y, sums, stack, np.arange(p, dtype=np.intp), settings)
    if solution is None:
        raise InvalidInput.of("model not identifiable", "X and penalties", "singular system", "full rank")
    back = np.empty_like(solution.rho)
    back[place] = solution.rho
    solution.rho = back
    return solution
