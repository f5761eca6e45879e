"""What a fleet shows of its vehicles.

One model of synthetic vehicles of two car models, some with one logged trip and some with many. Their masses and base loads differ. A
point is how much more a vehicle takes on the same winter trip than the simulation of its car model with published values; the bar is
its 90 % interval. A vehicle without trips is forecast as its car model, with the differences between vehicles in its interval. Own
trips narrow it.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import norm

import tripwatt as tw
from tripwatt.fleet.executors import Workers
from tripwatt.fleet.features import trip_features
from tripwatt.fleet.model import Sampling, fit_fleet
from tripwatt.hybrid import segment_table
from tripwatt.study.synthetic import synthetic_fleet

CAR_MODELS = ("bmw_i3_60ah", "nissan_leaf_24")
COUNTS = (1, 2, 4, 8, 16, 24)
SPREADS = {"body.curb_mass_kg": 0.3, "auxiliaries.base_load_w": 0.9}
rng = np.random.default_rng(2)
vehicles = [(car_model, count) for car_model in CAR_MODELS for count in COUNTS]
with TemporaryDirectory() as folder:
    store = tw.create_store(Path(folder, "store"), buckets=2)
    for number, (car_model, count) in enumerate(vehicles):
        entries = tw.load_vehicle(car_model).entries
        own = {
            name: entries[name].value * rng.uniform(1.0 - most, 1.0 + most)
            for name, most in SPREADS.items()
        }
        logs = synthetic_fleet(
            count, number, vehicle=tw.load_vehicle(car_model, overrides=own)
        ).logs
        store.add(logs, car_model=car_model, vehicle_id=f"{car_model} {count}")
    model = fit_fleet(
        store, Path(folder, "work"), Workers(), sampling=Sampling(per_vehicle=4)
    )

links = [
    {"length_m": 4000.0, "speed_m_s": 12.0, "grade": 0.0},
    {"length_m": 9000.0, "speed_m_s": 24.0, "grade": 0.0},
]
trip = tw.read_route(links).with_departure(
    tw.Departure(soc=0.8, ambient_temperature_degc=0.0)
)
figure, panels = plt.subplots(
    2, 1, figsize=(6.0, 4.8), sharex=True, layout="constrained"
)
for axes, car_model in zip(panels, CAR_MODELS, strict=True):
    run = tw.simulate(trip, car_model)
    features = (
        100.0 * trip_features(segment_table(trip, run))[0] / run.simulated_energy_wh
    )
    for row, count in enumerate((0, *COUNTS)):
        mean, covariance = model.posterior.weights(car_model, f"{car_model} {count}")
        half = norm.ppf(0.95) * np.sqrt(features @ covariance @ features)
        colour = "#0072b2" if count else "#d55e00"
        axes.errorbar(features @ mean, row, xerr=half, fmt="o", color=colour, capsize=3)
    axes.set_yticks(range(1 + len(COUNTS)), (0, *COUNTS))
    axes.invert_yaxis()
    axes.set(ylabel="trips of the vehicle [1]", title=tw.load_vehicle(car_model).title)
axes.set(xlabel="energy beyond the simulation [%]")
