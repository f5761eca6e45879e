"""The audit of all logs of a car: which rules judge a log, its cuts and its drives, in which order."""

from __future__ import annotations

import datetime as dt
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import by_key
from tripwatt.auditing import consistency, signals, stamps
from tripwatt.auditing.findings import Consequence, Cut, Finding, array, between, whole
from tripwatt.errors import Fault, counted, raise_faults, require_type
from tripwatt.trips import Recorded, Trip, TripSet, require_unique_ids, structure_faults, value_faults
from tripwatt.trips.reading import Group, group_by_kind
from tripwatt.trips.schema import faults_named

SHORTEST_LEG_M: Final = 1000.0
SHORTEST_LEG_S: Final = 120.0
"""Shortest distance and duration of a drive. On shorter drives one start and the resolution of the sensors are most of the energy."""


DRIVEN_M: Final = 50.0
"""Shortest distance of a piece of a log that counts as a drive; a shorter one is part of a stop."""


@dataclass(frozen=True, slots=True, repr=False)
class Audit:
    """Result of an audit: the drives that can be used, and everything that is wrong with the logs.

    Attributes
    ----------
    trips : tuple of Trip
        Sound drives: values validated, energy measured again over the remaining samples.
    findings : tuple of Finding
        What is wrong with the logs, in the order of the logs.
    n_logs : int
        How many logs were audited.
    lost_distance_m, lost_duration_s : float
        Distance [m] and duration [s] of the drives that are not used.

    Examples
    --------
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> result = audit(synthetic_fleet(2))
    >>> print(result)
    2 sound drives of 2 logs, 0 set aside
    >>> list(result.to_frame().columns), result.set_aside
    (['trip', 'from_s', 'to_s', 'what', 'consequence'], {})
    """

    trips: tuple[Trip, ...]
    findings: tuple[Finding, ...]
    n_logs: int
    lost_distance_m: float = 0.0
    lost_duration_s: float = 0.0

    @property
    def set_aside(self) -> dict[str, str]:
        """Name of each drive that is not used -> the reasons."""
        aside = (finding for finding in self.findings if finding.consequence == "set aside")
        by_trip = by_key(aside, lambda finding: finding.trip)
        return {trip: "; ".join(finding.what for finding in reasons) for trip, reasons in by_trip.items()}

    def groups(self) -> tuple[tuple[Consequence, Group], ...]:
        """Group the findings by consequence and kind.

        Returns
        -------
        tuple of (str, Group)
            Consequences in the order "set aside", "trimmed", "split", "noted"; for each, the most frequent kind first.

        Examples
        --------
        >>> from tripwatt.study.synthetic import synthetic_fleet
        >>> audit(synthetic_fleet(2)).groups()
        ()
        """
        return tuple(
            (consequence, group)
            for consequence in ("set aside", "trimmed", "split", "noted")
            for group in group_by_kind(
                (f.what, f.trip, 1, f"{f}") for f in self.findings if f.consequence == consequence
            )
        )

    def to_frame(self) -> pd.DataFrame:
        """Tabulate the findings.

        Returns
        -------
        DataFrame
            One row per finding: ``trip``, ``from_s``, ``to_s`` [s], ``what``, ``consequence``.
        """
        columns = ["trip", "from_s", "to_s", "what", "consequence"]
        return pd.DataFrame([[getattr(f, c) for c in columns] for f in self.findings], columns=columns)

    def __str__(self) -> str:
        used = counted(len(self.trips), "sound drive")
        return f"{used} of {counted(self.n_logs, 'log')}, {len(self.set_aside)} set aside"

    def __repr__(self) -> str:
        return f"<Audit {self}>"


