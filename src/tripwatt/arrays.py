"""Types of arrays, the same in every module."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
"""Numbers."""

IntArray = npt.NDArray[np.int64]
"""Counts, row numbers and group numbers."""

BoolArray = npt.NDArray[np.bool_]
"""Masks."""


def eigen(symmetric: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues, ascending, and eigenvectors of a symmetric matrix. O(n^3).

    LAPACK's fast algorithm (divide and conquer) fails on a few large matrices; the slower QR iteration then takes its
    place.

    Examples
    --------
    >>> eigen(np.diag([2.0, 1.0]))[0].tolist()
    [1.0, 2.0]
    """
    try:
        values, vectors = np.linalg.eigh(symmetric)
    except np.linalg.LinAlgError:
        from scipy.linalg import eigh  # scipy is slow to import

        values, vectors = eigh(symmetric, driver="ev")
    return np.asarray(values), np.asarray(vectors)
