"""Compare the residuals of a fitted model with the fitted error distribution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tripwatt_gamm.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tripwatt_gamm.estimator import Estimator


def _scatter(ax: Axes, x: FloatArray, y: FloatArray) -> None:
    from tripwatt_gamm import figures

    keep = figures.thin_index(x.size)
    # keep the extremes, which matter most in such a figure
    keep = np.union1d(keep, np.concatenate([np.argsort(y)[:10], np.argsort(y)[-10:]]))
    ax.scatter(x[keep], y[keep], s=7, color=figures.BLUE, alpha=0.35, linewidths=0, rasterized=True)


@dataclass(frozen=True, slots=True)
class ErrorDistribution:
    """The fitted error distribution: normal or sigma times Student's t.

    Attributes
    ----------
    sigma : float
        Scale, in units of the response.
    nu : float
        Degrees of freedom; NaN for the normal distribution.
    """

    sigma: float
    nu: float

    @property
    def name(self) -> str:
        """Name in figures."""
        return "normal" if np.isnan(self.nu) else f"t with {self.nu:.3g} df"

    @property
    def _frozen(self) -> Any:
        from scipy import stats

        return stats.norm(scale=self.sigma) if np.isnan(self.nu) else stats.t(self.nu, scale=self.sigma)

    def quantile(self, p: FloatArray) -> FloatArray:
        """Quantiles at probabilities `p`."""
        return np.asarray(self._frozen.ppf(p))

    def density(self, x: FloatArray) -> FloatArray:
        """Density at `x`."""
        return np.asarray(self._frozen.pdf(x))


def _distribution(model: Estimator) -> ErrorDistribution:
    nu = float("nan") if model.nu_ is None else float(model.nu_)
    return ErrorDistribution(float(np.sqrt(model.scale_)) if np.isnan(nu) else float(model.sigma_), nu)


@dataclass(frozen=True, slots=True)
class QuantileQuantile:
    """Ordered residuals and the quantiles of the fitted distribution; equal if the distribution is right.

    Attributes
    ----------
    residual : ndarray (n,)
        Sorted residuals, in units of the response.
    theoretical : ndarray (n,)
        Quantiles of the fitted distribution at (i - 1/2) / n.
    distribution : ErrorDistribution
        The fitted distribution.
    """

    residual: FloatArray
    theoretical: FloatArray
    distribution: ErrorDistribution

    @classmethod
    def from_residuals(cls, residual: FloatArray, distribution: ErrorDistribution) -> QuantileQuantile:
        """Sort residuals (n,) and compute the quantiles of the distribution at their ranks."""
        n = residual.size
        return cls(np.sort(residual), distribution.quantile((np.arange(n) + 0.5) / n), distribution)

    def band(self, at: NDArray[np.intp] | None = None) -> tuple[FloatArray, FloatArray]:
        """Compute the 95 % band of each ordered residual if the rows were independent.

        Parameters
        ----------
        at : ndarray of int, optional
            Positions of the ordered residuals; default all.

        Returns
        -------
        tuple of ndarray
            Lower and upper ends.
        """
        from scipy import stats

        n = self.residual.size
        i = 1 + (np.arange(n) if at is None else at)
        low, high = (self.distribution.quantile(stats.beta.ppf(p, i, n - i + 1)) for p in (0.025, 0.975))
        return low, high

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw it, on new axes if none are given."""
        from tripwatt_gamm import figures

        ax = figures.axes_or_new(ax)
        ends = np.arange(min(200, self.residual.size))
        keep = np.union1d(
            figures.thin_index(self.residual.size), np.concatenate([ends, self.residual.size - 1 - ends])
        )
        x = self.theoretical[keep]
        lower, upper = self.band(keep)
        ax.fill_between(
            x, lower, upper, color=figures.GREY, alpha=0.3, linewidth=0, label="95 %, were rows independent"
        )
        ax.scatter(x, self.residual[keep], s=8, color=figures.BLUE, alpha=0.6, linewidths=0, rasterized=True)
        ax.plot(x[[0, -1]], x[[0, -1]], color=figures.RED, linewidth=1.5)
        ax.legend(frameon=False, loc="upper left", fontsize="small")
        span = np.array([self.residual[0], self.residual[-1], x[0], x[-1]])
        pad = 0.04 * float(np.ptp(span))
        ax.set_ylim(float(span.min()) - pad, float(span.max()) + pad)
        ax.set(
            title="Q-Q plot", xlabel=f"Quantiles of the fitted {self.distribution.name}", ylabel="Residual"
        )
        return figures.figure_of(ax)


