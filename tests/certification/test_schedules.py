"""Traces with the changes of speed of the schedules of certification."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from tools.data.schedules import available, circuit, counted, published

from tripwatt.certification.consumption import driven_wh_per_km
from tripwatt.certification.schedules import CYCLES, SPEED_STEP_M_S, schedule
from tripwatt.vehicles import load_vehicle

# Length [km], duration [s], highest speed [km/h] and seconds at a standstill: 40 CFR 86 appendix I, 40 CFR 600 appendix I, UN GTR 15.
PUBLISHED = {
    "udds": (11.99, 1369, 91.25),
    "hwfet": (16.51, 765, 96.4),
    "wltc": (23.27, 1800, 131.3),
}


@pytest.mark.parametrize("cycle", CYCLES)
def test_traces_have_length_duration_and_top_speed_of_the_schedules(cycle: str) -> None:
    time, speed = schedule(cycle)
    length, duration, top = PUBLISHED[cycle]
    assert (time[0], time[-1], len(speed)) == (0.0, duration, duration + 1)
    assert np.all(np.diff(time) == 1.0)
    assert np.trapezoid(speed, time) / 1000.0 == pytest.approx(length, abs=0.01)
    assert speed.max() * 3.6 == pytest.approx(top, abs=0.2)
    assert (speed[0], speed[-1], speed.min()) == (0.0, 0.0, 0.0)
    assert not speed.flags.writeable


def test_a_circuit_by_hand() -> None:
    # two hops 0-1-0 and 0-2-0, two seconds at 0 and three at 2
    counts = {(0, 1): 1, (1, 0): 1, (0, 2): 1, (2, 0): 1, (0, 0): 2, (2, 2): 3}
    for order in range(4):
        found = circuit(counts, order).tolist()
        assert Counter(pairwise(found)) == counts
        assert found[0] == found[-1] == 0
        assert len(found) == 10
        top = found.index(2)
        assert found[top : top + 4] == [2, 2, 2, 2]
    # standing still is spread over the visits, not done at once
    assert circuit({(0, 1): 2, (1, 0): 2, (0, 0): 3}, 0).tolist() == [0, 0, 1, 0, 0, 1, 0, 0]


@pytest.mark.parametrize("cycle", CYCLES)
def test_energy_is_that_of_the_schedule(cycle: str) -> None:
    if not available(cycle):
        pytest.skip("no schedule: install fastsim 2.1.5, the extra `schedules`")
    steps = np.rint(schedule(cycle)[1] / SPEED_STEP_M_S).astype(int).tolist()
    assert Counter(pairwise(steps)) == Counter(counted(cycle))
    for name in ("vw_id3", "fiat_500e"):
        car = load_vehicle(name)
        mass = car.body.test_mass_kg
        mine = driven_wh_per_km(car, schedule(cycle), mass)
        assert mine == pytest.approx(driven_wh_per_km(car, published(cycle), mass), rel=0.005)
