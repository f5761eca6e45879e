"""Charging times from a car's charging curve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput
from tripwatt.roads.maps.stations import Station
from tripwatt.routes.places import Place
from tripwatt.units import SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle

_CLASS_SOC: Final = (0.0, 0.1, 0.5, 0.8, 0.9, 1.0)
_CLASS_RATE_1_H: Final = (1.2, 1.6, 1.4, 0.8, 0.4, 0.1)
"""Power over the energy of a full display of a middle-class car with direct current [1/h], at displayed charges. A
choice: such cars take 10 to 80 % in about half an hour."""

_ALTERNATING_W: Final = 11_000.0
"""Highest power of the on-board charger if that of the car is not known: three phases with 16 A."""

_CLASS_ALTERNATING_1_H: Final = 0.3
"""The same over the energy of a full display [1/h]: a choice, since cars of 20 to 25 kWh take about 6.6 kW."""

EFFICIENCY: Final = 0.92
"""Energy that reaches the battery over the energy of the station, with direct current; a choice."""

OVERHEAD_S: Final = 300.0
"""Time for parking, plugging in and paying at a stop [s]. A choice."""

EUROPEAN: Final = frozenset({"type2", "type2_cable", "schuko", "typee", "tesla_destination", "type2_combo"})
AMERICAN: Final = frozenset({"type1", "tesla_destination", "type1_combo"})
"""Plugs of cars that are sold in Europe and in North America, by their names on OpenStreetMap."""
_REGIONS: Final = ((34.0, -50.0, 84.0, 45.0, EUROPEAN), (7.0, -170.0, 84.0, -50.0, AMERICAN))
"""South, west, north and east of Europe and of North America [°], and their plugs; elsewhere, plugs differ from country to country."""
_CHADEMO_CAR: Final = "nissan_leaf"
"""Beginning of the names of the library's cars that charge with CHAdeMO."""
_ALTERNATING_CARS: Final = ("fiat_500e", "smart_eq_fortwo")
"""The library's cars that charge with alternating current only: the Fiat of 2013 to 2019 by FCA US, technical data 500e; the Smart by Open EV Data
(https://github.com/KilowattApp/open-ev-data), which lists no direct current."""

WARM_DEGC: Final = 25.0
_COLD_LOSS_1_K: Final = 0.36 / 25.0
"""Share of the power with direct current that cells lose for each kelvin below `WARM_DEGC`. Motoaki, Yi and Salisbury (2018), Energy Policy 122:
after half an hour at 0 °C a car has 36 % less charge than at 25 °C. A sample of one model of car, whose air temperature stands for that of its cells."""
_MIN_COLD_FACTOR: Final = 0.2
"""Smallest factor of the power of cold cells. The line is not followed to 0: the coldest charges of the study took about three times as
long, and colder ones are not known."""


