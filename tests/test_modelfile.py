"""A model directory: what was written comes back, and nothing that is damaged, altered or foreign does."""

import io
import json
import os
import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.refusals import refuses

from tripwatt import modelfile
from tripwatt.errors import InvalidInput
from tripwatt.modelfile import METADATA, read_metadata, read_model, write_model

PARTS = {
    "a.npz": {"x": np.array([0.1, -0.0, np.nan, 1e-310]), "names": np.array(["ab", "ü"])},
    "b.json": {"y": [0.1, 2.0**-1074], "text": "°C"},
}


def write(folder: Path) -> Path:
    write_model(folder, {"about": {"n": 2}}, PARTS)
    return folder


@pytest.fixture
def model(tmp_path: Path) -> Path:
    return write(tmp_path / "model")


def test_what_was_written_comes_back_to_the_last_bit(model: Path) -> None:
    found = read_model(model)
    assert found.metadata["about"] == {"n": 2}
    assert found.parts["b.json"] == PARTS["b.json"]
    for name, values in PARTS["a.npz"].items():
        assert found.parts["a.npz"][name].tobytes() == values.tobytes()


def test_equal_content_gives_equal_bytes(model: Path, tmp_path: Path) -> None:
    again = write(tmp_path / "again")
    for file in model.iterdir():
        assert file.read_bytes() == (again / file.name).read_bytes()


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_any_flipped_bit_is_refused(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    folder = tmp_path_factory.mktemp("flipped") / "model"
    write(folder)
    file = data.draw(st.sampled_from(sorted(folder.iterdir())))
    raw = bytearray(file.read_bytes())
    raw[data.draw(st.integers(0, len(raw) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    file.write_bytes(raw)
    with pytest.raises(InvalidInput) as caught:
        read_model(folder)
    assert file.name in str(caught.value)


@pytest.mark.parametrize("change", [lambda raw: raw[:-1], lambda raw: raw + b"\n", lambda raw: b""])
@pytest.mark.parametrize("name", ["a.npz", "b.json", METADATA])
def test_a_part_that_is_cut_or_longer_is_refused(model: Path, name: str, change) -> None:
    (model / name).write_bytes(change((model / name).read_bytes()))
    with pytest.raises(InvalidInput, match=name):
        read_model(model)


def test_all_missing_parts_are_named(model: Path) -> None:
    (model / "a.npz").unlink()
    (model / "b.json").unlink()
    with pytest.raises(InvalidInput) as caught:
        read_model(model)
    assert len(caught.value.faults) == 2
    assert "a.npz" in str(caught.value)


def test_a_newer_format_is_refused_with_what_is_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(modelfile, "FORMAT_VERSION", 7)
    write(tmp_path / "newer")
    monkeypatch.undo()
    refuses(r"format_version: got 7; allowed: 3; update tripwatt", read_model, tmp_path / "newer")


def test_an_older_format_is_refused_with_what_to_do(tmp_path: Path) -> None:
    """Its metadata are read: the folder of a car tells by them that its model is older."""
    place = tmp_path / "older"
    write_model(place, {"about": "x", "format_version": 1}, PARTS)
    with pytest.raises(InvalidInput) as caught:
        read_model(place)
    assert str(caught.value) == (
        f"model of an older format: {place / METADATA}, format_version: got 1; allowed: 3; "
        "fit it again with this version of tripwatt, or adapt its base again"
    )
    assert read_metadata(place)["format_version"] == 1


def test_pickles_are_neither_written_nor_read(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    refuses("not a plain array", write_model, model, {}, {"a.npz": {"x": np.array([object()])}})
    assert read_model(model).parts.keys() == PARTS.keys()

    class Trap:
        def __reduce__(self):
            return os.abort, ()

    buffer = io.BytesIO()
    np.savez(buffer, x=np.array([0.0]))
    trap = buffer.getvalue().replace(b"\x93NUMPY", b"\x93NUMPX")
    for raw in (trap, pickle.dumps(Trap()), b"PK\x03\x04 no archive"):
        monkeypatch.setattr(modelfile, "_encode", lambda name, part, raw=raw: raw)
        write_model(model, {}, {"a.npz": {}})
        with pytest.raises(InvalidInput, match="damaged"):
            read_model(model).parts["a.npz"]


def test_parts_cannot_point_out_of_the_folder(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    refuses("invalid name", write_model, model, {}, {"../a.npz": {}})
    (model.parent / "secret.json").write_text("{}")
    digest = "0" * 64
    text = (model / METADATA).read_text().replace('"b.json"', '"../secret.json"')
    old = json.loads(text)["sha256"]
    blank = text.replace(old, digest)
    (model / METADATA).write_text(blank.replace(digest, modelfile.hashlib.sha256(blank.encode()).hexdigest()))
    refuses("missing", read_model, model)


def test_written_whole_or_not_at_all(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = {f.name: f.read_bytes() for f in model.iterdir()}
    written = []

    def full(self: Path, raw: bytes) -> int:
        if written:
            raise OSError(28, "No space left on device")
        written.append(self)
        return len(raw)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        refuses("No space left", write_model, model, {"about": "other"}, PARTS)
    assert {f.name: f.read_bytes() for f in model.iterdir()} == before
    assert [p.name for p in model.parent.iterdir()] == ["model"]
    write_model(model, {"about": "other"}, {})
    assert sorted(f.name for f in model.iterdir()) == [METADATA]


def test_a_folder_with_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "letters").mkdir()
    (tmp_path / "letters" / "home.txt").write_text("dear")
    (tmp_path / "file").write_text("x")
    for place in ("letters", "file"):
        with pytest.raises(InvalidInput):
            write(tmp_path / place)
    assert (tmp_path / "letters" / "home.txt").read_text() == "dear"


@pytest.mark.parametrize("text", ["{}", "[]", "nothing", '{"format": "other"}'])
def test_what_is_no_model_is_said_so(tmp_path: Path, text: str) -> None:
    (tmp_path / METADATA).write_text(text)
    with pytest.raises(InvalidInput, match=METADATA):
        read_model(tmp_path)
