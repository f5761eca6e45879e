"""A corrector on another car, against plain Gaussian algebra of every option, with two small processes."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import block_diag

from tripwatt.errors import InvalidInput
from tripwatt.hybrid import SegmentTable
from tripwatt.hybrid.car_corrector import HierarchicalCorrector, factor_of
from tripwatt.hybrid.familiarity import FADING, Familiarity, Range
from tripwatt.hybrid.hierarchy import (
    OWN_SCALES,
    CarTransfer,
    Evidence,
    Members,
    Option,
    Posterior,
    grid,
    require_mode,
    term_scales,
)
from tripwatt.hybrid.parameters import Parameter
from tripwatt.hybrid.power import SETTLED_S, EnsembleCorrector, GPCorrector, PowerCorrector
from tripwatt.hybrid.split import SplitCorrector
from tripwatt.learners.gp import KernelTerm
from tripwatt.vehicles import load_vehicle

EXACT = {"rel": 1e-7, "abs": 1e-7}
AMBIENT = "ambient_temperature_degc"
COLUMNS_OF_ONE = ["hvac_w", "speed_m_s"]


def process(terms, whiteners, weights, factor, variances, ranges, sds, columns, shape):
    """A fitted Gaussian process whose features are columns as they are."""
    model = SimpleNamespace(
        whiteners_=whiteners,
        weights_=np.array(weights),
        factor_=np.array(factor),
        variances_=np.array(variances),
        ranges_=ranges,
        sds_=sds,
        features=lambda features: (features[columns].to_numpy(), np.ones(len(columns))),
    )
    seen = Familiarity({name: Range(*ranges[name], sds[name]) for name in ranges if name in FADING})
    predict = lambda own: own.features[columns].to_numpy() @ np.array(weights)  # noqa: E731
    return SimpleNamespace(terms=terms, model=model, shape=np.array(shape), predict=predict, familiarity=seen)


def members() -> Members:
    """A line and a smooth of two features; a smooth of one. The fourth variance of the first is not a term's."""
    line = KernelTerm(("hvac_w",), "line", 0.1)
    speed = KernelTerm(("speed_m_s",), "smooth", 100.0, 1.0)
    weather = KernelTerm((AMBIENT, "speed_m_s", "time_s"), "smooth", 100.0, 1.0)
    first = process(
        (line, speed),
        [None, np.zeros((5, 2))],
        [0.2, 1.0, -0.5],
        [[0.1, 0.0], [0.2, 0.3], [0.0, 0.4]],
        [0.04, 2.0, 99.0],
        {"speed_m_s": (5.0, 25.0)},
        {"speed_m_s": 5.0},
        ["hvac_w", "a", "b"],
        [0.5, 0.0, 1.0],
    )
    ranges = {AMBIENT: (0.0, 20.0), "speed_m_s": (5.0, 28.0), "time_s": (0.0, 1600.0)}
    second = process(
        (weather,),
        [np.zeros((4, 1))],
        [2.0],
        [[0.5]],
        [3.0],
        ranges,
        {AMBIENT: 10.0, "speed_m_s": 4.0, "time_s": 1000.0},
        ["c"],
        [-1.0],
    )
    return Members((first, second))


def rows(observed=True) -> SegmentTable:
    """Trips of two, one and two segments."""
    features = pd.DataFrame(
        {
            "hvac_w": [10.0, 20.0, 30.0, 5.0, 15.0],
            "a": [1.0, 2.0, -1.0, 0.5, 3.0],
            "b": [0.5, -2.0, 1.0, 1.5, 0.0],
            "c": [2.0, 1.0, 1.0, -3.0, 2.0],
            "speed_m_s": [10.0, 30.0, 20.0, 3.0, 20.0],
            AMBIENT: [10.0, 10.0, -10.0, 10.0, np.nan],
            "time_s": [0.0, 100.0, 3600.0, 9000.0, 10.0],
        }
    )
    watts = np.array([100.0, 120.0, 90.0, 80.0, 60.0])
    return SegmentTable(
        ("x", "y", "z"),
        np.array([0, 2, 3, 5]),
        features,
        np.array([0.5, 1.0, 2.0, 1.0, 0.25]),
        watts,
        observed_w=watts + np.array([4.0, -6.0, 9.0, 2.0, 8.0]) if observed else None,
    )


