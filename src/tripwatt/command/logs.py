"""Commands on logged trips: audit logs, and handle mappings of their columns."""

from __future__ import annotations

import itertools
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

import tripwatt as tw
from tripwatt import trips
from tripwatt.command import shared
from tripwatt.command.options import Answer, argument, make_group
from tripwatt.command.printing import print_notes, print_reading, print_table, say
from tripwatt.errors import Fault, InvalidInput, counted
from tripwatt.files import csv_text
from tripwatt.trips.messages import flag_to_dict


def audit(logs: shared.Logs) -> Answer:
    """List the faults of logged trips and their consequences.

    No file is changed. Each finding gives the trip, the time span, the fault, and the consequence: trimmed, split, set
    aside or noted.

    For example:

      # list all findings of all trips
      tripwatt audit data/tum
      # list every fault and note one by one
      tripwatt audit data/tum --json
      # audit a log of the app Torque
      tripwatt audit drive.csv --mapping torque
    """
    fleet = logs.read(lenient=True)
    result = tw.audit(fleet)
    document = {
        "read": len(fleet.trips),
        "used": [t.trip_id for t in result.trips],
        "findings": [asdict(finding) for finding in result.findings],
        "notes": [flag_to_dict(flag) for flag in fleet.notes],
        "faults": [fault.texts for fault in (fleet.report.faults if fleet.report else ())],
    }

    def shown() -> None:
        title = f"{counted(len(fleet.trips), 'trip')} read, {len(result.trips)} used ({fleet.name})"
        if result.findings:
            columns = ("trip", "from [s]", "to [s]", "consequence", "finding")
            rows = [
                (f.trip, f"{f.from_s:.1f}", f"{f.to_s:.1f}", f.consequence, f.what) for f in result.findings
            ]
            print_table(title, columns, rows, numbers=columns[1:3], folding=("finding",))
        else:
            say(f"{title}: no findings")
        print_reading(fleet, result)

    return Answer(document, shown)


def list_() -> Answer:
    """List the bundled mappings and the logger of each.

    For example:

      # list the bundled mappings
      tripwatt mapping list
    """
    from tripwatt.sources.mapping import shipped_mappings, shipped_text

    about = {name: _comment(shipped_text(name)) for name in shipped_mappings()}
    title, columns = "Mappings for --mapping NAME", ("name", "about")
    return Answer(
        [{"name": name, "about": text} for name, text in about.items()],
        partial(print_table, title, columns, about.items(), folding=columns[1:]),
    )


def show(name: Annotated[str, argument("NAME", "A name from `tripwatt mapping list`.")]) -> Answer:
    """Print a bundled mapping as TOML.

    For example:

      # save a copy to edit
      tripwatt mapping show torque > my.toml
    """
    from tripwatt.sources.mapping import shipped_mappings, shipped_text

    if name not in shipped_mappings():
        raise InvalidInput(Fault.unknown("unknown mapping", "NAME", name, shipped_mappings()))
    text = shipped_text(name)
    return Answer({"name": name, "toml": text}, partial(typer.echo, text, nl=False))


def suggest(
    file: Annotated[Path, argument("FILE", "A table of trips, or a folder; its largest file counts.")],
    out: shared.TextFile = None,
) -> Answer:
    """Propose a mapping for a table from its header and its values, with a reason for each entry.

    The exit code is 1 if you have to add entries before you can use the mapping.

    For example:

      # print the proposal
      tripwatt mapping suggest drive.csv
      # save it; check every line
      tripwatt mapping suggest drive.csv --out my.toml
      # use the mapping
      tripwatt evaluate logs --mapping my.toml
    """
    from tripwatt.sources.suggest import suggest_mapping

    proposal = suggest_mapping(file)
    if out is not None:
        shared.write_text(proposal.toml, out)

    def shown() -> None:
        say(*(proposal.toml.splitlines() if out is None else [f"{out}: check every line"]))
        print_notes(f"add {what} by hand" for what in proposal.missing)

    return Answer(asdict(proposal), shown, code=bool(proposal.missing))


def apply(
    data: Annotated[Path, argument("DATA", "A table of trips, or a folder of tables.")],
    mapping: shared.Columns = None,
    trip: shared.TripId = None,
    out: shared.OutFile = Path("trip.csv"),
) -> Answer:
    """Audit one trip of a table and write it with canonical columns and units, as input for `tripwatt forecast`.

    The command lists the findings of the audit. The time of the output starts at 0.

    For example:

      # convert your log
      tripwatt mapping apply drive.csv --mapping my.toml --out trip.csv
      # forecast the converted trip
      tripwatt forecast my-model trip.csv
    """
    if out.suffix.lower() != ".csv":
        raise InvalidInput.of("unknown file format", "--out", str(out), "a .csv file")
    fleet = shared.Logs(data, "table", mapping).read()
    result = tw.audit(fleet)
    aside = result.set_aside.get(trip or fleet.trips[0].trip_id, "")
    wanted = shared.one_trip(result.trips, trip, aside and f"set aside by the audit: {aside}")
    table = wanted.samples[[c for c in trips.COLUMNS if c in wanted]].copy()
    table["time_s"] -= table["time_s"].iloc[0]
    shared.write_text(csv_text(table), out)
    notes = [f"{f.trip}: {f.what} ({f.consequence})" for f in result.findings if f.trip == wanted.trip_id]

    def shown() -> None:
        say(f"{out}: {len(table)} samples of {wanted.trip_id} with {', '.join(table.columns)}")
        print_notes([*notes, *fleet.notes])

    document = {"trip": wanted.trip_id, "out": str(out), "samples": len(table), "notes": notes}
    return Answer(document, shown)


def _comment(text: str) -> str:
    """Return the comment at the head of a TOML text, in one line."""
    head = itertools.takewhile(lambda line: line.startswith("#"), text.splitlines())
    return " ".join(line.lstrip("# ") for line in head)


MAPPING = make_group(
    "Columns of your tables and what they hold: list, show, suggest and apply mappings.",
    (list_, show, suggest, apply),
)