def audit(logs: TripSet | Iterable[Recorded]) -> Audit:
    """Audit raw logs: mend, trim, split or set them aside, and report each change. O(samples).

    Parameters
    ----------
    logs : TripSet or iterable of Log
        Logs of one car as a reader gives them, before any resampling. The capacity of the battery is estimated from all of
        them together.

    Returns
    -------
    Audit
        The sound drives as `trips`, and a finding for each change.

    Raises
    ------
    InvalidInput
        If two logs share an id, or a log was resampled.

    Examples
    --------
    >>> time = np.arange(0.0, 600.0)
    >>> speed = 12.0 + 6.0 * np.sin(time / 15.0)
    >>> samples = pd.DataFrame({"time_s": time, "speed_m_s": speed, "voltage_v": 390.0 - 0.4 * np.cos(time / 15.0),
    ...                         "current_a": 15.0 + 25.0 * np.cos(time / 15.0)})
    >>> samples.iloc[400:, 1:] = samples.iloc[400, 1:].to_numpy()
    >>> from tripwatt.trips import Log
    >>> result = audit([Log.from_samples("A", samples)])
    >>> print(result.findings[-1])
    A, 400.0 to 599.0 s: every signal frozen for 199.0 s at 65 km/h (trimmed)
    >>> float(result.trips[0].duration_s)
    400.0
    """
    allowed = "a TripSet, or logs"
    given = logs.logs if isinstance(logs, TripSet) else require_type("logs", logs, Iterable, allowed)
    recorded = tuple(require_type("logs", log, Recorded, allowed) for log in given)
    require_unique_ids(recorded)
    raise_faults(
        Fault("not a raw log", log.trip_id, f"means over {log.step_s} s") for log in recorded if log.step_s
    )
    audited = [_audit_log(log) for log in recorded]
    legs = [leg for its_legs, _ in audited for leg in its_legs]
    used = _without_fault(legs, [finding for _, its_findings in audited for finding in its_findings])
    by_leg = consistency.soc_findings(legs, used)
    findings: list[Finding] = []
    for its_legs, its_findings in audited:
        findings += its_findings
        for leg in its_legs:
            findings += by_leg.get(leg.trip_id, [])
    ordered = without_repeats(findings, len(recorded))
    sound = _without_fault(legs, ordered)
    trips = tuple(Trip.from_log(leg) for leg, is_sound in zip(legs, sound, strict=True) if is_sound)
    lost = [leg for leg, is_sound in zip(legs, sound, strict=True) if not is_sound]
    lost_m, lost_s = sum(leg.distance_m for leg in lost), sum(leg.duration_s for leg in lost)
    return Audit(trips, ordered, len(recorded), float(lost_m), float(lost_s))


def _audit_log(trip: Recorded) -> tuple[list[Recorded], list[Finding]]:
    """Return the drives of one log, each mended and judged separately, and the findings."""
    with faults_named(trip.samples, trip.trip_id):
        samples, findings = signals.blank_infinite(trip.samples, trip.trip_id)
    samples, cuts, new_findings = stamps.mend_stamps(samples, trip.trip_id)
    findings += [*new_findings, *signals.missing_columns(samples, trip.trip_id)]
    if len(samples) < 2:
        findings.append(whole(samples, trip.trip_id, "fewer than two samples are left", "set aside"))
    if not _is_aside(findings):
        samples, new_findings = signals.blank_impossible(samples, trip.trip_id)
        findings += new_findings
    if _is_aside(findings):
        return [], findings
    for rule in (signals.sensor_stop_cuts, stamps.gap_cuts, signals.freeze_cuts, signals.charging_cuts):
        cuts += rule(samples)
    legs, new_findings = _legs(trip, samples, cuts)
    findings += new_findings
    mended = []
    for leg in legs:
        leg, new_findings = _judge_leg(leg)
        mended.append(leg)
        findings += new_findings
    return mended, findings


def _is_aside(findings: Iterable[Finding]) -> bool:
    return any(finding.consequence == "set aside" for finding in findings)


def _legs(trip: Recorded, samples: pd.DataFrame, cuts: Sequence[Cut]) -> tuple[list[Recorded], list[Finding]]:
    """Return the drives that are left of a log between its cuts, and the findings about the cuts."""
    keep = np.ones(len(samples), dtype=bool)
    edges = {0, len(samples)}
    for cut in cuts:
        keep[cut.first : cut.stop] = False
        edges |= {cut.first, cut.stop}
    pieces = [
        (first, samples.iloc[first:last].reset_index(drop=True))
        for first, last in pairwise(sorted(edges))
        if keep[first]
    ]
    driven = [(first, piece) for first, piece in pieces if driven_m(piece) >= DRIVEN_M]
    ordered = sorted(cuts, key=lambda cut: cut.first)
    findings = [finding_of_cut(trip.trip_id, samples, cut, driven) for cut in ordered]
    for _, piece in pieces if cuts and driven else ():
        if len(piece) > 1 and driven_m(piece) < DRIVEN_M:
            what = f"{driven_m(piece):.0f} m beside a cut are too short for a drive"
            findings.append(between(piece, trip.trip_id, (0, -1), what, "trimmed"))
    if not driven:
        what = "the car did not move" if not cuts else "no part of the log with a moving car is left"
        speed, time = array(samples, "speed_m_s"), array(samples, "time_s")
        fastest, lasts = float(np.nanmax(speed, initial=0.0)), float(np.ptp(time))
        # 10 m/s²: more than the hardest braking on a road
        if fastest > 10.0 * max(lasts, 0.1):
            what = f"speeds of up to {3.6 * fastest:.0f} km/h in {lasts:.3g} s: the unit of time is wrong"
        longest = max([(cut.stop - cut.first, cut.what) for cut in cuts if cut.stop > cut.first], default=())
        findings.append(whole(samples, trip.trip_id, "; ".join([what, *longest[1:]]), "set aside"))
    legs = []
    for number, (first, piece) in enumerate(driven, start=1):
        name = trip.trip_id if len(driven) == 1 else f"{trip.trip_id}-{number}"
        legs.append(_leg(trip, piece, name, follows=first > 0 and number > 1))
    return legs, findings


