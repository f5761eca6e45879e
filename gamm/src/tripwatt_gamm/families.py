"""Distributions of the response around the smooth predictor: gaussian, and Student's t with unknown scale.

The scaled t follows Wood, Pya & Säfken (2016, section 3 and appendix): y = eta + sigma * T_nu. All of its
derivatives come from one complex logarithm, log(t^2 + u^2) = 2 Re log(u + i t) with u = y - eta and
t = sigma sqrt(nu), whose derivatives in u and t are powers of 1 / (u + i t).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

import numpy as np
from scipy.special import digamma, gammaln, polygamma

from tripwatt_gamm.arrays import BoolArray, FloatArray

LOG_EXCESS_DF = (math.log(1e-9), math.log(1e7))
"""Bounds of log(nu - min_df): near the lower one nu counts as at its bound, at the upper one errors are gaussian to
working precision."""


@dataclass(frozen=True, slots=True)
class Gaussian:
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

    name: ClassVar[str] = "gaussian"
    scale: float | None = None


@dataclass(frozen=True, slots=True)
class ScaledT:
    """Errors sigma times Student's t with nu degrees of freedom.

    Attributes
    ----------
    min_df : float
        Lower bound of nu; 3 keeps the variance finite with room to spare.
    nu, sigma : float, optional
        Fixed values; estimated if None.

    Examples
    --------
    >>> family, residual = ScaledT(), np.array([0.0, 1.0])
    >>> round(float(family.loglik(np.zeros(1), nu=5.0, sigma=1.0)), 4)
    -0.9686
    >>> family.deviance(residual, nu=5.0).round(4).tolist()
    [0.0, 1.0939]
    >>> family.score(residual, nu=5.0, sigma=1.0).tolist()
    [0.0, 1.0]
    >>> family.expected_weight(nu=5.0, sigma=1.0)
    0.75
    """

    name: ClassVar[str] = "scat"
    min_df: float = 3.0
    nu: float | None = None
    sigma: float | None = None

    def loglik(self, residual: FloatArray, nu: float, sigma: float) -> float:
        """Sum the log-likelihood of residuals.

        Parameters
        ----------
        residual : ndarray, shape (n,)
            Response minus linear predictor.
        nu : float
            Degrees of freedom.
        sigma : float
            Scale of the errors, in the unit of the response.

        Returns
        -------
        float
            Natural logarithm, with all constants.
        """
        n = len(residual)
        return n * _log_constant(nu, sigma) - (nu + 1) / 2 * float(
            np.log1p((residual / sigma) ** 2 / nu).sum()
        )

    def deviance(self, residual: FloatArray, nu: float) -> FloatArray:
        """Compute the contribution of each residual to the deviance: (nu + 1) log(1 + r^2 / nu).

        Parameters
        ----------
        residual : ndarray, shape (n,)
            Response minus linear predictor, over sigma.
        nu : float
            Degrees of freedom.

        Returns
        -------
        ndarray, shape (n,)
            At least 0.
        """
        return np.asarray((nu + 1) * np.log1p(residual**2 / nu))

    def score(self, residual: FloatArray, nu: float, sigma: float) -> FloatArray:
        """Compute the derivative of the log-likelihood in the linear predictor.

        Parameters
        ----------
        residual : ndarray, shape (n,)
            Response minus linear predictor.
        nu : float
            Degrees of freedom.
        sigma : float
            Scale of the errors, in the unit of the response.

        Returns
        -------
        ndarray, shape (n,)
            Derivative of each row; it is bounded, so that an outlier has little weight.
        """
        return np.asarray((nu + 1) * residual / (nu * sigma**2 + residual**2))

    def expected_weight(self, nu: float, sigma: float) -> float:
        """Compute the Fisher information of one row: (nu + 1) / ((nu + 3) sigma^2).

        Parameters
        ----------
        nu : float
            Degrees of freedom.
        sigma : float
            Scale of the errors, in the unit of the response.

        Returns
        -------
        float
            The same for every row.
        """
        return (nu + 1) / ((nu + 3) * sigma**2)


Family: TypeAlias = Gaussian | ScaledT


def _log_constant(nu: float, sigma: float) -> float:
    return float(gammaln((nu + 1) / 2) - gammaln(nu / 2) - math.log(math.pi * nu) / 2 - math.log(sigma))


@dataclass(frozen=True, slots=True)
class Theta:
    """Shape and scale of a scaled t as parameters of the optimiser: (log(nu - min_df), log sigma)."""

    excess: float
    log_sigma: float
    min_df: float

    @classmethod
    def from_estimates(cls, nu: float, sigma: float, min_df: float) -> Theta:
        """Build from nu and sigma; log(nu - min_df) is kept within its bounds."""
        low, high = LOG_EXCESS_DF
        excess = math.log(max(nu - min_df, math.exp(low)))
        return cls(min(excess, high), math.log(sigma), min_df)

    def step(self, excess: float, log_sigma: float) -> Theta:
        """Return the parameters after a step; log(nu - min_df) is kept within its bounds."""
        low, high = LOG_EXCESS_DF
        return Theta(float(np.clip(self.excess + excess, low, high)), self.log_sigma + log_sigma, self.min_df)

    @property
    def nu(self) -> float:
        """Degrees of freedom."""
        return self.min_df + math.exp(self.excess)

    @property
    def sigma(self) -> float:
        """Scale."""
        return math.exp(self.log_sigma)

    @property
    def at_bound(self) -> bool:
        """Whether nu is less than 1e-3 above its lower bound."""
        return self.nu - self.min_df < 1e-3

    def jacobian(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """First (2,) and second (2, 2) derivatives of nu, and of t = sigma sqrt(nu), in the two parameters."""
        nu, a = self.nu, math.exp(self.excess)
        t = self.sigma * math.sqrt(nu)
        half = t * a / (2 * nu)
        nu1, nu2 = np.array([a, 0.0]), np.array([[a, 0.0], [0.0, 0.0]])
        t1 = np.array([half, t])
        t2 = np.array([[half + t * a**2 * (1 / (4 * nu**2) - 1 / (2 * nu**2)), half], [half, t]])
        return nu1, nu2, t1, t2


@dataclass(frozen=True, slots=True)
class TDerivatives:
    """Derivatives of the log-likelihood of a scaled t.

    Attributes
    ----------
    eta : ndarray (5, n)
        Orders 0 to 4 in the linear predictor.
    eta_theta : ndarray (4, 2, n)
        Orders 0 to 3 in the predictor, once in each of the two parameters of `Theta`.
    eta_theta2 : ndarray (3, 2, 2, n)
        Orders 0 to 2 in the predictor, twice in the parameters.
    """

    eta: FloatArray
    eta_theta: FloatArray
    eta_theta2: FloatArray


def t_derivatives(residual: FloatArray, theta: Theta) -> TDerivatives:
    """Compute all derivatives that Laplace REML with an exact Hessian needs.

    Parameters
    ----------
    residual : ndarray (n,)
        y minus the linear predictor.
    theta : Theta
        Shape and scale.

    Returns
    -------
    TDerivatives
    """
    nu, sigma = theta.nu, theta.sigma
    t = sigma * math.sqrt(nu)
    inverse = 1 / (residual + 1j * t)
    f = np.log(t * t + residual**2)
    powers = [2 * (-1) ** (j - 1) * math.factorial(j - 1) * inverse**j for j in range(1, 5)]
    h = -(nu + 1) / 2

    def from_log(order_u: int, order_t: int) -> FloatArray:
        if order_u + order_t == 0:
            return np.asarray(f)
        return np.asarray((1j**order_t * powers[order_u + order_t - 1]).real)

    sign = [1.0, -1.0, 1.0, -1.0, 1.0]
    eta = np.array([h * sign[j] * from_log(j, 0) for j in range(5)])
    eta[0] += gammaln((nu + 1) / 2) - gammaln(nu / 2) - math.log(math.pi) / 2 + nu * math.log(t)
    c1 = (digamma((nu + 1) / 2) - digamma(nu / 2)) / 2
    c2 = (polygamma(1, (nu + 1) / 2) - polygamma(1, nu / 2)) / 4
    in_nu = np.array([-0.5 * sign[j] * from_log(j, 0) for j in range(4)])
    in_nu[0] += c1 + math.log(t)
    in_t = np.array([h * sign[j] * from_log(j, 1) for j in range(4)])
    in_t[0] += nu / t
    in_nu_t = np.array([-0.5 * sign[j] * from_log(j, 1) for j in range(3)])
    in_nu_t[0] += 1 / t
    in_t_t = np.array([h * sign[j] * from_log(j, 2) for j in range(3)])
    in_t_t[0] -= nu / t**2
    nu1, nu2, t1, t2 = theta.jacobian()
    first = in_nu[:, None] * nu1[:, None] + in_t[:, None] * t1[:, None]
    crossed = np.outer(nu1, t1) + np.outer(t1, nu1)
    second = (
        in_nu_t[:, None, None] * crossed[..., None]
        + in_t_t[:, None, None] * np.outer(t1, t1)[..., None]
        + in_nu[:3, None, None] * nu2[..., None]
        + in_t[:3, None, None] * t2[..., None]
    )
    second[0] += c2 * np.outer(nu1, nu1)[..., None]
    return TDerivatives(eta, first, second)


def theta_objective(residual: FloatArray, theta: Theta) -> tuple[float, FloatArray, FloatArray]:
    """Log-likelihood of residuals (n,) with its gradient (2,) and Hessian (2, 2) in the parameters of `Theta`."""
    nu = theta.nu
    t = theta.sigma * math.sqrt(nu)
    square = residual**2
    inverse = 1.0 / (square + t * t)
    n = float(len(residual))
    f, q1, q2 = -float(np.log(inverse).sum()), float(inverse.sum()), float(inverse @ inverse)
    f_t, f_tt = 2 * t * q1, 2 * q1 - 4 * t * t * q2
    value = (
        n * (gammaln((nu + 1) / 2) - gammaln(nu / 2) - math.log(math.pi) / 2 + nu * math.log(t))
        - (nu + 1) / 2 * f
    )
    d_nu = n * ((digamma((nu + 1) / 2) - digamma(nu / 2)) / 2 + math.log(t)) - f / 2
    d_t = n * nu / t - (nu + 1) / 2 * f_t
    nu1, nu2, t1, t2 = theta.jacobian()
    d_nunu = n * (polygamma(1, (nu + 1) / 2) - polygamma(1, nu / 2)) / 4
    d_nut = n / t - f_t / 2
    d_tt = -n * nu / t**2 - (nu + 1) / 2 * f_tt
    gradient = d_nu * nu1 + d_t * t1
    hessian = (
        d_nunu * np.outer(nu1, nu1)
        + d_nut * (np.outer(nu1, t1) + np.outer(t1, nu1))
        + d_tt * np.outer(t1, t1)
        + d_nu * nu2
        + d_t * t2
    )
    return float(value), gradient, hessian


def fit_theta(residual: FloatArray, theta: Theta, free: tuple[bool, bool], steps: int = 50) -> Theta:
    """Estimate shape and scale from residuals (n,) by maximum likelihood: Newton's method with step halving.

    Parameters
    ----------
    residual : ndarray (n,)
        y minus the linear predictor.
    theta : Theta
        Start.
    free : tuple of bool
        Whether nu is estimated, and whether sigma is.
    steps : int
        Largest number of Newton steps.

    Returns
    -------
    Theta
    """
    is_free = np.array(free)
    low, high = LOG_EXCESS_DF
    value, gradient, hessian = theta_objective(residual, theta)
    for _ in range(steps):
        stuck = (theta.excess <= low and gradient[0] <= 0) or (theta.excess >= high and gradient[0] >= 0)
        active = is_free & np.array([not stuck, True])
        if not active.any() or np.abs(gradient[active]).max() <= 1e-9 * (1 + abs(value)):
            break
        step = _ascent(gradient, hessian, active)
        for _ in range(30):
            trial = theta.step(float(step[0]), float(step[1]))
            trial_value, trial_gradient, trial_hessian = theta_objective(residual, trial)
            if trial_value >= value:
                break
            step = step / 2
        else:
            break
        gain = trial_value - value
        theta, value, gradient, hessian = trial, trial_value, trial_gradient, trial_hessian
        if gain <= 1e-13 * (1 + abs(value)):
            break
    return theta


def _ascent(gradient: FloatArray, hessian: FloatArray, active: BoolArray) -> FloatArray:
    """Newton step on the active parameters, turned uphill, with components of at most 3."""
    step = np.zeros(2)
    values, vectors = np.linalg.eigh(-hessian[np.ix_(active, active)])
    steepest = float(np.abs(gradient).max())
    floor = max(
        1e-8 * float(np.abs(values).max()), 1e-12 * steepest, 1e-300
    )  # bounds the divisor in a flat direction
    step[active] = vectors @ ((vectors.T @ gradient[active]) / np.maximum(np.abs(values), floor))
    return np.asarray(step * min(1.0, 3.0 / max(float(np.abs(step).max()), 1e-300)))
