"""Findings of an audit."""

import pandas as pd
from tests.auditing.findings import NO, told

from tripwatt.auditing.findings import whole


def test_a_finding_on_a_whole_log_spans_its_known_stamps():
    stamps = pd.DataFrame({"time_s": [NO, 3.0, 4.0, 8.0, NO]})
    assert told([whole(stamps, "t", "words", "noted")]) == [(3.0, 8.0, "noted", "words")]
    assert told([whole(stamps[:1], "t", "words", "noted")]) == [(0.0, 0.0, "noted", "words")]
