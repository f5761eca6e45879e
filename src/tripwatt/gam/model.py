"""The model that users meet: fitted, it explains itself."""

from __future__ import annotations

from tripwatt.gam.estimator import Estimator


class GAMM(Estimator):
    """Generalised additive mixed model with gaussian or scaled t errors.

    Parameters
    ----------
    formula : str or Formula
        ``"y ~ weather + s(time, by=season) + s(trip, bs='re')"``, or the same as objects.
    family : {"gaussian", "scat"} or Family
        Distribution of the errors.
    method : {"fREML", "REML"}
        How smoothing parameters are chosen. For gaussian errors both are restricted maximum likelihood. For the
        scaled t "fREML" is the performance iteration (fast), "REML" exact Laplace REML.
    discretise : bool or int
        Round covariates to an even grid of 1,000 (or so many) values; True does so beyond 10,000 rows.
    extrapolation : {"clamp", "linear"}
        Outside its training range (of the rows of its level, for a by-smooth) a curve or a numeric column is held
        constant, or goes on as a straight line.
        Surfaces are always held: at the range, and within a twentieth of it from the nearest training point.
        With "clamp" the row is moved, not the term: all terms of a covariate see the same point.
    smoothing_parameters : sequence or mapping, optional
        Given values, in the order (or by the names) of `smoothing_parameters_`.
    ar1_rho : float or "estimate", optional
        Correlation of successive errors within groups, gaussian errors only.
    tolerance : float
        The scaled t's iteration stops when nothing moves by more than this many standard errors.
    max_iter : int
        Most iterations.

    Attributes
    ----------
    coef_, coef_names_
        Coefficients (p,) and their names.
    Vp_, Ve_ : ndarray (p, p)
        Bayesian posterior and frequentist covariance.
    F_ : ndarray (p, p)
        (X'WX + S)^-1 X'WX; its diagonal is `edf_`; `edf1_` is 2 edf - diag(F F).
    R_ : ndarray (p, p)
        Square root of X'WX / scale: R'R.
    terms_, term_slices_
        Fitted pieces, and the coefficients of each by label.
    smoothing_parameters_ : dict
    scale_, nu_, sigma_, nu_at_bound_
        Variance (1 for the scaled t), shape and scale of the t.
    reml_, loglik_, aic_, deviance_explained_, r2_, n_, residual_df_
    linear_predictor_, fitted_values_, residuals_ : ndarray (n,)
    converged_, n_iter_, message_, notes_
    empty_columns_ : list of str
        Coefficients without data: 0 with standard error 0.
    ranges_, levels_ : dict
        Training range of each covariate; levels of each factor.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> frame = pd.DataFrame({"x": np.linspace(0, 1, 100), "trip": np.repeat(list("abcde"), 20)})
    >>> y = np.sin(6 * frame["x"]) + 0.1 * rng.standard_normal(100)
    >>> model = GAMM(Formula(None, (Smooth(("x",)),))).fit(frame, y)
    >>> bool(model.converged_), bool(model.r2_ > 0.9)
    (True, True)
    >>> value, error = model.predict(frame, se=True)
    >>> bool(np.abs(value - np.sin(6 * frame["x"])).max() < 0.2), bool((error > 0.0).all())
    (True, True)
    >>> model.extrapolation_mask(pd.DataFrame({"x": [0.5, 1.5]})).tolist()
    [False, True]
    >>> model.leave_groups_out(frame, y, groups="trip").shape
    (100,)
    """
