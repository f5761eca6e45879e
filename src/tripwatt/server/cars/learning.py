"""How a car learns: each new trip is forecast by a model that has not seen it, and only then is the model adapted to it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tripwatt.auditing import audit
from tripwatt.errors import InvalidInput
from tripwatt.forecasting import ForecastModel, load_metadata, load_model, save_model
from tripwatt.forecasting.fitting import held_out_figures, provenance_of
from tripwatt.population.adapting import PROTOCOL, Adaptation, about_adaptation, in_order, population_of
from tripwatt.population.cars import for_car
from tripwatt.server.cars.diary import diary_entry
from tripwatt.trips import Trip, TripSet
from tripwatt.vehicles import Vehicle

Progress = Callable[[int, int], None]
"""Called with the number of trips forecast so far, and the number of all."""


@dataclass(frozen=True, slots=True)
class Learned:
    """Result of adding logs to a car.

    Attributes
    ----------
    added, known : int
        Number of logs that are new, and number that were stored before.
    entries : int
        Number of new trips in the diary.
    left_out : tuple of str
        Given drives that are not in the diary, with the reason.
    flat : int
        Number of new trips in the diary without heights, whose climb is unknown.

    Examples
    --------
    >>> Learned(added=12, known=0, entries=11, left_out=("A: no sound drive",)).entries
    11
    """

    added: int
    known: int
    entries: int = 0
    left_out: tuple[str, ...] = ()
    flat: int = 0


@dataclass
class Lesson:
    """What a car learns from its logs.

    Attributes
    ----------
    entries : list of dict
        New rows of the diary.
    left_out : dict of str to str
        Given drives that are not in the diary, and why.
    model : dict of str to bytes
        The parts of the stored model; empty if nothing was learned.
    """

    entries: list[dict[str, Any]] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    model: dict[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Learner:
    """A car's vehicle and logs, and what it has learned so far.

    Attributes
    ----------
    vehicle : Vehicle
        The vehicle with its published values.
    base : Path or None
        Folder of the model that is adapted to the trips; None for the bundled model.
    logs : TripSet
        All logs of the car.
    seen : frozenset of str
        Names of the trips in its diary.
    stored : ForecastModel or None
        Stored model, adapted to these trips; None before the first trip, or if an older version of tripwatt wrote the model.
    """

    vehicle: Vehicle
    base: Path | None
    logs: TripSet
    seen: frozenset[str]
    stored: ForecastModel | None

    def model(self) -> ForecastModel:
        """Return the model of the car; before the first trip, that of its published values."""
        if self.stored is not None:
            return self.stored
        return self.adaptation().model if self.seen else for_car(self.base, self.vehicle)

    def adaptation(self) -> Adaptation:
        """Return what the car has learned; computed from its trips again if an older version of tripwatt learned them."""
        base, stored = load_model(self.base), self.stored
        adaptation = Adaptation.before_trips(base, self.vehicle, population_of(base))
        if stored is not None and stored.evidence_ is not None and stored.roads_ is not None:
            return adaptation.with_evidence(stored.evidence_, stored.ranges_, stored.roads_)
        if not self.seen:
            return adaptation
        trips = _measured_by_date(audit(self.logs).trips)
        return adaptation.with_trips([trip for trip in trips if trip.trip_id in self.seen])

    def learn(self, names: Iterable[str], progress: Progress) -> Lesson:
        """Forecast the trips that are not in the diary one after the other, each before it is learned.

        Parameters
        ----------
        names : iterable of str
            Names of logs; if the audit sets them aside, `Lesson.left_out` has the reason.
        progress : callable
        """
        audited, lesson, names = audit(self.logs), Lesson(), {*names}
        lesson.left_out |= {trip: why for trip, why in audited.set_aside.items() if trip in names}
        ahead = [trip for trip in _measured_by_date(audited.trips) if trip.trip_id not in self.seen]
        if not ahead:
            return lesson
        published, adaptation, model = for_car(self.base, self.vehicle), self.adaptation(), self.model()
        for number, trip in enumerate(ahead, start=1):
            try:
                forecasts = model.forecast(trip), published.forecast(trip)
                row = diary_entry(trip, *forecasts, len(adaptation.evidence))
                adaptation = adaptation.with_trips([trip])
            except InvalidInput as error:
                lesson.left_out[trip.trip_id] = f"{error}"
            else:
                lesson.entries.append(row)
                model = adaptation.model
            progress(number, len(ahead))
        if lesson.entries:
            base = load_metadata(self.base, check_parts=False)
            provenance = provenance_of(self.logs, audited, model, [])
            lesson.model = _stored_parts(model, {**provenance, **about_adaptation(adaptation, base)})
        return lesson


def _stored_parts(model: ForecastModel, provenance: Mapping[str, Any]) -> dict[str, bytes]:
    figures = {**held_out_figures(model.held_out_), "protocol": PROTOCOL}
    with TemporaryDirectory() as folder:
        path = Path(folder, "model")
        save_model(model, path, provenance=provenance, evaluation=figures)
        return {file.name: file.read_bytes() for file in path.iterdir()}


def model_of_parts(parts: Mapping[str, bytes]) -> ForecastModel:
    """Load a model from its stored parts."""
    with TemporaryDirectory() as folder:
        for name, content in parts.items():
            Path(folder, name).write_bytes(content)
        return load_model(folder)


def _measured_by_date(trips: Iterable[Trip]) -> list[Trip]:
    """Sort trips with measured energy by departure; those without a date come last, by name."""
    dated = in_order(trip for trip in trips if trip.context.started_at is not None)
    undated = (trip for trip in trips if trip.context.started_at is None)
    return [*dated, *sorted(in_order(undated), key=lambda trip: trip.trip_id)]
