"""Linear baselines, against arithmetic that is written out here."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from tests.hybrid.tables import EXACT

from tripwatt.hybrid.trip_table import EnergyRegression, PhysicsOnly


def test_regression_of_the_relative_error() -> None:
    """Two trips with one regressor: each row is divided by its energy, so (1/2 + 2/2) over (1/4 + 4/4)."""
    own = SimpleNamespace(
        last_rows=np.array([1, 3]),
        observed_wh=np.array([1.0, 2.0, 1.0, 2.0]),
        totals=pd.DataFrame({"km": [0.5, 1.0, 1.0, 2.0]}),
        simulated=lambda name: {"x": np.array([0.0, 3.0, 0.0, 5.0])}[name],
    )
    model = EnergyRegression(("km",)).fit(own)
    assert model.coefficients_ == pytest.approx([(0.5 + 1.0) / (0.25 + 1.0)], **EXACT)
    assert model.predict(own) == pytest.approx(1.2 * np.array([0.5, 1.0, 1.0, 2.0]), **EXACT)
    # with the simulation: 3 a + 1 b = 2 and 5 a + 2 b = 2
    both = EnergyRegression(("km",), "x").fit(own)
    assert both.coefficients_ == pytest.approx([2.0, -4.0], **EXACT)
    assert PhysicsOnly("x").fit(own).predict(own).tolist() == [0.0, 3.0, 0.0, 5.0]
