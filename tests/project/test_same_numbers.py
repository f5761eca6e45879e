"""The comparison of two states' numbers."""

from pathlib import Path

from tools.quality.same_numbers import compared, renamed, results


def test_numbers_agree_to_a_billionth_and_times_are_left_aside() -> None:
    old = {"a": [1.0, {"b": 2}], "fit_s": 1.0, "text": "x", "flag": True}
    new = {"a": [1.0 + 1e-10, {"b": 2}], "fit_s": 9.0, "text": "y", "flag": False}
    assert compared(old, new) == (2, compared(old, new).largest, [], [])
    assert compared({"a": float("nan")}, {"a": float("nan")}).wrong == []
    assert compared({"a": 1.0}, {"a": 1.0 + 1e-8}).wrong == ["/a: 1.0 and 1.00000001"]


def test_a_renamed_place_is_compared_a_new_one_listed_and_a_missing_one_wrong() -> None:
    table = ((r"/hvac(\w*)$", r"/climate\1"), (r"^/old/", "/new/"))
    assert renamed("/old/hvac_wh", table) == "/new/climate_wh"
    found = compared({"old": {"hvac_wh": 1.0, "gone": 2.0}}, {"new": {"climate_wh": 3.0, "more": 1.0}}, table)
    assert found.wrong == ["/new/climate_wh: 1.0 and 3.0", "missing: /new/gone"]
    assert (found.compared, found.new) == (1, ["/new/more"])


def test_a_checkout_stands_for_its_published_files(tmp_path: Path) -> None:
    folder = tmp_path / "docs" / "results"
    folder.mkdir(parents=True)
    for name in ("paper", "stamps"):
        (folder / f"{name}.json").write_text('{"a": 1}', "utf-8")
    assert results(tmp_path) == {"paper.json": {"a": 1}}
    assert results(folder / "paper.json") == {"": {"a": 1}}
