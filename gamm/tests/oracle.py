"""Fits by R's mgcv dressed as fitted models, so that inference is tested at exactly its parameters."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd

from tripwatt_gamm.families import Gaussian, ScaledT

HERE = Path(__file__).parent / "fixtures" / "inference"
SYNTH = Path(__file__).parent / "fixtures" / "mgcv_synth"


def model(gram, penalty, coef, terms, scalars, names):
    """The attributes of a fitted model that inference reads, from X'WX and the penalty.

    terms: (label, kind, null_dim, slice, penalty of the term without its place) in the order of coefficients.
    """
    student = np.isfinite(scalars["nu"])
    posterior = np.linalg.inv(gram + penalty)
    hat = posterior @ gram
    edf = np.diag(hat)
    values, vectors = np.linalg.eigh(gram)
    return SimpleNamespace(
        coef_=coef,
        coef_names_=names,
        Vp_=posterior * scalars["scale"],
        F_=hat,
        edf_=edf,
        edf1_=2 * edf - np.einsum("ij,ji->i", hat, hat),
        R_=(vectors * np.sqrt(np.clip(values, 0, None) / scalars["scale"])).T,
        scale_=scalars["scale"],
        residual_df_=scalars["n"] - edf.sum(),
        nu_=scalars["nu"],
        sigma_=scalars["sigma"],
        family_=ScaledT() if student else Gaussian(),
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


def small(name):
    """One of the committed fits, and the tables that mgcv prints for it."""
    folder = HERE / name
    read = lambda file: pd.read_csv(folder / file)  # noqa: E731
    smooths, parametric = read("smooths.csv"), read("parametric.csv")
    terms = [("parametric", "parametric", len(parametric), slice(0, len(parametric)))]
    terms += [(r.term, r.kind, r.null_dim, slice(r.first - 1, r.last)) for r in smooths.itertuples()]
    coef = read("coef.csv")["coef"].to_numpy()
    scalars = read("scalars.csv").iloc[0].to_dict()
    names = [f"b{i}" for i in range(coef.size)]
    fit = model(read("gram.csv").to_numpy(), read("penalty.csv").to_numpy(), coef, terms, scalars, names)
    return fit, smooths.set_index("term"), parametric


def synthetic(kind, family):
    """Model A or B of the synthetic reference set, fitted by mgcv's gam, and the tables that it prints."""
    folder, design = SYNTH / f"{kind}_gam_{family}", SYNTH / f"{kind}_design"
    read = lambda file: pd.read_csv(folder / file)  # noqa: E731
    X = pd.read_csv(design / "X.csv").to_numpy()
    coef, sp, scalars = read("coef.csv"), read("sp.csv"), read("scalars.csv").iloc[0].to_dict()
    smooths, parametric = read("smooths.csv"), read("parametric.csv")
    smooths.columns = ["edf", "ref_df", "statistic", "p_value", "term"]
    parametric.columns = ["estimate", "std_error", "statistic", "p_value", "term"]
    penalty, spans = np.zeros((X.shape[1],) * 2), {}
    for file, value, name in zip(sorted(design.glob("S*.csv")), sp["sp"], sp["name"], strict=True):
        first, last, rank = map(int, re.findall(r"(?:first|last|rank)(\d+)", file.name))
        at = slice(first - 1, last)
        penalty[at, at] += value * pd.read_csv(file).to_numpy()
        spans[re.sub(r"\)\d$", ")", name)] = (at, rank)
    p = len(parametric)
    terms = [("parametric", "parametric", p, slice(0, p))]
    for label, (at, rank) in spans.items():
        random = label == "s(trip)"
        terms.append(
            (label, "random" if random else "smooth", 0 if random else max(at.stop - at.start - rank, 1), at)
        )
    student = np.isfinite(scalars["nu"])
    weight = (scalars["nu"] + 1) / ((scalars["nu"] + 3) * scalars["sigma"] ** 2) if student else 1.0
    scalars["scale"] = scalars.pop("phi")
    fit = model(
        weight * X.T @ X,
        penalty,
        coef["coef"].to_numpy(),
        terms,
        scalars,
        list(coef["name"]),
    )
    return fit, smooths.set_index("term"), parametric.set_index("term")
