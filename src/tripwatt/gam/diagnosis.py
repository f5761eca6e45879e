"""Is the fitted model believable? Residual figures, concurvity, autocorrelation within groups.

Every object gives its numbers by `frame` and draws itself by `plot`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tripwatt.errors import Fault, InvalidInput

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tripwatt.gam.model import GAMM

__all__ = [
    "Autocorrelation",
    "Diagnosis",
    "ErrorDistribution",
    "QuantileQuantile",
    "ResidualHistogram",
    "ResidualsAgainstPredictor",
    "ResponseAgainstFitted",
    "autocorrelation",
    "concurvity",
    "diagnosis",
]

_FloatArray = NDArray[np.float64]
BLUE: Final = "#0072B2"  # Okabe & Ito's palette, told apart by every eye
RED: Final = "#D55E00"
GREY: Final = "#999999"
_MOST_POINTS: Final = 4000  # more are not seen in a figure, only waited for


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.0, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    return figure.add_subplot()


def _thinned(n: int) -> NDArray[np.intp]:
    """Evenly spaced row numbers, all of them where they are few."""
    return np.unique(np.linspace(0, n - 1, min(n, _MOST_POINTS)).round().astype(np.intp))


def _scatter(ax: Axes, x: _FloatArray, y: _FloatArray) -> None:
    keep = _thinned(x.size)
    # the extremes are what such a figure is looked at for
    keep = np.union1d(keep, np.concatenate([np.argsort(y)[:10], np.argsort(y)[-10:]]))
    ax.scatter(x[keep], y[keep], s=7, color=BLUE, alpha=0.35, linewidths=0, rasterized=True)


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

    def quantile(self, p: _FloatArray) -> _FloatArray:
        """Quantiles at probabilities `p`."""
        from scipy import stats

        q = stats.norm.ppf(p) if np.isnan(self.nu) else stats.t.ppf(p, self.nu)
        return np.asarray(self.sigma * q, dtype=float)

    def density(self, x: _FloatArray) -> _FloatArray:
        """Density at `x`."""
        from scipy import stats

        z = x / self.sigma
        d = stats.norm.pdf(z) if np.isnan(self.nu) else stats.t.pdf(z, self.nu)
        return np.asarray(d / self.sigma, dtype=float)


def _distribution(model: GAMM) -> ErrorDistribution:
    nu = float("nan") if model.nu_ is None else float(model.nu_)
    return ErrorDistribution(float(np.sqrt(model.scale_)) if np.isnan(nu) else float(model.sigma_), nu)


@dataclass(frozen=True, slots=True)
class QuantileQuantile:
    """Ordered residuals against the quantiles of the fitted distribution; on the red line if it is right.

    Attributes
    ----------
    residual : ndarray (n,)
        Sorted residuals, in units of the response.
    theoretical : ndarray (n,)
        Quantiles of the fitted distribution at (i - 1/2) / n.
    distribution : ErrorDistribution
        The fitted distribution.
    """

    residual: _FloatArray
    theoretical: _FloatArray
    distribution: ErrorDistribution

    @classmethod
    def of(cls, residual: _FloatArray, distribution: ErrorDistribution) -> QuantileQuantile:
        """Sort residuals (n,) and find their quantiles."""
        n = residual.size
        return cls(np.sort(residual), distribution.quantile((np.arange(n) + 0.5) / n), distribution)

    def band(self, at: NDArray[np.intp] | None = None) -> tuple[_FloatArray, _FloatArray]:
        """Where 95 % of each ordered residual would lie, were the rows independent.

        Parameters
        ----------
        at : ndarray of int, optional
            Which of them; default all.

        Returns
        -------
        tuple of ndarray
            Lower and upper end.
        """
        from scipy import stats

        n = self.residual.size
        i = 1 + (np.arange(n) if at is None else at)
        low, high = (self.distribution.quantile(stats.beta.ppf(p, i, n - i + 1)) for p in (0.025, 0.975))
        return low, high

    def frame(self) -> pd.DataFrame:
        """The numbers: ``theoretical``, ``residual``, ``lower``, ``upper`` (of `band`)."""
        import pandas as pd

        lower, upper = self.band()
        columns = {"theoretical": self.theoretical, "residual": self.residual}
        return pd.DataFrame({**columns, "lower": lower, "upper": upper})

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw it, on new axes if none are given."""
        ax = _axes(ax)
        ends = np.arange(min(200, self.residual.size))
        keep = np.union1d(_thinned(self.residual.size), np.concatenate([ends, self.residual.size - 1 - ends]))
        x = self.theoretical[keep]
        lower, upper = self.band(keep)
        ax.fill_between(x, lower, upper, color=GREY, alpha=0.3, linewidth=0, label="95 %, were rows independent")
        ax.scatter(x, self.residual[keep], s=8, color=BLUE, alpha=0.6, linewidths=0, rasterized=True)
        ax.plot(x[[0, -1]], x[[0, -1]], color=RED, linewidth=1.5)
        ax.legend(frameon=False, loc="upper left", fontsize="small")
        span = np.array([self.residual[0], self.residual[-1], x[0], x[-1]])
        pad = 0.04 * float(np.ptp(span))
        ax.set_ylim(float(span.min()) - pad, float(span.max()) + pad)
        ax.set(
            title="Q-Q plot", xlabel=f"Quantiles of the fitted {self.distribution.name}", ylabel="Residual"
        )
        return ax


