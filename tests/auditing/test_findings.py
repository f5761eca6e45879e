"""Findings of an audit."""

import numpy as np
import pandas as pd

from tripwatt.auditing.findings import whole

NO = np.nan


def told(findings):
    return [(f.from_s, f.to_s, f.consequence, f.what) for f in findings]


def test_a_finding_on_a_whole_log_spans_its_known_stamps():
    stamps = pd.DataFrame({"time_s": [NO, 3.0, 4.0, 8.0, NO]})
    assert told([whole(stamps, "t", "words", "noted")]) == [(3.0, 8.0, "noted", "words")]
    assert told([whole(stamps[:1], "t", "words", "noted")]) == [(0.0, 0.0, "noted", "words")]
