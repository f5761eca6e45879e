"""What reproduces the figures: protocols, hold-outs, scores, the paper, the report, synthetic worlds."""
