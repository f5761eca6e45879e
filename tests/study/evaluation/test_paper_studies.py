"""What the protocol `paper` measures beside its table: forms of the simulation, choices inside the fold, trips needed."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tripwatt.hybrid import build_table
from tripwatt.learners.folds import Split, leave_one_out
from tripwatt.study.evaluation import Execution, evaluate
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.hold_outs import CarChoice, HoldOut
from tripwatt.study.evaluation.paper_studies import (
    CHOICES,
    CURVE,
    FORMS,
    NEAREST,
    chosen_folds,
    crossing,
    simulation_forms,
    studies,
    study_comparisons,
    study_models,
    trips_needed,
)
from tripwatt.study.evaluation.tasks import FoldResult
from tripwatt.study.paper import Table2Corrector, correctors
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.vehicles import load_vehicle


@pytest.fixture(scope="module")
def fleet():
    made = synthetic_fleet(n_trips=9, seed=3)
    return dataclasses.replace(made, reference={trip.trip_id: None for trip in made.trips})


@pytest.fixture(scope="module")
def table(fleet):
    cars = {"physics-paper": load_vehicle("bmw_i3_60ah", preset="paper")}
    return build_table(fleet.trips, cars, step_s=5.0)


def hold_out(table, trips="reference", scheme="leave_one_trip_out"):
    return HoldOut(scheme, trips, table, table, leave_one_out(np.arange(len(table))))


# -- forms of the simulation ---------------------------------------------------------------------------------


def test_forms_change_what_their_titles_state_and_nothing_else():
    cars = simulation_forms(CarChoice("bmw_i3_60ah"))
    assert list(cars) == list(FORMS)
    paper = load_vehicle("bmw_i3_60ah", "paper")
    for name, car in cars.items():
        assert car.climate is None, name
        assert car.battery == paper.battery
        assert car.auxiliaries.base_load_w == (300.0 if name == "physics-idle" else 0.0)
        measured = name == "physics-no-auxiliaries"
        assert car.road_load.method == ("coastdown" if measured else "coefficients")
        assert car.body.curb_mass_kg == (1281.0 if measured else 1195.0)
        if "textbook" not in name:
            assert car.drivetrain == paper.drivetrain
    road = cars[NEAREST].road_load
    assert road.drag_area_m2 == pytest.approx(0.29 * 2.38)
    assert road.rolling_coefficients == (0.0065, 0.0)
    assert cars["physics-textbook"].regeneration.fraction == 0.5
    assert cars["physics-textbook-energy"].regeneration.fraction * 0.9 == pytest.approx(0.5)


def test_the_textbook_form_has_one_efficiency():
    from tripwatt.physics.drivetrain import propulsion

    car = simulation_forms(CarChoice("bmw_i3_60ah"))["physics-textbook-energy"]
    wheel, speed = np.array([9000.0, -9000.0]), np.array([15.0, 15.0])
    run = propulsion(wheel, speed, np.ones(2), car.drivetrain, car.regeneration)
    assert run.motor_power_w == pytest.approx([10_000.0, -4500.0])  # half of the braking energy comes back
    half = simulation_forms(CarChoice("bmw_i3_60ah"))["physics-textbook"]
    run = propulsion(wheel, speed, np.ones(2), half.drivetrain, half.regeneration)
    assert run.motor_power_w == pytest.approx([10_000.0, -4050.0])  # half of the braking power, at 0.9


def test_other_cars_have_no_forms_and_given_values_stay():
    assert simulation_forms(CarChoice("nissan_leaf_24")) == {}
    cars = simulation_forms(CarChoice("bmw_i3_60ah", {"body.driver_mass_kg": 100.0}))
    assert {car.body.driver_mass_kg for car in cars.values()} == {100.0}


# -- which models run, and where -------------------------------------------------------------------------------


def test_studies_follow_the_models_of_the_table():
    assert study_models(["linear4", "physics"]) == ()
    names = {model.name for model in study_models(["physics-paper", "forest"])}
    assert names == {*FORMS, "forest-brochure"}
    names = {model.name for model in study_models(["boosting", "boosting-only"])}
    assert names == {"boosting-exchangeable", "boosting-ar1"}
    assert {model.name for model in study_models(["gamm"])} == {"gamm-ar1"}
    everything = study_models(["physics-paper", "gamm", "forest", "boosting", "boosting-only"])
    assert len({model.name for model in everything}) == len(everything) == 5 + 3 + 2 + 1
    for model in everything:
        made = model.method.make(3)
        assert getattr(made, "simulation", getattr(made, "preset", None)) == model.simulation


def test_studies_run_on_the_reference_trips_alone(table):
    (varied,) = study_comparisons(hold_out(table), ["physics-paper", "gamm"], 0)
    # the simulations of the forms are not known
    assert [spec.name for spec in varied.specs] == ["gamm-ar1"]
    assert len(varied.hold_out.splits) == 9
    assert study_comparisons(hold_out(table, trips="audited"), ["gamm"], 0) == []
    assert study_comparisons(hold_out(table, scheme="leave_one_day_out"), ["gamm"], 0) == []
    _, draws = study_comparisons(hold_out(table), ["boosting", "boosting-only"], 0)
    assert [(len(s.train), s.draw) for s in draws.hold_out.splits] == [
        (3, k) for k in range(4)
    ]  # 5 to score, not 6
    assert draws.specs == CURVE
    assert studies(Comparison(hold_out(table, trips="all"), ()), [], 0) == {}


def test_a_run_on_reference_trips_scores_the_forms(fleet):
    run = evaluate(fleet, models=("physics-paper",), execution=Execution(n_jobs=1))
    found = run.results["studies"]
    assert (found["trips"], found["n_trips"], found["nearest"]) == ("reference", 9, NEAREST)
    assert found["trips_needed"] is None
    assert found["choices"] == {}
    assert set(found["models"]) == {"physics-paper", *FORMS}
    table = run.results["evaluations"][0]["models"]["physics-paper"]
    own = found["models"]["physics-paper"]
    assert (own["mape"], own["mape_ci95"], own["improved_share"]) == (table["mape"], table["mape_ci95"], None)
    assert own["title"] == "physics as in the paper"
    # less load, less energy: the mean of (predicted - observed) / observed falls
    bias = {name: score["bias"] for name, score in found["models"].items()}
    assert bias["physics-no-auxiliaries"] < bias["physics-paper"]
    assert bias[NEAREST] < bias["physics-idle"]
    assert bias["physics-textbook-energy"] < bias["physics-textbook"]
    assert run.results["table2"] == []


def test_scores_of_a_study_are_those_of_its_folds(table):
    paper = table.simulated("physics-paper")
    observed = table.observed_wh[table.last_rows]
    simulated = paper[table.last_rows]
    share = np.array([0.5, 0.5, 0.5, 0.5, 0.5, 2.0, 2.0, 2.0, 2.0])  # of the simulation's error
    energy = paper.copy()
    for i in range(len(table)):
        own = table.rows_of(np.array([i]))
        energy[own] += (1.0 - share[i]) * (observed[i] - simulated[i])
    results = [
        FoldResult("gamm-ar1", split, energy[table.last_rows[split.test]], 1.0 + i, 10.0 * i)
        for i, split in enumerate(hold_out(table).splits)
    ]
    spec = SimpleNamespace(name="gamm", title="the GAMM", simulation="physics-paper")
    main = Comparison(hold_out(table), (spec,))
    (varied,) = study_comparisons(main.hold_out, ["gamm"], 0)
    varied = dataclasses.replace(varied, results=tuple(results))
    score = studies(main, [varied], 0)["models"]["gamm-ar1"]
    ape = np.abs(observed - simulated) * share / observed
    assert score["mape"] == pytest.approx(ape.mean())
    assert score["max_ape"] == pytest.approx(ape.max())
    assert score["improved_share"] == pytest.approx(5 / 9)
    assert (score["fit_s"], score["predict_ms"]) == (5.0, 40.0)
    assert score["simulation"] == "physics-paper"


# -- choices inside the fold -----------------------------------------------------------------------------------


def result(model, fold, inner, energy=1.0, fit_s=1.0):
    split = Split(fold, np.empty(0, np.int64), np.array([fold]))
    return FoldResult(model, split, np.array([energy]), fit_s, 3.0, inner)


def test_each_fold_takes_the_candidate_with_the_least_inner_error():
    first = {0: result("a", 0, 2.0, 10.0), 1: result("a", 1, 1.0, 11.0), 2: result("a", 2, np.nan, 12.0)}
    second = {
        0: result("b", 0, 1.0, 20.0, 4.0),
        1: result("b", 1, 3.0, 21.0, 4.0),
        2: result("b", 2, np.nan, 22.0),
    }
    found, count = chosen_folds("c", [first, second])
    assert [float(found[i].predicted_wh[0]) for i in range(3)] == [20.0, 11.0, 12.0]
    assert count == {"a": 2, "b": 1}
    assert {r.model for r in found.values()} == {"c"}
    assert found[0].fit_s == 5.0  # both are fitted for the choice
    assert set(CHOICES) == {"gamm-chosen", "boosting-chosen"}


def test_the_inner_error_of_a_fold_has_not_seen_it(table):
    corrector = Table2Corrector(every_rows=24, errors="normal", terms=("s(time_s, k=4)", "s(speed_m_s, k=4)"))
    X, groups = table.covariates, table.groups
    y = table.observed_wh - table.simulated("physics-paper")
    before = corrector.inner_errors(X, y, groups, groups, 0)
    changed = np.where(groups == 4, 5.0 * y + 100.0, y)
    after = corrector.inner_errors(X, changed, groups, groups, 0)
    assert before.shape == (9,)
    assert after[4] == before[4]
    assert (after != before).sum() >= 7  # all but its own block
    few = groups < 2
    assert np.isnan(corrector.inner_errors(X[few], y[few], groups[few], groups[few], 0)).all()


def test_inner_errors_are_mean_errors_at_the_end_of_the_other_trips(table):
    corrector = Table2Corrector(every_rows=24, errors="normal", terms=("s(speed_m_s, k=4)",))
    X, groups = table.covariates, table.groups
    level = np.repeat(np.arange(9.0) * 10.0, np.diff(table.offsets))
    found = corrector.inner_errors(X, level, groups, groups, 7)
    block = np.random.default_rng([7, 5]).permutation(np.arange(9) % 5)
    expected = np.zeros(9)
    for own in range(5):
        errors = []
        for other in set(range(5)) - {own}:
            kept = ~np.isin(block[groups], [own, other])
            fitted = dataclasses.replace(corrector).fit(X[kept], level[kept], groups[kept])
            ends = table.last_rows[block == other]
            errors += np.abs(level[ends] - fitted.predict(X.iloc[ends])).tolist()
        expected[block == own] = np.mean(errors)
    np.testing.assert_allclose(found, expected)


def test_errors_of_the_gamm_are_those_asked_for(table):
    X, groups = table.covariates, table.groups
    y = table.observed_wh - table.simulated("physics-paper")
    terms = ("s(time_s, k=4)", "s(speed_m_s, k=4)")
    engines = {}
    for errors in ("t", "normal", "ar1"):
        engines[errors] = Table2Corrector(every_rows=12, errors=errors, terms=terms).fit(X, y, groups).model_
    assert [math.isnan(engines[e].nu_) for e in ("t", "normal", "ar1")] == [False, True, True]
    assert engines["normal"].ar1_rho is None
    assert engines["ar1"].ar1_rho == "estimate"
    assert engines["ar1"].reml_ < engines["normal"].reml_
    made = correctors.gamm(errors="ar1")
    assert (made.corrector.errors, made.simulation, made.shares_folds) == ("ar1", "physics-paper", True)
    assert correctors.forest(simulation="other").simulation == "other"
    assert correctors.boosting(correlation="ar1").corrector.correlation == "ar1"


def test_folds_of_the_gamm_are_fits_without_the_trip(table):
    X, groups = table.covariates, table.groups
    y = table.observed_wh - table.simulated("physics-paper")
    corrector = Table2Corrector(every_rows=24, errors="normal", terms=("weather", "s(time_s, k=4, bs='ps')"))
    together = corrector.leave_groups_out(X, y, groups)
    assert together.shape == y.shape
    kept = groups != 3
    alone = dataclasses.replace(corrector).fit(X[kept], y[kept], groups[kept]).predict(X[~kept])
    # the knots of the former also span the trip's own covariates
    assert np.abs(together[~kept] - alone).max() < 0.02 * np.ptp(y)
    pairs = groups // 2
    of_pairs = corrector.leave_groups_out(X, y, groups, pairs)
    changed = np.where(pairs == 1, -y, y)
    np.testing.assert_array_equal(
        corrector.leave_groups_out(X, changed, groups, pairs)[pairs == 1], of_pairs[pairs == 1]
    )
    unknown = X.assign(season=pd.Categorical(["unknown"] * len(X)))
    corrector.medians_ = X.select_dtypes("number").median()
    assert set(corrector.frame(unknown)["season"]) == {"summer"}
    assert list(corrector.frame(X)["season"].cat.categories) == ["summer", "winter"]


# -- trips needed ------------------------------------------------------------------------------------------------


def test_the_crossing_lies_on_a_line_in_the_logarithm_of_the_trips():
    sizes = np.array([2, 8, 32])
    means = np.array([[0.4, 0.3, 0.1], [0.9, 0.5, 0.2]])
    assert crossing(sizes, means) == pytest.approx(16.0)  # half way from 0.3 to 0.1 in the logarithm
    assert crossing(sizes, means + np.array([[0.0], [0.1]])) == pytest.approx(8.0)
    assert crossing(sizes, means + np.array([[0.0], [0.3]])) == 2.0  # below from the start
    assert crossing(sizes, means - np.array([[0.0], [0.15]])) == np.inf


def curve_results(hybrid, alone):
    """Errors by (size, draw) of four trips of 1 Wh, of which the first is always in the training set."""
    table = SimpleNamespace(observed_wh=np.ones(4), last_rows=np.arange(4), offsets=np.arange(5))
    sizes = [(size, draw) for size in (2, 8) for draw in range(2)]
    splits = [Split(k, np.arange(size), np.arange(1, 4), draw) for k, (size, draw) in enumerate(sizes)]
    results = [
        FoldResult(name, split, 1.0 + np.array(errors[len(split.train)][split.draw]), 1.0, 0.0)
        for name, errors in (("boosting", hybrid), ("boosting-only", alone))
        for split in splits
    ]

    class Table(SimpleNamespace):
        def __len__(self):
            return 4

    hold = HoldOut("random_draws", "reference", Table(**vars(table)), None, tuple(splits))
    return Comparison(hold, CURVE, tuple(results))


def test_the_learning_curve_is_the_mean_over_draws_and_trips():
    hybrid = {2: [[0.6, 0.6, 0.6], [0.2, 0.2, 0.2]], 8: [[0.1, 0.1, 0.1], [0.3, 0.3, 0.3]]}
    alone = {2: [[0.9, 0.9, 0.9], [0.9, 0.9, 0.9]], 8: [[0.2, 0.3, 0.4], [0.3, 0.3, 0.3]]}
    found = trips_needed(curve_results(hybrid, alone), 0)
    assert [row["n_trips"] for row in found["curve"]] == [2, 8]
    assert [row["boosting"] for row in found["curve"]] == pytest.approx([0.4, 0.2])
    assert [row["boosting-only"] for row in found["curve"]] == pytest.approx([0.9, 0.3])
    assert found["crossing"] == pytest.approx(
        4.0
    )  # 0.3 is half way from 0.4 to 0.2, and 4 half way from 2 to 8
    low, high = found["crossing_ci95"]
    assert low <= found["crossing"]
    assert high is None or high >= found["crossing"]
    assert found == trips_needed(curve_results(hybrid, alone), 0)
    never = {size: [[0.99] * 3] * 2 for size in (2, 8)}
    nothing = trips_needed(curve_results(never, alone), 0)
    assert nothing["crossing"] is None
    assert nothing["crossing_ci95"] == [None, None]


def test_a_draw_is_scored_on_the_trips_that_it_does_not_train_on(table):
    _, draws = study_comparisons(hold_out(table), ["boosting", "boosting-only"], 0)
    (task,) = draws.specs[0].tasks(0, draws.hold_out, draws.hold_out.splits[:1], 0)
    (found,) = task.run()
    assert found.model == "boosting"
    assert len(found.split.test) == 6
    order = np.random.default_rng((0, 0)).permutation(9)
    assert set(found.split.test) == set(order[3:].tolist())
    train = table.take(np.sort(order[:3]))
    test = table.take(found.split.test)
    energy = correctors.boosting(0).fit(train).predict(test)[test.last_rows]
    assert found.predicted_wh == pytest.approx(energy)
