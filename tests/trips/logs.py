"""Logs of random values at given times."""

import numpy as np
import pandas as pd
from hypothesis import strategies as st


def log(time: np.ndarray, seed: int = 0) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    return pd.DataFrame(
        {
            "time_s": time,
            "speed_m_s": rng.uniform(0, 30, len(time)),
            "voltage_v": rng.uniform(340, 400, len(time)),
            "current_a": rng.normal(20, 40, len(time)),
        }
    )


steps = st.lists(st.floats(0.05, 3.0), min_size=3, max_size=200)
