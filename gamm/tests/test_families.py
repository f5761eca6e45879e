"""Families: derivatives, and fits of each by R's mgcv with prior weights and offsets."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from gamm_samples import FIXTURES
from tripwatt_gamm import GAMM, Binomial, Gamma, Gaussian, InvalidInput, Poisson, ScaledT, anova
from tripwatt_gamm.families import Response

FITS = {
    "gaussian": ("normal", "gaussian", "w", None),
    "gaussian_offset": ("normal", "gaussian", None, "exposure"),
    "gamma": ("gamma", "gamma", None, None),
    "gamma_weighted": ("gamma", "gamma", "w", "exposure"),
    "poisson": ("poisson", "poisson", None, "exposure"),
    "poisson_weighted": ("poisson", "poisson", "w", "exposure"),
    "binomial": ("share", "binomial", "trials", None),
}
TERMS = {"full": 's(x) + s(z, k=6) + s(g, bs="re")', "small": "s(x)"}


@pytest.fixture(scope="module")
def data():
    return pd.read_csv(FIXTURES / "families" / "data.csv")


@pytest.fixture(scope="module")
def peers():
    return json.loads((FIXTURES / "families" / "fits.json").read_text())


@pytest.fixture(scope="module")
def fits(data):
    return {
        (name, terms): GAMM(f"{y} ~ {formula}", family).fit(data, weights=weights, offset=offset)
        for name, (y, family, weights, offset) in FITS.items()
        for terms, formula in TERMS.items()
    }


@pytest.mark.parametrize("name", list(FITS))
def test_comparisons_are_those_of_mgcv(peers, fits, name):
    peer, table = peers[name]["anova"], anova(fits[name, "small"], fits[name, "full"])
    rel = 5e-5
    assert table["residual_df"].tolist() == pytest.approx(peer["Resid. Df"], rel=rel)
    assert table["deviance"].tolist() == pytest.approx(peer["Resid. Dev"], rel=1e-4)
    last = table.iloc[1]
    assert last["df"] == pytest.approx(peer["Df"][1], rel=rel)
    assert last["statistic"] == pytest.approx(peer.get("F", peer["Deviance"])[1], rel=rel)
    p_value = peer.get("Pr(>F)", peer.get("Pr(>Chi)"))[1]
    assert np.log(last["p_value"]) == pytest.approx(np.log(p_value), rel=1e-3)
    with pytest.raises(InvalidInput, match="cannot be compared: anova: got 1 of"):
        anova(fits[name, "small"])


@pytest.mark.parametrize("name", ["gaussian", "gamma_weighted", "binomial"])
def test_slopes_of_the_coefficients_are_differences_of_fits(data, fits, name):
    y, family, weights, offset = FITS[name]
    model = fits[name, "full"]
    values = np.array(list(model.smoothing_parameters_.values()))
    if name == "gamma_weighted":  # the scale would be estimated anew
        family = Gamma(scale=model.reml_scale_)
        values = values / model.reml_scale_
    for j, step in enumerate(1e-3 * np.eye(len(values))):
        moved = [
            GAMM(f"{y} ~ {TERMS['full']}", family, smoothing_parameters=values * np.exp(sign * step))
            for sign in (1, -1)
        ]
        up, down = (one.fit(data, weights=weights, offset=offset).coef_ for one in moved)
        assert model.slopes_[:, j] == pytest.approx((up - down) / 2e-3, rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("name", list(FITS))
@pytest.mark.parametrize("terms", list(TERMS))
def test_fits_are_those_of_mgcv(data, peers, fits, name, terms):
    peer, model = peers[name][terms], fits[name, terms]
    page, new = model.summary(), data.iloc[[0, 100, 300]]
    assert model.converged_
    ours = {
        "reml": model.reml_,
        "edf": model.edf_.sum(),
        "scale": model.scale_,
        "reml_scale": model.reml_scale_,
        "sp": list(model.smoothing_parameters_.values()),
        "aic": model.aic_,
        "deviance": model.deviance_,
        "deviance_explained": model.deviance_explained_,
        "r2": model.r2_,
        "coef": model.coef_[0],
        "smooth_edf": page.smooth["edf"],
        "ref_df": page.smooth["ref_df"],
        "statistic": page.smooth["statistic"],
        "parametric": page.parametric.iloc[0, :3],
        "link": model.predict(new, scale="link"),
        "link_se": model.intervals(new)["std_error"],
        "mean": model.predict(new),
        "residual": model.deviance_residuals_[:3],
    }
    if name == "gamma_weighted":
        # R adds up weighted densities of the unweighted shape; ours is the likelihood of the model that was fitted
        ours.pop("aic")
    peer["parametric"] = peer["parametric"][:3]
    for key, value in ours.items():
        np.testing.assert_allclose(value, peer[key], rtol=3e-4, atol=2e-5, err_msg=key)


FAMILIES = [
    (Gaussian(), stats.norm.logpdf, [1.2], [0.3, -1.0, 2.0], lambda mu, phi: (mu, np.sqrt(phi))),
    (Gamma(), stats.gamma.logpdf, [0.4], [0.3, 1.0, 7.0], lambda mu, phi: (1 / phi, 0.0, mu * phi)),
    (Poisson(), stats.poisson.logpmf, [0.0], [0.0, 1.0, 7.0], lambda mu, phi: (mu,)),
    (Binomial(), stats.binom.logpmf, [0.0], [0.0, 1.0, 1.0], lambda mu, phi: (1, mu)),
    (ScaledT(), stats.t.logpdf, [0.3, -0.4], [0.3, -1.0, 2.0], None),
]


@pytest.mark.parametrize(("family", "density", "theta", "y", "arguments"), FAMILIES)
def test_likelihoods_are_those_of_scipy_and_have_exact_derivatives(family, density, theta, y, arguments):
    y, eta, theta, h = np.array(y), np.array([0.2, -0.5, 0.9]), np.array(theta), 1e-5
    rows = Response.of(y)
    d = family.derivatives(rows, eta, theta)
    if isinstance(family, ScaledT):
        nu, sigma = family.shape(theta)
        expected = density(y, nu, eta, sigma)
        value, gradient, hessian = family.objective(y - eta, theta)
        assert value == pytest.approx(-expected.sum())
        for i, step in enumerate(h * np.eye(2)):
            up, down = family.objective(y - eta, theta + step), family.objective(y - eta, theta - step)
            assert (up[0] - down[0]) / (2 * h) == pytest.approx(gradient[i], abs=1e-6)
            assert (up[1] - down[1]) / (2 * h) == pytest.approx(hessian[i], abs=1e-6)
    else:
        expected = density(y, *arguments(family.link.mean(eta), np.exp(theta[0])))
    assert d[0] == pytest.approx(expected)
    up, down = family.derivatives(rows, eta + h, theta), family.derivatives(rows, eta - h, theta)
    assert (up - down)[:3] / (2 * h) == pytest.approx(d[1:], abs=1e-6)
    # one row of weight 4 has the errors of half the size, or counts as four rows
    heavy = family.derivatives(replace(rows, weights=4 * rows.weights), eta, theta)
    if family.scaled_rows:
        heavy -= [[np.log(2)], [0], [0], [0]]
        twice = family.derivatives(Response.of(2 * y), 2 * eta, theta)
        assert heavy == pytest.approx(twice * [[1.0], [2.0], [4.0], [8.0]])
    else:
        assert heavy[1:] == pytest.approx(4 * d[1:])
    assert family.link.predictor(family.link.mean(eta)) == pytest.approx(eta)


def test_weights_of_students_t_scale_its_errors(data):
    """Rows times 2 with a scale twice as large are rows of weight 4."""
    formula = "normal ~ s(x, k=6)"
    one = GAMM(formula, "scat", "REML").fit(data, weights=np.full(len(data), 4.0))
    two = GAMM(formula, "scat", "REML").fit(data)
    assert one.sigma_ == pytest.approx(2 * two.sigma_, rel=1e-4)
    assert one.fitted_values_ == pytest.approx(two.fitted_values_, abs=1e-5)
    assert (one.reml_, one.loglik_) == pytest.approx((two.reml_, two.loglik_), abs=1e-4)


def test_offsets_move_predictions(data):
    model = GAMM("poisson ~ s(x)", "poisson").fit(data, offset="exposure")
    assert model.predict(data) == pytest.approx(model.fitted_values_)
    rate = model.predict(data, offset=np.zeros(len(data)))
    assert rate * np.exp(data["exposure"].to_numpy()) == pytest.approx(model.fitted_values_)
    given = GAMM("poisson ~ s(x)", "poisson").fit(data, offset=data["exposure"])
    assert given.coef_ == pytest.approx(model.coef_)
    with pytest.raises(InvalidInput, match="no offset"):
        given.predict(data)
    held = model.leave_groups_out(data, groups="g", offset="exposure")
    own = data["g"] == "g07"
    without = GAMM("poisson ~ s(x)", "poisson").fit(data[~own], offset="exposure")
    assert held[own] == pytest.approx(without.predict(data[own]), rel=0.02)


@pytest.mark.parametrize(
    ("formula", "family", "options", "words"),
    [
        ("normal ~ s(x)", "poisson", {}, "impossible response: family poisson"),
        ("normal ~ s(x)", "gamma", {}, "allowed: numbers above 0"),
        ("normal ~ s(x)", "gaussian", {"weights": "exposure"}, "invalid weights"),
        ("normal ~ s(x)", "gaussian", {"offset": "nowhere"}, "unknown column: 'nowhere'"),
    ],
)
def test_impossible_values_are_named(data, formula, family, options, words):
    with pytest.raises(InvalidInput, match=words):
        GAMM(formula, family).fit(data, **options)