TRUST = np.exp(-0.5 * np.array([0.0, 0.5**2, 1.0, 0.4**2, 0.0]))
"""The nearer range of a speed counts: 30 m/s are 1 sd beyond 25 and 0.5 beyond 28, 3 m/s 0.4 and 0.5 below 5. At -10 °C 1 sd.
A longer time is no other kind of drive, and an unknown temperature no distance."""
FEATURES = np.array(
    [
        [10.0, 1.0, 0.5, 2.0],
        [20.0, 2.0, -2.0, 1.0],
        [30.0, -1.0, 1.0, 1.0],
        [5.0, 0.5, 1.5, -3.0],
        [15.0, 3.0, 0.0, 2.0],
    ]
)
SCALES = np.array([1.0, 2.0, 2.0, 0.5])
PARTS = (
    Parameter("mass", 0.1, "", ("body.curb_mass_kg",), ("hvac",)),
    Parameter("heat", 0.4, "", (), ("hvac", "unknown")),
)
TRANSFER = CarTransfer(members(), SCALES, PARTS)
COVARIANCE = block_diag(
    *(np.array(f) @ np.array(f).T for f in ([[0.1, 0.0], [0.2, 0.3], [0.0, 0.4]], [[0.5]]))
)
VARIANCES = np.array([0.04, 2.0, 2.0, 3.0])
WEIGHTS = np.array([0.2, 1.0, -0.5, 2.0])
STAGE = np.array([0, 0, 0, 1])
"""The corrector of each weight: the shares of its stage."""


def evidence(n=4) -> Evidence:
    """Trips with large errors, so that no option is ruled out."""
    rng = np.random.default_rng(5)
    world, own, lost = (rng.normal(0.0, s, (n, 4)) for s in (3.0, 4.0, 2.0))
    physical = rng.normal(0.0, 20.0, (n, 2))
    return Evidence(
        world, own, lost, physical, np.array([50.0, 80.0, 60.0, 90.0])[:n], rng.normal(0.0, 4.0, n)
    )


