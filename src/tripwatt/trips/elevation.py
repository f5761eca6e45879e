"""Repair of heights of a log: interpolate over distance rather than time, and leave out heights that no road can have."""

from __future__ import annotations

from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray, distance_driven, running_sum
from tripwatt.trips.columns import STEEPEST_GRADE

MIN_BETWEEN_FIXES_S: Final = 30.0
"""Shortest mean time between the fixes of an interpolated height; the slope of a measured height changes more often."""

HEIGHT_NOISE_M: Final = 10.0
"""Error of satellite heights that smoothing removes."""
MIN_FAULT_M: Final = 60.0
"""Smallest jump that is certainly a fault: a smaller one may be a sensor catching up with the road, by 40 m and more in the Twizy's log."""


def elevation_over_distance(time_s: FloatArray, speed_m_s: FloatArray, elevation_m: FloatArray) -> FloatArray:
    """Interpolate an elevation over distance, if the log has interpolated it over time. O(samples x fixes).

    Some logs have a fix of the height every few minutes, and straight lines over time between fixes: a car that waits at a
    light then seems to climb. The fixes are where the lines meet. Any other elevation is returned unchanged.

    Parameters
    ----------
    time_s, speed_m_s, elevation_m : ndarray, shape (samples,)
        Missing elevations (NaN) stay missing; a missing speed counts as standing.

    Returns
    -------
    ndarray, shape (samples,)

    Examples
    --------
    >>> time = np.arange(0.0, 181.0)
    >>> speed = np.where(time < 90.0, 0.0, 10.0)
    >>> elevation_over_distance(time, speed, time / 10.0)[[0, 80, 135, 180]].round(2).tolist()
    [0.0, 0.0, 9.05, 18.0]
    """
    known = np.flatnonzero(np.isfinite(elevation_m))
    if len(known) < 3:
        return elevation_m
    time, height = time_s[known], elevation_m[known]
    fixes = _fixes(time, height, int((time[-1] - time[0]) / MIN_BETWEEN_FIXES_S))
    if fixes is None:
        return elevation_m
    speed = np.nan_to_num(speed_m_s)
    driven = distance_driven(time_s, speed)[known]
    filled = elevation_m.copy()
    filled[known] = np.interp(driven, driven[fixes], height[fixes])
    return filled


def heights_of_a_road(time_s: FloatArray, distance_m: FloatArray, elevation_m: FloatArray) -> FloatArray:
    """Replace heights that no road can have. O(samples + jumps).

    A jump is a change of height that exceeds that of the steepest street by `HEIGHT_NOISE_M`. Jumps divide the heights into runs.
    The runs that stay cover most of the road, and a road can join each with the next. Heights between them, such as voids of 0 m
    or a drift in a tunnel, are interpolated over distance. Other runs at an end, such as 0 m before the first fix, keep their slopes,
    but their jump is removed. Jumps below `MIN_FAULT_M`, by which a sensor catches up, stay, except beside 0 m at an end.

    Parameters
    ----------
    time_s, distance_m, elevation_m : ndarray, shape (samples,)
        Missing elevations (NaN) stay missing.

    Returns
    -------
    ndarray, shape (samples,)
        Repaired heights; `elevation_m` itself if every height stays.

    Examples
    --------
    >>> time = np.arange(0.0, 60.0)
    >>> height = np.where(time < 6.0, 0.0, 500.0 + time)
    >>> heights_of_a_road(time, 15.0 * time, height)[[0, 5, 6, 59]].tolist()
    [506.0, 506.0, 506.0, 559.0]
    """
    known = np.flatnonzero(np.isfinite(elevation_m))
    way, height = distance_m[known], elevation_m[known]
    start, end = _jumps(time_s[known], way, height)
    if not len(start):
        return elevation_m
    first, last = np.append(0, end), np.append(start, len(known) - 1)
    chain = _chain(way, height, first, last)
    number, rise = np.arange(len(first)), height[end] - height[start]
    outer = (number < chain[0]) | (number > chain[-1])
    stays = outer | np.isin(number, chain)
    unset = np.diff(running_sum(height != 0.0)[np.column_stack((first, last + 1))])[:, 0] == 0.0
    faulty = (np.abs(rise) > MIN_FAULT_M) | unset[1:] | unset[:-1]
    faulty &= outer[1:] | outer[:-1]
    climbed = stays[1:] & stays[:-1] & ~faulty
    if climbed.all():
        return elevation_m
    begins, ends = np.append(first[stays], start[climbed]), np.append(last[stays], end[climbed])
    borders = np.bincount(begins, minlength=len(known) + 1) - np.bincount(ends + 1, minlength=len(known) + 1)
    kept = np.cumsum(borders)[:-1] > 0
    dropped = np.zeros(len(known))
    dropped[end[faulty]] = rise[faulty]
    moved = np.cumsum(dropped)
    sound = height - (moved - moved[first[chain[0]]])
    filled = elevation_m.copy()
    filled[known] = np.where(kept, sound, np.interp(way, way[kept], sound[kept]))
    return filled


