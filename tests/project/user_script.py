"""What a user may write with every name of `tripwatt`: `test_types.py` has it checked by mypy and pyright, both strict."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

import tripwatt as tw


def plans(route: Path) -> list[tw.Plan]:
    links: list[Mapping[str, float | None]] = [{"length_m": 3000.0, "speed_m_s": 12.0, "grade": None}]
    rows = [{"length_m": 12_000.0, "speed_m_s": 25.0}]
    table = pd.DataFrame(rows)
    return [tw.read_route(source, trip_id="commute") for source in (route, str(route), links, rows, table)]


def charge_to_leave_with(plan: tw.Plan) -> float:
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=-5, payload_mass_kg=80.0)
    forecast: tw.Forecast = tw.forecast(plan, departure, car="vw_id3")
    low, high = forecast.interval(0.9)
    if forecast.energy_wh > high or forecast.p_arrive(0.1) < 0.5:
        return low
    half: pd.DataFrame = forecast.to_frame()
    later = forecast.update_since_departure(half[["time_s", "displayed_soc"]].head(3))
    figure: Figure = later.plot()
    figure.show()
    return tw.soc_needed(tw.leaving_with(later, 0.7), reserve=0.1)


def by_cause(plan: tw.Plan) -> dict[str, float]:
    car = tw.load_vehicle("bmw_i3_60ah")
    simulation = tw.simulate(plan, car)
    print(
        tw.sweep(plan, car, {"mass": [1300.0, 1500.0]})["energy_wh"].max(),
        tw.sweep([plan], car)["soc"].min(),
    )
    figure: Figure = simulation.plot(ax=Figure().subplots())
    figure.clear()
    more: dict[str, float] = tw.forecast(plan, car=car).by_cause_wh
    return {cause: energy - simulation.by_cause_wh.get(cause, 0.0) for cause, energy in more.items()}


class PerKilometre:
    """A whole model."""

    wh_m = 0.0

    def fit(self, trips: Sequence[tw.Trip]) -> None:
        self.wh_m = sum(trip.observed_energy_wh or 0.0 for trip in trips) / sum(t.distance_m for t in trips)

    def predict(self, trip: tw.Plan) -> float:
        return self.wh_m * trip.distance_m


class Halves:
    """A splitter."""

    def split(
        self, X: Sequence[tw.Trip], y: object = None, groups: object = None
    ) -> list[tuple[list[int], list[int]]]:
        even = list(range(0, len(X), 2))
        odd = list(range(1, len(X), 2))
        return [(even, odd), (odd, even)]


def trips_of_logs(folder: Path) -> tuple[tw.Trip, ...]:
    fleet = tw.read_logs(folder, "table") if folder.is_dir() else tw.sample_trips("tum")
    audit = tw.audit(fleet)
    for finding in audit.findings:
        print(finding.trip, finding.what)
    car = tw.load_vehicle("bmw_i3_60ah")
    run = tw.evaluate(
        fleet.trips, models=["constant", PerKilometre()], car=car, hold_outs=[Halves(), "audited"]
    )
    pair = run.compare("constant", "PerKilometre")
    print(
        run.to_frame()["mape"].min(),
        run.folds["model"].unique(),
        pair.diff,
        pair.significant,
        audit.lost_distance_m,
    )
    return audit.trips or tw.read_trips(folder)


def fitted(trips: Sequence[tw.Trip], folder: Path) -> tw.ForecastModel:
    tables = [
        trip.to_frame() for trip in tw.read_logs({trip.trip_id: trip.to_frame() for trip in trips}).logs
    ]
    model = tw.fit(tables if folder.exists() else trips, "bmw_i3_60ah", covariates=["traffic"])
    model.forecast(trips[0], tw.Departure(covariates={"traffic": 2, "driver": "anna"}))
    tw.save_model(model, folder)
    described = tw.describe_car(mass_kg=1800.0, consumption_kwh_per_100km=16.0)
    others = [tw.for_car(tw.load_model(folder), described), tw.adapt(model, trips[:3], "vw_id3")]
    return min(others, key=lambda other: other.forecast(trips[0]).sd_wh)


def kept(logs: Path, folder: Path) -> list[str]:
    store = tw.create_store(folder / "store")
    print(store.add(tw.read_logs(logs, "table"), car_model="vw_id3", vehicle_id="V1").added)
    ids = [str(row["trip_id"]) for row in tw.open_store(folder / "store").trip_rows()]
    car = tw.create_car(folder / "car", "vw_id3")
    return [*ids, car.name, tw.open_car(folder / "car").vehicle.title]


def journey(start: str, end: str, folder: Path) -> tuple[bool, float]:
    found: tw.Journey = tw.plan_journey([start, end], tw.Departure(soc=0.6), atlas=folder)
    return found.arrives, found.forecast.soc_arrival


def without_a_road(model: tw.ForecastModel) -> float:
    needed: tw.Need = tw.need(50.0, "city", tw.Departure(ambient_temperature_degc=-5), model=model)
    far: tw.Range = tw.range_km(0.5, model=model)
    return min(needed.energy_quantile_wh, far.range_m)


def advised(plan: tw.Plan) -> list[str]:
    found: tw.Advice = tw.advise(plan, tw.Departure(soc=0.4), reserve=0.1)
    return [one.actions[0].code for one in found.singly if one.difference.interval(0.9)[1] < 0.0]


def main() -> None:
    print(tw.__version__)
    try:
        print([charge_to_leave_with(plan) for plan in plans(Path(sys.argv[1]))])
    except tw.InvalidInput as error:
        print([fault.fix for fault in error.faults])


if __name__ == "__main__":
    main()