@dataclass(frozen=True, slots=True)
class ResidualsAgainstPredictor:
    """Residuals against the linear predictor: a pattern means that the model misses something.

    Attributes
    ----------
    linear_predictor, residual : ndarray (n,)
    """

    linear_predictor: _FloatArray
    residual: _FloatArray

    def frame(self) -> pd.DataFrame:
        """The numbers: ``linear_predictor``, ``residual``."""
        import pandas as pd

        return pd.DataFrame({"linear_predictor": self.linear_predictor, "residual": self.residual})

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw it, on new axes if none are given."""
        ax = _axes(ax)
        _scatter(ax, self.linear_predictor, self.residual)
        ax.axhline(0.0, color=RED, linewidth=1.5)
        ax.set(title="Residuals and linear predictor", xlabel="Linear predictor", ylabel="Residual")
        return ax


@dataclass(frozen=True, slots=True)
class ResidualHistogram:
    """Histogram of the residuals with the fitted density.

    Attributes
    ----------
    edges : ndarray (bins + 1,)
        Edges of the bins, from the 0.2 % to the 99.8 % quantile: a heavy tail would leave one bar.
    count : ndarray (bins,)
        Residuals per bin.
    expected : ndarray (bins,)
        What the fitted distribution has there, in residuals.
    below, above : int
        Residuals beyond the first and the last edge.
    distribution : str
        Name of the fitted distribution.
    """

    edges: _FloatArray
    count: NDArray[np.int64]
    expected: _FloatArray
    below: int
    above: int
    distribution: str

    @classmethod
    def of(cls, residual: _FloatArray, distribution: ErrorDistribution) -> ResidualHistogram:
        """Bin residuals (n,) after Freedman & Diaconis, at most 60 bins."""
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

    def frame(self) -> pd.DataFrame:
        """The numbers: ``left``, ``right``, ``count``, ``expected``."""
        import pandas as pd

        columns = {
            "left": self.edges[:-1],
            "right": self.edges[1:],
            "count": self.count,
            "expected": self.expected,
        }
        return pd.DataFrame(columns)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw it, on new axes if none are given."""
        ax = _axes(ax)
        middle = (self.edges[1:] + self.edges[:-1]) / 2
        ax.bar(middle, self.count, width=np.diff(self.edges), color=BLUE, alpha=0.5, label="residuals")
        ax.plot(middle, self.expected, color=RED, linewidth=1.5, label=self.distribution)
        note = f"{self.below} below, {self.above} above the axis" if self.below + self.above else ""
        ax.set(
            title="Histogram of residuals", xlabel=f"Residual ({note})" if note else "Residual", ylabel="Rows"
        )
        ax.set_ylim(
            0.0, 1.3 * max(float(self.count.max()), float(self.expected.max()))
        )  # room for the legend
        ax.legend(frameon=False, loc="upper right")
        return ax