def _jumps(time: FloatArray, way: FloatArray, height: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the first and the last sample of each jump.

    Cuts are added as jumps between two samples, where a drift begins or ends.
    """
    rise = height[1:] - height[:-1]
    # 0.5: largest drift of a height while the car stands
    over = np.abs(rise) - STEEPEST_GRADE * (way[1:] - way[:-1]) - 0.5 * (time[1:] - time[:-1])
    if np.maximum(over, 0.0).sum() <= HEIGHT_NOISE_M:  # of most roads: too little for one jump
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    direction = np.where(over > 0.0, np.sign(rise), 0.0)
    edge = np.flatnonzero(np.diff(direction, prepend=0.0, append=0.0))
    jumps = np.diff(running_sum(over)[edge]) > HEIGHT_NOISE_M
    start, end = edge[:-1][jumps], edge[1:][jumps]
    cuts: list[int] = []
    for a, b in np.column_stack((start, end))[np.abs(height[end] - height[start]) > MIN_FAULT_M].tolist():
        # 5000.0: longest road on which a receiver without a fix, as in a tunnel, drifts before its height
        # jumps back
        # 0.07: smallest grade of a drift: a less steep rise is a hill
        longest = min(5000.0, abs(height[b] - height[a]) / 0.07)
        near, far = np.searchsorted(way, (way[b] - longest, way[a] + longest))
        for here, part in ((b, np.arange(near, a)[::-1]), (a, np.arange(b + 1, far))):
            # 0.01: largest grade of the road along a drift, beyond the noise
            room = HEIGHT_NOISE_M + 0.01 * np.abs(way[part] - way[here])
            back = part[np.abs(height[part] - height[here]) <= room]
            cuts += (back[:1] - (here == a)).tolist()
    cut = np.unique(np.array(cuts, dtype=np.int64))
    cut = cut[np.searchsorted(start, cut, "right") == np.searchsorted(end, cut, "right")]
    return np.sort(np.append(start, cut)), np.sort(np.append(end, cut + 1))


def _chain(way: FloatArray, height: FloatArray, first: IntArray, last: IntArray) -> list[int]:
    """Return the indices of the runs that cover most of the road, such that a road can join each with the next. O(runs)."""
    changes = running_sum(np.diff(height) != 0.0)
    # 0.1: weight of a run whose height never changes, such as 0 m before the first fix; other runs have 1
    covered = np.where(changes[last] > changes[first], 1.0, 0.1) * (way[last] - way[first])
    before = np.full(len(first), -1)
    for k in range(1, len(first)):
        # 500: largest number of successive runs that may be left out
        back = slice(max(k - 500, 0), k)
        over = np.abs(height[first[k]] - height[last[back]]) - HEIGHT_NOISE_M
        # 0.2: largest mean grade of a longer road: the steepest streets are only a few hundred metres long
        over -= 0.2 * (way[first[k]] - way[last[back]])
        # 25.0: length of road that each metre of a jump costs: a shorter run between two opposite jumps is
        # left out
        joined = covered[back] - 25.0 * np.maximum(over, 0.0)
        joined[over > MIN_FAULT_M - HEIGHT_NOISE_M] = 0.0
        best = int(joined.argmax())
        if joined[best] > 0.0:
            covered[k] += joined[best]
            before[k] = back.start + best
    chain = [int(covered.argmax())]
    while before[chain[0]] >= 0:
        chain.insert(0, int(before[chain[0]]))
    return chain


def _fixes(time: FloatArray, height: FloatArray, max_lines: int) -> IntArray | None:
    """Find samples between which heights are straight lines over time (Douglas and Peucker 1973); None for more than `max_lines` lines."""
    kept = {0, len(time) - 1}
    spans = [(0, len(time) - 1)]
    while spans:
        if len(kept) - 1 > max_lines:
            return None
        a, b = spans.pop()
        if b - a < 2:
            continue
        part = slice(a, b + 1)
        line = height[a] + (height[b] - height[a]) * (time[part] - time[a]) / (time[b] - time[a])
        off = np.abs(height[part] - line)
        worst = a + int(off.argmax())
        # 0.016: largest distance from a straight line of a height interpolated between two fixes and
        # rounded to 0.01 m
        if off[worst - a] > 0.016:
            kept.add(worst)
            spans += [(a, worst), (worst, b)]
    return np.array(sorted(kept), dtype=np.int64)
