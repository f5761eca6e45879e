"""Generalised additive mixed models with gaussian or Student's t errors; knows neither cars nor trips."""
