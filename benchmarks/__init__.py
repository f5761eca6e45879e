"""Measurements against peers and against the project's own bars. Not part of the package, not part of the gate."""
