"""The diary of a car: for each trip, the forecast made before the model was adapted to it, and the measured energy."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.errors import percent
from tripwatt.forecasting import Forecast
from tripwatt.hybrid.factors import acts_between
from tripwatt.trips import Trip
from tripwatt.uncertainty import Coverage

LEVEL: Final = 0.9
"""Level of the interval that a diary keeps: that of the intervals on the page."""

TEXTS: Final = ("trip_id", "started_at")
FORECAST: Final = ("forecast_wh", "low_wh", "high_wh")
"""Columns of a forecast and of its interval."""

BOOK: Final = "book_"
"""Prefix of the columns with the forecast by the published values of the car, without its own trips."""

NUMBERS: Final = (
    *("trips_learned", "distance_m", "duration_s", "ambient_temperature_degc", "energy_wh"),
    *FORECAST,
    *(f"{BOOK}{name}" for name in FORECAST),
)
CAUSE: Final = "cause_"
"""Prefix of the columns with the forecast's energy by cause [Wh]."""

QUARTERS: Final = ("december_to_february", "march_to_may", "june_to_august", "september_to_november")
LATEST: Final = 20
"""Number of latest trips in the running score. A choice: about a month of commutes."""

COLD_DEGC: Final = 5.0
WARM_DEGC: Final = 20.0
"""Bounds of the classes of outside air: heating all the way, little climate control, cooling. A choice."""


@dataclass(frozen=True, slots=True)
class Score:
    """Score of forecasts against the measured energy of their trips.

    Attributes
    ----------
    trips : int
        Number of trips.
    error : float
        Mean of the absolute error of a trip divided by its energy; trips without consumption are left out.
    weighted_error : float
        Sum of the absolute errors over the sum of the energies.
    bias : float
        Sum of forecast less measured energy over the sum of the energies: positive when forecasts are high.
    coverage : float
        Share of the trips within their 90 % interval.
    width : float
        Sum of the widths of the intervals over the sum of the energies.
    inside : int
        Trips within their interval.
    needed_width : float
        The `width` at which the intervals, all scaled by one factor, would have held exactly 90 % of these trips. If it is far
        below `width`, the intervals were wider than necessary.

    Examples
    --------
    >>> table = pd.DataFrame({"energy_wh": [1000.0], "forecast_wh": [1100.0], "low_wh": [900.0], "high_wh": [1300.0]})
    >>> Score.of(table).to_dict()["coverage"]
    1.0
    """

    trips: int
    error: float
    weighted_error: float
    bias: float
    coverage: float
    width: float
    inside: int
    needed_width: float

    @classmethod
    def of(cls, table: pd.DataFrame, prefix: str = "") -> Score:
        """Score the rows of a diary.

        Parameters
        ----------
        table : DataFrame
            Columns `energy_wh`, and `forecast_wh`, `low_wh` and `high_wh` after `prefix`.
        prefix : str
            Prefix of the columns: `book_` for the forecasts without the car's own trips.

        Returns
        -------
        Score
            NaN for values that no row determines.

        Examples
        --------
        >>> table = pd.DataFrame({"energy_wh": [1000.0, 3000.0], "forecast_wh": [1100.0, 2700.0],
        ...                       "low_wh": [900.0, 2500.0], "high_wh": [1300.0, 2900.0]})
        >>> score = Score.of(table)
        >>> score.inside, score.coverage, score.width, round(score.needed_width, 6)
        (1, 0.5, 0.2, 0.3)
        """
        names = ("energy_wh", *(f"{prefix}{name}" for name in FORECAST))
        measured, forecast, low, high = (table[name].to_numpy(dtype=np.float64) for name in names)
        covered = Coverage.from_bounds(measured, low, high, LEVEL)
        total, consumed = float(np.abs(measured).sum()) or math.nan, measured > 0.0
        error, width = forecast - measured, float((high - low).sum() / total)
        relative = np.abs(error[consumed]) / measured[consumed]
        return cls(
            len(measured),
            float(np.mean(relative)) if consumed.any() else math.nan,
            float(np.abs(error).sum() / total),
            float(error.sum() / total),
            covered.share,
            width,
            covered.inside,
            covered.needed * width,
        )

    def to_dict(self) -> dict[str, float | int | None]:
        """Convert the score to plain values.

        Returns
        -------
        dict
            One key for each attribute; None instead of NaN.
        """
        return {name: value if math.isfinite(value) else None for name, value in asdict(self).items()}