@dataclass(frozen=True, slots=True)
class ResponseAgainstFitted:
    """Response against fitted values.

    Attributes
    ----------
    fitted, response : ndarray (n,)
    """

    fitted: _FloatArray
    response: _FloatArray

    def frame(self) -> pd.DataFrame:
        """The numbers: ``fitted``, ``response``."""
        import pandas as pd

        return pd.DataFrame({"fitted": self.fitted, "response": self.response})

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw it, on new axes if none are given."""
        ax = _axes(ax)
        _scatter(ax, self.fitted, self.response)
        ends = [float(self.fitted.min()), float(self.fitted.max())]
        ax.plot(ends, ends, color=RED, linewidth=1.5)
        ax.set(title="Response and fitted values", xlabel="Fitted value", ylabel="Response")
        return ax


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The four residual figures of a fitted model.

    Attributes
    ----------
    qq : QuantileQuantile
    predictor : ResidualsAgainstPredictor
    histogram : ResidualHistogram
    response : ResponseAgainstFitted
    """

    qq: QuantileQuantile
    predictor: ResidualsAgainstPredictor
    histogram: ResidualHistogram
    response: ResponseAgainstFitted

    def frame(self) -> pd.DataFrame:
        """One row per row of the data: ``fitted``, ``response``, ``linear_predictor``, ``residual``, ``theoretical``."""
        whole = self.response.frame().join(self.predictor.frame())
        rank = np.argsort(np.argsort(self.predictor.residual, kind="stable"), kind="stable")
        return whole.assign(theoretical=self.qq.theoretical[rank])

    def plot(self, figure: Figure | None = None) -> Figure:
        """Draw the four figures, on a new 2 x 2 figure if none is given."""
        if figure is None:
            from matplotlib.backends.backend_agg import FigureCanvasAgg
            from matplotlib.figure import Figure

            figure = Figure(figsize=(9.0, 7.2), layout="constrained")
            FigureCanvasAgg(figure)
        axes = figure.subplots(2, 2)
        self.qq.plot(axes[0, 0])
        self.predictor.plot(axes[0, 1])
        self.histogram.plot(axes[1, 0])
        self.response.plot(axes[1, 1])
        return figure


def diagnosis(model: GAMM) -> Diagnosis:
    """Residual figures of a fitted model.

    Parameters
    ----------
    model : GAMM
        A fitted model.

    Returns
    -------
    Diagnosis
        ``.qq``, ``.predictor``, ``.histogram``, ``.response``; ``.plot()`` draws all four.
    """
    distribution = _distribution(model)
    residual = np.asarray(model.residuals_, dtype=float)
    fitted = np.asarray(model.fitted_values_, dtype=float)
    return Diagnosis(
        QuantileQuantile.of(residual, distribution),
        ResidualsAgainstPredictor(np.asarray(model.linear_predictor_, dtype=float), residual),
        ResidualHistogram.of(residual, distribution),
        ResponseAgainstFitted(fitted, fitted + residual),
    )


def concurvity(model: GAMM) -> pd.DataFrame:
    """How far each term can be had from all the others: 0 not at all, 1 entirely.

    A term's function f splits into the part g that lies in the space of the other terms and the rest. All three
    measures are ||g||^2 / ||f||^2 on the rows of the data (after Ramsay, Burnett & Krewski 2003, Epidemiology
    14:18, for functions; Wood 2017, section 5.6, for these three).

    Parameters
    ----------
    model : GAMM
        A fitted model.

    Returns
    -------
    pandas.DataFrame
        Indexed by term ("parametric" holds all parametric ones): ``worst``, over all functions that the term
        could be; ``observed``, for the function that was fitted; ``estimate``, for its basis as a whole.
    """
    import pandas as pd

    spans: dict[str, list[slice]] = {}
    for block in model.blocks_:
        spans.setdefault("parametric" if block.kind == "parametric" else block.label, []).append(block.slice)
    columns = np.arange(model.coef_.size)
    rows = {}
    for label, slices in spans.items():
        inside = np.concatenate([columns[s] for s in slices])
        rows[label] = _concurvity(model.R_, model.coef_, inside)
    return pd.DataFrame.from_dict(
        rows, orient="index", columns=["worst", "observed", "estimate"]
    ).rename_axis("term")


def _concurvity(
    factor: _FloatArray, coef: _FloatArray, inside: NDArray[np.intp]
) -> tuple[float, float, float]:
    """Worst, observed and estimate of the columns `inside` of X, from any A with A'A = X'X."""
    alive = np.flatnonzero((factor**2).sum(axis=0) > 0)
    inside = np.intersect1d(inside, alive)
    outside = np.setdiff1d(alive, inside)
    if inside.size == 0 or outside.size == 0:
        return (0.0, 0.0, 0.0)
    others, own = _orthonormal(factor[:, outside]), _orthonormal(factor[:, inside])
    worst = float(np.linalg.svd(others.T @ own, compute_uv=False)[0] ** 2)
    shadow = others.T @ factor[:, inside]
    fit, part = factor[:, inside] @ coef[inside], shadow @ coef[inside]
    observed = float(part @ part / (fit @ fit)) if fit @ fit > 0 else 0.0
    estimate = float((shadow**2).sum() / (factor[:, inside] ** 2).sum())
    return min(worst, 1.0), min(observed, 1.0), min(estimate, 1.0)


