"""Findings of the audit, and the trips of each set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from tripwatt.report.panel import Content, panel
from tripwatt.report.tables import Column, Table, in_words, tabulated
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
    pairs = {(str(finding.get("consequence") or "noted"), str(finding.get("trip"))) for finding in audit}
    done = Counter(consequence for consequence, _ in pairs)
    tally = listed([f"{trips} {what}" for what, trips in sorted(done.items())])
    counted = (
        f"the audit has {len(audit)} findings (trips: {tally})" if audit else "the audit has no findings"
    )
    read = view.results.get("trips_read")
    texts = [
        *([f"{len(read)} trips were read"] if read else []),
        counted,
        *([listed(parts)] if parts else []),
    ]
    return " ".join(f"{text[:1].upper()}{text[1:]}." for text in texts)


def audit_table(view: View) -> Table:
    """Every finding of the audit and what it led to."""
    findings = view.results.get("audit") or ()
    return tabulated(
        view.captioned("Findings of the audit"),
        sorted(findings, key=lambda f: (natural_key(f.get("trip")), f.get("from_s") or 0.0)),
        Column("Trip", lambda f: plain(f.get("trip"))),
        Column("From [s]", "from_s", digits=1),
        Column("To [s]", "to_s", digits=1),
        in_words("What was found", lambda f: plain(f.get("what", ""), 400)),
        in_words("Consequence", lambda f: plain(f.get("consequence", ""), 200)),
    )


def used_table(view: View) -> Table:
    """The trips of each set, and those that were read but are not in it, with the reason."""
    read = [str(trip) for trip in view.results.get("trips_read") or ()]

    def absent(row: tuple[str, Sequence[str]]) -> str:
        name, ids = row
        left_out = sorted(set(read) - set(map(str, ids)), key=natural_key)
        return "; ".join(f"{plain(trip)}: {_why_absent(view, name, trip)}" for trip in left_out) or "none"

    return tabulated(
        view.captioned("Trips of each set"),
        _sets(view).items(),
        Column("Set", lambda row: TRIP_SETS.get(row[0], row[0])),
        Column("Number", lambda row: str(len(row[1]))),
        in_words("Trips", lambda row: ", ".join(plain(i) for i in sorted(row[1], key=natural_key))),
        in_words("Read, but not in it", absent),
    )


def _sets(view: View) -> Mapping[str, Sequence[str]]:
    """Trips of the sets that the audit decides on; a set by the kind of trip is a part of one of them."""
    used: Mapping[str, Sequence[str]] = view.results.get("trips_used") or {}
    return {name: ids for name, ids in used.items() if name in TRIP_SETS}


def _why_absent(view: View, name: str, trip: str) -> str:
    own = [f for f in view.results.get("audit") or () if str(f.get("trip")) == trip]
    reasons = [plain(f.get("what", ""), 200) for f in own if f.get("consequence") in ("set aside", "split")]
    if name == "reference":
        return "; ".join(
            ["not a reference trip of the data set", *(f"audit: {reason}" for reason in reasons)]
        )
    if name == "all":
        noted = [plain(n, 200) for n in view.results.get("notes") or () if trip in str(n)]
        return "; ".join(noted) or "could not be simulated or scored"
    return "; ".join(reasons) or "see the audit"