def diary_entry(trip: Trip, forecast: Forecast, published: Forecast, trips_learned: int) -> dict[str, Any]:
    """Return the row of a trip in the diary.

    Parameters
    ----------
    trip : Trip
        Trip with measured energy.
    forecast, published : Forecast
        Forecasts at its departure: by the model as it was then, and by the model without the car's own trips.
    trips_learned : int
        Number of trips learned before.
    """
    started = trip.context.started_at
    return {
        "trip_id": trip.trip_id,
        "started_at": "" if started is None else started.isoformat(),
        "trips_learned": trips_learned,
        "distance_m": trip.distance_m,
        "duration_s": trip.duration_s,
        "has_heights": trip.has("elevation_m") or trip.has("grade"),
        "ambient_temperature_degc": forecast.plan.departure.ambient_temperature_degc,
        "energy_wh": trip.observed_energy_wh,
        **_columns(forecast),
        **_columns(published, BOOK),
        **{f"{CAUSE}{name}_wh": value for name, value in forecast.by_cause_wh.items()},
    }


def _season(rows: pd.DataFrame) -> dict[str, float | int | None]:
    """Return the sums and scores of the rows of one quarter."""
    score = Score.of(rows).to_dict()
    kept = {"trips": score["trips"], "error": score["weighted_error"], "coverage": score["coverage"]}
    return kept | {name: float(rows[name].sum()) for name in ("distance_m", "energy_wh")}


def causes_of(columns: Iterable[str]) -> dict[str, str]:
    """Return the columns of a diary that hold energy by cause, each with its cause.

    Examples
    --------
    >>> causes_of(["trip_id", "cause_air_wh"])
    {'cause_air_wh': 'air'}
    """
    return {name: name.removeprefix(CAUSE).removesuffix("_wh") for name in columns if name.startswith(CAUSE)}


def _columns(forecast: Forecast, prefix: str = "") -> dict[str, float]:
    """Return the values of the columns of a forecast."""
    values = forecast.energy_wh, *forecast.interval(LEVEL)
    return dict(zip((f"{prefix}{name}" for name in FORECAST), values, strict=True))


