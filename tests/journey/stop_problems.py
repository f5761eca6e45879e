"""Roads with stations that are made from a seed, and every plan of one, tried."""

import numpy as np

from tripwatt.journey.solver import StopProblem

LEVELS = np.arange(21) / 20


def made_problem(seed, stations=None, length_km=None):
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
    return StopProblem(
        float(rng.uniform(0.3, 1.0)), taken, need, time, shape - shape[:, :1], rng.uniform(60.0, 600.0)
    )


def exhaustive(problem):
    """Least time of all sequences of stations and levels; a way is given up only where driving straight on would take longer than a whole plan."""
    end, best, levels = len(problem.taken) - 1, float("inf"), problem.levels.tolist()
    taken, need, time = problem.taken.tolist(), problem.need.tolist(), problem.time_s.tolist()
    charging = problem.charging_s.tolist()

    def drive(node, level, spent):
        nonlocal best
        if level >= need[node][end]:
            best = min(best, spent + time[node][end])
        for there in range(end - 1, node, -1):
            if level < need[node][there]:
                continue
            arrived = spent + time[node][there]
            arrival = min(max(level - taken[node][there], 0.0), 1.0)
            here = float(np.interp(arrival, levels, charging[there]))
            for k, leave in enumerate(levels):
                total = arrived + max(charging[there][k] - here, 0.0) + problem.overhead_s
                if total + time[there][end] >= best:
                    break
                drive(there, leave, total)

    drive(0, problem.start_soc, 0.0)
    return best
