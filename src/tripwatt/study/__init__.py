"""Reproduce the published figures: protocols, hold-outs, scores, the paper, the report, synthetic worlds."""
