"""Evaluations with trips, cars, models and splits of one's own."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import LogisticRegression, Ridge
from sklearn.model_selection import GroupKFold, KFold, LeaveOneOut, ShuffleSplit, StratifiedKFold

import tripwatt as tw
from tripwatt.study.evaluation import Execution
from tripwatt.study.evaluation.metrics import paired_difference
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Plan

HERE = Execution(n_jobs=1)
ONE = "leave_one_trip_out:audited"


@pytest.fixture(scope="module")
def fleet():
    return synthetic_fleet(9)


@pytest.fixture(scope="module")
def run(fleet):
    return tw.evaluate(fleet, models=["constant", "linear4", "physics"], execution=HERE)


class PerKilometre:
    """The mean consumption; keeps what it was given."""

    def __init__(self, given):
        self.given = given

    def __deepcopy__(self, memo):
        return type(self)(self.given)

    def fit(self, trips):
        self.ids = [trip.trip_id for trip in trips]
        energy_wh = sum(trip.observed_energy_wh for trip in trips)
        self.wh_m = energy_wh / sum(Plan.from_trip(trip).distance_m for trip in trips)

    def predict(self, trip):
        self.given.append((trip, self.ids))
        return self.wh_m * trip.distance_m


class Never(PerKilometre):
    def predict(self, trip):
        raise ZeroDivisionError("no trip has a price")


class Unclear:
    def fit(self, data):
        return self

    predict = fit


class MeanPower:
    def fit(self, table):
        self.mean_w = float(np.average(table.residual_w, weights=table.hours))

    def predict(self, table):
        return np.full(len(table.hours), self.mean_w)


@pytest.mark.parametrize("protocol", ["paper", "forecast"])
def test_a_whole_model_gets_plans_of_trips_that_it_was_not_fitted_on(fleet, protocol):
    given = []
    run = tw.evaluate(fleet, protocol=protocol, models=[PerKilometre(given)], hold_outs=ONE, execution=HERE)
    assert len(given) == 9
    for plan, fitted_on in given:
        assert isinstance(plan, Plan)
        assert plan.trip_id not in fitted_on
        assert len(fitted_on) == 8
    rows = run.folds.set_index("trip")
    trips = {trip.trip_id: trip for trip in fleet.trips}
    for name, row in rows.iterrows():
        others = [trip for key, trip in trips.items() if key != name]
        wh_m = sum(t.observed_energy_wh for t in others) / sum(Plan.from_trip(t).distance_m for t in others)
        assert row["predicted_energy_wh"] == pytest.approx(wh_m * Plan.from_trip(trips[name]).distance_m)
    assert rows["simulated_energy_wh"].tolist() == [0.0] * 9


def test_an_evaluation_without_a_prediction_raises_the_reason(fleet):
    with pytest.raises(tw.InvalidInput, match=r"no trip was scored.*ZeroDivisionError: no trip has a price"):
        tw.evaluate(fleet, models=["constant", Never([])], hold_outs=ONE, execution=HERE)


def test_a_regressor_corrects_the_simulation_of_the_paper(fleet):
    run = tw.evaluate(fleet, models=["physics-paper", Ridge(1e12)], hold_outs=ONE, execution=HERE)
    ape = run.folds.pivot_table(index="trip", columns="model", values="correction_wh")
    assert ape["physics-paper"].abs().max() == 0.0
    # so much shrinkage leaves the mean residual of the other trips
    assert ape["Ridge"].std() < 0.1 * ape["Ridge"].abs().mean()


def test_a_corrector_on_segments_is_a_forecast_with_intervals_and_updates():
    run = tw.evaluate(
        synthetic_fleet(16),
        protocol="forecast",
        models={"mean": MeanPower()},
        hold_outs=[KFold(2)],
        execution=HERE,
    )
    scores = run.results["evaluations"][0]["models"]["mean"]
    assert 0.0 < scores["mape"] < 0.5
    assert {"coverage", "update"} <= scores.keys()


def test_trips_a_car_and_a_splitter(fleet, run):
    car = tw.load_vehicle("bmw_i3_60ah")
    own = tw.evaluate(
        fleet.trips, models=["linear4", "physics"], car=car, hold_outs=LeaveOneOut(), execution=HERE
    )
    ours = run.folds[(run.folds["scheme"] == "leave_one_trip_out") & (run.folds["trips"] == "audited")]
    theirs = own.folds
    assert set(theirs["scheme"]) == {"LeaveOneOut"}
    for model in ("linear4", "physics"):
        one, two = (f[f["model"] == model]["predicted_energy_wh"].to_numpy() for f in (ours, theirs))
        assert one == pytest.approx(two)
    heavy = tw.load_vehicle("bmw_i3_60ah", overrides={"mass": 2000.0})
    given = tw.evaluate(fleet, models=["physics"], car=heavy, hold_outs=[GroupKFold(3), ONE], execution=HERE)
    assert list(dict.fromkeys(given.folds["scheme"])) == ["GroupKFold", "leave_one_trip_out"]
    assert (
        given.folds["predicted_energy_wh"].iloc[9:].to_numpy()
        > theirs[theirs["model"] == "physics"]["predicted_energy_wh"].to_numpy()
    ).all()


def test_days_are_the_groups_of_a_splitter(fleet):
    seen = []

    class Days:
        def split(self, X, y=None, groups=None):
            seen.extend([[trip.context.day for trip in X], list(groups), list(y)])
            return [(groups != groups[0], groups == groups[0])]

    run = tw.evaluate(fleet, models=["constant"], hold_outs=Days(), execution=HERE)
    days, groups, energies = seen
    assert len({*zip(days, groups, strict=True)}) == len({*days}) == len({*groups})
    assert energies == pytest.approx([trip.observed_energy_wh for trip in fleet.trips], rel=1e-3)
    assert run.results["evaluations"][0]["n_trips"] == groups.count(groups[0])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (
            {"hold_outs": "leave_one_out"},
            "unknown hold-out: hold_outs: got 'leave_one_out'; allowed: leave_one_trip_out",
        ),
        ({"hold_outs": 3}, "unknown hold-out: hold_outs: got 3; allowed: names of hold-outs, or splitters"),
        ({"hold_outs": []}, "unknown hold-out: hold_outs: got an empty list"),
        ({"hold_outs": StratifiedKFold(3)}, "trips cannot be split: StratifiedKFold: got .*continuous"),
        ({"models": [Ridge]}, "class in place of an object: models: got Ridge"),
        ({"models": [abs]}, "object cannot be fitted: models"),
        ({"models": ["forrest"]}, "unknown model: models: got 'forrest'; allowed: constant"),
        ({"models": {"forest": Ridge()}}, "name is taken: models: got forest"),
        (
            {"models": [LogisticRegression()]},
            "object cannot be fitted: models: got the classifier LogisticRegression",
        ),
        ({"hold_outs": KFold}, "unknown hold-out: hold_outs: got <class .*objects, not classes"),
        (
            {"models": [MeanPower()]},
            "model not available: models: got MeanPower on segments; allowed: a regressor",
        ),
        ({"models": [Unclear()]}, r"unknown kind of model: models: got fit\(data\) of Unclear"),
        ({"trips": [1, 2]}, "unknown type: trips: got 1; allowed: trips, logs"),
    ],
)
def test_what_cannot_be_evaluated_is_refused(fleet, wrong, message):
    given = {"trips": fleet, "models": ["constant"], "execution": HERE} | wrong
    with pytest.raises(tw.InvalidInput, match=message):
        tw.evaluate(given.pop("trips"), **given)


def test_tables_of_a_run(run):
    frame = run.to_frame()
    assert frame.columns[:7].tolist() == [
        "scheme",
        "trips",
        "model",
        "n_trips",
        "mape",
        "mape_low",
        "mape_high",
    ]
    for row in frame.itertuples():
        own = run.folds.query("scheme == @row.scheme and trips == @row.trips and model == @row.model")["ape"]
        assert row.mape == pytest.approx(own.mean())
        assert row.max_ape == own.max()
        assert row.mape_low < row.mape < row.mape_high
    label = "leave_one_day_out:audited"
    days = run.folds.query("scheme == 'leave_one_day_out'").pivot_table(
        index="trip", columns="model", values="ape", sort=False
    )
    of_day = [run.results["days"][trip] for trip in days.index]
    assert run.compare("physics", "constant", hold_out=label) == paired_difference(
        days["physics"].to_numpy(), days["constant"].to_numpy(), 0, of_day
    )
    with pytest.raises(
        tw.InvalidInput, match="unknown model: compare: got 'x'; allowed: constant, linear4, physics"
    ):
        run.compare("x", "physics")
    with pytest.raises(
        tw.InvalidInput, match="unknown hold-out: hold_out: got 'y'; allowed: leave_one_trip_out:audited"
    ):
        run.compare("physics", "constant", hold_out="y")
    html = run._repr_html_()
    assert html.count("<tr>") == len(frame)
    assert "physics, leave_one_day_out of audited trips" in html


def test_a_figure_of_a_run(run):
    figure = run.plot()
    (axes,) = figure.axes
    means = (
        run.folds[run.folds["scheme"] == "leave_one_trip_out"]
        .query("trips == 'audited'")
        .groupby("model")["ape"]
        .mean()
    )
    assert [t.get_text() for t in axes.get_yticklabels()] == means.sort_values(ascending=False).index.tolist()
    own = Figure().subplots()
    assert run.plot(own) is own.figure
    assert own.get_xlabel() == "absolute percentage error of each trip [%], mean: diamond"
    assert own.get_title() == "leave one trip out:audited, 9 trips"


def test_a_trip_that_is_scored_twice_counts_once(fleet):
    """Repeated splits: the error of a trip is the mean of its errors, and the interval is over trips."""
    splitters = [
        ShuffleSplit(3, test_size=0.4, random_state=0),
        ShuffleSplit(2, test_size=0.4, random_state=1),
    ]
    run = tw.evaluate(fleet, models=["linear4", "physics"], hold_outs=splitters, execution=HERE)
    frame = run.to_frame()
    assert list(dict.fromkeys(frame["scheme"])) == ["ShuffleSplit", "ShuffleSplit-2"]
    for label, splitter in zip(("ShuffleSplit", "ShuffleSplit-2"), splitters, strict=True):
        tests = [test for _, test in splitter.split(fleet.logs)]
        rows = run.folds[(run.folds["scheme"] == label) & (run.folds["model"] == "linear4")]
        assert len(rows) == sum(map(len, tests)) > rows["trip"].nunique()
        own = frame[(frame["scheme"] == label) & (frame["model"] == "linear4")].iloc[0]
        assert own["n_trips"] == rows["trip"].nunique() == len(np.unique(np.concatenate(tests)))
        assert own["mape"] == pytest.approx(rows.groupby("trip")["ape"].mean().mean())
    means = run.folds.groupby(["scheme", "model", "trip"], sort=False)["ape"].mean()["ShuffleSplit-2"]
    pair = run.compare("linear4", "physics", hold_out="ShuffleSplit-2:audited")
    assert pair.diff == pytest.approx((means["linear4"] - means["physics"]).mean())


def test_a_mapping_names_rows_of_the_protocol_too(fleet):
    run = tw.evaluate(fleet, models={"bare": "physics", "mean": "constant"}, hold_outs=ONE, execution=HERE)
    assert run.folds["model"].unique().tolist() == ["mean", "bare"]


def test_finished_folds_of_an_equal_model_from_outside_are_used_again(fleet, tmp_path):
    def folds(model, *, resume):
        counts = []
        tw.evaluate(
            fleet,
            models=[model],
            hold_outs=ONE,
            execution=Execution(1, tmp_path, resume, lambda done, total: counts.append((done, total))),
        )
        return counts[0]

    assert folds(HistGradientBoostingRegressor(max_iter=3), resume=False) == (0, 9)
    assert folds(HistGradientBoostingRegressor(max_iter=3), resume=True) == (9, 9)
    assert folds(HistGradientBoostingRegressor(max_iter=4), resume=True) == (0, 9)


def test_groups_without_dates_are_noted(fleet):
    undated = [replace(trip, context=replace(trip.context, started_at=None)) for trip in fleet.trips]

    def notes(trips, splitter, **more):
        given = {"models": ["constant"], "execution": HERE} | more
        run = tw.evaluate(trips, "bmw_i3_60ah", hold_outs=splitter, **given)
        return [note for note in map(str, run.results["notes"]) if "a group of its own" in note]

    said = "GroupKFold: fewer than three dates of trips are known: each trip is a group of its own"
    assert notes(undated, GroupKFold(9)) == [said]
    assert notes(undated, KFold(3)) == []
    assert notes(fleet.trips, GroupKFold(3)) == []
