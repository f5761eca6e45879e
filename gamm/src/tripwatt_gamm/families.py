"""Distributions of the response around the smooth predictor, each with its link.

Exponential families follow McCullagh & Nelder (1989, Generalized Linear Models, chapter 2): with weight w and scale phi
the log-likelihood of a row is w / phi times a kernel in the response and the linear predictor, plus a normaliser. The
scaled t follows Wood, Pya & Säfken (2016, section 3 and appendix): y = eta + sigma * T_nu.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.special import betaln, digamma, expit, gammaln, logit, xlogy, zeta

from tripwatt_gamm.arrays import BoolArray, FloatArray, Index

LOG_EXCESS_DF = (math.log(1e-9), math.log(1e7))
"""Bounds of log(nu - min_df): near the lower one nu counts as at its bound, at the upper one errors are gaussian to
working precision."""


AT_BOUND = 1e-3
"""Distance of nu from its lower bound up to which it counts as at the bound: a choice, because no figure shows less."""


@dataclass(frozen=True)
class Response:
    """Response, prior weights and offset of the rows, (n,) each."""

    y: FloatArray
    weights: FloatArray
    offset: FloatArray

    @classmethod
    def of(cls, y: FloatArray) -> Response:
        """Build the response of rows with weight 1 and without offset."""
        return cls(y, np.ones_like(y), np.zeros_like(y))

    def at(self, rows: Index) -> Response:
        """Return the response of some rows, in the given order."""
        return Response(self.y[rows], self.weights[rows], self.offset[rows])


class Link(NamedTuple):
    """Function that maps the mean to the linear predictor, and its inverse."""

    name: str
    predictor: Callable[[FloatArray], FloatArray]
    mean: Callable[[FloatArray], FloatArray]


IDENTITY = Link("identity", np.asarray, np.asarray)
LOG = Link("log", np.log, np.exp)
LOGIT = Link("logit", logit, expit)


class Family(ABC):
    """Base class of the distributions of the response.

    Attributes
    ----------
    name : str
        Name as an option of `tripwatt_gamm.GAMM`.
    link : Link
    scaled_rows : bool
        Whether prior weights divide the variance of additive errors, so that rows times their roots have equal errors.
    allowed, limits : str, tuple of float
        Values that the response can have.
    bounds : ndarray (2, m)
        Bounds of the parameters of the family.

    Examples
    --------
    >>> family, rows, eta, theta = Poisson(), Response.of(np.array([1.0, 3.0])), np.zeros(2), np.zeros(1)
    >>> family.link.name, family.estimates_scale, family.start(rows.y).round(3).tolist()
    ('log', False, [0.095, 1.065])
    >>> family.derivatives(rows, eta, theta)[1].tolist(), family.information(rows, eta, theta).tolist()
    ([0.0, 2.0], [1.0, 1.0])
    >>> family.deviance(rows, eta, theta).round(3).tolist()
    [0.0, 2.592]
    """

    name: ClassVar[str]
    link: ClassVar[Link] = IDENTITY
    scaled_rows: ClassVar[bool] = False
    allowed: ClassVar[str] = "finite numbers"
    limits: ClassVar[tuple[float, float]] = (-math.inf, math.inf)
    bounds: ClassVar[FloatArray]

    @property
    def estimates_scale(self) -> bool:
        """Whether a scale is estimated that divides the penalties, as the variance of normal errors."""
        return isinstance(self, ExponentialFamily) and self.scale is None

    @property
    @abstractmethod
    def free(self) -> BoolArray:
        """Which parameters of the family are estimated, (m,)."""

    @abstractmethod
    def derivatives(self, rows: Response, eta: FloatArray, theta: FloatArray) -> FloatArray:
        """Compute the log-likelihood of each row and its derivatives in the linear predictor.

        Parameters
        ----------
        rows : Response
            Response and prior weights.
        eta : ndarray, shape (n,)
            Linear predictor.
        theta : ndarray, shape (m,)
            Parameters of the family.

        Returns
        -------
        ndarray, shape (4, n)
            Orders 0 to 3.
        """

    @abstractmethod
    def deviance(self, rows: Response, eta: FloatArray, theta: FloatArray) -> FloatArray:
        """Compute the contribution of each row to the deviance.

        Parameters
        ----------
        rows : Response
            Response and prior weights of n rows.
        eta : ndarray, shape (n,)
            Linear predictor.
        theta : ndarray, shape (m,)
            Parameters of the family.

        Returns
        -------
        ndarray, shape (n,)
            At least 0.
        """

    @abstractmethod
    def information(self, rows: Response, eta: FloatArray, theta: FloatArray) -> FloatArray:
        """Compute the Fisher information of each row about its linear predictor.

        Parameters
        ----------
        rows : Response
            Response and prior weights of n rows.
        eta : ndarray, shape (n,)
            Linear predictor.
        theta : ndarray, shape (m,)
            Parameters of the family.

        Returns
        -------
        ndarray, shape (n,)
            Above 0.
        """

    def start(self, y: FloatArray) -> FloatArray:
        """Compute a rough linear predictor of a response, moved towards its mean, to start from.

        Parameters
        ----------
        y : ndarray, shape (n,)
            Response.

        Returns
        -------
        ndarray, shape (n,)
            Link of nine tenths of the response and a tenth of its mean.
        """
        return self.link.predictor(0.9 * y + 0.1 * y.mean())


@dataclass(frozen=True, slots=True)
class ExponentialFamily(Family):
    """Base class of the exponential families: a kernel, the kernel of a perfect fit and a normaliser.

    Attributes
    ----------
    scale : float, optional
        Dispersion; estimated if None. It is 1 for counts and proportions.
    """

    bounds = np.array([[-math.inf], [math.inf]])
    scale: float | None = None

    @property
    def free(self) -> BoolArray:
        """Whether the log of the scale, the only parameter, is estimated."""
        return np.array([self.scale is None])

    def first(self, rows: Response, eta: FloatArray) -> FloatArray:
        """Return the log of the scale: the given one, or the mean deviance."""
        if self.scale is not None:
            return np.array([math.log(self.scale)])
        return np.asarray(np.log(self.deviance(rows, eta, np.zeros(1)).mean(keepdims=True)))

    @abstractmethod
    def _kernel(self, y: FloatArray, eta: FloatArray) -> tuple[FloatArray, ...]:
        """Kernel and its first three derivatives in eta."""

    def _perfect(self, y: FloatArray) -> FloatArray:
        """Kernel of a perfect fit."""
        return self._kernel(y, self.link.predictor(y))[0]

    @abstractmethod
    def _normaliser(self, y: FloatArray, precision: FloatArray) -> FloatArray:
        """Part of the log-likelihood without the predictor, at precision w / phi."""

    def derivatives(self, rows: Response, eta: FloatArray, theta: FloatArray) -> FloatArray:
        """Log-likelihood and derivatives (4, n)."""
        precision = rows.weights * np.exp(-theta[0])
        orders: FloatArray = precision * np.array(self._kernel(rows.y, eta))
        orders[0] += self._normaliser(rows.y, precision)
        return orders

    def deviance(self, rows: Response, eta: FloatArray, theta: FloatArray) -> FloatArray:
        """Contributions to the deviance (n,), not divided by the scale."""
        gap = self._perfect(rows.y) - self._kernel(rows.y, eta)[0]
        return np.asarray(2 * rows.weights * np.maximum(gap, 0.0))

    def information(self, rows: Response, eta: FloatArray, theta: FloatArray) -> FloatArray:
        """Fisher information (n,): for each of these families that of the response at its mean."""
        return np.asarray(-rows.weights * np.exp(-theta[0]) * self._kernel(self.link.mean(eta), eta)[2])


@dataclass(frozen=True, slots=True)
class Gaussian(ExponentialFamily):
    """Normal errors with constant variance.

    Attributes
    ----------
    scale : float, optional
        Variance; estimated if None.

    Examples
    --------
    >>> Gaussian().name, Gaussian(scale=0.01).scale
    ('gaussian', 0.01)
    """

    name, scaled_rows = "gaussian", True

    def _kernel(self, y: FloatArray, eta: FloatArray) -> tuple[FloatArray, ...]:
        return -((y - eta) ** 2) / 2, y - eta, -np.ones_like(y), np.zeros_like(y)

    def _normaliser(self, y: FloatArray, precision: FloatArray) -> FloatArray:
        return np.log(precision / (2 * math.pi)) / 2


@dataclass(frozen=True, slots=True)
class Gamma(ExponentialFamily):
    """Positive responses whose standard deviation is proportional to their mean; log link.

    Attributes
    ----------
    scale : float, optional
        Squared coefficient of variation; estimated if None.

    Examples
    --------
    >>> Gamma().deviance(Response.of(np.ones(1)), np.zeros(1), np.zeros(1)).tolist()
    [0.0]
    >>> Gamma().dispersion(np.array([1.0, 3.0]), np.full(2, 2.0), np.ones(2), freedom=1.0)
    0.5
    """

    name, link = "gamma", LOG
    allowed, limits = "numbers above 0", (np.finfo(float).tiny, math.inf)

    def _kernel(self, y: FloatArray, eta: FloatArray) -> tuple[FloatArray, ...]:
        ratio = y * np.exp(-eta)
        return -eta - ratio, ratio - 1, -ratio, ratio

    def _perfect(self, y: FloatArray) -> FloatArray:
        return -np.log(y) - 1

    def _normaliser(self, y: FloatArray, precision: FloatArray) -> FloatArray:
        return np.asarray(precision * np.log(precision) - gammaln(precision) + (precision - 1) * np.log(y))

    def dispersion(self, y: FloatArray, mean: FloatArray, weights: FloatArray, freedom: float) -> float:
        """Estimate the scale by the moments of Fletcher (2012, Biometrika 99:230), which outliers near 0 move little.

        Parameters
        ----------
        y, mean, weights : ndarray, shape (n,)
            Response, fitted means and prior weights.
        freedom : float
            Residual degrees of freedom.

        Returns
        -------
        float
            Squared coefficient of variation.
        """
        ratio = y / mean - 1
        return float(weights @ ratio**2 / freedom / (1 + 2 * ratio.mean()))


@dataclass(frozen=True, slots=True)
class Poisson(ExponentialFamily):
    """Counts; log link.

    Attributes
    ----------
    scale : float
        Dispersion, 1.

    Examples
    --------
    >>> Poisson().derivatives(Response.of(np.ones(1)), np.zeros(1), np.zeros(1)).tolist()
    [[-1.0], [0.0], [-1.0], [-1.0]]
    """

    name, link = "poisson", LOG
    allowed, limits = "numbers of at least 0", (0.0, math.inf)
    scale: float | None = 1.0

    def _kernel(self, y: FloatArray, eta: FloatArray) -> tuple[FloatArray, ...]:
        mean = np.exp(eta)
        return y * eta - mean, y - mean, -mean, -mean

    def _perfect(self, y: FloatArray) -> FloatArray:
        return np.asarray(xlogy(y, y) - y)

    def _normaliser(self, y: FloatArray, precision: FloatArray) -> FloatArray:
        return np.asarray(-precision * gammaln(y + 1))


@dataclass(frozen=True, slots=True)
class Binomial(ExponentialFamily):
    """Shares of successes, with the numbers of trials as prior weights, or 0 and 1; logit link.

    Attributes
    ----------
    scale : float
        Dispersion, 1.

    Examples
    --------
    >>> Binomial().information(Response.of(np.ones(1)), np.zeros(1), np.zeros(1)).tolist()
    [0.25]
    """

    name, link = "binomial", LOGIT
    allowed, limits = "shares between 0 and 1", (0.0, 1.0)
    scale: float | None = 1.0

    def _kernel(self, y: FloatArray, eta: FloatArray) -> tuple[FloatArray, ...]:
        mean, variance = expit(eta), expit(eta) * expit(-eta)
        return y * eta - np.logaddexp(0, eta), y - mean, -variance, -variance * (1 - 2 * mean)

    def _perfect(self, y: FloatArray) -> FloatArray:
        return np.asarray(xlogy(y, y) + xlogy(1 - y, 1 - y))

    def _normaliser(self, y: FloatArray, precision: FloatArray) -> FloatArray:
        successes = precision * y
        return np.asarray(-np.log1p(precision) - betaln(successes + 1, precision - successes + 1))


@dataclass(frozen=True, slots=True)
class ScaledT(Family):
    """Errors sigma times Student's t with nu degrees of freedom; prior weights divide sigma squared.

    Attributes
    ----------
    min_df : float
        Lower bound of nu; 3 keeps the variance finite with room to spare.
    nu, sigma : float, optional
        Fixed values; estimated if None.

    Examples
    --------
    >>> family, rows = ScaledT(), Response.of(np.array([0.0, 1.0]))
    >>> theta = family.theta(nu=5.0, sigma=1.0)
    >>> family.derivatives(rows, np.zeros(2), theta)[:2].round(4).tolist()
    [[-0.9686, -1.5156], [0.0, 1.0]]
    >>> family.deviance(rows, np.zeros(2), theta).round(4).tolist()
    [0.0, 1.0939]
    >>> round(float(family.information(rows, np.zeros(2), theta)[0]), 4)
    0.75
    >>> family.shape(theta)[1], round(float(family.objective(rows.y, theta)[0]), 4)
    (1.0, 2.4842)
    """

    name = "scat"
    scaled_rows, bounds = True, np.column_stack([LOG_EXCESS_DF, [-math.inf, math.inf]])
    min_df: float = 3.0
    nu: float | None = None
    sigma: float | None = None

    def theta(self, nu: float, sigma: float) -> FloatArray:
        """Compute the parameters log(nu - min_df), kept within its bounds, and log(sigma).

        Parameters
        ----------
        nu, sigma : float
            Shape and scale.

        Returns
        -------
        ndarray, shape (2,)
            A given nu has no lower bound: then the first is log(nu).
        """
        low, high = LOG_EXCESS_DF
        excess = math.log(max(nu - self._least, math.exp(low)))
        return np.array([min(excess, high), math.log(sigma)])

    def shape(self, theta: FloatArray) -> tuple[float, float]:
        """Compute shape and scale.

        Parameters
        ----------
        theta : ndarray, shape (2,)
            Parameters of the family.

        Returns
        -------
        tuple of float
            nu and sigma.
        """
        return self._least + math.exp(theta[0]), math.exp(theta[1])

    @property
    def _least(self) -> float:
        return self.min_df if self.nu is None else 0.0

    @property
    def free(self) -> BoolArray:
        """Whether nu and sigma are estimated."""
        return np.array([self.nu is None, self.sigma is None])

    def derivatives(self, rows: Response, eta: FloatArray, theta: FloatArray) -> FloatArray:
        """Compute the log-likelihood of each row and its derivatives in the linear predictor.

        Parameters
        ----------
        rows : Response
            Response and prior weights of n rows.
        eta : ndarray, shape (n,)
            Linear predictor.
        theta : ndarray, shape (m,)
            Parameters of the family.

        Returns
        -------
        ndarray, shape (4, n)
            Orders 0 to 3.
        """
        nu, sigma = self.shape(theta)
        root, t2 = np.sqrt(rows.weights), nu * sigma**2
        r = root * (rows.y - eta)
        q = r**2 + t2
        constant = gammaln((nu + 1) / 2) - gammaln(nu / 2) - math.log(math.pi * t2) / 2 + np.log(root)
        first, second = (nu + 1) * r / q, (nu + 1) * (r**2 - t2) / q**2
        third = (nu + 1) * 2 * r * (r**2 - 3 * t2) / q**3
        likelihood = constant - (nu + 1) / 2 * np.log1p(r**2 / t2)
        return np.array([likelihood, root * first, root**2 * second, root**3 * third])

    def deviance(self, rows: Response, eta: FloatArray, theta: FloatArray) -> FloatArray:
        """Compute the contribution of each row to the deviance: (nu + 1) log(1 + r^2 / (nu sigma^2)).

        Parameters
        ----------
        rows : Response
            Response and prior weights of n rows.
        eta : ndarray, shape (n,)
            Linear predictor.
        theta : ndarray, shape (m,)
            Parameters of the family.

        Returns
        -------
        ndarray, shape (n,)
            At least 0.
        """
        nu, sigma = self.shape(theta)
        return np.asarray((nu + 1) * np.log1p(rows.weights * ((rows.y - eta) / sigma) ** 2 / nu))

    def information(self, rows: Response, eta: FloatArray, theta: FloatArray) -> FloatArray:
        """Compute the Fisher information of each row: (nu + 1) / ((nu + 3) sigma^2), times its weight.

        Parameters
        ----------
        rows : Response
            Response and prior weights of n rows.
        eta : ndarray, shape (n,)
            Linear predictor.
        theta : ndarray, shape (m,)
            Parameters of the family.

        Returns
        -------
        ndarray, shape (n,)
            Above 0.
        """
        nu, sigma = self.shape(theta)
        return rows.weights * ((nu + 1) / ((nu + 3) * sigma**2))

    def objective(self, residual: FloatArray, theta: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Compute the negative log-likelihood of residuals.

        Parameters
        ----------
        residual : ndarray, shape (n,)
            Response minus linear predictor.
        theta : ndarray, shape (2,)
            Parameters of the family.

        Returns
        -------
        tuple
            Value, gradient (2,) and Hessian (2, 2) in `theta`.
        """
        nu, sigma = self.shape(theta)
        excess, n = math.exp(theta[0]), len(residual)
        ratio = residual**2 / (nu * sigma**2)
        p = ratio / (1 + ratio)
        logs, first = float(np.log1p(ratio).sum()), float(p.sum())
        spread = first - float(p @ p)
        half = np.array([(nu + 1) / 2, nu / 2])
        constant = float(np.subtract(*gammaln(half))) - math.log(math.pi * nu) / 2 - theta[1]
        slope = float(np.subtract(*digamma(half))) / 2 - 1 / (2 * nu)
        bend = float(np.subtract(*zeta(2, half))) / 4 + 1 / (2 * nu**2)
        in_nu = n * slope - logs / 2 + (nu + 1) * first / (2 * nu)
        in_nu2 = n * bend + first / nu - (nu + 1) * (spread + first) / (2 * nu**2)
        gradient = np.array([excess * in_nu, (nu + 1) * first - n])
        mixed = excess * (first - (nu + 1) * spread / nu)
        hessian = np.array([[excess**2 * in_nu2 + gradient[0], mixed], [mixed, -2 * (nu + 1) * spread]])
        return -(n * constant - (nu + 1) / 2 * logs), -gradient, -hessian


FAMILIES: dict[str, Family] = {
    family.name: family for family in (Gaussian(), ScaledT(), Gamma(), Poisson(), Binomial())
}
"""Families by name, with default settings."""
