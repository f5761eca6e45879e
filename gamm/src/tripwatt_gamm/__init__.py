"""Generalised additive mixed models of gaussian, Student's t, Gamma, Poisson and binomial responses, independent of cars and trips.

>>> import numpy as np, pandas as pd
>>> from tripwatt_gamm import GAMM, Formula, Smooth
>>> frame = pd.DataFrame({"x": np.linspace(0, 1, 50)})
>>> y = 3 * frame["x"] + np.random.default_rng(0).normal(0, 0.1, 50)
>>> model = GAMM(Formula(None, (Smooth(("x",)),))).fit(frame, y)
>>> model.predict(frame).shape
(50,)

A fitted model explains itself:

>>> model.summary().smooth.index.tolist(), model.diagnosis().distribution_name, list(model.effects(frame))
(['s(x)'], 'normal', ['s(x)'])
>>> model.plot(frame).axes[0].get_xlabel()
'x'
"""

from tripwatt_gamm.checks import Autocorrelation, anova, autocorrelation, basis_check, concurvity
from tripwatt_gamm.diagnosis import Diagnosis
from tripwatt_gamm.effects import CurveEffect, FactorEffect, RandomEffects, SurfaceEffect, plot_effects
from tripwatt_gamm.errors import InvalidInput, NotFittedError
from tripwatt_gamm.families import Binomial, Family, Gamma, Gaussian, Poisson, ScaledT
from tripwatt_gamm.model import GAMM
from tripwatt_gamm.summary import Summary
from tripwatt_gamm.terms import Formula, Parametric, RandomEffect, Smooth, Tensor, Term

__all__ = [
    "GAMM",
    "Autocorrelation",
    "Binomial",
    "CurveEffect",
    "Diagnosis",
    "FactorEffect",
    "Family",
    "Formula",
    "Gamma",
    "Gaussian",
    "InvalidInput",
    "NotFittedError",
    "Parametric",
    "Poisson",
    "RandomEffect",
    "RandomEffects",
    "ScaledT",
    "Smooth",
    "Summary",
    "SurfaceEffect",
    "Tensor",
    "Term",
    "anova",
    "autocorrelation",
    "basis_check",
    "concurvity",
    "plot_effects",
]
