"""Terms of every kind: fits by R's mgcv, and rows that the fit did not have."""

import json

import numpy as np
import pandas as pd
import pytest

from gamm_samples import FIXTURES
from tripwatt_gamm import GAMM, InvalidInput, basis_check

PEERS = json.loads((FIXTURES / "terms" / "fits.json").read_text())


@pytest.fixture(scope="module")
def data():
    """The rows of fixtures/terms/reference.R."""
    frame, i = pd.read_csv(FIXTURES / "families" / "data.csv"), np.arange(400)
    frame = frame.assign(f=np.array(list("abc"))[i % 3], h=np.array(list("uv"))[i // 3 % 2])
    step = (frame["f"] == "b") * frame["x"] - (frame["h"] == "v") * (frame["f"] == "c")
    return frame.assign(y=frame["normal"] + step + np.sin(2 * np.pi * frame["z"] + i % 3 + 1))


@pytest.mark.parametrize("peer", PEERS, ids=lambda peer: peer["formula"])
def test_fits_are_those_of_mgcv(data, peer):
    new = data.iloc[[0, 101, 302]]
    model = GAMM(peer["formula"], select="s(w" in peer["formula"] or "te(" in peer["formula"]).fit(data)
    assert model.converged_
    assert model.reml_ == pytest.approx(peer["reml"], rel=1e-6)
    assert model.aic_ == pytest.approx(peer["aic"], rel=1e-5)
    assert model.bic_ == pytest.approx(peer.get("bic", model.bic_), rel=1e-5)
    assert model.edf_.sum() == pytest.approx(peer["edf"], rel=1e-4)
    band = model.intervals(new)
    assert band["mean"].tolist() == pytest.approx(peer["link"], rel=1e-4)
    assert band["std_error"].tolist() == pytest.approx(peer["link_se"], rel=1e-4)


def test_products_at_new_rows(data):
    model = GAMM("y ~ f*x + offset(exposure)", extrapolation="clamp").fit(data)
    coef = dict(zip(model.coef_names_, model.coef_, strict=True))
    far = pd.DataFrame({"f": ["b", "b"], "x": [data["x"].max(), 9.0], "exposure": 0.5})
    line = coef["(Intercept)"] + coef["fb"] + (coef["x"] + coef["fb:x"]) * data["x"].max() + 0.5
    assert model.predict(far) == pytest.approx(line)
    assert list(model.effects(data)["f:x"].frame()["level"]) == ["fb:x", "fc:x"]
    held = model.leave_groups_out(data, groups="g")
    own = data["g"] == "g07"
    without = GAMM("y ~ f*x + offset(exposure)").fit(data[~own])
    assert held[own] == pytest.approx(without.predict(data[own]))
    with pytest.raises(InvalidInput, match=r"two offsets.*offset\(exposure\)"):
        GAMM("y ~ x + offset(exposure)").fit(data, offset=np.ones(400))


def test_cyclic_curves_continue_with_their_period(data):
    model = GAMM('y ~ s(z, bs="cc", k=8) + f').fit(data)
    z = data["z"].to_numpy()
    assert model.predict(data.assign(z=z + 2 * np.ptp(z))) == pytest.approx(model.predict(data))
    ends = model.predict(pd.DataFrame({"z": [z.min(), z.min() + 1e-5, z.max() - 1e-5, z.max()], "f": "a"}))
    assert ends[0] == pytest.approx(ends[3])
    assert ends[1] - ends[0] == pytest.approx(ends[3] - ends[2], rel=1e-3)
    longer = GAMM('y ~ s(z, bs="cc", k=8, knots=c(-0.5, 1.5)) + f').fit(data)
    assert longer.predict(data.assign(z=z + 2)) == pytest.approx(longer.predict(data))
    for knots in ("c(0.1, 1)", "c(1, 0)", "c(0, 0.5, 1)"):
        with pytest.raises(InvalidInput, match="invalid knots: s\\(z\\)"):
            GAMM(f'y ~ s(z, bs="cc", k=8, knots={knots})').fit(data)
    with pytest.raises(InvalidInput, match="of basis tp"):
        GAMM("y ~ s(z, knots=c(0, 1))").fit(data)


@pytest.mark.parametrize(("n", "k", "seed"), [(400, 8, 3), (300, 4, 5)])
def test_a_selected_interaction_does_not_depend_on_its_basis(n, k, seed):
    """Centred thin plate margins are nearly singular at even points: true penalties are 1e-10 of the largest."""
    rng = np.random.default_rng(seed)
    x, w = rng.uniform(size=n), rng.uniform(size=n)
    frame = pd.DataFrame({"x": x, "w": w, "y": 2 * np.sin(3 * x) * np.cos(4 * w) + rng.normal(0, 0.5, n)})
    fits = {}
    for basis in ("tp", "cr"):
        formula = f'y ~ s(x) + s(w) + ti(x, w, bs="{basis}", k={k})'
        assert GAMM(formula).fit(frame).terms_[-1].null_dim == 1
        fits[basis] = GAMM(formula, select=True).fit(frame)
        assert fits[basis].converged_
        assert fits[basis].terms_[-1].null_dim == 0
    assert fits["tp"].scale_ == pytest.approx(fits["cr"].scale_, rel=0.03)
    assert fits["tp"].reml_ == pytest.approx(fits["cr"].reml_, abs=4)


def test_curves_of_the_levels_of_a_factor(data):
    model = GAMM('y ~ s(x) + s(x, g, bs="fs", k=5)').fit(data)
    curves = model.effects(data)
    assert len(curves) == 21
    assert curves["s(x,g) g07"].rug.size == 20
    assert model.predict(data) == pytest.approx(model.fitted_values_)
    new = data.assign(g="new")
    assert model.predict(new) == pytest.approx(model.predict(data, exclude=["s(x,g)"]))
    with pytest.raises(InvalidInput, match="a number for a factor"):
        GAMM('y ~ s(g, x, bs="fs")').fit(data.assign(g=np.arange(400)))


def test_checks_of_bases_are_those_of_mgcv(data):
    for peer in PEERS:
        if peer.get("checks") and "te(" not in peer["formula"]:
            model = GAMM(peer["formula"], select="s(w" in peer["formula"]).fit(data)
            table, expected = basis_check(model, data, 2000), np.array(peer["checks"], dtype=float)
            assert table.iloc[:, :3].to_numpy() == pytest.approx(expected[:, :3], rel=1e-4)
            assert table["p_value"].to_numpy() == pytest.approx(expected[:, 3], abs=0.04)
    surface = GAMM("normal ~ s(z, w, k=14)").fit(data)
    assert basis_check(surface, data)["k_index"].tolist() == pytest.approx([0.984449286], rel=1e-4)  # of mgcv
    with pytest.raises(InvalidInput, match="the 400 rows of the fit"):
        basis_check(surface, data[:10])
