"""Jobs of cars that learn, without HTTP."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")

from tripwatt.service.car_jobs import CarJobs, uploaded
from tripwatt.service.car_schemas import plain
from tripwatt.service.problems import Problem


def test_without_a_folder_there_are_no_cars() -> None:
    jobs = CarJobs()
    assert jobs.names() == []
    assert jobs.model("any") is None
    assert jobs.list() == {"cars": None}
    with pytest.raises(Problem) as caught:
        jobs.show("any")
    assert caught.value.kind == "no-live"


def test_an_upload_is_named_by_letters_and_digits(tmp_path: Path) -> None:
    (tmp_path / "uploads" / "good0001" / "tables").mkdir(parents=True)
    assert uploaded(tmp_path, "good0001").name == "tables"
    for name in ("..", "", "missing1", "../uploads/good0001"):
        with pytest.raises(Problem):
            uploaded(tmp_path, name)


def test_what_is_not_finite_is_null() -> None:
    given = [1.5, -2.0, 0.0, math.nan, math.inf, -math.inf, 3, "a", None]
    assert [plain(value) for value in given] == [1.5, -2.0, 0.0, None, None, None, 3, "a", None]
