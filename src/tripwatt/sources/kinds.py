"""Files of a folder grouped by their columns, each group with its mapping."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from tripwatt.errors import Fault, InvalidInput, or_none, raise_faults
from tripwatt.files import file_head, parse_toml
from tripwatt.physics.battery import open_circuit_voltage, usable_energy_wh
from tripwatt.sources.columnar import PARQUET, open_table, table_files
from tripwatt.sources.delimited import column_key, first_row, open_delimited
from tripwatt.sources.mapping import ENERGY, POWER, ColumnMapping, load_mapping, mapping_from_tables
from tripwatt.sources.naming import vocabulary, words
from tripwatt.sources.raw_files import NEEDED
from tripwatt.sources.suggest import Suggestion, suggest_mapping
from tripwatt.trips import COLUMNS
from tripwatt.vehicles import Vehicle

MEASURED: Final = frozenset((POWER, ENERGY, "current_a", "soc", "displayed_soc"))
"""Columns of which one is needed for the energy."""

HEAD_BYTES: Final = 1 << 16
"""Number of first bytes of a file that are read for its header."""

Changes = Mapping[str, Any]
"""In `changes`, our column -> the `column` and `unit` to use instead of the proposed ones, or None to leave the column out. In
`current_positive`, "discharge" or "charge", or None to keep the proposed one. Both may be left out."""


@dataclass(frozen=True, slots=True)
class Kind:
    """Files with the same columns, and how they are read.

    Attributes
    ----------
    files : mapping of Path to tuple of str
        File -> header to use for a file without one, else empty.
    names : tuple of str
        Columns of the largest file, if possible of one with a header.
    tables : mapping
        The mapping as the tables of its TOML.
    mapping : ColumnMapping or None
        None if the mapping is incomplete; `faults` say what is missing.
    faults : tuple of Fault
    proposal : Suggestion or None
        None if the mapping was given or the columns have canonical names.
    assumed : mapping of str to float
        Battery values of the mapping that were filled in from the car's published values.
    """

    files: Mapping[Path, tuple[str, ...]]
    names: tuple[str, ...]
    tables: Mapping[str, Any] = field(default_factory=dict)
    mapping: ColumnMapping | None = None
    faults: tuple[Fault, ...] = ()
    proposal: Suggestion | None = None
    assumed: Mapping[str, float] = field(default_factory=dict)


def given_kind(path: Path, mapping: Path | str | ColumnMapping) -> Kind:
    """All files of a folder as one kind with a given mapping."""
    checked = mapping if isinstance(mapping, ColumnMapping) else load_mapping(mapping)
    files = table_files(path)
    _, bare, _ = _headers(files)
    return Kind({file: bare.get(file, ()) for file in files}, (), mapping=checked)


def proposed_kinds(
    path: Path,
    vehicle: Vehicle | None = None,
    changes: Mapping[int, Changes] | None = None,
    ignored: Sequence[str] = (),
) -> list[Kind]:
    """The kinds of files in a folder, each with a mapping proposed from its header and values.

    Parameters
    ----------
    path : Path
        A table or a folder of tables.
    vehicle : Vehicle, optional
        The car whose battery gives the energy of a state of charge, or a voltage that is not logged.
    changes : mapping of int to Changes, optional
        Number of the kind -> changes of a user to its proposed mapping.
    ignored : sequence of str
        Names of files that are left out.

    Returns
    -------
    list of Kind
        The kind of the largest file first; each file without columns is a kind of its own.

    Raises
    ------
    InvalidInput
        When there is no table.
    """
    headers, bare, faults = _headers(table_files(path))
    groups: list[tuple[frozenset[str], list[Path]]] = []
    for file in sorted(headers, key=lambda file: -file.stat().st_size):
        keys = frozenset(column_key(name) for name in headers[file])
        for other, files in groups:
            # 0.7: least share of common columns of two files of one kind
            if len(keys & other) >= 0.7 * len(keys | other):
                files.append(file)
                break
        else:
            groups.append((keys, [file]))
    kinds = []
    for number, (_, files) in enumerate(groups):
        kept = [file for file in files if file.name not in ignored]
        kept.sort(key=lambda file: file in bare)  # those with a header of their own first
        kind = Kind({file: bare.get(file, ()) for file in sorted(kept)}, headers[(kept or files)[0]])
        change = (changes or {}).get(number, {})
        kinds.append(_with_mapping(kind, kept, vehicle, change) if kept else kind)
    unread = {file: its_faults for file, its_faults in faults.items() if file.name not in ignored}
    return [*kinds, *(Kind({file: ()}, (), faults=its_faults) for file, its_faults in unread.items())]


def _with_mapping(kind: Kind, files: Sequence[Path], vehicle: Vehicle | None, changes: Changes) -> Kind:
    try:
        canonical = [name for name in kind.names if name in (*COLUMNS, ENERGY)]
        proposal, tables = None, {"columns": {n: {"column": n} for n in canonical}}
        if not set(NEEDED) <= set(canonical):
            proposal = suggest_mapping(files[0], kind.files[files[0]], beside=files[1:])
            tables = parse_toml(proposal.toml, "mapping")
        trip = tables.pop("trip", {})  # files that are read by themselves are of one vehicle
        tables |= {"trip": {"column": trip["column"]}} if "column" in trip else {}
        tables, assumed = _changed(tables, changes, vehicle)
        kind = replace(kind, tables=tables, proposal=proposal, assumed=assumed)
        present = tables["columns"].keys()
        if proposal is not None and not (set(NEEDED) <= present and MEASURED & present):
            raise_faults(proposal.unfit)
        return replace(kind, mapping=mapping_from_tables(tables, "the proposed mapping"))
    except InvalidInput as error:
        return replace(kind, faults=error.faults)


def _changed(
    tables: dict[str, Any], changes: Changes, vehicle: Vehicle | None
) -> tuple[dict[str, Any], dict[str, float]]:
    """A proposed mapping with the changes of a user, and the battery values that are filled in from the car."""
    columns = tables.setdefault("columns", {})
    for ours, choice in changes.get("changes", {}).items():
        before = columns.pop(ours, {})
        if choice is not None:
            unchanged = before if before.get("column") == choice["column"] else {}
            columns[ours] = {**unchanged, **{key: text for key, text in choice.items() if text}}
    if changes.get("current_positive"):
        tables["current"] = {"positive": changes["current_positive"]}
    assumed = {}
    measured = {POWER, "current_a"} & columns.keys()
    if vehicle is not None and measured and "voltage_v" not in columns:
        # 0.5: state of charge at which the open-circuit voltage is taken as the battery's nominal voltage
        assumed["nominal_voltage_v"] = float(open_circuit_voltage(np.array([0.5]), vehicle.battery)[0])
    charge = {"soc", "displayed_soc"} & columns.keys()
    capacity = {}
    if vehicle is not None and charge:
        battery = vehicle.battery
        # percent of the battery management are of the whole battery, those of a display of its usable part
        name = re.sub(r"\W", " ", columns[min(charge, key=len)].get("column", ""))
        if len(charge) == 2 or re.search(vocabulary()["whole"], words(name)):
            battery = replace(battery, displayed_zero_soc=0.0, displayed_full_soc=1.0)
        capacity["usable_capacity_kwh"] = usable_energy_wh(battery) / 1000.0
        assumed |= {} if measured else capacity
    if assumed or capacity:  # the capacity also checks a measured energy
        tables["battery"] = tables.get("battery", {}) | capacity | assumed
    return tables, assumed


def _headers(
    files: Sequence[Path],
) -> tuple[dict[Path, tuple[str, ...]], dict[Path, tuple[str, ...]], dict[Path, tuple[Fault, ...]]]:
    """Return the columns of each file, of these the columns given to files without a header, and the faults of files without columns.

    A file without a header gets the columns of the nearest file before it, in the order of names, that has as many; else of the
    next one.
    """
    headers: dict[Path, tuple[str, ...]] = {}
    bare: dict[Path, tuple[str, ...]] = {}
    faults: dict[Path, tuple[Fault, ...]] = {}
    ordered = sorted(files, key=natural)
    for file in ordered:
        try:
            is_parquet = file.suffix.lower() == PARQUET
            table = open_table(file) if is_parquet else open_delimited(file, file_head(file, HEAD_BYTES))
            headers[file] = tuple(table.names)
        except InvalidInput as error:
            faults[file] = error.faults
    for place, file in enumerate(ordered):
        if file in faults and faults[file][0].what == "no header":
            near = [*reversed(ordered[:place]), *ordered[place + 1 :]]
            candidates = [headers[other] for other in near if other in headers and other not in bare]
            names = next((names for names in candidates if _fits(file, names)), None)
            if names is not None:
                headers[file] = bare[file] = names
                del faults[file]
    return headers, bare, faults


def _fits(file: Path, names: tuple[str, ...]) -> bool:
    """Whether the first row of a file without a header has a cell for each name."""
    head = or_none(open_delimited, file, file_head(file, HEAD_BYTES), names)
    if head is None:
        return False
    cells, named = first_row(head), len([name for name in names if name])
    return len(cells) in (named, len(names)) or (not cells[-1] and len(cells) - 1 in (named, len(names)))


def natural(path: Path) -> list[tuple[int, str]]:
    """Sort key of paths that orders numbers by value: 2 before 10."""
    return [(int(part), "") if part.isdigit() else (0, part) for part in re.split(r"(\d+)", f"{path}")]
