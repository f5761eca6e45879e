"""Correctors as they are stored."""

import numpy as np
import pytest
from tests.hybrid.tables import EXACT, table

from tripwatt.hybrid.stored import StoredTrees, value_faults


@pytest.mark.parametrize(("divisor", "expected"), [(None, [105.0, 106.0]), (4, [2.5, 2.75])])
def test_stored_trees(divisor, expected) -> None:
    class Trees:
        """One column instead of trees."""

        def __len__(self) -> int:
            return 0

        def sum(self, X: np.ndarray) -> np.ndarray:
            return X[:, 0]

    trees = Trees()
    stored = StoredTrees(
        trees, ("row",), 100.0 if divisor is None else 0.0, 5.0 if divisor is None else 10.0, divisor
    )
    own = table([2], [0.1, 0.1])
    assert stored.predict(own) == pytest.approx(expected, **EXACT)
    assert stored.predict_with_uncertainty(own)[1].tolist() == [[0.0], [0.0]]
    assert stored.outside_factor(own).shape == (2, 0)


@pytest.mark.parametrize(("low", "high", "is_right"), [(1.0, 3.0, True), (2.0, 2.0, True), (3.0, 1.0, False)])
def test_the_ends_of_a_stored_range_are_in_order(low, high, is_right):
    faults = [*value_faults({"climate": [{"low": low, "high": high}]})]
    assert [fault.what for fault in faults] == ([] if is_right else ["values out of order"])
    assert all(f"low and high [{low}, {high}]" == fault.got for fault in faults)