def driven_m(samples: pd.DataFrame) -> float:
    """Distance driven in some samples [m], by those with a known speed."""
    speed, time = array(samples, "speed_m_s"), array(samples, "time_s")
    known = np.isfinite(speed) & np.isfinite(time)
    return float(np.trapezoid(speed[known], time[known]))


def finding_of_cut(
    trip_id: str, samples: pd.DataFrame, cut: Cut, driven: Sequence[tuple[int, pd.DataFrame]]
) -> Finding:
    """Make the finding of a cut: "split" if there are drives on both sides of the cut, else "trimmed"."""
    before = any(first < cut.first for first, _ in driven)
    after = any(first >= cut.stop for first, _ in driven)
    first, last = max(cut.first - 1, 0), min(cut.stop, len(samples) - 1)
    return between(samples, trip_id, (first, last), cut.what, "split" if before and after else "trimmed")


def _leg(trip: Recorded, samples: pd.DataFrame, name: str, *, follows: bool) -> Recorded:
    context = trip.context
    if follows:
        late = float(samples["time_s"].iloc[0] - trip.samples["time_s"].iloc[0])
        started = context.started_at and context.started_at + dt.timedelta(seconds=max(late, 0.0))
        context = replace(context, follows_trip=True, started_at=started)
    return replace(trip, trip_id=name, samples=samples, context=context, observed_energy_wh=None)


def _judge_leg(leg: Recorded) -> tuple[Recorded, list[Finding]]:
    """Apply the rules to one drive; return the mended drive, even if it is set aside, and the findings."""
    samples = signals.drop_blank_speed(leg.samples)
    name = leg.trip_id
    findings = [
        *stamps.gap_findings(samples, name),
        *signals.filled_gaps(samples, name),
        *signals.frozen_sensor_findings(samples, name),
        *signals.ambient_findings(samples, name),
        *signals.coarse_findings(samples, name),
    ]
    soc_faults, heater = consistency.blank_soc_faults, signals.blank_stuck_heater
    for blank in (signals.mend_heights, heater, soc_faults, signals.blank_fahrenheit):
        samples, new_findings = blank(samples, name)
        findings += new_findings
    mended = leg.with_samples(samples)
    for rule in (consistency.unit_findings, consistency.offset_findings, consistency.energy_error_findings):
        findings += rule(mended)
    short = [f"{SHORTEST_LEG_M:g} m"] * (mended.distance_m < SHORTEST_LEG_M)
    short += [f"{SHORTEST_LEG_S:g} s"] * (mended.duration_s < SHORTEST_LEG_S)
    if short:
        what = f"{mended.distance_m:.0f} m in {mended.duration_s:.0f} s: shorter than {', '.join(short)}"
        findings.append(whole(samples, name, what, "set aside"))
    faults = (*structure_faults(samples, name), *value_faults(samples, name))
    findings += [whole(samples, name, f"{f.what}: {f.got}", "set aside") for f in faults]
    return mended, findings


def without_repeats(findings: Sequence[Finding], n_logs: int) -> tuple[Finding, ...]:
    """Merge a note that every log has, such as that of a missing column, into one note on all logs."""
    counts = Counter(f.what for f in findings if f.consequence == "noted")
    common = {what for what, n in counts.items() if n == n_logs > 1}
    shared = (
        Finding("all logs", 0.0, max(f.to_s for f in findings), what, "noted") for what in sorted(common)
    )
    return (*shared, *(f for f in findings if f.what not in common or f.consequence != "noted"))


def _without_fault(legs: Sequence[Recorded], findings: Iterable[Finding]) -> list[bool]:
    aside = {f.trip for f in findings if f.consequence == "set aside"}
    return [leg.trip_id not in aside for leg in legs]
