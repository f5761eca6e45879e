"""Data that several tests fit: clustered rows, published studies, and fits by R's mgcv."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd

from tripwatt_gamm import Formula, Parametric, RandomEffect, Smooth
from tripwatt_gamm.families import Gaussian, ScaledT

FIXTURES = Path(__file__).parent / "fixtures"
X = Smooth(("x",), "ps", 10)
FULL = Formula("y", (Parametric("w"), X, Smooth(("x", "z"), k=15), RandomEffect("g")))
"""A curve, and a formula with terms of every kind, for `clustered`."""


def clustered(seed=0, n=240, groups=8):
    """A wave in x that z tilts, a factor w, a switch `on`, and groups with effects of their own; heavy-tailed errors."""
    rng = np.random.default_rng(seed)
    group = np.repeat(np.arange(groups), n // groups)
    x, z = rng.uniform(-2, 5, n), rng.normal(size=n)
    w = np.array(["a", "b", "b", "c"])[group % 4]
    y = np.sin(x) + 0.3 * z * x + (w == "b") + rng.normal(0, 0.5, groups)[group] + 0.3 * rng.standard_t(5, n)
    return pd.DataFrame({"x": x, "z": z, "w": w, "g": [f"g{i}" for i in group], "on": (z > 0) * 1.0, "y": y})


def study(name):
    """A published study, one row for each measurement: sleepstudy, oxboys or machines."""
    wide = pd.read_csv(FIXTURES / "mixed" / f"{name}.csv")
    if name == "sleepstudy":
        long = wide.melt("subject", var_name="days", value_name="reaction")
        return long.assign(days=long["days"].str.removeprefix("day").astype(float))
    if name == "oxboys":
        return wide
    return wide.astype({"worker": str}).melt(["worker", "machine"], value_name="score")


def mgcv_fit(name):
    """A fit by mgcv with the attributes of a fitted model that inference reads, and the tables that mgcv prints for it.

    Inference is tested at exactly its parameters, from its crossproduct X'WX and its penalty.
    """
    files = ("gram", "penalty", "coef", "smooths", "parametric", "scalars")
    gram, penalty, coef, smooths, parametric, scalars = (
        pd.read_csv(FIXTURES / "inference" / name / f"{file}.csv") for file in files
    )
    gram, penalty, coef = gram.to_numpy(), penalty.to_numpy(), coef["coef"].to_numpy()
    scalars = scalars.iloc[0].to_dict()
    posterior = np.linalg.inv(gram + penalty)
    hat = posterior @ gram
    edf = np.diag(hat)
    values, vectors = np.linalg.eigh(gram)
    terms = [("parametric", "parametric", len(parametric), slice(0, len(parametric)))]
    terms += [
        (row.term, row.kind, row.null_dim, slice(row.first - 1, row.last)) for row in smooths.itertuples()
    ]
    model = SimpleNamespace(
        coef_=coef,
        coef_names_=[f"b{i}" for i in range(coef.size)],
        Vp_=posterior * scalars["scale"],
        edf_=edf,
        edf1_=2 * edf - np.einsum("ij,ji->i", hat, hat),
        R_=(vectors * np.sqrt(np.clip(values, 0, None) / scalars["scale"])).T,
        scale_=scalars["scale"],
        residual_df_=scalars["n"] - edf.sum(),
        nu_=scalars["nu"],
        sigma_=scalars["sigma"],
        family_=ScaledT() if np.isfinite(scalars["nu"]) else Gaussian(),
        smoothing_parameters_={label: 1.0 for label, kind, *_ in terms if kind != "parametric"},
        terms_=[
            SimpleNamespace(
                label=label,
                kind=kind,
                null_dim=null_dim,
                slice=at,
                start=at.start,
                penalties=[] if kind == "parametric" else [penalty[at, at]],
            )
            for label, kind, null_dim, at in terms
        ],
    )
    return model, smooths.set_index("term"), parametric
