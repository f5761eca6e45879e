"""Generalised additive mixed models with gaussian or Student's t errors; knows neither cars nor trips.

>>> import numpy as np, pandas as pd
>>> from tripwatt.gam import GAMM, Formula, Smooth
>>> frame = pd.DataFrame({"x": np.linspace(0, 1, 50)})
>>> y = 3 * frame["x"] + np.random.default_rng(0).normal(0, 0.1, 50)
>>> model = GAMM(Formula(None, (Smooth(("x",)),))).fit(frame, y)
>>> model.predict(frame).shape
(50,)
"""

from tripwatt.gam.families import Family, Gaussian, ScaledT
from tripwatt.gam.model import GAMM
from tripwatt.gam.terms import Formula, Parametric, RandomEffect, Smooth, Tensor, Term

__all__ = [
    "GAMM",
    "Family",
    "Formula",
    "Gaussian",
    "Parametric",
    "RandomEffect",
    "ScaledT",
    "Smooth",
    "Tensor",
    "Term",
]
