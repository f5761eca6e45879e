"""Encoded polylines: coordinates as the text that routers send."""

from __future__ import annotations

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput
from tripwatt.routes.points import MAX_POINTS, require_on_earth


def decode_polyline(text: str, where: str, *, precision: float = 1e5, dimensions: int = 2) -> FloatArray:
    """Decode an encoded polyline to latitudes, longitudes [°] and heights [m], shape (points, dimensions).

    O(characters), without a loop over them.

    Parameters
    ----------
    text : str
    where : str
        Name of the text for messages.
    precision : float
        Latitudes and longitudes are encoded as whole numbers: degrees times this [1/deg].
    dimensions : int
        2, or 3 if heights are encoded too, in hundredths of a metre.

    Raises
    ------
    InvalidInput
        When the text is not an encoded polyline, or has more than `MAX_POINTS` points.

    Examples
    --------
    >>> decode_polyline("_p~iF~ps|U_ulLnnqC", "example")
    array([[  38.5 , -120.2 ],
           [  40.7 , -120.95]])
    """
    if len(text) > 32 * MAX_POINTS:
        raise InvalidInput.of("polyline too long", where, f"{len(text)} characters", f"{32 * MAX_POINTS}")
    chunks = np.frombuffer(text.encode("utf-32-le", "surrogatepass"), dtype=np.uint32).astype(np.int64) - 63
    ends = np.flatnonzero(chunks < 0x20)  # the last character of each number lacks the bit for "more follow"
    starts = np.concatenate(([0], ends + 1))
    lengths = np.diff(starts, append=len(chunks))  # the last length is that of an unfinished number, else 0
    # a number has ten characters of five bits each at most; a coordinate takes seven
    if ((chunks < 0) | (chunks >= 64)).any() or (lengths > 10).any():
        raise InvalidInput.of("not an encoded polyline", where, repr(text[:20]), "an encoded polyline")
    if lengths[-1] or len(ends) % dimensions or len(ends) < 2 * dimensions:
        got = f"{len(ends)} numbers{' and a part of one' if lengths[-1] else ''}"
        raise InvalidInput.of(
            "not an encoded polyline", where, got, f"{dimensions} for each of at least 2 points"
        )
    place = np.arange(len(chunks)) - np.repeat(starts, lengths)
    values = np.add.reduceat((chunks & 0x1F) << (5 * place), starts[:-1])
    numbers = np.where(values & 1, ~(values >> 1), values >> 1)
    scale = np.array([precision, precision, 100.0][:dimensions])
    points = np.cumsum(numbers.astype(np.float64).reshape(-1, dimensions), axis=0) / scale
    require_on_earth(points[:, 0], points[:, 1], where)
    return np.asarray(points)
