"""Roads with stations that are made from a seed, and every plan of one, tried."""

import numpy as np

from tripwatt.roads.journey.solver import MIN_CHARGE_S, MIN_GAIN_SOC, StopProblem

LEVELS = np.arange(21) / 20


def made_problem(seed, stations=None, length_km=None, paused=False):
    """A road with up to 30 stations, their detours, powers and temperatures, and legs with errors."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 31)) if stations is None else stations
    length = float(rng.uniform(150.0, 420.0)) if length_km is None else length_km
    position = np.concatenate(([0.0], np.sort(rng.uniform(0.0, length, count)), [length]))
    hills = np.concatenate(([0.0], rng.normal(0.0, 0.01, count + 1)))
    off = np.concatenate(([0.0], rng.uniform(0.0, 3.0, count), [0.0]))
    way = position - position[:, None] + off + off[:, None]
    taken = way / rng.uniform(180.0, 320.0) + np.cumsum(hills) - np.cumsum(hills)[:, None]
    need = taken + rng.uniform(0.02, 0.15) + np.hypot(0.1 * taken, 0.01)
    time = np.where(np.triu(np.ones_like(way), 1) > 0.0, 3600.0 * way / 100.0, np.inf)
    shape = np.cumsum(1.0 + 4.0 * LEVELS**4) * rng.uniform(8.0, 60.0, (count + 2, 1))
    start, overhead = float(rng.uniform(0.3, 1.0)), rng.uniform(60.0, 600.0)
    pause = np.where(rng.random(count + 2) < 0.2, rng.uniform(0.0, 7200.0, count + 2), 0.0) * paused
    return StopProblem(start, taken, need, time, shape - shape[:, :1], overhead, pause)


def exhaustive(problem):
    """Least time of all sequences of stations and all levels in each; infinity where none arrives.

    A way is given up only where no end of it can take less than the best plan so far: what is left takes at least the drive straight on, and
    what the charge lacks for that at the highest power of all stations ahead, with the overhead of a stop.
    """
    require_longer_by_stations(problem)
    end, best, levels = len(problem.taken) - 1, np.inf, problem.levels
    min_left = (problem.need - problem.taken)[:-1, end].min()
    lacks = np.maximum(problem.taken[:-1, end, None] + min_left - levels, 0.0)
    step = np.diff(problem.charging_s, axis=1).min(axis=1)[:-1] / np.diff(levels).max()
    fastest = np.append(
        np.minimum.accumulate(step[::-1])[::-1][1:], 1e9
    )  # after the last station there is none
    left_s = problem.time_s[:-1, end, None] + lacks * fastest[:, None] + problem.overhead_s * (lacks > 0.0)
    left_s -= problem.pause_s.sum()

    def drive(node, soc, spent):
        nonlocal best
        direct = spent[soc >= problem.need[node, end]]
        best = min(best, direct.min(initial=np.inf) + problem.time_s[node, end])
        there = np.arange(node + 1, end)
        arrival = np.clip(soc - problem.taken[node, there, None], 0.0, 1.0)
        here = np.array(
            [np.interp(a, levels, problem.charging_s[k]) for a, k in zip(arrival, there, strict=True)]
        )
        arrived = (
            spent + problem.time_s[node, there, None] + problem.overhead_s - problem.pause_s[there, None]
        )
        arrived = np.where(soc >= problem.need[node, there, None], arrived, np.inf)
        charged = problem.charging_s[there][:, None, :] - here.reshape(*arrived.shape, 1)
        charged = np.where(
            levels - MIN_GAIN_SOC >= arrival[:, :, None],
            np.maximum(
                charged, np.maximum(problem.pause_s - problem.overhead_s, MIN_CHARGE_S)[there, None, None]
            ),
            np.inf,
        )
        total = (arrived[:, :, None] + charged).min(axis=1)
        for k in reversed(range(len(there))):
            useful = total[k] + left_s[there[k]] < best
            if useful.any():
                drive(int(there[k]), levels[useful], total[k][useful])

    drive(0, np.array([problem.start_soc]), np.zeros(1))
    return float(best)


def require_longer_by_stations(problem):
    """What the bound of `exhaustive` rests on: no station makes a drive shorter, or take less."""
    for way in (problem.time_s, problem.taken):
        for k in range(1, len(way) - 1):
            assert np.all(way[:k, k, None] + way[k, k + 1 :] >= way[:k, k + 1 :] - 1e-9)
