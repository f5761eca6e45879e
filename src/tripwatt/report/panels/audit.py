"""Findings of the audit, and the trips of each set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tripwatt.report.panel import Content, panel
from tripwatt.report.tables import Table, number
from tripwatt.report.view import TRIP_SETS, View, natural_key, plain
from tripwatt.report.words import listed


@panel("audit-findings", "What the audit found and did", wide=True, errors=False)
def audit_findings(view: View) -> Content:
    """Every finding with its consequence."""
    table = audit_table(view)
    if not table.rows:
        return Content(f"{on_audit(view)} Every trip was used as it was logged.")
    return Content(on_audit(view), tables=(table,))


@panel("trips-used", "Trips in each set", folded=True, wide=True, errors=False)
def trips_used(view: View) -> Content | None:
    """The trips of each set of trips."""
    table = used_table(view)
    return Content("The trips of each row of the result.", tables=(table,)) if table.rows else None


def on_audit(view: View) -> str:
    """How many trips were read, how many each set uses, what the audit did."""
    used = _sets(view)
    counts = {
        e["trips"]: e.get("n_trips") for e in view.evaluations if e.get("scheme") == "leave_one_trip_out"
    }
    counts.update({name: len(ids) for name, ids in used.items()})
    words = {"reference": "the reference set", "audited": "the audited set", "all": "the unaudited set"}
    parts = [f"{words.get(name, name)} has {number} trips" for name, number in counts.items()]
    audit = view.results.get("audit") or ()
    done: dict[str, set[str]] = {}
    for finding in audit:
        done.setdefault(str(finding.get("consequence") or "noted"), set()).add(str(finding.get("trip")))
    tally = listed([f"{len(trips)} {what}" for what, trips in sorted(done.items())])
    found = f"the audit has {len(audit)} findings (trips: {tally})" if audit else "the audit has no findings"
    read = view.results.get("trips_read")
    texts = [*([f"{len(read)} trips were read"] if read else []), found, *([listed(parts)] if parts else [])]
    return " ".join(f"{text[:1].upper()}{text[1:]}." for text in texts)


def audit_table(view: View) -> Table:
    """Every finding of the audit and what it led to."""
    findings = sorted(
        view.results.get("audit") or (), key=lambda f: (natural_key(f.get("trip")), f.get("from_s") or 0.0)
    )
    rows = [
        (
            plain(f.get("trip")),
            number(f.get("from_s"), 1.0, 1),
            number(f.get("to_s"), 1.0, 1),
            plain(f.get("what", ""), 400),
            plain(f.get("consequence", ""), 200),
        )
        for f in findings
    ]
    columns = ("Trip", "From [s]", "To [s]", "What was found", "Consequence")
    return Table(view.captioned("Findings of the audit"), columns, tuple(rows), frozenset({0, 3, 4}))


def used_table(view: View) -> Table:
    """The trips of each set, and those that were read but are not in it, with the reason."""
    used = _sets(view)
    read = [str(trip) for trip in view.results.get("trips_read") or ()]
    rows = []
    for name, ids in used.items():
        absent = sorted(set(read) - set(map(str, ids)), key=natural_key)
        rows.append(
            (
                TRIP_SETS.get(name, name),
                str(len(ids)),
                ", ".join(plain(i) for i in sorted(ids, key=natural_key)),
                "; ".join(f"{plain(trip)}: {_why_absent(view, name, trip)}" for trip in absent) or "none",
            )
        )
    columns = ("Set", "Number", "Trips", "Read, but not in it")
    return Table(view.captioned("Trips of each set"), columns, tuple(rows), frozenset({0, 2, 3}))


def _sets(view: View) -> Mapping[str, Sequence[str]]:
    """Trips of the sets that the audit decides on; a set by the kind of trip is a part of one of them."""
    used: Mapping[str, Sequence[str]] = view.results.get("trips_used") or {}
    return {name: ids for name, ids in used.items() if name in TRIP_SETS}


def _why_absent(view: View, name: str, trip: str) -> str:
    found = [f for f in view.results.get("audit") or () if str(f.get("trip")) == trip]
    reasons = [plain(f.get("what", ""), 200) for f in found if f.get("consequence") in ("set aside", "split")]
    if name == "reference":
        return "; ".join(
            ["not a reference trip of the data set", *(f"audit: {reason}" for reason in reasons)]
        )
    if name == "all":
        noted = [plain(n, 200) for n in view.results.get("notes") or () if trip in str(n)]
        return "; ".join(noted) or "could not be simulated or scored"
    return "; ".join(reasons) or "see the audit"


PANELS = (audit_findings, trips_used)