@dataclass(frozen=True, eq=False, repr=False)
class Diary:
    """Trips of one car in the order in which they were learned.

    Attributes
    ----------
    table : DataFrame
        One row per trip: `trip_id`, `started_at`, `trips_learned` before it, distance, duration and temperature, the measured
        `energy_wh`, the forecast at departure with its 90 % interval (`forecast_wh`, `low_wh`, `high_wh`), the same by the
        model without own trips (`book_forecast_wh`, `book_low_wh`, `book_high_wh`), and the forecast by cause.

    Examples
    --------
    >>> row = {"trip_id": "A", "ambient_temperature_degc": 3.0, "energy_wh": 1000.0, "forecast_wh": 1100.0,
    ...        "low_wh": 900.0, "high_wh": 1300.0, "book_forecast_wh": 1200.0, "book_low_wh": 900.0, "book_high_wh": 1500.0}
    >>> diary = Diary.from_entries([row])
    >>> len(diary), diary.score.error
    (1, 0.1)
    >>> adapted, published = diary.latest(5)
    >>> adapted.error < published.error
    True
    >>> list(diary.by_temperature()), diary.by_cause_wh()
    (['below 5 °C'], {})
    """

    table: pd.DataFrame

    @classmethod
    def from_entries(cls, entries: Iterable[Mapping[str, Any]]) -> Diary:
        """Make a diary.

        Parameters
        ----------
        entries : iterable of mapping
            One for each trip, keys as the columns of `table`.

        Returns
        -------
        Diary
            Without entries, no rows and all columns except those by cause.

        Raises
        ------
        KeyError, TypeError
            When an entry is not that of a trip.
        """
        rows = [{"trip_id": entry["trip_id"], **entry} for entry in entries]
        return cls(pd.DataFrame(rows, columns=None if rows else [*TEXTS, *NUMBERS]))

    def __len__(self) -> int:
        return len(self.table)

    @property
    def trip_ids(self) -> frozenset[str]:
        """Names of the trips in the diary."""
        return frozenset(self.table["trip_id"])

    @property
    def score(self) -> Score:
        """Score over all trips, each forecast before it was learned."""
        return Score.of(self.table)

    def latest(self, trips: int = LATEST) -> tuple[Score, Score]:
        """Score the last trips.

        Parameters
        ----------
        trips : int
            Number of trips.

        Returns
        -------
        adapted : Score
            Score of the forecasts by the model as it was at each trip.
        published : Score
            Score of the forecasts by the model without the car's own trips.
        """
        last = self.table.tail(trips)
        return Score.of(last), Score.of(last, BOOK)

    def by_temperature(self) -> dict[str, Score]:
        """Score the trips by outside air: below 5 °C, up to 20 °C, from 20 °C on, unknown.

        Returns
        -------
        dict of str to Score
            Classes without trips are left out.
        """
        air = self.table["ambient_temperature_degc"].to_numpy(dtype=np.float64)
        classes = {
            "below 5 °C": air < COLD_DEGC,
            "5 to 20 °C": (air >= COLD_DEGC) & (air < WARM_DEGC),
            "20 °C and more": air >= WARM_DEGC,
            "unknown": np.isnan(air),
        }
        return {name: Score.of(self.table[rows]) for name, rows in classes.items() if rows.any()}

    def by_season(self) -> dict[str, dict[str, float | int | None]]:
        """Sum trips, distance, measured energy, error and coverage over each quarter of the year that has trips.

        The quarters are those of meteorology: December to February is the first.

        Returns
        -------
        dict of str to dict
            Name of the quarter -> `trips`, `distance_m` [m], `energy_wh` [Wh], `error` and `coverage`: the
            `weighted_error` and the `coverage` of `Score`.

        Examples
        --------
        >>> Diary.from_entries([]).by_season()
        {}
        """
        month = pd.to_datetime(
            self.table["started_at"].replace("", None), errors="coerce", format="ISO8601", utc=True
        ).dt.month
        quarters = {name: self.table[(month % 12) // 3 == k] for k, name in enumerate(QUARTERS)}
        return {name: _season(rows) for name, rows in quarters.items() if len(rows)}

    def seen_degc(self, factor: str) -> tuple[float, float] | None:
        """Return the range of outside temperatures of the trips that show a factor of the car.

        Parameters
        ----------
        factor : str
            A name of `tripwatt.hybrid.factors.NAMES`.

        Returns
        -------
        (float, float) or None
            Lowest and highest [°C]; None if no trip shows the factor.

        Examples
        --------
        >>> Diary.from_entries([]).seen_degc("heating") is None
        True
        """
        air = self.table["ambient_temperature_degc"].to_numpy(dtype=np.float64)
        low, high = acts_between(factor)
        temperatures = air[(air >= low) & (air <= high)]
        return (float(temperatures.min()), float(temperatures.max())) if len(temperatures) else None

    def by_cause_wh(self) -> dict[str, float]:
        """Sum the energy of all trips by cause: the forecasts by cause, and the energy that was not forecast.

        Returns
        -------
        dict of str to float
            Cause -> energy [Wh]; `not_forecast` is measured less forecast energy. Empty if no forecast is by cause.
        """
        columns = causes_of(map(str, self.table))
        causes = {name: float(self.table[column].sum()) for column, name in columns.items()}
        if causes:
            causes["not_forecast"] = float((self.table["energy_wh"] - self.table["forecast_wh"]).sum())
        return causes

    def __repr__(self) -> str:
        score = self.score
        if not score.trips:
            return "<Diary without a trip>"
        error, width, needed = (
            percent(s, 1) for s in (score.weighted_error, score.width, score.needed_width)
        )
        within = f"{score.inside} within 90 % intervals of {width}, needed {needed}"
        return f"<Diary {score.trips} trips: error {error}, {within}>"