def before(option: Option) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of (in common, own, lost, parameters)."""
    share = np.array(option.shares)[STAGE]
    mean = np.concatenate([share * WEIGHTS, np.zeros(4 + 4 + 2)])
    own = option.own**2 * (1 - share**2) * VARIANCES
    covariance = block_diag(
        share[:, None] * COVARIANCE * share,
        np.diag(own),
        np.diag(share**2 * VARIANCES),
        np.diag(option.published**2 * np.array([0.01, 0.16])),
    )
    return mean, covariance


def stacked(trips: Evidence) -> np.ndarray:
    return np.hstack([trips.world, trips.own, trips.lost, trips.physical])


def dense(trips: Evidence, known: list[int], mode="both"):
    """Weight, posterior mean and posterior covariance of each option."""
    X, y, n = stacked(trips)[known], trips.residual_wh[known], trips.noise_wh2[known]
    found, logs = [], []
    for option in grid(mode, stages=2):
        mean, covariance = before(option)
        if known:
            total = X @ covariance @ X.T + np.diag(option.noise * n)
            gain = covariance @ X.T @ np.linalg.inv(total)
            error = y - X @ mean
            logs.append(-0.5 * error @ np.linalg.solve(total, error) - 0.5 * np.linalg.slogdet(total)[1])
            mean, covariance = mean + gain @ (y - X @ mean), covariance - gain @ X @ covariance
        else:
            logs.append(0.0)
        found.append((option, mean, covariance))
    weights = np.exp(np.array(logs) - max(logs))
    return weights / weights.sum(), found


def test_grid() -> None:
    """Every combination of shares, own and book scales and noise; a mode fixes one of the scales at 0."""
    quarters = {0.0, 0.25, 0.5, 0.75, 1.0}
    both = grid()
    assert len(set(both)) == len(both) == 5 * 5 * 3 * 5
    assert {o.share for o in both} == {o.own for o in both} == quarters
    assert {o.published for o in both} == {0.5, 1.0, 1.5}
    assert {o.noise for o in both} == {0.25, 0.5, 1.0, 2.0, 4.0}
    assert {o.published for o in grid("effects")} == {0.0}
    assert {o.own for o in grid("effects")} == quarters
    apart = grid(stages=2)
    assert len(set(apart)) == len(apart) == 3 * 3 * 5 * 3 * 5
    assert {o.shares for o in apart} == {(a, b) for a in (0.0, 0.5, 1.0) for b in (0.0, 0.5, 1.0)}
    assert Option((0.0, 1.0), 1.0, 1.0, 1.0).share == 0.5
    assert {o.own for o in grid("parameters")} == {0.0}
    assert {o.published for o in grid("parameters")} == {0.5, 1.0, 1.5}
    require_mode("both")
    with pytest.raises(InvalidInput, match="unknown adaptation mode"):
        require_mode("all")


class TestMembers:
    def test_side_by_side(self) -> None:
        own = members()
        assert own.sizes == [1, 2, 1]
        assert own.weights.tolist() == WEIGHTS.tolist()
        assert own.variances.tolist() == VARIANCES.tolist()
        assert own.shape.tolist() == [0.5, 0.0, 1.0, -1.0]
        assert own.features(rows()).tolist() == FEATURES.tolist()
        assert own.predict(rows()) == pytest.approx(FEATURES @ WEIGHTS, **EXACT)

    def test_familiarity(self) -> None:
        assert members().familiarity(rows()) == pytest.approx(TRUST, **EXACT)
        line = KernelTerm(("hvac_w",), "line", 0.1)
        alone = Members((SimpleNamespace(terms=(line,), model=None, familiarity=Familiarity()),))
        assert alone.familiarity(rows()).tolist() == [1.0] * 5

    def test_of_a_corrector(self) -> None:
        a, b, c = GPCorrector(()), GPCorrector(()), GPCorrector(())
        assert Members.from_corrector(a).correctors == (a,)
        assert Members.from_corrector(EnsembleCorrector([a, PowerCorrector()])).correctors == (a,)
        split = SplitCorrector(a, EnsembleCorrector([b, PowerCorrector()]), c, True)
        assert Members.from_corrector(split).correctors == (a, b)
        assert Members.from_corrector(SplitCorrector(a, b, c, False)).correctors == (c,)
        with pytest.raises(InvalidInput, match="cannot be transferred"):
            Members.from_corrector(EnsembleCorrector([PowerCorrector()]))

    def test_scales(self) -> None:
        """A smooth of speed goes with the mass, 1.5; one of the cabin's temperatures with its heat loss, (30 + 30) / (20 + 10)."""
        car = lambda mass, climate: SimpleNamespace(body=SimpleNamespace(test_mass_kg=mass), climate=climate)  # noqa: E731
        room = lambda shell, fresh: SimpleNamespace(shell_w_k=shell, fresh_air_low_w_k=fresh)  # noqa: E731
        first, second = car(1000.0, room(20.0, 10.0)), car(1500.0, room(30.0, 30.0))
        assert term_scales(members(), first, second).tolist() == [1.0, 1.5, 1.5, 2.0]
        for one, other in ((car(1000.0, None), second), (first, car(1500.0, None))):
            assert term_scales(members(), one, other).tolist() == [1.0, 1.5, 1.5, 1.0]
        wide = KernelTerm(("battery_temperature_degc",), "smooth", 1.0)
        climate_line = KernelTerm((AMBIENT,), "line", 1.0)
        driving_line = KernelTerm(("speed_m_s",), "line", 1.0)
        terms = (wide, climate_line, driving_line)
        model = SimpleNamespace(whiteners_=[np.zeros((2, 1)), None, None])
        other = Members((SimpleNamespace(terms=terms, model=model),))
        assert term_scales(other, first, second).tolist() == [1.0, 1.0, 1.0]


