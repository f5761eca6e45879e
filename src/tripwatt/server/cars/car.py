"""A user's car: its description, trips, diary and model, and the samples that it sends while it drives.

One SQLite file in the car's folder holds all of this. A trip that ends on the road is stored as a log like any other.
"""

from __future__ import annotations

import json
import math
import secrets
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Self, cast

import numpy as np

from tripwatt.errors import Fault, InvalidInput, damage, raise_faults, system_errors
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.forecasting.forecast import updated
from tripwatt.forecasting.measured import last_reading, since_departure
from tripwatt.forecasting.plausible import contradicts_energy
from tripwatt.forecasting.storage import vehicle_of_values
from tripwatt.modelfile import FORMAT_VERSION, METADATA
from tripwatt.physics.battery import usable_energy_wh
from tripwatt.roads.advice import Companion
from tripwatt.server.cars.car_file import ALLOWED, FORGET, MadeForecast, row_of_log
from tripwatt.server.cars.diary import Diary
from tripwatt.server.cars.documents import HIGH, LOW, LiveForecastDocument, LiveResponse, live_forecast
from tripwatt.server.cars.learning import Learned, Learner, Lesson, Progress, model_of_parts
from tripwatt.server.cars.live_car import LiveCar, make_car_folder
from tripwatt.server.cars.plan import LivePlan
from tripwatt.trips import Departure, Log, TripSet
from tripwatt.units import SECONDS_PER_DAY
from tripwatt.vehicles import Vehicle

MAX_LEFT_OUT: Final = 100
"""Most trips left out of the diary whose reasons are kept (a choice); the oldest reasons are dropped first."""

RESERVE: Final = 0.1
"""Displayed state of charge to keep if the plan has no reserve: the default of all forecasts."""

AIR_S: Final = SECONDS_PER_DAY
"""Longest age of an outside temperature that is still used [s]. A choice: the next day begins at about the same temperature."""

ModelOf = Callable[[Mapping[str, Any]], ForecastModel]
"""Request of a plan -> model that forecasts it; the same object until the model changes."""