@dataclass(frozen=True, slots=True)
class ChargingCurve:
    """Charging power over the displayed state of charge.

    Attributes
    ----------
    soc : tuple of float
        Displayed states of charge, ascending from 0 to 1.
    power_w : tuple of float
        Highest power with direct current at each state of charge.
    alternating_w : float
        Highest power of the on-board charger.
    is_class : bool
        Whether the curve is that of a class of cars and not of the car.

    Raises
    ------
    InvalidInput
        If `soc` and `power_w` are not a curve.

    Examples
    --------
    >>> curve = ChargingCurve.from_class(50_000.0)
    >>> curve.is_class
    True
    >>> station = Station(47.0, 9.0, "", 20_000.0, direct_current=True)
    >>> slow, fast = curve.power_at(np.array([1.0, 0.5]), station)
    >>> bool(slow < fast < station.power_w)
    True
    """

    soc: tuple[float, ...]
    power_w: tuple[float, ...]
    alternating_w: float = _ALTERNATING_W
    is_class: bool = False

    def __post_init__(self) -> None:
        is_ascending = len(self.soc) == len(self.power_w) >= 2 and bool((np.diff(self.soc) > 0).all())
        if not (is_ascending and self.soc[0] == 0.0 and self.soc[-1] == 1.0 and min(self.power_w) > 0.0):
            got = f"{len(self.soc)} charges and {len(self.power_w)} powers"
            allowed = "as many powers above 0 as charges that rise from 0 to 1"
            raise InvalidInput.of("no charging curve", "charging_curve", got, allowed)

    @classmethod
    def from_vehicle(cls, vehicle: Vehicle, display_wh: float) -> ChargingCurve:
        """Return the curve of a car, or that of its class if the curve of the car is not known.

        Parameters
        ----------
        vehicle : Vehicle
            The car.
        display_wh : float
            Energy of its display from empty to full [Wh].

        Returns
        -------
        ChargingCurve
            The curve; `is_class` is true for the curve of a class.

        Examples
        --------
        >>> from tripwatt.vehicles import load_vehicle
        >>> ChargingCurve.from_vehicle(load_vehicle("nissan_leaf_40"), 37_600.0).power_w
        (41000.0, 45000.0, 36000.0, 15000.0)
        """
        curve = vehicle.charging
        if curve is None:
            return cls.from_class(display_wh)
        return cls(curve.displayed_soc, curve.power_w, curve.alternating_power_w)

    @classmethod
    def from_class(cls, display_wh: float) -> ChargingCurve:
        """Scale the curve of middle-class cars to the battery of a car.

        Parameters
        ----------
        display_wh : float
            Energy of the display from empty to full [Wh].

        Returns
        -------
        ChargingCurve
            The scaled curve, with `is_class` true.
        """
        alternating_w = min(_CLASS_ALTERNATING_1_H * display_wh, _ALTERNATING_W)
        return cls(
            _CLASS_SOC, tuple(rate * display_wh for rate in _CLASS_RATE_1_H), alternating_w, is_class=True
        )

    @property
    def most_w(self) -> tuple[float, float]:
        """Highest power with alternating and with direct current [W]."""
        return self.alternating_w, max(self.power_w)

    def power_at(self, soc: FloatArray, station: Station, cell_degc: float = WARM_DEGC) -> FloatArray:
        """Compute the power into the battery.

        Parameters
        ----------
        soc : ndarray
            Displayed states of charge, 0 to 1.
        station : Station
            Station at which the car charges.
        cell_degc : float
            Temperature of the cells [°C]; cold cells take less direct current.

        Returns
        -------
        ndarray
            Power [W] after the losses of charging, shape of `soc`.
        """
        accepted_w = np.interp(soc, self.soc, self.power_w)
        if station.direct_current:
            accepted_w = cold_factor(cell_degc) * accepted_w
        else:  # an almost full battery takes less than the on-board charger gives
            accepted_w = np.minimum(accepted_w, self.alternating_w)
        return np.asarray(EFFICIENCY * np.minimum(accepted_w, station.power_w))

    def seconds(
        self, levels: FloatArray, station: Station, display_wh: float, cell_degc: float = WARM_DEGC
    ) -> FloatArray:
        """Compute the time to charge from the first of some displayed charges to each of these charges. O(levels).

        Parameters
        ----------
        levels : ndarray, shape (levels,)
            Displayed states of charge, 0 to 1, ascending.
        station : Station
            Station at which the car charges.
        display_wh : float
            Energy of the display from empty to full [Wh].
        cell_degc : float
            Temperature of the cells [°C].

        Returns
        -------
        ndarray, shape (levels,)
            Time [s], without the overhead of a stop.

        Examples
        --------
        >>> curve = ChargingCurve((0.0, 1.0), (46_000.0, 46_000.0))
        >>> station = Station(47.0, 9.0, "", 100_000.0, direct_current=True)
        >>> (curve.seconds(np.array([0.2, 0.7]), station, 46_000.0) / 60.0).round(2).tolist()
        [0.0, 32.61]
        >>> (curve.seconds(np.array([0.2, 0.7]), station, 46_000.0, cell_degc=0.0) / 60.0).round(2).tolist()
        [0.0, 50.95]
        """
        middle = 0.5 * (levels[1:] + levels[:-1])
        seconds = np.diff(levels) * display_wh / self.power_at(middle, station, cell_degc) * SECONDS_PER_HOUR
        return np.concatenate(([0.0], np.cumsum(seconds)))


def plugs_of(car: str, place: Place) -> frozenset[str]:
    """Return the plugs that a car is assumed to have, by its name and the region of a place; empty if they are not known.

    Examples
    --------
    >>> sorted(plugs_of("nissan_leaf_40", Place(47.0, 9.0)) - plugs_of("vw_id3", Place(47.0, 9.0)))
    ['chademo']
    >>> "type2_combo" in plugs_of("fiat_500e", Place(47.0, 9.0))
    False
    """
    tesla = {"tesla_supercharger", "nacs"} if car.startswith("tesla") else set[str]()
    for south, west, north, east, plugs in _REGIONS:
        if south <= place.latitude_deg < north and west <= place.longitude_deg < east:
            is_leaf = car.startswith(_CHADEMO_CAR)
            if is_leaf or car in _ALTERNATING_CARS:
                return plugs - {"type1_combo", "type2_combo"} | {*["chademo"] * is_leaf}
            return plugs | tesla | {"tesla_supercharger_ccs"}
    return frozenset()


def cold_factor(cell_degc: float) -> float:
    """Return the power with direct current that cells of a temperature take, over that of warm cells.

    Examples
    --------
    >>> cold_factor(30.0), round(cold_factor(0.0), 2), cold_factor(-40.0)
    (1.0, 0.64, 0.2)
    """
    return float(np.clip(1.0 - _COLD_LOSS_1_K * (WARM_DEGC - cell_degc), _MIN_COLD_FACTOR, 1.0))
