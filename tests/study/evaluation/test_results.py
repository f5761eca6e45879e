"""Results as files."""

import numpy as np
import pytest

from tripwatt.study.evaluation.results import _plain


def test_results_hold_plain_numbers():
    assert _plain(np.float64(2.5)) == 2.5
    with pytest.raises(TypeError, match="results hold a set"):
        _plain({1})
