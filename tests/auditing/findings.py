"""Findings as tuples."""

NO = float("nan")


def told(findings):
    return [(f.from_s, f.to_s, f.consequence, f.what) for f in findings]
