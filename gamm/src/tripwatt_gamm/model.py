"""The public model class, with summary, effects, diagnosis and figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from tripwatt_gamm.diagnosis import Diagnosis
from tripwatt_gamm.effects import Effect, plot_effects, term_effects
from tripwatt_gamm.estimator import Estimator
from tripwatt_gamm.inference import variance_components
from tripwatt_gamm.summary import Summary

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class GAMM(Estimator):
    """Generalised additive mixed model.

    Parameters
    ----------
    formula : str or Formula
        ``"y ~ weather + s(time, by=season) + s(trip, bs='re')"``, or the same as objects.
    family : {"gaussian", "scat", "gamma", "poisson", "binomial"} or Family
        Distribution of the response: normal or Student's t errors, or Gamma and Poisson with the log link, binomial
        with the logit link.
    method : {"fREML", "REML"}
        How smoothing parameters are chosen. For gaussian errors both are restricted maximum likelihood. For the
        scaled t "fREML" is the performance iteration (fast), "REML" exact Laplace REML; for all others both are the
        latter.
    discretise : bool
        Whether covariates are rounded to an even grid of 1,000 values if there are more than 10,000 rows.
    extrapolation : {"linear", "clamp"}
        Rule for a curve or a numeric column outside its training range (for a by-smooth, that of the rows of its
        level): continued as a straight line, or held constant. Surfaces are always held constant: at the edge of the
        range, and farther than a twentieth of it from the nearest training point. With "clamp" the row itself is
        moved, so that all terms of a covariate are evaluated at the same point.
    smoothing_parameters : sequence of float, optional
        Given values, in the order of `smoothing_parameters_`.
    ar1_rho : float or "estimate", optional
        Correlation of successive errors within groups. With a scaled t the innovations are sigma times Student's t;
        with a scaled t, estimating this correlation or correlated random effects requires ``method="REML"``.
    tolerance : float
        The iteration of the scaled t stops once nothing changes by more than this many standard errors.
    max_iter : int
        Largest number of iterations.
    select : bool
        Whether every smooth gets a further penalty of what its own do not reach, a straight line for instance, so that
        it can vanish (Marra & Wood 2011).

    Attributes
    ----------
    coef_, coef_names_
        Coefficients (p,) and their names.
    Vp_ : ndarray (p, p)
        Bayesian posterior covariance.
    edf_, edf1_ : ndarray (p,)
        Diagonals of F = (X'WX + S)^-1 X'WX, and of 2 F - F F.
    R_ : ndarray (p, p)
        A matrix with R'R = X'WX / scale.
    terms_
        Fitted pieces.
    smoothing_parameters_ : dict
        Smoothing parameters by the label of the term, numbered if the term has several.
    scale_, reml_scale_, nu_, sigma_, nu_at_bound_
        Dispersion (1 for the scaled t, counts and shares) and the one of the REML score, from which that of Gamma
        differs; shape and scale of the t.
    log_sp_covariance_, slopes_ : ndarray (M, M), (p, M)
        Covariance of the logs of `smoothing_parameters_`, from the Hessian of the score; slopes of the coefficients in them.
    loadings_, joint_covariance_ : ndarray (q,), (q + M, q + M)
        Loadings of correlated effects: the lower triangle of the unit matrix L in Sigma = L D L', row by row, times the
        ratio of the root mean squares of the row's and the column's multiplier. Their covariance with these logs.
    reml_, loglik_, aic_, bic_, deviance_explained_, r2_, n_, residual_df_
        `reml_` is the negative log restricted likelihood; lme4's REML criterion is twice as large.
    fitted_values_, linear_predictor_, residuals_, deviance_residuals_ : ndarray (n,)
        Means of the rows of the fit, their links, response minus mean, and signed roots of `deviance_`'s parts.
    converged_, n_iter_, message_, hessian_, notes_
        Whether and how the fit ended, the Hessian of the score there, and notes on changes to the model that the data forced.
    empty_columns_ : list of str
        Coefficients without data: 0 with standard error 0.
    ranges_, levels_ : dict
        Training range of each covariate; levels of each factor.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from tripwatt_gamm import Formula, Smooth
    >>> rng = np.random.default_rng(1)
    >>> frame = pd.DataFrame({"x": np.linspace(0, 1, 100), "trip": np.repeat(list("abcde"), 20)})
    >>> y = np.sin(6 * frame["x"]) + 0.1 * rng.standard_normal(100)
    >>> model = GAMM(Formula(None, (Smooth(("x",)),))).fit(frame, y)
    >>> bool(model.converged_), bool(model.r2_ > 0.9)
    (True, True)
    >>> error = np.abs(model.predict(frame) - np.sin(6 * frame["x"]))
    >>> bool(error.max() < 0.2), bool((model.intervals(frame)["std_error"] > 0.0).all())
    (True, True)
    >>> model.extrapolation_mask(pd.DataFrame({"x": [0.5, 1.5]})).tolist()
    [False, True]
    >>> model.leave_groups_out(frame, y, groups="trip").shape
    (100,)
    >>> model.summary().formula, list(model.effects(frame)), model.diagnosis().distribution_name
    ('~ s(x)', ['s(x)'], 'normal')
    >>> model.variance_components()["term"].tolist(), len(model.plot(frame).axes)
    (['Residual'], 1)
    """

    def summary(self) -> Summary:
        """Summarise the fit: ``print(model.summary())``.

        Returns
        -------
        Summary
            Tables, tests and scores.
        """
        return Summary.from_model(self)

    def variance_components(self, level: float = 0.95) -> pd.DataFrame:
        """Tabulate the standard deviations of all random effects and of the errors.

        Parameters
        ----------
        level : float
            Coverage of the intervals, between 0 and 1.

        Returns
        -------
        DataFrame
            Table of `tripwatt_gamm.inference.variance_components`.
        """
        return variance_components(self, level)

    def effects(
        self, frame: pd.DataFrame | None = None, level: float = 0.95, points: int | None = None
    ) -> dict[str, Effect]:
        """Compute the effect of each term: curves with bands, surfaces, coefficients, random effects.

        Parameters
        ----------
        frame : DataFrame, optional
            The data. Needed for rugs and points, and to leave out the parts of a surface that are far from all data.
        level : float
            Coverage of the bands, between 0 and 1.
        points : int, optional
            Points of the grid per covariate. Default 200 for curves, 60 for surfaces.

        Returns
        -------
        dict
            Effects by the label of their term, in the order of the model.
        """
        return term_effects(self, frame, level, points)

    def diagnosis(self) -> Diagnosis:
        """Compare the residuals with the fitted error distribution.

        Returns
        -------
        Diagnosis
            ``.plot()`` draws four figures.
        """
        return Diagnosis.from_model(self)

    def plot(
        self, frame: pd.DataFrame | None = None, figure: Figure | None = None, columns: int = 3
    ) -> Figure:
        """Draw all effects, one panel for each.

        Parameters
        ----------
        frame : DataFrame, optional
            The data, for rugs and points.
        figure : matplotlib Figure, optional
            Empty figure to draw on; a new one by default.
        columns : int
            Largest number of panels in a row.

        Returns
        -------
        matplotlib Figure
            The figure that was drawn on.
        """
        return plot_effects(self.effects(frame), figure, columns)
