"""The residual process as a matrix, by the textbook: what the package computes without one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.uncertainty.process import ComponentProcess, ResidualProcess, Segments


def component_covariance(
    process: ComponentProcess, time_s: FloatArray, size_w: FloatArray, noise_w: FloatArray
) -> FloatArray:
    """Covariance of one component [W²], shape (segments, segments)."""
    lag = np.abs(time_s[:, None] - time_s)
    start = np.sqrt(1.0 + process.onset**2 * np.exp(-time_s / process.onset_time_s))
    covariance = process.drift_sd_w**2 * np.exp(-lag / process.drift_time_s) * np.outer(start, start)
    covariance += process.constant_sd_w**2 + process.share_sd**2 * np.outer(size_w, size_w)
    covariance[np.diag_indices(len(time_s))] += (process.noise * noise_w) ** 2
    return np.asarray(covariance)


def covariance(process: ResidualProcess, segments: Segments, component: str = "joint") -> FloatArray:
    """Covariance of "drive", "climate" or both [W²], shape (segments, segments)."""
    found = np.zeros((len(segments), len(segments)))
    if component != "climate":
        found += component_covariance(
            process.drive, segments.time_s, segments.moved_w, segments.drive_noise_w
        )
    if component != "drive":
        found += component_covariance(
            process.climate, segments.time_s, segments.climate_w, np.ones(len(segments))
        )
    return found


@dataclass(frozen=True, eq=False)
class DensePower:
    """Residual power with its covariance (Rasmussen and Williams 2006, section 2.2)."""

    mean_w: FloatArray
    covariance_w2: FloatArray

    @classmethod
    def from_covariance(cls, covariance_w2: FloatArray) -> DensePower:
        """Before anything was observed: mean 0."""
        return cls(np.zeros(len(covariance_w2)), covariance_w2)

    def given(self, weights: FloatArray, observed: FloatArray, variance: FloatArray) -> DensePower:
        """After ``weights @ residual power`` was observed with independent errors."""
        cross = self.covariance_w2 @ weights.T
        total = weights @ cross + np.diag(variance)
        scale = np.sqrt(np.diag(total))
        gain = np.linalg.solve(total / np.outer(scale, scale), (cross / scale).T).T / scale
        covariance = self.covariance_w2 - gain @ cross.T
        return DensePower(
            self.mean_w + gain @ (observed - weights @ self.mean_w), 0.5 * (covariance + covariance.T)
        )

    def sd_wh(self, hours: FloatArray) -> FloatArray:
        """Standard deviation of the cumulative energy at the end of each segment [Wh]."""
        scaled = self.covariance_w2 * np.outer(hours, hours)
        variance = np.diag(np.cumsum(np.cumsum(scaled, axis=0), axis=1))
        return np.sqrt(np.maximum(variance, 0.0))