@dataclass(frozen=True, slots=True)
class ResidualHistogram:
    """Histogram of the residuals with the fitted density.

    Attributes
    ----------
    edges : ndarray (bins + 1,)
        Edges of the bins, from the 0.2 % to the 99.8 % quantile; with a heavy tail the full range would be one bar.
    count : ndarray (bins,)
        Residuals per bin.
    expected : ndarray (bins,)
        Number of residuals per bin that the fitted distribution predicts.
    below, above : int
        Residuals beyond the first and the last edge.
    distribution : str
        Name of the fitted distribution.
    """

    edges: FloatArray
    count: IntArray
    expected: FloatArray
    below: int
    above: int
    distribution: str

    @classmethod
    def from_residuals(cls, residual: FloatArray, distribution: ErrorDistribution) -> ResidualHistogram:
        """Bin residuals (n,) by the rule of Freedman & Diaconis, with 5 to 60 bins."""
        low, q1, q3, high = np.quantile(residual, [0.002, 0.25, 0.75, 0.998])
        width = 2 * (q3 - q1) / residual.size ** (1 / 3)
        bins = int(np.clip(np.ceil((high - low) / width) if width > 0 else 1, 5, 60))
        edges = np.linspace(low, high, bins + 1) if high > low else np.array([low - 0.5, low + 0.5])
        count = np.histogram(residual, edges)[0]
        # Simpson's rule on each bin
        ends, middle = distribution.density(edges), distribution.density((edges[1:] + edges[:-1]) / 2)
        mass = np.diff(edges) * (ends[1:] + 4 * middle + ends[:-1]) / 6
        below, above = int((residual < edges[0]).sum()), int((residual > edges[-1]).sum())
        return cls(edges, count, residual.size * mass, below, above, distribution.name)

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw it, on new axes if none are given."""
        from tripwatt_gamm import figures

        ax = figures.axes_or_new(ax)
        middle = (self.edges[1:] + self.edges[:-1]) / 2
        ax.bar(
            middle, self.count, width=np.diff(self.edges), color=figures.BLUE, alpha=0.5, label="residuals"
        )
        ax.plot(middle, self.expected, color=figures.RED, linewidth=1.5, label=self.distribution)
        note = f"{self.below} below, {self.above} above the axis" if self.below + self.above else ""
        ax.set(
            title="Histogram of residuals", xlabel=f"Residual ({note})" if note else "Residual", ylabel="Rows"
        )
        ax.set_ylim(
            0.0, 1.3 * max(float(self.count.max()), float(self.expected.max()))
        )  # room for the legend
        ax.legend(frameon=False, loc="upper right")
        return figures.figure_of(ax)


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The residuals of a fitted model, and four figures to check them.

    Attributes
    ----------
    fitted, residual : ndarray (n,)
        Fitted values, and response minus fitted values, in the order of the data.
    distribution : ErrorDistribution
        The fitted distribution of the errors.

    Examples
    --------
    >>> import pandas as pd
    >>> from tripwatt_gamm.model import GAMM
    >>> x = np.linspace(0, 1, 60)
    >>> frame = pd.DataFrame({"x": x, "y": np.sin(6 * x) + 0.2 * np.cos(90 * x)})
    >>> result = Diagnosis.from_model(GAMM("y ~ s(x, k=8)").fit(frame))
    >>> result.frame().shape
    (60, 4)
    >>> len(result.plot().axes)
    4
    """

    fitted: FloatArray
    residual: FloatArray
    distribution: ErrorDistribution

    @classmethod
    def from_model(cls, model: Estimator) -> Diagnosis:
        """Build the diagnosis from the residuals of a fitted model.

        Parameters
        ----------
        model : GAMM
            A fitted model.
        """
        return cls(model.fitted_values_, model.residuals_, _distribution(model))

    @property
    def qq(self) -> QuantileQuantile:
        """Residuals against the quantiles of their distribution."""
        return QuantileQuantile.from_residuals(self.residual, self.distribution)

    @property
    def histogram(self) -> ResidualHistogram:
        """Histogram of the residuals with the fitted density."""
        return ResidualHistogram.from_residuals(self.residual, self.distribution)

    def frame(self) -> pd.DataFrame:
        """Tabulate what the figures show.

        Returns
        -------
        DataFrame
            One row per row of the data: ``fitted``, ``response``, ``residual``, ``theoretical``.
        """
        import pandas as pd

        rank = np.argsort(np.argsort(self.residual, kind="stable"), kind="stable")
        columns = {"fitted": self.fitted, "response": self.fitted + self.residual, "residual": self.residual}
        return pd.DataFrame({**columns, "theoretical": self.qq.theoretical[rank]})

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw the four figures.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes that the 2 x 2 panels replace; a new figure by default.

        Returns
        -------
        matplotlib Figure
            The figure that was drawn on.
        """
        from tripwatt_gamm import figures

        place = figures.place_for_panels(ax, 9.0, 7.2)
        (first, second), (third, fourth) = place.subplots(2, 2)
        self.qq.plot(first)
        _scatter(second, self.fitted, self.residual)
        second.axhline(0.0, color=figures.RED, linewidth=1.5)
        second.set(title="Residuals and linear predictor", xlabel="Linear predictor", ylabel="Residual")
        self.histogram.plot(third)
        _scatter(fourth, self.fitted, self.fitted + self.residual)
        ends = [float(self.fitted.min()), float(self.fitted.max())]
        fourth.plot(ends, ends, color=figures.RED, linewidth=1.5)
        fourth.set(title="Response and fitted values", xlabel="Fitted value", ylabel="Response")
        return figures.figure_of(place)
