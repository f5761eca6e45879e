"""Compare the residuals of a fitted model with the fitted error distribution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats

from tripwatt_gamm.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tripwatt_gamm.estimator import Estimator


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The residuals of a fitted model, and four figures to check them.

    Attributes
    ----------
    predictor, fitted, response : ndarray (n,)
        Linear predictor, fitted values and response, in the order of the data.
    residual : ndarray (n,)
        Response minus fitted values, times the root of the prior weight; deviance residuals if errors are not additive.
    sigma : float
        Scale of the fitted error distribution, in the unit of the response.
    nu : float
        Degrees of freedom of Student's t; NaN for normal errors.

    Examples
    --------
    >>> import pandas as pd
    >>> from tripwatt_gamm.model import GAMM
    >>> x = np.linspace(0, 1, 60)
    >>> frame = pd.DataFrame({"x": x, "y": np.sin(6 * x) + 0.2 * np.cos(90 * x)})
    >>> result = Diagnosis.from_model(GAMM("y ~ s(x, k=8)").fit(frame))
    >>> result.distribution_name
    'normal'
    >>> len(result.plot().axes)
    4
    """

    predictor: FloatArray
    fitted: FloatArray
    response: FloatArray
    residual: FloatArray
    sigma: float
    nu: float

    @classmethod
    def from_model(cls, model: Estimator) -> Diagnosis:
        """Build the diagnosis from the residuals of a fitted model.

        Parameters
        ----------
        model : GAMM
            A fitted model.
        """
        values = model.linear_predictor_, model.fitted_values_, model.response_, model.scaled_residuals_
        return cls(*values, float(model.sigma_), float(model.nu_))

    @property
    def distribution(self) -> Any:
        """The fitted error distribution, frozen by `scipy.stats`."""
        return stats.norm(scale=self.sigma) if np.isnan(self.nu) else stats.t(self.nu, scale=self.sigma)

    @property
    def distribution_name(self) -> str:
        """Name of the fitted error distribution in figures."""
        return "normal" if np.isnan(self.nu) else f"t with {self.nu:.3g} df"

    def plot(self, figure: Figure | None = None) -> Figure:
        """Draw the four figures.

        Parameters
        ----------
        figure : matplotlib Figure, optional
            Empty figure to draw on; a new one by default.

        Returns
        -------
        matplotlib Figure
            The figure that was drawn on.
        """
        from tripwatt_gamm import figures

        figure = figures.new_figure(9.0, 7.2) if figure is None else figure
        (quantiles, residuals), (histogram, response) = figure.subplots(2, 2)
        self._plot_quantiles(quantiles)
        figures.scatter(residuals, self.predictor, self.residual)
        residuals.axhline(0.0, color=figures.RED, linewidth=1.5)
        residuals.set(title="Residuals and linear predictor", xlabel="Linear predictor", ylabel="Residual")
        self._plot_histogram(histogram)
        figures.scatter(response, self.fitted, self.response)
        ends = [float(self.fitted.min()), float(self.fitted.max())]
        response.plot(ends, ends, color=figures.RED, linewidth=1.5)
        response.set(title="Response and fitted values", xlabel="Fitted value", ylabel="Response")
        return figure

    def _plot_quantiles(self, ax: Axes) -> None:
        """Draw the sorted residuals over the quantiles of the fitted distribution, with a 95 % band for independent rows."""
        from tripwatt_gamm import figures

        n, ordered = len(self.residual), np.sort(self.residual)
        shown = figures.shown_rows(ordered)
        # the i-th of n independent probabilities follows a beta distribution
        below, above = (stats.beta.ppf(p, shown + 1, n - shown) for p in (0.025, 0.975))
        low, middle, high = self.distribution.ppf([below, (shown + 0.5) / n, above])
        band = "95 %, were rows independent"
        ax.fill_between(middle, low, high, color=figures.GREY, alpha=0.3, linewidth=0, label=band)
        figures.scatter(ax, middle, ordered[shown])
        ax.plot(middle[[0, -1]], middle[[0, -1]], color=figures.RED, linewidth=1.5)
        ax.legend(frameon=False, loc="upper left", fontsize="small")
        ends = np.array([ordered[0], ordered[-1], middle[0], middle[-1]])
        margin = 0.04 * float(np.ptp(ends))
        ax.set_ylim(float(ends.min()) - margin, float(ends.max()) + margin)
        label = f"Quantiles of the fitted {self.distribution_name}"
        ax.set(title="Q-Q plot", xlabel=label, ylabel="Residual")

    def _plot_histogram(self, ax: Axes) -> None:
        """Draw the histogram of the residuals with the number that the fitted distribution expects in each bin."""
        from tripwatt_gamm import figures

        # with a heavy tail, bins over the full range would be one bar
        inner = tuple(np.quantile(self.residual, [0.002, 0.998]))
        count, edges, _ = ax.hist(
            self.residual, 40, range=inner, color=figures.BLUE, alpha=0.5, label="residuals"
        )
        expected = len(self.residual) * np.diff(self.distribution.cdf(edges))
        middle = (edges[1:] + edges[:-1]) / 2
        ax.plot(middle, expected, color=figures.RED, linewidth=1.5, label=self.distribution_name)
        beyond = len(self.residual) - int(np.sum(count))
        label = f"Residual ({beyond} beyond the axis)" if beyond else "Residual"
        ax.set(title="Histogram of residuals", xlabel=label, ylabel="Rows")
        ax.set_ylim(top=1.3 * max(float(np.max(count)), float(expected.max())))  # room for the legend
        ax.legend(frameon=False, loc="upper right")
