"""Versions of a fleet's model."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from tests.support.refusals import refuses

from tripwatt.fleet.registry import (
    Comparison,
    FollowedModel,
    Registry,
    compare,
    predict_sample,
    without_sampled,
)

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def test_versions_are_added_promoted_forth_and_back(fleet, tmp_path):
    *_, model, _ = fleet
    registry = Registry(tmp_path / "reg")
    assert registry.versions() == ()
    assert registry.history() == []
    refuses("no version in use", registry.current)
    assert [registry.add(model, "é"), registry.add(model), registry.add(model)] == ["0001", "0002", "0003"]
    refuses("no version in use", registry.load)
    for version in ("0001", "0002", "0001"):
        registry.promote(version)
        assert registry.current() == version
    assert [(h["action"], h["version"]) for h in registry.history()] == [
        *(("add", v) for v in ("0001", "0002", "0003")),
        *(("promote", v) for v in ("0001", "0002", "0001")),
    ]
    assert registry.history()[0]["note"] == "é"
    with (registry.folder / "history.jsonl").open("a") as file:
        file.write('{"action": "pro')
    assert len(registry.history()) == 6
    refuses("unknown version", registry.promote, "0009")
    part = registry.path("0002") / "fleet.npz"
    part.write_bytes(part.read_bytes()[:-1])
    refuses(r"fleet\.npz", registry.promote, "0002")
    assert registry.current() == "0001"
    (tmp_path / "file").write_text("")
    refuses("registry cannot be written", Registry(tmp_path / "file").add, model)


def test_a_worse_challenger_is_refused():
    worse = Comparison(10, 5, 0.05, 0.07, 0.02, 0.01, 0.03)
    assert worse.worse
    assert replace(worse, low=0.00251).worse
    assert not replace(worse, low=0.00249).worse
    assert not replace(worse, low=-0.01).worse
    assert str(worse) == (
        "mean error 7.00 % against 5.00 % on 10 trips of 5 vehicles; "
        "the difference is +2.00 % (95 % interval +1.00 % to +3.00 %); "
        "the new model is refused if all of the interval is above +0.25 %, which holds"
    )
    trifle = Comparison(400, 200, 0.0205, 0.0206, 0.0001, 0.00005, 0.00015)
    assert not trifle.worse
    assert str(trifle).endswith("is refused if all of the interval is above +0.10 %, which does not hold")


def test_promote_refuses_what_is_worse(fleet, tmp_path):
    *_, model, _ = fleet
    registry = Registry(tmp_path)
    registry.add(model)
    refuses("challenger is worse", registry.promote, "0001", Comparison(10, 5, 0.05, 0.07, 0.02, 0.01, 0.03))
    assert registry.history()[-1]["action"] == "add"
    registry.promote("0001", Comparison(10, 5, 0.05, 0.04, -0.01, -0.02, 0.0))
    assert registry.history()[-1]["comparison"]["difference"] == -0.01


def test_models_are_compared_on_trips_that_neither_has_seen(fleet, sample):
    *_, model, _ = fleet
    left = without_sampled(model, sample)
    assert left.trips == model.trips - len(sample)
    assert without_sampled(left, replace(sample, digests=("x",) * len(sample))) is left
    own = predict_sample(model, sample)
    observed = sample.table.totals_wh(sample.table.observed_power_w)
    assert np.mean(np.abs(own - observed)) < np.mean(np.abs(predict_sample(left, sample) - observed))
    group = sample.groups[0]
    table = sample.table.take([0])
    corrector = model.of_vehicle(group[1], driver=group[2]).corrector_
    assert own[0] == pytest.approx(table.totals_wh(table.simulated_w + corrector.predict(table))[0])
    same = compare(model, model, sample)
    assert (same.difference, same.low, same.high) == (0.0, 0.0, 0.0)
    assert (same.trips, same.vehicles) == (len(sample), len({group[1] for group in sample.groups}))
    moved = replace(
        model, posterior=replace(model.posterior, mean=model.posterior.mean + 5.0), digests=frozenset()
    )
    against = compare(replace(model, digests=frozenset()), moved, sample)
    assert against.worse
    assert against.difference == pytest.approx(against.challenger - against.champion)
    assert against.low <= against.difference <= against.high
    back = compare(moved, replace(model, digests=frozenset()), sample)
    assert back.difference == pytest.approx(-against.difference)
    assert not back.worse


def test_a_follower_changes_versions_without_losing_a_request(fleet, tmp_path):
    *_, model, _ = fleet
    registry = Registry(tmp_path)
    other = replace(model, about={"other": True})
    registry.add(model)
    registry.add(other)
    registry.promote("0001")
    followed = FollowedModel(registry)
    assert followed.version == "0001"
    failed, seen, stop = [], set(), threading.Event()

    def ask():
        while not stop.is_set():
            try:
                seen.add("other" in followed.get().about)
            except Exception as error:
                failed.append(error)
            time.sleep(0.001)

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for _ in range(3):
        registry.promote("0002")
        registry.promote("0001")
    registry.promote("0002")
    deadline = time.monotonic() + 30.0
    while followed.version != "0002" and time.monotonic() < deadline:
        time.sleep(0.01)
    stop.set()
    for thread in threads:
        thread.join()
    assert failed == []
    assert seen == {True, False}
    assert "other" in followed.get().about  # a thread may have been reading the version before
    assert followed.version == "0002"
    (registry.path("0001") / "metadata.json").write_text("{}")
    registry._move_pointer("0001")
    assert "other" in followed.get().about  # a damaged version is not taken
    (tmp_path / "current").unlink()
    assert "other" in followed.get().about


def test_a_caller_that_read_the_pointer_long_ago_does_not_turn_it_back(fleet, tmp_path, monkeypatch):
    *_, model, _ = fleet
    registry = Registry(tmp_path)
    for version in ("0001", "0002"):
        registry.add(model)
        registry.promote(version)
    followed = FollowedModel(registry)
    answers = ["0001", "0002"]  # what the caller read before it waited, and what is there now
    monkeypatch.setattr(Registry, "current", lambda self: answers.pop(0))
    followed.get()
    assert (followed.version, answers) == ("0002", [])
