"""A car on the road: its samples as they arrive, the trip that it is on, and the forecast of that trip after each of them.

Everything is kept in the folder `live` of the car: the journal of samples that no finished trip holds, the plan of its trip,
the finished trips as tables, and the forecasts that were made on the way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, cast

from tripwatt.errors import InvalidInput
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.server.cars.documents import HIGH, LOW, LiveForecastDocument, LiveResponse, live_forecast
from tripwatt.server.cars.on_the_way import MadeForecast
from tripwatt.server.cars.plan import LivePlan
from tripwatt.server.cars.recording import Recorder
from tripwatt.trips import Departure
from tripwatt.trips.columns import require_fraction
from tripwatt.units import SECONDS_PER_DAY

AIR_S: Final = SECONDS_PER_DAY
"""An outside temperature of a message counts for so long."""

ModelOf = Callable[[Mapping[str, Any]], ForecastModel]
"""The request of a plan -> the model of its forecast; the same object for as long as the model is the same."""


class RoadCar(Recorder):
    """A car that sends samples: a new folder, or one that may be a car of `create_car` beside. One process at a time has it open.

    Parameters
    ----------
    folder : Path or str
        Of the car, whose name is that of the folder.
    model_of : callable, optional
        Request of a plan -> model of its forecast. Without one, trips are kept and not forecast.
    reserve : float
        Displayed state of charge to keep, where the plan has none.
    keep_days : float
        Days that finished trips, and samples of a car that is silent, stay on disk; older ones are erased now and every hour.

    Raises
    ------
    InvalidInput
        When its name cannot be one, it cannot be written, its plan is damaged, or another process has it open.

    Attributes
    ----------
    note : callable
        Called with a sentence when a forecast cannot be kept.
    updated : Forecast or None
        That of the latest document; None without a plan.

    Examples
    --------
    >>> import tempfile
    >>> from tripwatt.server.cars import Sample
    >>> with tempfile.TemporaryDirectory() as folder, RoadCar(Path(folder, "my-leaf")) as car:
    ...     print([car.add(Sample(1.7e9 + 10.0 * k, {"speed_m_s": 10.0, "displayed_soc": 0.8})) for k in range(4)])
    ...     print(car.observed().shape, car.departure().soc, car.about(1.7e9 + 60.0)["seconds_since_message"] is None)
    ...     print(car.usual_trip(), car.usual_trip_at(1.7e9))
    ...     car.set_plan({"links": []})
    ...     print(car.plan.request, car.at_departure(), car.document(1.7e9)["forecast"])
    ...     print(car.end_when_silent(1.7e9), car.logs())
    ['new', 'new', 'new', 'new']
    (4, 3) 0.8 False
    None None
    {'links': []} None None
    False ()
    >>> car.update(model.forecast(plan)).arrival.interval(0.9)  # doctest: +SKIP
    (0.51, 0.56)
    """

    def __init__(
        self,
        folder: Path | str,
        model_of: ModelOf | None = None,
        *,
        reserve: float = 0.1,
        keep_days: float = math.inf,
    ) -> None:
        self.reserve = require_fraction("reserve", reserve)
        super().__init__(folder, keep_days=keep_days)
        self.model_of = model_of
        self.note: Callable[[str], None] = lambda _: None
        # what the forecast at departure was made of, and that forecast
        self._departing: tuple[tuple[LivePlan, ForecastModel, Departure], Forecast] | None = None
        self._of: tuple[Any, ...] = ()
        self._forecast: LiveForecastDocument | None = None
        self._faults: list[dict[str, str]] = []
        self.updated: Forecast | None = None

    def at_departure(self) -> Forecast | None:
        """Forecast the trip at its departure; what the plan leaves unknown of the departure is what the samples show.

        It is made again when plan, model or departure are others.

        Returns
        -------
        Forecast or None
            None without a plan and a usual trip, or without a model.

        Raises
        ------
        InvalidInput
            When the plan cannot be forecast.
        """
        plan = self.plan
        if plan is None and self.usual_trip() is not None and self._usual is not None:
            plan = self._usual[2]
        if plan is None or self.model_of is None:
            return None
        model, known, shown = self.model_of(plan.request), plan.road.departure, self.departure()
        if known.soc is not None or known.bms_soc is not None:
            shown = replace(shown, soc=None, bms_soc=None)
        made_of = plan, model, shown.merge(known)
        if self._departing is None or self._departing[0] != made_of:
            self._departing = made_of, model.forecast(replace(plan.road, departure=made_of[2]))
        return self._departing[1]

    def update(self, forecast: Forecast) -> Forecast:
        """Update a forecast of the trip made at its departure by what was measured so far. O(samples of the trip).

        Parameters
        ----------
        forecast : Forecast
            Of the trip that the car is on.

        Returns
        -------
        Forecast
            The same where fewer than two samples were measured.

        Raises
        ------
        InvalidInput
            As `Forecast.update`: when the samples are not those of this trip.
        """
        observed = self.observed(forecast.plan.start_s)
        return forecast if len(observed) < 2 else forecast.update(observed)

    def shown_soc(self) -> float | None:
        """Return the displayed charge by the latest message that has a charge.

        Returns
        -------
        float or None
            A charge of the battery management is converted by the model of the car; None without one, and without a charge.

        Examples
        --------
        >>> import tempfile
        >>> from tripwatt.server.cars import Sample
        >>> with tempfile.TemporaryDirectory() as folder, RoadCar(f"{folder}/leaf") as car:
        ...     car.add(Sample(1.7e9, {"displayed_soc": 0.8}))
        ...     car.shown_soc()
        'new'
        0.8
        """
        if self._soc is None or self._soc[1] == "soc" or self.model_of is None:
            return None if self._soc is None or self._soc[1] != "soc" else self._soc[2]
        model = self.model_of({} if self.plan is None else self.plan.request)
        scale = None if model.uncertainty_ is None else model.uncertainty_.charge
        shown = scale.displayed if scale is not None else model.vehicle.battery.displayed_from_soc
        return min(max(float(shown(self._soc[2])), 0.0), 1.0)

    def last_air_degc(self, now_s: float) -> float | None:
        """Return the outside temperature by the latest message that has one.

        Parameters
        ----------
        now_s : float
            The time by our clock [s since 1970].

        Returns
        -------
        float or None
            [°C]; None without one, and where it is older than `AIR_S`.

        Examples
        --------
        >>> import tempfile
        >>> from tripwatt.server.cars import Sample
        >>> with tempfile.TemporaryDirectory() as folder, RoadCar(f"{folder}/leaf") as car:
        ...     car.add(Sample(1.7e9, {"ambient_temperature_degc": -3.0}))
        ...     print(car.last_air_degc(car.now_s()), car.last_air_degc(car.now_s() + 2.0 * AIR_S))
        'new'
        -3.0 None
        """
        age_s = now_s - (self.received_s or 0.0) + self._ordered.newest_s - self._air[0]
        return self._air[1] if age_s <= AIR_S else None

    @property
    def state(self) -> tuple[int, int, float | None]:
        """What a forecast depends on: numbers of samples and of plans, and the start of the trip."""
        return self.counts["new"], self._plans, None if self.trip is None else self.trip.start_s

    def document(self, now_s: float) -> LiveResponse:
        """Describe the car and the forecast of its trip, given what was measured. It is made once for the same samples.

        Samples that cannot be of the trip leave the forecast before them, else that of the departure, and `faults`.

        Parameters
        ----------
        now_s : float
            The time by our clock [s since 1970].

        Returns
        -------
        dict
            Plain values, as the service gives them.
        """
        if self._of != self.state:
            self._make()
        usual = None
        if self.plan is None and self._forecast is not None and self._departing is not None:
            usual = self._departing[0][0].usual_trip
        document = {
            **self.about(now_s),
            "soc": self.shown_soc(),
            "ambient_temperature_degc": self.last_air_degc(now_s),
            "plan": "given" if self.plan is not None else None if usual is None else "usual",
            "usual_trip": usual,
            "forecast": self._forecast,
            "flags": [],
            "message": None,
            "faults": [*self._faults, *self.mixed(now_s)],
        }
        return cast(LiveResponse, document)

    def _make(self) -> None:
        """Make the forecast of the document; one that is due is kept for the diary."""
        before, of, self._of = self._forecast, self._of, self.state
        departing, self._faults = None, []
        try:
            departing = self.at_departure()
            self.updated = None if departing is None else self.update(departing)
            self._forecast = None if self.updated is None else self._live(self.updated)
        except InvalidInput as error:
            self._faults = [fault.texts for fault in error.faults]
            if of[1:] != self._of[1:]:  # the forecast before is of another trip or plan
                self._forecast = None if departing is None else self._live(departing)
            return
        if self._forecast is None:
            return
        try:
            # the forecast before is that of the departure if the car was on no trip
            if before is not None and of[1:] == (self._of[1], None):
                self.keep_forecast(before, departing=True)
            self.keep_forecast(self._forecast)
        except OSError as error:
            self.note(f"forecast not stored: {error}"[:200])

    def _live(self, forecast: Forecast) -> LiveForecastDocument:
        plan = None if self._departing is None else self._departing[0][0]
        reserve = None if plan is None else plan.request.get("reserve")
        return live_forecast(forecast, self.reserve if reserve is None else reserve)

    @property
    def forecasts(self) -> tuple[MadeForecast, ...]:
        """Forecasts that were kept of the trip that the car is on."""
        return () if self.trip is None else self._on_the_way.of(self.trip.start_s)

    @property
    def wants_forecast(self) -> bool:
        """Whether a forecast that is made now is kept with the trip."""
        trip = self.trip
        return trip is not None and self._on_the_way.is_due(trip.start_s, trip.last_s - trip.start_s)

    def keep_forecast(self, forecast: LiveForecastDocument, *, departing: bool = False) -> bool:
        """Keep a forecast of the whole trip for the diary, if it is due.

        Parameters
        ----------
        forecast : dict
            As in `document`.
        departing : bool
            Whether it is that of the departure; it counts only as the first one.

        Returns
        -------
        bool
            Whether it was kept.

        Raises
        ------
        OSError
            When it cannot be written.

        Examples
        --------
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder, RoadCar(f"{folder}/leaf") as car:
        ...     car.keep_forecast({"energy_wh": 2000.0, "quantiles_wh": {"0.05": 1800.0, "0.95": 2200.0}})
        False
        """
        trip = self.trip
        if trip is None or (departing and self.forecasts):
            return False
        at_s, distance_m = (0.0, 0.0) if departing else (trip.last_s - trip.start_s, trip.distance_m)
        ends = (forecast["quantiles_wh"][end] for end in (LOW, HIGH))
        return self._on_the_way.add(
            trip.start_s, MadeForecast(at_s, distance_m, forecast["energy_wh"], *ends)
        )

    def __repr__(self) -> str:
        trip = self.trip
        return f"<RoadCar {self.name}: {'on no trip' if trip is None else f'{trip.distance_m / 1000.0:.1f} km driven'}>"
