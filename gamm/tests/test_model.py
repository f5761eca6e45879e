"""The model against fits by R's mgcv 1.8-41: same scores, same fits, same tables."""

import numpy as np
import pandas as pd
import pytest

from gamm_samples import FIXTURES, study
from tripwatt_gamm import GAMM, ScaledT

FORMULAS = {
    "A": """y ~ weather + season + s(time, by=season, bs="ps", k=12) + s(tamb, bs="ps", k=10) + s(vel, k=10)
        + s(delev, bs="ps", k=10) + ti(tamb, delev, bs="ps", k=5) + s(trip, bs="re")""",
    "B": 'y ~ weather + s(time) + s(vel) + s(tamb, delev, k=25) + s(trip, bs="re")',
    "core": 'y ~ weather + s(time) + s(tamb) + s(vel) + s(delev) + s(trip, bs="re")',
    "ps": """y ~ weather + s(time, bs="ps", k=20) + s(tamb, bs="ps", k=12) + s(vel, bs="ps", k=12)
        + s(delev, bs="ps", k=12) + ti(tamb, delev, bs="ps", k=6) + s(trip, bs="re")""",
    "psby": """y ~ weather + season + s(time, by=season, bs="ps", k=20) + s(tamb, bs="ps", k=12)
        + s(vel, by=season, bs="ps", k=12) + s(delev, by=season, bs="ps", k=12)
        + ti(tamb, delev, bs="ps", k=6) + s(trip, bs="re")""",
    "paper": """y ~ weather + season + s(time, by=season) + s(tamb) + s(vel, by=season) + s(delev, by=season)
        + s(tamb, delev, k=30) + s(trip, bs="re")""",
    # smooths by ordered factors: summer < winter, and sunny < cloudy < rainy
    "O": """y ~ weather + s(time) + s(tamb) + s(vel) + s(delev) + s(time, by=winter) + s(tamb, by=winter)
        + s(trip, bs="re")""",
    "P": """y ~ weather + s(time, bs="ps", k=12) + s(vel, bs="cr") + s(time, by=sky, bs="ps", k=8)
        + s(trip, bs="re")""",
}


class Peer:
    """A stored fit of mgcv."""

    def __init__(self, folder):
        self.folder = folder
        self.scalars = pd.read_csv(folder / "scalars.csv").iloc[0]
        self.sp = pd.read_csv(folder / "sp.csv")["sp"].to_numpy()
        self.edf = float(pd.read_csv(folder / "coef.csv")["edf"].sum())
        self.fitted = pd.read_csv(folder / "fitted.csv")["fit"].to_numpy()

    def fit_at_its_parameters(self, formula, frame):
        """Fit a formula by REML with the smoothing parameters of this fit, its shape and its scale."""
        student = np.isfinite(self.scalars["nu"])
        family = ScaledT(nu=self.scalars["nu"], sigma=self.scalars["sigma"]) if student else "gaussian"
        return GAMM(formula, family, "REML", discretise=False, smoothing_parameters=self.sp).fit(frame)


def peer_of(name):
    return Peer(FIXTURES / "mgcv_synth" / name)


@pytest.fixture(scope="module")
def synth():
    frame = pd.read_csv(FIXTURES / "mgcv_synth" / "data.csv")
    winter = pd.Categorical(frame["season"], ["summer", "winter"], ordered=True)
    return frame.assign(
        winter=winter, sky=pd.Categorical(frame["weather"], ["sunny", "cloudy", "rainy"], ordered=True)
    )


@pytest.mark.parametrize("name", ["A", "B", "O", "P"])
@pytest.mark.parametrize("errors", ["gaussian", "scat"])
def test_at_the_parameters_of_gam_everything_is_equal(synth, name, errors):
    peer = peer_of(f"{name}_gam_{errors}")
    model = peer.fit_at_its_parameters(FORMULAS[name], synth)
    assert model.reml_ == pytest.approx(peer.scalars["score"], rel=1e-9)
    assert np.abs(model.fitted_values_ - peer.fitted).max() < 1e-6
    page = model.summary()
    smooths, parametric = (pd.read_csv(peer.folder / f"{table}.csv") for table in ("smooths", "parametric"))
    # of an ordered factor, there is no smooth for the reference level
    assert [*page.smooth.index, *page.parametric.index] == [*smooths["term"], *parametric["term"]]
    np.testing.assert_allclose(page.smooth["edf"], smooths["edf"], atol=1e-5)
    np.testing.assert_allclose(page.smooth[["ref_df", "statistic"]], smooths.iloc[:, 1:3], rtol=5e-4)
    np.testing.assert_allclose(page.smooth["p_value"], smooths.iloc[:, 3], atol=1e-3)
    np.testing.assert_allclose(page.parametric, parametric.iloc[:, :4], rtol=5e-4)
    if name in "AB":
        assert model.loglik_ == pytest.approx(peer.scalars["loglik"], rel=1e-9)
    text = synth.assign(winter=synth["season"], sky=synth["weather"])  # plain text at prediction
    assert model.predict(text) == pytest.approx(model.fitted_values_, abs=1e-8)


