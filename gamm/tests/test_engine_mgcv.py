"""The engine against fits by R's mgcv 1.8-41: same designs, same scores, same fits."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bare_matrix import fit_matrix
from tripwatt_gamm import GAMM, Formula, Parametric, RandomEffect, ScaledT, Smooth, Tensor

SYNTH = Path(__file__).parent / "fixtures" / "mgcv_synth"


def s(*names, **options):
    return Smooth(names, **options)


WEATHER, SEASON, TRIP = Parametric("weather"), Parametric("season"), RandomEffect("trip")
MODELS = {
    "A": (
        WEATHER,
        SEASON,
        s("time", by="season", basis="ps", k=12),
        s("tamb", basis="ps", k=10),
        s("vel", k=10),
        s("delev", basis="ps", k=10),
        Tensor(("tamb", "delev"), "ps", (5, 5)),
        TRIP,
    ),
    "B": (WEATHER, s("time"), s("vel"), s("tamb", "delev", k=25), TRIP),
    "core": (WEATHER, s("time"), s("tamb"), s("vel"), s("delev"), TRIP),
    "ps": (
        WEATHER,
        s("time", basis="ps", k=20),
        *(s(name, basis="ps", k=12) for name in ("tamb", "vel", "delev")),
        Tensor(("tamb", "delev"), "ps", (6, 6)),
        TRIP,
    ),
    "psby": (
        WEATHER,
        SEASON,
        s("time", by="season", basis="ps", k=20),
        s("tamb", basis="ps", k=12),
        *(s(name, by="season", basis="ps", k=12) for name in ("vel", "delev")),
        Tensor(("tamb", "delev"), "ps", (6, 6)),
        TRIP,
    ),
    "paper": (
        WEATHER,
        SEASON,
        s("time", by="season"),
        s("tamb"),
        s("vel", by="season"),
        s("delev", by="season"),
        s("tamb", "delev", k=30),
        TRIP,
    ),
    # ordered factors: `winter` is summer < winter, `sky` sunny < cloudy < rainy
    "O": (
        WEATHER,
        *(s(name) for name in ("time", "tamb", "vel", "delev")),
        *(s(name, by="winter") for name in ("time", "tamb")),
        TRIP,
    ),
    "P": (
        WEATHER,
        s("time", basis="ps", k=12),
        s("vel", basis="cr"),
        s("time", by="sky", basis="ps", k=8),
        TRIP,
    ),
}
ORDERED = {"winter": ("season", ["summer", "winter"]), "sky": ("weather", ["sunny", "cloudy", "rainy"])}


class Peer:
    """A stored fit."""

    def __init__(self, folder):
        self.folder = folder
        self.scalars = pd.read_csv(folder / "scalars.csv").iloc[0]
        self.sp = pd.read_csv(folder / "sp.csv")["sp"].to_numpy()
        self.coef = pd.read_csv(folder / "coef.csv")
        self.fitted = pd.read_csv(folder / "fitted.csv")["fit"].to_numpy()

    @property
    def edf(self):
        return float(self.coef["edf"].sum())


def fitted(name, frame, peer, family, **options):
    return GAMM(Formula("y", MODELS[name]), family, discretise=False, **options).fit(frame)


@pytest.fixture(scope="module")
def synth():
    return pd.read_csv(SYNTH / "data.csv")


@pytest.mark.parametrize("name", ["A", "B"])
@pytest.mark.parametrize("errors", ["gaussian", "scat"])
def test_at_the_parameters_of_gam_everything_is_equal(synth, name, errors):
    peer = Peer(SYNTH / f"{name}_gam_{errors}")
    family = (
        "gaussian" if errors == "gaussian" else ScaledT(nu=peer.scalars["nu"], sigma=peer.scalars["sigma"])
    )
    model = fitted(name, synth, peer, family, method="REML", smoothing_parameters=peer.sp)
    assert model.reml_ == pytest.approx(peer.scalars["score"], rel=1e-9)
    assert model.loglik_ == pytest.approx(peer.scalars["loglik"], rel=1e-9)
    assert np.abs(model.fitted_values_ - peer.fitted).max() < 1e-6
    page = model.summary()
    smooths, parametric = (pd.read_csv(peer.folder / f"{table}.csv") for table in ("smooths", "parametric"))
    assert [*page.smooth.index, *page.parametric.index] == [*smooths["term"], *parametric["term"]]
    np.testing.assert_allclose(page.smooth["edf"], smooths["edf"], atol=1e-5)
    np.testing.assert_allclose(page.smooth[["ref_df", "statistic"]], smooths.iloc[:, 1:3], rtol=5e-4)
    np.testing.assert_allclose(page.smooth["p_value"], smooths.iloc[:, 3], atol=1e-3)
    np.testing.assert_allclose(page.parametric, parametric.iloc[:, :4], rtol=5e-4)


def with_ordered_factors(frame):
    columns = {
        name: pd.Categorical(frame[source], levels, ordered=True)
        for name, (source, levels) in ORDERED.items()
    }
    return frame.assign(**columns)


@pytest.mark.parametrize("name", ["O", "P"])
@pytest.mark.parametrize("errors", ["gaussian", "scat"])
def test_smooths_by_an_ordered_factor_are_those_of_gam(synth, name, errors):
    peer = Peer(SYNTH / f"{name}_gam_{errors}")
    family = (
        "gaussian" if errors == "gaussian" else ScaledT(nu=peer.scalars["nu"], sigma=peer.scalars["sigma"])
    )
    frame = with_ordered_factors(synth)
    model = fitted(name, frame, peer, family, method="REML", smoothing_parameters=peer.sp)
    assert model.reml_ == pytest.approx(peer.scalars["score"], rel=1e-9)
    assert np.abs(model.fitted_values_ - peer.fitted).max() < 1e-6
    table = pd.read_csv(SYNTH / f"{name}_gam_{errors}" / "smooths.csv")
    found = model.summary().smooth
    assert list(found.index) == table["term"].tolist()  # no smooth for the reference level
    assert found["edf"].to_numpy() == pytest.approx(table["edf"].to_numpy(), abs=1e-5)
    assert found["ref_df"].to_numpy() == pytest.approx(table["Ref.df"].to_numpy(), abs=1e-3)
    with_values = model.predict(frame.assign(winter=frame["season"], sky=frame["weather"]))
    assert with_values == pytest.approx(model.fitted_values_, abs=1e-8)  # plain text at prediction


@pytest.mark.parametrize("name", ["O", "P"])
@pytest.mark.parametrize("engine", ["gam", "bam"])
def test_at_our_optimum_every_smooth_by_an_ordered_factor_has_the_edf_of_mgcv(synth, name, engine):
    peer = Peer(SYNTH / f"{name}_{engine}_scat")
    table = pd.read_csv(SYNTH / f"{name}_{engine}_scat" / "smooths.csv")
    method = "REML" if engine == "gam" else "fREML"
    model = fitted(name, with_ordered_factors(synth), peer, "scat", method=method)
    assert model.summary().smooth["edf"].to_numpy() == pytest.approx(table["edf"].to_numpy(), abs=0.05)
    assert np.abs(model.fitted_values_ - peer.fitted).max() < 2e-3 * synth["y"].std()


@pytest.mark.parametrize("name", ["A", "B"])
@pytest.mark.parametrize("errors", ["gaussian", "scat"])
def test_our_optimum_is_no_worse_than_gams(synth, name, errors):
    peer = Peer(SYNTH / f"{name}_gam_{errors}")
    model = fitted(name, synth, peer, errors, method="REML")
    assert model.converged_
    assert model.reml_ <= peer.scalars["score"] + 1e-4
    assert model.edf_.sum() == pytest.approx(peer.edf, abs=0.1)
    assert np.abs(model.fitted_values_ - peer.fitted).max() < 1e-3 * synth["y"].std()


@pytest.mark.parametrize("name", ["A", "B"])
def test_performance_iteration_meets_bam(synth, name):
    peer = Peer(SYNTH / f"{name}_bam_scat")
    model = fitted(name, synth, peer, "scat")
    assert model.converged_
    assert model.nu_at_bound_ == (name == "A")
    assert (model.nu_, model.sigma_) == pytest.approx((peer.scalars["nu"], peer.scalars["sigma"]), rel=1e-3)
    assert model.edf_.sum() == pytest.approx(peer.edf, abs=0.02)
    assert np.abs(model.fitted_values_ - peer.fitted).max() < 2e-3 * synth["y"].std()


@pytest.mark.parametrize("name", ["A", "B"])
def test_bare_matrices_give_the_score_of_gam(synth, name):
    design = SYNTH / f"{name}_design"
    X = pd.read_csv(design / "X.csv").to_numpy()
    penalties = []
    for file in sorted(design.glob("S*")):
        first, last = map(int, re.search(r"first(\d+)_last(\d+)", file.name).groups())
        penalties.append((first - 1, last, pd.read_csv(file).to_numpy()))
    peer = Peer(SYNTH / f"{name}_gam_scat")
    family = ScaledT(nu=peer.scalars["nu"], sigma=peer.scalars["sigma"])
    fit = fit_matrix(X, penalties, synth["y"].to_numpy(), family, "REML", peer.sp)
    assert fit.score == pytest.approx(peer.scalars["score"], rel=1e-9)
    Vp = pd.read_csv(SYNTH / f"{name}_gam_scat" / "Vp.csv").to_numpy()
    assert np.abs(fit.covariance - Vp).max() < 1e-6 * np.abs(Vp).max()


def test_discretised_covariates_change_next_to_nothing(synth):
    exact = GAMM(Formula("y", MODELS["B"]), discretise=False).fit(synth)
    rounded = GAMM(Formula("y", MODELS["B"]), discretise=200).fit(synth)
    assert np.abs(rounded.fitted_values_ - exact.fitted_values_).max() < 0.05 * synth["y"].std()
    assert rounded.edf_.sum() == pytest.approx(exact.edf_.sum(), abs=0.5)


@pytest.mark.parametrize(
    ("name", "rate", "edf", "spread"),
    [("core", "60s", 0.1, 0.005), ("ps", "60s", 0.1, 0.005), ("psby", "60s", 0.1, 0.005)],
)
def test_real_trips_meet_bam(reference_dir, name, rate, edf, spread):
    frame = pd.read_csv(reference_dir / "mgcv" / f"tum_{rate}.csv")
    peer = Peer(reference_dir / "mgcv" / f"{name}{rate}_bam_scat")
    model = fitted(name, frame, peer, "scat")
    assert model.converged_
    assert model.nu_at_bound_
    assert model.sigma_ == pytest.approx(peer.scalars["sigma"], rel=1e-4)
    assert model.edf_.sum() == pytest.approx(peer.edf, abs=edf)
    assert np.abs(model.fitted_values_ - peer.fitted).max() < spread * frame["y"].std()
    assert model.r2_ == pytest.approx(peer.scalars["r.sq"], abs=1e-4)


@pytest.mark.parametrize(
    "fit", ["core60s_gam_gauss", "core60s_gam_scat", "ps60s_gam_scat", "psby60s_gam_scat"]
)
def test_real_trips_have_the_laplace_score_and_the_table_of_gam(reference_dir, fit):
    peer = Peer(reference_dir / "mgcv" / fit)
    frame = pd.read_csv(reference_dir / "mgcv" / "tum_60s.csv")
    name, _, errors = fit.partition("60s_gam_")
    family = "gaussian" if errors == "gauss" else ScaledT(nu=peer.scalars["nu"], sigma=peer.scalars["sigma"])
    model = fitted(name, frame, peer, family, method="REML", smoothing_parameters=peer.sp)
    assert model.reml_ == pytest.approx(peer.scalars["score"], rel=1e-8)
    printed, ours = pd.read_csv(peer.folder / "edf.csv"), model.summary().smooth
    np.testing.assert_allclose(ours["edf"], printed["edf"], atol=1e-3)
    tested = printed["stat"].notna().to_numpy()  # the random effect was not
    columns = ["ref_df", "statistic"]
    np.testing.assert_allclose(ours.loc[tested, columns], printed.loc[tested, ["ref.df", "stat"]], rtol=5e-4)
    np.testing.assert_allclose(ours.loc[tested, "p_value"], printed.loc[tested, "p"], atol=1e-3)


def test_nested_terms_are_reduced_and_said_so(reference_dir):
    frame = pd.read_csv(reference_dir / "mgcv" / "tum_10s.csv")
    peer = Peer(reference_dir / "mgcv" / "paper10s_bam_scat")
    model = fitted("paper", frame, peer, "scat")
    assert any("s(tamb,delev)" in note for note in model.notes_)
    assert model.sigma_ == pytest.approx(peer.scalars["sigma"], rel=2e-3)
    assert model.edf_.sum() == pytest.approx(peer.edf, abs=2)
    # its surface rests on a random 2,000 of the points, ours on an even 2,000: equal in the mean square only
    assert (model.fitted_values_ - peer.fitted).std() < 0.02 * frame["y"].std()