def _orthonormal(a: _FloatArray) -> _FloatArray:
    """Basis of the column space; columns that repeat others add nothing to it."""
    u, size, _ = np.linalg.svd(a / np.linalg.norm(a, axis=0), full_matrices=False)
    return np.asarray(u[:, size > 1e-8 * size[0]], dtype=float)


@dataclass(frozen=True, slots=True)
class Autocorrelation:
    """Correlation of residuals with later ones of the same group.

    Attributes
    ----------
    lag : ndarray (m,)
        In rows, from 1.
    correlation : ndarray (m,)
        Pooled over the groups.
    pairs : ndarray (m,)
        Pairs of rows behind each value.
    """

    lag: NDArray[np.intp]
    correlation: _FloatArray
    pairs: NDArray[np.intp]

    @property
    def bound(self) -> _FloatArray:
        """Twice the standard error of each correlation if the rows were independent."""
        return np.asarray(2 / np.sqrt(np.maximum(self.pairs, 1)), dtype=float)

    @property
    def warning(self) -> str:
        """What this means for the summary; empty if the rows may pass for independent."""
        first = float(self.correlation[0]) if self.lag.size else 0.0
        if first <= max(0.1, float(self.bound[0]) if self.lag.size else 0.0):
            return ""
        return (
            f"Neighbouring residuals within a group correlate with {first:.4f}. The model takes the rows for "
            "independent: its EDFs are too large, its standard errors and p-values too small. Believe only a "
            "validation that leaves out whole groups."
        )

    def frame(self) -> pd.DataFrame:
        """The numbers: ``lag``, ``correlation``, ``pairs``, ``bound``."""
        import pandas as pd

        columns = {"lag": self.lag, "correlation": self.correlation, "pairs": self.pairs, "bound": self.bound}
        return pd.DataFrame(columns)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw it, on new axes if none are given."""
        ax = _axes(ax)
        ax.fill_between(self.lag, -self.bound, self.bound, color=GREY, alpha=0.3, linewidth=0)
        ax.vlines(self.lag, 0.0, self.correlation, color=BLUE, linewidth=2)
        ax.axhline(0.0, color="black", linewidth=0.8)
        ax.set(title="Autocorrelation within groups", xlabel="Lag (rows)", ylabel="Correlation of residuals")
        return ax


def autocorrelation(
    residuals: ArrayLike, groups: ArrayLike | Sequence[object], max_lag: int = 30
) -> Autocorrelation:
    """Autocorrelation of residuals within groups, rows in the order of the data.

    Parameters
    ----------
    residuals : array_like, shape (n,)
        Residuals, those of one group in their order of time.
    groups : array_like, shape (n,)
        Group of each row.
    max_lag : int
        Largest lag, in rows; cut to the longest group.

    Returns
    -------
    Autocorrelation

    Raises
    ------
    InvalidInput
        If lengths differ, a residual is not finite or there is no pair within a group.

    Examples
    --------
    >>> result = autocorrelation([1.0, -1.0, 1.0, -1.0], ["a", "a", "b", "b"], max_lag=1)
    >>> result.correlation.tolist(), result.pairs.tolist()
    ([-1.0], [2])
    """
    import pandas as pd

    r = np.asarray(residuals, dtype=float)
    code = pd.factorize(np.asarray(groups))[0]
    faults = []
    if r.shape != code.shape:
        faults.append(Fault("lengths differ", "residuals and groups", f"{r.size} and {code.size}", "equal"))
    if not np.isfinite(r).all():
        faults.append(Fault("not finite", "residuals", f"{(~np.isfinite(r)).sum()} values", "finite numbers"))
    if faults:
        raise InvalidInput(faults)
    order = np.argsort(code, kind="stable")
    r, code = r[order] - r.mean(), code[order]
    longest = int(np.bincount(code).max(initial=0)) if r.size else 0
    lags = np.arange(1, min(max_lag, longest - 1) + 1)
    if lags.size == 0:
        raise InvalidInput(
            Fault("no pair of rows", "groups", f"longest has {longest} rows", "two rows or more")
        )
    variance = float(r @ r) / r.size
    correlation, pairs = np.zeros(lags.size), np.zeros(lags.size, dtype=np.intp)
    for i, lag in enumerate(lags):
        same = code[lag:] == code[:-lag]
        pairs[i] = int(same.sum())
        product = float(r[lag:][same] @ r[:-lag][same])
        correlation[i] = product / pairs[i] / variance if variance > 0 else 0.0
    return Autocorrelation(lags, correlation, pairs)
