"""Distance, energy, cost and CO2 of a fleet's trips beside what the car models take for them, and the progress of drivers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from tripwatt.fleet import Warranty
from tripwatt.fleet.charging import EFFICIENCY
from tripwatt.fleet.deviations import deviations
from tripwatt.fleet.statistics import TripRows
from tripwatt.hybrid.groups import GroupPosterior


@dataclass(frozen=True, slots=True)
class ReportSettings:
    """What a manager asks of the report of a fleet.

    Attributes
    ----------
    probability, reserve : float
        As for `needs_by_hour`.
    drivers : bool
        Whether to compare the drivers.
    coldest_degc : float or None
        Outside temperature instead of that of the coldest week [°C].
    price : float
        Price of a kWh from the plug [€]. The default is a choice of the order of European tariffs of companies.
    co2_g : float
        CO2 of a kWh from the plug [g]. The default is a choice of the order of European electricity.
    groups : mapping of str to str
        Vehicle -> its group, such as its depot.
    new_at : mapping of str to str
        Vehicle -> its first day, such as 2022-05-01.
    warranty : Warranty
    """

    probability: float = 0.95
    reserve: float = 0.1
    drivers: bool = False
    coldest_degc: float | None = None
    price: float = 0.30
    co2_g: float = 250.0
    groups: Mapping[str, str] = field(default_factory=dict)
    new_at: Mapping[str, str] = field(default_factory=dict)
    warranty: Warranty = field(default_factory=Warranty)


def trip_energies(posterior: GroupPosterior, rows: TripRows) -> pd.DataFrame:
    """Tabulate the measured energy of trips beside what a usual vehicle of the car model takes for them.

    Returns
    -------
    DataFrame
        One row per trip: `car_model`, `vehicle_id`, `driver`, `month` (empty if unknown), `distance_m` [m], `energy_wh` and
        `expected_wh` [Wh]. The expectation has the weights of the car model, without the deviation of the vehicle and of the driver.
    """
    names = ["car_model", "vehicle_id", "driver"]
    frame: pd.DataFrame = rows.table.select([*names, "started_at", "distance_m"]).to_pandas()
    weights = {model: posterior.weights(model)[0] for model in frame["car_model"].unique()}
    correction = np.einsum("ij,ij->i", rows.X, frame["car_model"].map(weights).tolist()) if len(frame) else 0
    return frame.assign(
        month=frame.pop("started_at").fillna("").str[:7],
        energy_wh=rows.numbers("observed_wh"),
        expected_wh=rows.numbers("simulated_wh") + correction,
    )


def total_by(trips: pd.DataFrame, by: str, settings: ReportSettings) -> pd.DataFrame:
    """Sum the trips of each value of a column.

    Parameters
    ----------
    trips : DataFrame
        From `trip_energies`.
    by : str
        Name of the column.
    settings : ReportSettings

    Returns
    -------
    DataFrame
        One row per value, in the order of the values: `trips`; `distance_m` [m]; `energy_wh` and `expected_wh` [Wh] from the battery;
        `excess` [1], energy over expectation - 1; `wh_per_km`; `cost` [€], `cost_per_km` and `co2_kg` of the energy from the plug, of which the share
        `EFFICIENCY` reaches the battery; and `gain` [€], the cost of the energy beyond the expectation, negative if there is less.
    """
    columns = ["distance_m", "energy_wh", "expected_wh"]
    table = trips.groupby(by)[columns].sum().assign(trips=trips.groupby(by).size()).reset_index()
    energy, expected = table["energy_wh"], table["expected_wh"]
    plug_kwh = energy / (1000.0 * EFFICIENCY)
    return table.assign(
        excess=energy / expected - 1.0,
        wh_per_km=1000.0 * energy / table["distance_m"],
        cost=settings.price * plug_kwh,
        cost_per_km=1000.0 * settings.price * plug_kwh / table["distance_m"],
        co2_kg=1e-3 * settings.co2_g * plug_kwh,
        gain=settings.price * (energy - expected) / (1000.0 * EFFICIENCY),
    )


def totals(posterior: GroupPosterior, rows: TripRows, settings: ReportSettings) -> dict[str, pd.DataFrame]:
    """Sum the trips by vehicle, with `deviations`, by car model and group, and by month; vehicles and groups by falling gain."""
    trips = trip_energies(posterior, rows)
    vehicles = total_by(trips, "vehicle_id", settings)
    shares = deviations(posterior, rows).drop(columns="trips")
    vehicles = vehicles.merge(shares, on="vehicle_id").sort_values("gain", ascending=False, ignore_index=True)
    kinds = {"car model": total_by(trips, "car_model", settings).rename(columns={"car_model": "name"})}
    if settings.groups:
        trips["group"], vehicles["group"] = (
            t["vehicle_id"].map(settings.groups).fillna("none") for t in (trips, vehicles)
        )
        kinds["group"] = total_by(trips, "group", settings).rename(columns={"group": "name"})
    groups = pd.concat([table.assign(by=kind) for kind, table in kinds.items()])
    groups = groups.sort_values("gain", ascending=False, ignore_index=True)
    return {
        "vehicles": vehicles,
        "groups": groups,
        "months": total_by(trips[trips["month"] != ""], "month", settings),
    }


def drivers_by_name(posterior: GroupPosterior, rows: TripRows, price: float = 0.30) -> pd.DataFrame:
    """Compare drivers with the others of their vehicle, and each with his own earlier trips.

    Parameters
    ----------
    posterior : GroupPosterior
    rows : TripRows
    price : float
        Price of a kWh from the plug [€].

    Returns
    -------
    DataFrame
        `deviations` of drivers in the order of names; `cost` [€] of `share` on their dated trips; and `none`: the probability [1] that there is no difference or one of the other
        sign; `earlier` and `later`: excess [1] over the vehicle's model in the first and second half of the trips.
    """
    from scipy.special import ndtr

    compared = deviations(posterior, rows, drivers=True)
    names = ["car_model", "vehicle_id", "driver"]
    trips = trip_energies(posterior, rows).iloc[rows.chronological[0]]
    groups = rows.groups
    own = pd.DataFrame({group: posterior.weights(*group[:2])[0] for group in set(groups)})
    corrections = (rows.X[trips.index] * own[[groups[i] for i in trips.index]].to_numpy().T).sum(axis=1)
    trips["expected_wh"] = rows.numbers("simulated_wh")[trips.index] + corrections
    place = trips.groupby(names).cumcount() / trips.groupby(names)["driver"].transform("size")
    for name, half in (("earlier", place < 0.5), ("later", place >= 0.5)):
        sums = trips[half].groupby(names)[["energy_wh", "expected_wh"]].sum()
        excess = (sums["energy_wh"] / sums["expected_wh"] - 1.0).rename(name)
        compared = compared.join(excess, on=names)
    compared = compared.join(trips.groupby(names)["expected_wh"].sum(), on=names)
    compared["cost"] = price / (1000.0 * EFFICIENCY) * compared["share"] * compared.pop("expected_wh")
    compared["none"] = ndtr(-(compared["share"].abs() / compared["sd"]).astype(float))
    return compared.sort_values(["driver", "vehicle_id"], ignore_index=True)