class TestTransfer:
    def test_rows_and_evidence(self) -> None:
        common, own, lost = TRANSFER.rows(rows())
        scaled = FEATURES * SCALES
        assert own == pytest.approx(scaled, **EXACT)
        assert common == pytest.approx(scaled * TRUST[:, None], **EXACT)
        assert lost == pytest.approx(scaled * np.sqrt(1.0 - TRUST**2)[:, None], **EXACT)
        physical = np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 30.0], [4.0, 40.0], [5.0, 50.0]])
        found = TRANSFER.evidence(rows(), physical, np.ones(3))
        hours = rows().hours[:, None]
        by_trip = lambda values: np.array([values[:2].sum(axis=0), values[2], values[3:].sum(axis=0)])  # noqa: E731
        for name, values in (("world", common), ("own", own), ("lost", lost), ("physical", physical)):
            assert getattr(found, name) == pytest.approx(by_trip(values * hours), **EXACT)
        assert found.residual_wh == pytest.approx([4 * 0.5 - 6.0, 18.0, 2.0 + 2.0], **EXACT)
        assert np.isnan(TRANSFER.evidence(rows(False), physical, np.ones(3)).residual_wh).all()
        assert found.take([2]).residual_wh == pytest.approx([4.0], **EXACT)

    def test_levels(self) -> None:
        """In common by corrector, own and lost by stage, parameters; their priors are those of the dense form at scales of 1."""
        given = TRANSFER.given(evidence())
        covariance = block_diag(*(level.covariance_times(np.eye(len(level.usual))) for level in given.levels))
        widths = np.diag([0.01, 0.16])
        dense_form = block_diag(COVARIANCE, np.diag(VARIANCES), np.diag(VARIANCES), widths)
        assert covariance == pytest.approx(dense_form, **EXACT)

    @pytest.mark.parametrize("mode", ["both", "effects", "parameters"])
    def test_posterior(self, mode: str) -> None:
        trips = evidence()
        trips = dataclasses.replace(
            trips, residual_wh=3.0 * trips.residual_wh
        )  # so that some options do not count
        found = CarTransfer(members(), SCALES, PARTS, mode).posterior(trips)
        weights, options = dense(trips, [0, 1, 2, 3], mode)
        assert found.weights == pytest.approx(weights, **EXACT)
        assert weights.min() < 1e-4 < weights.max() / 20.0
        kept = np.where(weights >= 1e-4, weights, 0.0)  # options that hardly count are left out
        kept /= kept.sum()
        mean = sum(w * m for w, (_, m, _) in zip(kept, options, strict=True))
        second = sum(w * (c + np.outer(m, m)) for w, (_, m, c) in zip(kept, options, strict=True))
        assert found.mean == pytest.approx(mean, **EXACT)
        assert found.covariance == pytest.approx(second - np.outer(mean, mean), rel=1e-6, abs=1e-7)
        for k in range(2):
            mean_share = sum(w * o.shares[k] for w, (o, _, _) in zip(weights, options, strict=True))
            assert found.shares[k] == pytest.approx(mean_share)
        assert found.share == pytest.approx(sum(found.shares) / 2.0)
        scale = sum(w * o.noise for w, (o, _, _) in zip(weights, options, strict=True))
        assert found.noise_scale == pytest.approx(scale, **EXACT)
        sd = np.sqrt(np.maximum(np.diag(found.covariance)[-2:], 0.0))
        named = found.parameters(["mass", "heat"])
        assert named["mass"] == pytest.approx((found.mean[-2], sd[0]))
        assert named["heat"] == pytest.approx((found.mean[-1], sd[1]))
        assert found.parameters([]) == {}

    def test_options_of_less_than_a_ten_thousandth_are_left_out(self) -> None:
        """With errors of the trips that are a hundred times smaller most options are ruled out."""
        trips = evidence()
        trips = Evidence(
            trips.world, trips.own, trips.lost, trips.physical, trips.noise_wh2 / 1e3, trips.residual_wh
        )
        weights, options = dense(trips, [0, 1, 2, 3])
        kept = np.where(weights >= 1e-4, weights, 0.0)
        assert 0 < (kept == 0.0).sum() < len(kept)
        kept /= kept.sum()
        mean = sum(w * m for w, (_, m, _) in zip(kept, options, strict=True))
        second = sum(w * (c + np.outer(m, m)) for w, (_, m, c) in zip(kept, options, strict=True))
        found = TRANSFER.posterior(trips)
        assert found.mean == pytest.approx(mean, **EXACT)
        assert found.covariance == pytest.approx(second - np.outer(mean, mean), rel=1e-6, abs=1e-7)
        assert found.weights == pytest.approx(weights, **EXACT)

    def test_left_out(self) -> None:
        trips = evidence()
        mean, variance = TRANSFER.left_out(trips)
        X = stacked(trips)
        for i in range(4):
            weights, options = dense(trips, [k for k in range(4) if k != i])
            means = np.array([X[i] @ m for _, m, _ in options])
            variances = np.array([X[i] @ c @ X[i] for _, _, c in options])
            centre = weights @ means
            assert mean[i] == pytest.approx(centre, **EXACT)
            assert variance[i] == pytest.approx(weights @ (variances + means**2) - centre**2, rel=1e-6)

    @pytest.mark.parametrize("known", [[], [2], [0, 3]])
    def test_draws(self, known: list[int]) -> None:
        trips = evidence()
        score = np.array([1, 2])
        draws = np.array([known, known[::-1]], dtype=np.int64).reshape(2, len(known))
        found = TRANSFER.predict_draws(trips, draws, score)
        weights, options = dense(trips, known)
        X = stacked(trips)[score]
        means = np.array([X @ m for _, m, _ in options])
        noise = np.array([o.noise for o, _, _ in options])[:, None] * trips.noise_wh2[score]
        variances = np.array([np.diag(X @ c @ X.T) for _, _, c in options]) + noise
        centre = weights @ means
        for draw in range(2):
            assert found.mean_wh[draw] == pytest.approx(centre, **EXACT)
            assert found.sd_wh[draw] == pytest.approx(
                np.sqrt(weights @ (variances + means**2) - centre**2), rel=1e-6
            )
            assert found.share[draw] == pytest.approx(
                sum(w * o.share for w, (o, _, _) in zip(weights, options, strict=True))
            )


