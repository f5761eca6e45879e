"""Correctors of power, against arithmetic that is written out here."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from tests.hybrid.tables import EXACT, Fixed, table

from tripwatt.hybrid.power import (
    EnsembleCorrector,
    GPCorrector,
    LearnerCorrector,
    less_trip_mean,
)
from tripwatt.learners.gp import KernelTerm


class TestCorrectors:
    two = table([1, 1], [0.1, 0.1])

    def test_ensemble(self) -> None:
        members = [Fixed(10.0, 3.0), Fixed(40.0, 5.0)]
        mean = EnsembleCorrector(members).fit(self.two)
        assert [m.seen is self.two for m in members] == [True, True]
        assert mean.predict(self.two).tolist() == [25.0, 25.0]
        assert mean.outside_factor(self.two).tolist() == [[30.0], [30.0]]
        both = mean.predict_with_uncertainty(self.two)
        assert both[0].tolist() == [25.0, 25.0]
        assert both[1].tolist() == [[3.0], [3.0]]
        assert mean.clone_tuned().predict(self.two).tolist() == [25.5, 25.5]
        assert mean.predict_climate(self.two) is None

    def test_less_the_mean_over_time(self) -> None:
        """(1 h 4 + 3 h 8) / 4 h is 7; the other trip has one row."""
        own = table([2, 1], [1.0, 3.0, 2.0])
        found = less_trip_mean(np.array([[4.0], [8.0], [5.0]]), own)
        assert found[:, 0] == pytest.approx([-3.0, 1.0, 0.0], **EXACT)

    def test_a_longer_drive_is_no_further_outside_than_one_of_an_hour(self) -> None:
        rng = np.random.default_rng(4)
        rows = pd.DataFrame({"time_s": np.tile(np.arange(10) * 200.0, 6), "simulated_w": 5000.0})
        corrector = GPCorrector((KernelTerm(("time_s",), "smooth", 1.0),))
        corrector.model.fit(rows, rng.normal(0.0, 300.0, 60), np.repeat(np.arange(6), 10), np.full(60, 0.05))

        def outside(time_s: float) -> np.ndarray:
            return corrector.outside_factor(SimpleNamespace(columns=rows.assign(time_s=time_s)))

        assert outside(1800.0).shape == (60, 0)
        assert (outside(3500.0) < outside(3600.0)).all()
        np.testing.assert_array_equal(outside(3600.0), outside(9000.0))

    def test_shape_moves_energy_along_a_trip(self) -> None:
        """One feature of prior variance 9: ridge on rows less their mean; the total stays that of the weights."""
        own = table([2], [1.0, 3.0], simulated=[0.0, 0.0], observed=[10.0, 30.0])
        column = np.array([[1.0], [2.0]])

        @dataclass
        class Model:
            terms: tuple[()] = ()
            weights_: tuple[float] = (100.0,)

            def fit(self, *given):
                self.given = given

            def features(self, features):
                return column

            def by_feature(self, of_terms):
                return np.array([9.0])

            def factor(self, features):
                return features * 2.0

        corrector = GPCorrector(())
        corrector.model = Model()
        corrector.fit(own)
        assert corrector.model.given[1].tolist() == [10.0, 30.0]
        # left are -90 and -170, less -150: 60 and -20; the feature less 1.75: -0.75 and 0.25
        gram = 0.75**2 + 0.25**2 + ((3600.0 + 400.0) / 2.0) / (4.0 * 9.0)
        shape = -(0.75 * 60.0 + 0.25 * 20.0) / gram
        assert corrector.shape == pytest.approx([shape], **EXACT)
        expected = [100.0 - 0.75 * shape, 200.0 + 0.25 * shape]
        assert corrector.predict(own) == pytest.approx(expected, **EXACT)
        mean, factor = corrector.predict_with_uncertainty(own)
        assert mean == pytest.approx(expected, **EXACT)
        assert factor.tolist() == [[2.0], [4.0]]

    def test_learners_see_their_features(self) -> None:
        seen = {}

        class Learner:
            def fit(self, columns, target, groups) -> None:
                seen.update(columns=list(columns), target=target, groups=groups)

            def predict(self, columns):
                return columns["row"].to_numpy() * 2.0

            def tuned(self):
                return "tuned"

        own = table([1, 2], [0.1] * 3, observed=[1.0, 2.0, 3.0])
        made = LearnerCorrector(Learner(), ("row",)).fit(own)
        assert seen["columns"] == ["row"]
        assert seen["target"].tolist() == [1.0, 2.0, 3.0]
        assert seen["groups"].tolist() == [0, 1, 1]
        mean, factor = made.predict_with_uncertainty(own)
        assert mean.tolist() == [0.0, 2.0, 4.0]
        assert factor.tolist() == [[0.0]] * 3
        assert made.outside_factor(own).tolist() == [[0.0]] * 3
        again = made.clone_tuned()
        assert (again.model, again.features) == ("tuned", ("row",))
