"""Measures of the code and of its tests: sizes, mutants, same numbers, the probe of published results."""
