"""What a fleet shows of its vehicles.

One model of twelve synthetic vehicles of two car models, some with one logged trip and some with many. A point is how much more a vehicle
takes on the same winter trip than the simulation of its car model with published values; the bar is its 90 % interval. A vehicle
without trips is forecast as its car model, and its interval contains the differences between vehicles. Own trips narrow it.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
from benchmarks.many_vehicles import CAR_MODELS, FleetPlan, many_vehicles, vehicle_truth
from scipy.stats import norm

import tripwatt as tw
from tripwatt.fleet.executors import InProcess
from tripwatt.fleet.features import trip_features
from tripwatt.fleet.model import Sampling, fit_fleet
from tripwatt.hybrid import segment_table

COUNTS = (1, 2, 4, 8, 16, 32)
plan = FleetPlan(384, vehicles=12, car_models=CAR_MODELS[:2], minutes=9.0, seed=3)
vehicles = {truth.vehicle_id: truth.car_model for truth in (vehicle_truth(plan, k) for k in range(12))}
trips_of = dict(zip(vehicles, np.repeat(COUNTS, 2), strict=True))
logs = list(many_vehicles(plan))
with TemporaryDirectory() as folder:
    store = tw.create_store(Path(folder, "store"), buckets=2)
    for vehicle, car_model in vehicles.items():
        its = [log for log in logs if log.context.car == vehicle]
        store.add(its[: trips_of[vehicle]], car_model=car_model)
    model = fit_fleet(store, Path(folder, "work"), InProcess(), sampling=Sampling(per_vehicle=4))

links = [
    {"length_m": 4000.0, "speed_m_s": 12.0, "grade": 0.0},
    {"length_m": 9000.0, "speed_m_s": 24.0, "grade": 0.0},
]
trip = tw.read_route(links).with_departure(tw.Departure(soc=0.8, ambient_temperature_degc=0.0))
figure, panels = plt.subplots(2, 1, figsize=(6.0, 4.8), sharex=True, layout="constrained")
for axes, car_model in zip(panels, plan.car_models, strict=True):
    run = tw.simulate(trip, car_model)
    features = 100.0 * trip_features(segment_table(trip, run))[0] / run.simulated_energy_wh
    rows = {0: None} | {trips_of[vehicle]: vehicle for vehicle, its in vehicles.items() if its == car_model}
    for row, vehicle in enumerate(rows.values()):
        mean, covariance = model.posterior.weights(car_model, vehicle)
        half = norm.ppf(0.95) * np.sqrt(features @ covariance @ features)
        colour = "#0072b2" if vehicle else "#d55e00"
        axes.errorbar(features @ mean, row, xerr=half, fmt="o", color=colour, capsize=3)
    axes.set_yticks(range(len(rows)), list(rows))
    axes.invert_yaxis()
    axes.set(ylabel="trips of the vehicle [1]", title=tw.load_vehicle(car_model).title)
axes.set(xlabel="energy beyond the simulation [%]")