@pytest.mark.parametrize("name", ["O", "P"])
@pytest.mark.parametrize("engine", ["gam", "bam"])
def test_at_our_optimum_every_smooth_by_an_ordered_factor_has_the_edf_of_mgcv(synth, name, engine):
    peer = peer_of(f"{name}_{engine}_scat")
    table = pd.read_csv(peer.folder / "smooths.csv")
    method = "REML" if engine == "gam" else "fREML"
    model = GAMM(FORMULAS[name], "scat", method, discretise=False).fit(synth)
    assert model.summary().smooth["edf"].to_numpy() == pytest.approx(table["edf"].to_numpy(), abs=0.05)
    assert np.abs(model.fitted_values_ - peer.fitted).max() < 2e-3 * synth["y"].std()


@pytest.mark.parametrize("name", ["A", "B"])
@pytest.mark.parametrize("errors", ["gaussian", "scat"])
def test_our_optimum_is_no_worse_than_gams(synth, name, errors):
    peer = peer_of(f"{name}_gam_{errors}")
    model = GAMM(FORMULAS[name], errors, "REML", discretise=False).fit(synth)
    assert model.converged_
    assert model.reml_ <= peer.scalars["score"] + 1e-4
    assert model.edf_.sum() == pytest.approx(peer.edf, abs=0.1)
    assert np.abs(model.fitted_values_ - peer.fitted).max() < 1e-3 * synth["y"].std()


@pytest.mark.parametrize("name", ["A", "B"])
def test_performance_iteration_meets_bam(synth, name):
    peer = peer_of(f"{name}_bam_scat")
    model = GAMM(FORMULAS[name], "scat", discretise=False).fit(synth)
    assert model.converged_
    assert model.nu_at_bound_ == (name == "A")
    assert (model.nu_, model.sigma_) == pytest.approx((peer.scalars["nu"], peer.scalars["sigma"]), rel=1e-3)
    assert model.edf_.sum() == pytest.approx(peer.edf, abs=0.02)
    assert np.abs(model.fitted_values_ - peer.fitted).max() < 2e-3 * synth["y"].std()


def test_discretised_covariates_change_next_to_nothing(synth, monkeypatch):
    exact = GAMM(FORMULAS["B"], discretise=False).fit(synth)
    monkeypatch.setattr("tripwatt_gamm.design.EXACT_ROWS", 0)
    monkeypatch.setattr("tripwatt_gamm.design.MAX_VALUES", 200)
    rounded = GAMM(FORMULAS["B"]).fit(synth)
    assert np.abs(rounded.fitted_values_ - exact.fitted_values_).max() < 0.05 * synth["y"].std()
    assert rounded.edf_.sum() == pytest.approx(exact.edf_.sum(), abs=0.5)


@pytest.mark.parametrize("name", ["core", "ps", "psby"])
def test_real_trips_meet_bam(reference_dir, name):
    frame = pd.read_csv(reference_dir / "mgcv" / "tum_60s.csv")
    peer = Peer(reference_dir / "mgcv" / f"{name}60s_bam_scat")
    model = GAMM(FORMULAS[name], "scat", discretise=False).fit(frame)
    assert model.converged_
    assert model.nu_at_bound_
    assert model.sigma_ == pytest.approx(peer.scalars["sigma"], rel=1e-4)
    assert model.edf_.sum() == pytest.approx(peer.edf, abs=0.1)
    assert np.abs(model.fitted_values_ - peer.fitted).max() < 0.005 * frame["y"].std()
    assert model.r2_ == pytest.approx(peer.scalars["r.sq"], abs=1e-4)


@pytest.mark.parametrize(
    "fit", ["core60s_gam_gauss", "core60s_gam_scat", "ps60s_gam_scat", "psby60s_gam_scat"]
)
def test_real_trips_have_the_laplace_score_and_the_table_of_gam(reference_dir, fit):
    peer = Peer(reference_dir / "mgcv" / fit)
    frame = pd.read_csv(reference_dir / "mgcv" / "tum_60s.csv")
    model = peer.fit_at_its_parameters(FORMULAS[fit.partition("60s")[0]], frame)
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
    model = GAMM(FORMULAS["paper"], "scat", discretise=False).fit(frame)
    assert any("s(tamb,delev)" in note for note in model.notes_)
    assert model.sigma_ == pytest.approx(peer.scalars["sigma"], rel=2e-3)
    assert model.edf_.sum() == pytest.approx(peer.edf, abs=2)
    # its surface rests on a random 2,000 of the points, ours on an even 2,000: equal in the mean square only
    assert (model.fitted_values_ - peer.fitted).std() < 0.02 * frame["y"].std()


def test_summary_and_effects_of_correlated_effects_name_both():
    model = GAMM("reaction ~ days + (1 + days | subject)").fit(study("sleepstudy"))
    text = str(model.summary())
    assert "Variance components:" in text
    assert "(1+days|subject) subject (Intercept)  24.7405" in text
    effects = model.effects()
    assert list(effects) == ["days", "(1+days|subject) (Intercept)", "(1+days|subject) days"]
    assert effects["(1+days|subject) days"].sd == pytest.approx(5.9221, abs=1e-4)
    slopes = effects["(1+days|subject) days"].frame().set_index("level")["effect"]
    assert slopes["308"] == pytest.approx(model.coef_[20])
