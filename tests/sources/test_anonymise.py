"""Logs to hand on: planted secrets are gone, and they are read like the originals."""

from __future__ import annotations

from pathlib import Path

import pytest
from tools.data.dirty_logs import write_dirty_folder

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.sources.anonymise import anonymise_logs
from tripwatt.vehicles import load_vehicle

SECRETS = (
    "WBY1Z21000V307905", "Erika Mustermann", "48.137154", "11.575382", "Hauptstrasse 7", "2019-06-18", "18.06.2019", "Erikas Leaf",
    "+49 151 2345678", "erika@example.org",
)  # fmt: skip


def planted(folder: Path) -> None:
    folder.mkdir()
    rows = [
        f"2019-06-18 08:{k // 60:02d}:{k % 60:02d},{36 + k % 7},380.5,{12 + k % 9},WBY1Z21000V307905,48.137154,11.575382,"
        f'"Hauptstrasse 7","Erika Mustermann",{31234 + k / 1000:.3f},erika@example.org'
        for k in range(400)
    ]
    rows[30] = rows[30].replace("36", "Erika Mustermann", 1).replace("380.5", "+49 151 2345678")
    rows[40] += ",Erika Mustermann"
    rows[50] = "Erikas Leaf,48.137154"
    head = "Erikas Leaf\nTime,Speed (km/h),Pack V (V),Pack A (A),VIN,Latitude,Longitude,Address,Driver,Odometer (km),Erikas Leaf\n"
    (folder / "Erika Mustermann 18.06.2019.csv").write_text(head + "\n".join(rows) + "\n")


@pytest.mark.parametrize("positions", [False, True])
def test_no_planted_secret_is_left(tmp_path: Path, positions: bool) -> None:
    planted(tmp_path / "logs")
    written = anonymise_logs(tmp_path / "logs", tmp_path / "shared", positions=positions)
    content = "".join(f"{file.name}\n{file.read_text()}" for file in written)
    kept = ("48.137154", "11.575382") if positions else ()
    assert [secret for secret in SECRETS if secret in content] == list(kept)
    assert "380.5" in content
    assert "31234" not in content


def read(folder: Path) -> tuple[list[float], list[tuple[str, str, int]]]:
    judged = tw.audit(tw.read_logs(folder, "table", vehicle=load_vehicle("nissan_leaf_40")))
    energies = sorted(round(trip.observed_energy_wh or 0.0, 6) for trip in judged.trips)
    return energies, sorted((consequence, group.what, group.count) for consequence, group in judged.groups())


@pytest.mark.parametrize("logger", ["plain", "ovms"])
def test_the_audit_reads_them_alike(tmp_path: Path, logger: str) -> None:
    folder, shared = tmp_path / "logs", tmp_path / "shared"
    write_dirty_folder(folder, logger, 2)
    anonymise_logs(folder, shared)
    assert read(shared) == read(folder)


def test_a_folder_in_use_is_not_touched(tmp_path: Path) -> None:
    planted(tmp_path / "logs")
    with pytest.raises(InvalidInput, match="folder in use"):
        anonymise_logs(tmp_path / "logs", tmp_path / "logs")
