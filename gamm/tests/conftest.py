"""Data and fits that several tests share; what needs the fits of real trips by mgcv skips where they are missing."""

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import settings

from gamm_samples import FULL, clustered
from tripwatt_gamm import GAMM

settings.register_profile("gate", derandomize=True, deadline=None)  # no test asserts a time
settings.load_profile("gate")


@pytest.fixture(scope="session")
def reference_dir():
    folder = Path(os.environ.get("TRIPWATT_REFERENCE", "../shared/reference"))
    if not (folder / "mgcv").is_dir():
        pytest.skip(f"no fits of mgcv at {folder}: set TRIPWATT_REFERENCE to the folder that holds them")
    return folder


@pytest.fixture(scope="session")
def frame():
    return clustered()


@pytest.fixture(scope="session")
def model(frame):
    return GAMM(FULL, "scat").fit(frame)


@pytest.fixture(scope="session")
def waves():
    """A wave of either sign by the factor f, a surface over a triangle, and random effects with sd 0.7."""
    rng = np.random.default_rng(11)
    n, groups = 600, 20
    frame = pd.DataFrame({"x": rng.uniform(0, 1, n), "g": np.repeat(np.arange(groups), n // groups)})
    frame["g"] = "g" + frame["g"].astype(str)
    frame["f"] = np.where(rng.uniform(size=n) < 0.5, "up", "down")
    frame["u"] = rng.uniform(0, 1, n)
    frame["v"] = frame["u"] * rng.uniform(0, 1, n)  # a triangle: one corner has no data
    wave = np.sin(6 * frame["x"]) * np.where(frame["f"] == "up", 1, -1)
    frame["y"] = wave + frame["u"] * frame["v"] * 3 + 0.7 * rng.normal(size=groups).repeat(n // groups)
    frame["y"] += 0.2 * rng.standard_t(6, n)
    return frame


@pytest.fixture(scope="session")
def waves_fit(waves):
    return GAMM('y ~ f + s(x, by=f, k=8) + te(u, v, k=4) + s(g, bs="re")', family="scat").fit(waves)