class TestCorrector:
    def posterior(self) -> Posterior:
        rng = np.random.default_rng(2)
        root = rng.normal(0.0, 1.0, (14, 14))
        option = Option((0.5, 0.5), 1.0, 1.0, 1.0), Option((0.0, 1.0), 1.0, 1.0, 1.0)
        return Posterior(rng.normal(0.0, 1.0, 14), root @ root.T, option, np.array([0.5, 0.5]), 1.0)

    @pytest.mark.parametrize("calibrated", [frozenset(), frozenset({"mass"})])
    def test_parameters_become_causes(self, calibrated) -> None:
        """The own weight of hvac_w, number 4, takes both parameters; the mean of a calibrated one is in the car."""
        given = self.posterior()
        found = HierarchicalCorrector.from_posterior(TRANSFER, given, calibrated)
        mean = given.mean[:12].copy()
        mean[4] += given.mean[13] + (0.0 if calibrated else given.mean[12])
        assert found.mean == pytest.approx(mean, **EXACT)
        onto = np.hstack([np.eye(12), np.zeros((12, 2))])
        onto[4, 12:] = 1.0
        covariance = onto @ given.covariance @ onto.T
        assert found.factor @ found.factor.T == pytest.approx(covariance, rel=1e-4, abs=1e-3)
        assert found.shares == (0.25, 0.75)
        assert found.scales is TRANSFER.scales

    def test_small_directions_are_dropped(self) -> None:
        """Of variances 1, 2e-8 and 0.5e-8 of the largest the last is not stored."""
        diagonal = np.concatenate([[4.0, 8e-8, 2e-8], np.zeros(11)])
        given = Posterior(
            np.zeros(14), np.diag(diagonal), (Option((0.5, 0.5), 1.0, 1.0, 1.0),), np.ones(1), 1.0
        )
        found = HierarchicalCorrector.from_posterior(TRANSFER, given, frozenset())
        assert found.factor.shape == (12, 2)
        assert np.sort((found.factor**2).sum(axis=0)) == pytest.approx([8e-8, 4.0], rel=1e-6)

    def test_prediction(self) -> None:
        """The weights of (in common, own, lost), and the base's shape within a trip by the share."""
        found = HierarchicalCorrector.from_posterior(TRANSFER, self.posterior(), frozenset())
        own = rows()
        X = np.hstack(TRANSFER.rows(own))
        shares = np.array([0.25, 0.25, 0.25, 0.75])
        shape = (FEATURES * SCALES * TRUST[:, None]) @ (shares * np.array([0.5, 0.0, 1.0, -1.0]))
        hours = own.hours
        for trip in (slice(0, 2), slice(2, 3), slice(3, 5)):
            shape[trip] -= (shape[trip] @ hours[trip]) / hours[trip].sum()
        mean, factor = found.predict_with_uncertainty(own)
        assert mean == pytest.approx(X @ found.mean + shape, **EXACT)
        assert factor == pytest.approx(X @ found.factor, **EXACT)
        assert found.predict(own).tolist() == mean.tolist()
        assert found.outside_factor(own).shape == (5, 0)
        assert found.predict_climate(own) is None
        for refused in (lambda: found.fit(own), found.clone_tuned):
            with pytest.raises(InvalidInput, match="cannot be fitted"):
                refused()