class Car(LiveCar):
    """A car and its folder; made by `create_car`, opened by `open_car`, or by `Car.follow` to record samples on the road.

    Parameters
    ----------
    folder : Path or str
        Folder of the car; its name is the car's name. A folder of tripwatt 0.2 or 0.3.0.dev0 is read once into the car's file.

    Attributes
    ----------
    model_of : callable or None
        Request of a plan -> model that forecasts it.
    note : callable
        Called with a sentence when a forecast cannot be kept.
    updated : Forecast or None
        Forecast of the latest `document`; None if `at_departure` returned None.
    companion : Companion or None
        Follows the trip of the latest forecast at departure; None before the first.

    Raises
    ------
    InvalidInput
        When the file cannot be made, is damaged, or is of a newer format.

    Examples
    --------
    >>> import tempfile
    >>> from tripwatt.server.cars.telemetry import Sample
    >>> with tempfile.TemporaryDirectory() as folder, Car.follow(Path(folder, "my-leaf")) as car:
    ...     print([car.record(Sample(1.7e9 + 10.0 * k, {"speed_m_s": 10.0, "displayed_soc": 0.8})) for k in range(4)])
    ...     print(car.observed().shape, car.departure().soc, car.shown(1.7e9 + 60.0)["seconds_since_message"] is None)
    ...     print(car.present_plan, car.usual_trip_at(1.7e9))
    ...     car.set_plan({"links": []})
    ...     print(car.plan.request, car.at_departure(), car.document(1.7e9)["forecast"])
    ...     print(car.end_when_silent(1.7e9), car.logs())
    ['new', 'new', 'new', 'new']
    (4, 3) 0.8 False
    None None
    {'links': []} None None
    False ()
    >>> open_car("cars/my-leaf").add(tw.read_logs("exports", mapping="leaf_spy"))  # doctest: +SKIP
    Learned(added=12, known=0, entries=11, left_out=(), flat=0)
    """

    def __init__(self, folder: Path | str) -> None:
        super().__init__(folder)
        self.model_of: ModelOf | None = None
        self.note: Callable[[str], None] = lambda _: None
        # plan, model and departure of the forecast at departure, and that forecast
        self._at_departure: tuple[tuple[LivePlan, ForecastModel, Departure], Forecast] | None = None
        self._forecast_state: tuple[Any, ...] = ()
        self._forecast: LiveForecastDocument | None = None
        self._faults: list[dict[str, str]] = []
        self.updated: Forecast | None = None
        self.companion: Companion | None = None

    @classmethod
    def follow(
        cls, folder: Path | str, model_of: ModelOf | None = None, *, keep_days: float = math.inf
    ) -> Self:
        """Open a car that sends samples. Close it at the end: only one process at a time can follow a car.

        Parameters
        ----------
        folder : Path or str
            Folder of the car; created if missing.
        model_of : callable, optional
            Request of a plan -> model that forecasts it. Without it, trips are stored but not forecast.
        keep_days : float
            Days for which finished trips, and samples of a silent car, stay on disk. Older ones are erased now and every hour.

        Returns
        -------
        Car
            The car, with the trip that it is on restored from its file.

        Raises
        ------
        InvalidInput
            When the folder's name is not a valid car name, the folder cannot be written, or another process follows the car.
        """
        make_car_folder(Path(folder).absolute())
        car = cls(folder)
        car.model_of, car.keep_days = model_of, keep_days
        car._resume()
        return car

    @cached_property
    def vehicle(self) -> Vehicle:
        """The car with its published values.

        Raises
        ------
        InvalidInput
            When the car has no description, only samples from the road.
        """
        values = self.file.setting("vehicle")
        if values is None:
            got, fix = "no description", "make one: tripwatt car new"
            raise InvalidInput.of("not a car", f"{self.folder}", got, "a folder of `tripwatt car new`", fix)
        with damage(self.file.path, ALLOWED, FORGET):
            return vehicle_of_values(values)

    @property
    def is_described(self) -> bool:
        """Whether the car has a description; without one, it has only samples from the road."""
        return self.file.setting("vehicle") is not None

    @property
    def reserve_asked(self) -> float:
        """Displayed state of charge to keep: that of the plan, else `RESERVE`."""
        asked = None if self.plan is None else self.plan.request.get("reserve")
        return RESERVE if asked is None else asked

    @property
    def label(self) -> str:
        """The owner's name for the car; by default the name of its folder."""
        return f"{self.file.setting('label') or self.name}"

    @property
    def diary(self) -> Diary:
        """The diary of the car: its trips, each with the forecast made before it was learned."""
        with self.file.read() as db:
            rows = db.execute("SELECT entry FROM diary ORDER BY rowid")
            return Diary.from_entries(json.loads(entry) for (entry,) in rows)

    @property
    def left_out(self) -> dict[str, str]:
        """Trip -> why it is not in the diary, such as that the audit set it aside or that it cannot be forecast."""
        with damage(self.file.path, ALLOWED, FORGET):
            return dict(self.file.setting("left_out") or {})

    def logs(self) -> tuple[Log, ...]:
        """Read all logs of the car as they were recorded.

        Returns
        -------
        tuple of Log
            Logs in the order of their departure.
        """
        return self.file.logs()

    def model(self) -> ForecastModel:
        """Load the model of the car.

        Returns
        -------
        ForecastModel
            The model adapted to the car's trips; before the first trip, that of its published values.
        """
        return self._learner().model()

    def add(self, logs: TripSet | Iterable[Log], *, progress: Progress | None = None) -> Learned:
        """Store logs, forecast their trips one after the other, and learn from them.

        A log that is stored already is not added again. O(samples of all logs).

        Parameters
        ----------
        logs : TripSet or iterable of Log
            Logs as a reader returned them, not resampled.
        progress : callable, optional
            Called with the number of trips forecast so far, and the number of all.

        Returns
        -------
        Learned
            What is new among the logs and in the diary.

        Raises
        ------
        InvalidInput
            When a log was resampled, or the car cannot be written.
        """
        given = logs.logs if isinstance(logs, TripSet) else logs
        raw_logs = [replace(log, context=replace(log.context, car=None)) for log in given]
        resampled = [log for log in raw_logs if log.step_s is not None]
        raise_faults(Fault("not a raw log", log.trip_id, f"means over {log.step_s} s") for log in resampled)
        rows = [row_of_log(log) for log in raw_logs]
        with system_errors("cannot write the car", f"{self.folder}", "a writable folder with space"):
            with self.file.write() as db:
                added = db.put_logs(rows)
                stored = {digest for (digest,) in db.execute("SELECT digest FROM trips")}
            why = "another log of this name was added before"
            refused = {f"{name}": why for name, digest, *_ in rows if digest not in stored}
            counts = Learned(added, len(rows) - added - len(refused))
            return self._learn({log.trip_id for log in raw_logs} - {*refused}, counts, refused, progress)

    def learn(self, *, progress: Progress | None = None) -> Learned:
        """Learn the trips that the car finished on the road.

        Each trip is forecast before the model is adapted to it, and then entered in the diary.

        Parameters
        ----------
        progress : callable, optional
            As in `add`.

        Returns
        -------
        Learned
            Counts of trips; `known` are those learned earlier.

        Raises
        ------
        InvalidInput
            When the car has no description, or cannot be written.
        """
        finished = self._finished()
        names = {name for name, is_learned in finished.items() if not is_learned}
        with system_errors("cannot write the car", f"{self.folder}", "a writable folder with space"):
            return self._learn(names, Learned(len(names), len(finished) - len(names)), {}, progress)

    @property
    def has_news(self) -> bool:
        """Whether a trip that was finished on the road is not learned yet; False if the car has no description."""
        return self.is_described and not all(self._finished().values())

    def _finished(self) -> dict[str, bool]:
        """Return the trips that were finished on the road, each with whether it is learned."""
        return dict(self.file.rows("SELECT trip_id, is_learned FROM trips WHERE start_s IS NOT NULL"))

    def _learner(self) -> Learner:
        with damage(self.file.path, ALLOWED, FORGET):
            parts = dict(self.file.rows("SELECT part, content FROM model"))
            is_current = bool(parts) and json.loads(parts[METADATA])["format_version"] == FORMAT_VERSION
            stored = model_of_parts(parts) if is_current else None
            base = self.file.setting("base")
            logs = TripSet(self.name, self.logs())
            return Learner(self.vehicle, base and Path(base), logs, self.diary.trip_ids, stored)

    def _learn(
        self, names: Iterable[str], counts: Learned, refused: Mapping[str, str], progress: Progress | None
    ) -> Learned:
        """Learn all trips that are not in the diary; repeat this if another process changed the learned state meanwhile.

        The result has the reasons why trips of `names` were left out, and those of `refused`.
        """
        is_stored = False
        while not is_stored:
            state, learner = self.file.setting("state"), self._learner()
            lesson = learner.learn(names, progress or (lambda done, total: None))
            is_stored = self._store_lesson(state, learner.logs, lesson)
        left_out = tuple(f"{trip}: {why}" for trip, why in {**lesson.left_out, **refused}.items())
        flat = sum(not entry["has_heights"] for entry in lesson.entries)
        return replace(counts, entries=len(lesson.entries), left_out=left_out, flat=flat)

    def _store_lesson(self, state: str, logs: TripSet, lesson: Lesson) -> bool:
        """Write model and diary in one transaction; return False if the learned state is no longer `state`."""
        with self.file.write() as db:
            if self.file.setting("state", db) != state:
                return False
            names = [(log.trip_id,) for log in logs.logs]
            db.executemany("UPDATE trips SET is_learned = TRUE WHERE trip_id = ?", names)
            if lesson.entries:
                rows = [(entry["trip_id"], json.dumps(entry)) for entry in lesson.entries]
                db.executemany("INSERT INTO diary VALUES (?, ?)", rows)
                db.execute("DELETE FROM model")
                db.executemany("INSERT INTO model VALUES (?, ?)", lesson.model.items())
                db.put_settings({"state": secrets.token_hex(8)})
            if lesson.left_out:
                left_out = [*{**self.left_out, **lesson.left_out}.items()]
                db.put_settings({"left_out": dict(left_out[-MAX_LEFT_OUT:])})
        self.file.checkpoint()
        return True

    def about(self, diary: Diary | None = None) -> dict[str, Any]:
        """Describe the car, its trips, what was learned, and its scores.

        Parameters
        ----------
        diary : Diary, optional
            Diary of the car, if it was read already.

        Returns
        -------
        dict
            Plain values.
        """
        with damage(self.file.path, ALLOWED, FORGET):
            diary = self.diary if diary is None else diary
            latest, by_book = diary.latest()
            ((trips,),) = self.file.rows("SELECT count(*) FROM trips")
            parts = self.file.rows("SELECT content FROM model WHERE part = ?", METADATA)
            metadata = json.loads(parts[0][0]) if parts else {}
            is_current = metadata.get("format_version") == FORMAT_VERSION
            adapted = metadata["provenance"]["adapted"] if is_current else {}
            return {
                "car": self.name,
                "label": self.label,
                "folder": f"{self.folder}",
                "has_token": self.file.setting("token") is not None,
                "vehicle": self.vehicle.name,
                "title": self.vehicle.title,
                "trips": trips,
                "in_diary": len(diary),
                "left_out": self.left_out,
                "learned": {
                    name: {**value, "seen_degc": diary.seen_degc(name)}
                    for name, value in adapted.get("parameters", {}).items()
                },
                "experts": adapted.get("experts", {}),
                "score": diary.score.to_dict(),
                "latest": latest.to_dict(),
                "latest_by_book": by_book.to_dict(),
                "by_temperature": {name: score.to_dict() for name, score in diary.by_temperature().items()},
                "by_season": diary.by_season(),
                "by_cause_wh": diary.by_cause_wh(),
            }

    def at_departure(self) -> Forecast | None:
        """Forecast the trip at its departure. Values of the departure that the plan leaves out come from the samples.

        The forecast is made again only if the plan, the model or the departure changed.

        Returns
        -------
        Forecast or None
            None if there is neither a plan nor a usual trip, or no model.

        Raises
        ------
        InvalidInput
            When the plan cannot be forecast.
        """
        plan = self.present_plan
        if plan is None or self.model_of is None:
            return None
        model, planned, sampled = self.model_of(plan.request), plan.road.departure, self.departure()
        if planned.soc is not None or planned.bms_soc is not None:
            sampled = replace(sampled, soc=None, bms_soc=None)
        departure = sampled.merge(planned)
        if self._at_departure is None or self._at_departure[0] != (plan, model, departure):
            forecast = model.forecast(replace(plan.road, departure=departure))
            self._at_departure = (plan, model, departure), forecast
            self.companion = Companion(forecast, self.reserve_asked)
        return self._at_departure[1]

    def update(self, forecast: Forecast) -> Forecast:
        """Update the forecast made at departure with what was measured so far, including samples that wait for late ones.

        O(samples of the trip).

        Parameters
        ----------
        forecast : Forecast
            Forecast of the trip that the car is on.

        Returns
        -------
        Forecast
            The same forecast if fewer than two samples were measured.

        Raises
        ------
        InvalidInput
            As in `Forecast.update`: when the samples do not fit this trip.
        """
        plan, measured = forecast.plan, self.measured(forecast.plan.start_s)
        return updated(forecast, since_departure(measured, plan)) if len(measured["time_s"]) > 1 else forecast

    def shown_soc(self) -> float | None:
        """Return the displayed state of charge from the latest message that has a charge.

        Returns
        -------
        float or None
            A charge of the battery management is converted with the car's model; None if there is no model.
            A charge that the measured energy contradicts is replaced by that of the forecast; without a forecast, it is None if the car has
            a description. None also if no message has a charge.

        Examples
        --------
        >>> import tempfile
        >>> from tripwatt.server.cars.telemetry import Sample
        >>> with tempfile.TemporaryDirectory() as folder, Car.follow(f"{folder}/leaf") as car:
        ...     car.record(Sample(1.7e9, {"displayed_soc": 0.8}))
        ...     car.shown_soc()
        'new'
        0.8
        """
        if self._soc is None:
            return None
        _, field, soc = self._soc
        now = self.updated if self.trip is not None else None
        if now is not None and any(flag.code == "charge_contradicted" for flag in now.flags):
            columns = now.along.columns()
            return float(np.interp(now.measured_until_s, columns["time_s"], columns["displayed_soc"]))
        if now is None and self.is_described and self._charge_contradicted():
            return None
        if field == "soc" or self.model_of is None:
            return soc if field == "soc" else None
        model = self.model_of({} if self.plan is None else self.plan.request)
        scale = None if model.uncertainty_ is None else model.uncertainty_.charge
        displayed = model.vehicle.battery.displayed_from_soc if scale is None else scale.displayed
        return min(max(float(displayed(soc)), 0.0), 1.0)

    def _charge_contradicted(self) -> bool:
        """Return whether the energy that was measured on the trip contradicts its charge, as in `contradicts_energy`. O(samples of the trip)."""
        samples = self.measured()
        reading, usable_wh = last_reading(samples, samples["time_s"]), usable_energy_wh(self.vehicle.battery)
        return contradicts_energy(reading, samples, usable_wh)

    def last_air_degc(self, now_s: float) -> float | None:
        """Return the outside temperature from the latest message that has one.

        Parameters
        ----------
        now_s : float
            The time by our clock [s since 1970].

        Returns
        -------
        float or None
            Temperature [°C]; None if no message has one, or if it is older than `AIR_S`.

        Examples
        --------
        >>> import tempfile
        >>> from tripwatt.server.cars.telemetry import Sample
        >>> with tempfile.TemporaryDirectory() as folder, Car.follow(f"{folder}/leaf") as car:
        ...     car.record(Sample(1.7e9, {"ambient_temperature_degc": -3.0}))
        ...     print(car.last_air_degc(car.now_s()), car.last_air_degc(car.now_s() + 2.0 * AIR_S))
        'new'
        -3.0 None
        """
        age_s = now_s - (self.received_s or 0.0) + self._ordered.newest_s - self._air[0]
        return self._air[1] if age_s <= AIR_S else None

    @property
    def live_state(self) -> tuple[int, int, float | None]:
        """What a forecast depends on: number of new samples, number of plan changes, start of the trip (None without a trip)."""
        return self.counts["new"], self._plans, None if self.trip is None else self.trip.start_s

    def document(self, now_s: float) -> LiveResponse:
        """Return the car and the forecast of its trip, given what was measured.

        A new forecast is made only after `live_state` changed. If the samples do not fit the trip, `faults` has the reason and the
        forecast stays the previous one. If the trip or the plan has changed since, the forecast is that at departure.

        Parameters
        ----------
        now_s : float
            The time by our clock [s since 1970].

        Returns
        -------
        dict
            Plain values, as in the response of the service.
        """
        if self._forecast_state != self.live_state:
            self._update_forecast()
        plan = self.plan if self._forecast is None else self.present_plan
        document = {
            **self.shown(now_s),
            "soc": self.shown_soc(),
            "ambient_temperature_degc": self.last_air_degc(now_s),
            "plan": None if plan is None else "usual" if plan.usual_trip else "given",
            "usual_trip": None if plan is None else plan.usual_trip,
            "destination": None if plan is None else plan.request.get("destination"),
            "forecast": self._forecast,
            "flags": [],
            "message": None,
            "faults": [*self._faults, *self.mixed(now_s)],
        }
        return cast(LiveResponse, document)

    def _update_forecast(self) -> None:
        """Make the forecast of the document, and store it for the diary if one is due."""
        before, state_before, self._forecast_state = self._forecast, self._forecast_state, self.live_state
        departing, self._faults = None, []
        try:
            departing = self.at_departure()
            self.updated = None if departing is None else self.update(departing)
            self._forecast = self._live_forecast(self.updated, departing)
        except InvalidInput as error:
            self._faults = [fault.texts for fault in error.faults]
            if state_before[1:] != self.live_state[1:]:  # the forecast before is of another trip or plan
                self._forecast = self._live_forecast(departing, departing)
            return
        if self._forecast is None:
            return
        try:
            # the forecast before is that of the departure if the car was on no trip
            if before is not None and state_before[1:] == (self.live_state[1], None):
                self.keep_forecast(before, departing=True)
            self.keep_forecast(self._forecast)
        except OSError as error:
            self.note(f"forecast not stored: {error}"[:200])

    def _live_forecast(self, now: Forecast | None, departing: Forecast | None) -> LiveForecastDocument | None:
        return None if now is None or departing is None else live_forecast(now, departing, self.reserve_asked)

    def keep_forecast(self, forecast: LiveForecastDocument, *, departing: bool = False) -> bool:
        """Store a forecast of the whole trip for the diary, if one is due.

        The forecast counts all samples, see `update`. The time and distance stored with it, and whether it is due, are those of the
        trip without the samples that still wait for late ones, at most the last `LATE_S` of the trip.

        Parameters
        ----------
        forecast : dict
            As in `document`.
        departing : bool
            Whether this is the forecast at departure, which is stored only if no other is stored yet.

        Returns
        -------
        bool
            Whether the forecast was stored.

        Raises
        ------
        OSError
            When the forecast cannot be written.

        Examples
        --------
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder, Car.follow(f"{folder}/leaf") as car:
        ...     car.keep_forecast({"energy_wh": 2000.0, "quantiles_wh": {"0.05": 1800.0, "0.95": 2200.0}})
        False
        """
        trip = self.trip
        if trip is None or (self.forecasts if departing else not self.wants_forecast):
            return False
        at_s, distance_m = (0.0, 0.0) if departing else (trip.last_s - trip.start_s, trip.distance_m)
        bounds = (forecast["quantiles_wh"][end] for end in (LOW, HIGH))
        made = MadeForecast(at_s, distance_m, forecast["energy_wh"], *bounds)
        with self.file.write() as db:
            db.put_forecasts(trip.start_s, [made])
        return True

    def __repr__(self) -> str:
        if not self.is_described:
            return f"<Car {self.name}: no description>"
        return f"<Car {self.name}: {self.vehicle.title}, {len(self.diary)} trips in its diary>"