def test_two_cars_are_alike_before_any_trip_and_a_longer_drive_is_no_other_kind_of_drive():
    assert OWN_SCALES == (0.0, 0.25, 0.5, 0.75, 1.0)
    options = grid("both")
    assert max(option.own for option in options) == 1.0
    assert len(options) == 5 * 5 * 3 * 5

    climate = load_vehicle("bmw_i3_60ah").climate
    capacity_j_k = climate.air_heat_capacity_j_k + climate.interior_heat_capacity_j_k
    left = np.exp(-SETTLED_S * 70.0 / capacity_j_k)
    assert left == pytest.approx(1.0 / 12.0, rel=0.05), "a twelfth of the cabin's difference is left"


@pytest.mark.parametrize("scale", [1.0, 1e-9])
def test_independent_weights_are_factorised_on_their_own(scale) -> None:
    """Two weights that depend on each other, one known exactly, one alone and one that is negligible."""
    covariance = np.zeros((5, 5))
    covariance[np.ix_([0, 3], [0, 3])] = [[2.0, 1.0], [1.0, 2.0]]
    covariance[2, 2], covariance[4, 4] = 1e-6, 1e-9  # of the largest variance, 3: more and less than 1e-8
    factor = factor_of(scale * covariance)
    covariance[4, 4] = 0.0
    assert factor.shape == (5, 3)
    np.testing.assert_allclose(factor @ factor.T, scale * covariance, atol=1e-15 * scale)
    assert np.count_nonzero(factor[:, np.abs(factor[2]) > 0.0]) == 1


def test_the_error_of_a_measurement_does_not_scale_with_that_of_the_model():
    flat = np.ones((3, 2))
    noise, measured = np.array([100.0, 400.0, 900.0]), np.array([0.0, 50.0, 70.0])
    told = Evidence(flat, flat, flat, flat, noise, np.zeros(3), measured)
    exact = Evidence(flat, flat, flat, flat, noise, np.zeros(3))
    for scale in (0.25, 1.0, 4.0):
        assert told.error_wh2(scale) == pytest.approx(exact.error_wh2(scale) + measured)
        assert exact.error_wh2(scale) == pytest.approx(scale * noise)
    part = told.take([2, 0])
    assert part.error_wh2(2.0) == pytest.approx([1870.0, 200.0])
    assert exact.take([1]).measured.tolist() == [0.0]
