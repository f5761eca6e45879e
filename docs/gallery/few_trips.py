"""A new car, trip by trip.

A Volkswagen ID.3 without trips of its own is forecast by its published values and by what cars have in common, with all that is unknown of it
in the interval. Each logged trip shows more of the car: the errors on other trips fall, and the interval narrows. The trips are synthetic;
each dot is a trip that no model has seen.
"""

import matplotlib.pyplot as plt
import numpy as np

import tripwatt as tw
from tripwatt.study.synthetic import synthetic_fleet

COUNTS = (0, 1, 2, 3, 5, 8, 12, 20)
car = tw.load_vehicle("vw_id3")
base = tw.load_model("bmw_i3_tum")
trips = synthetic_fleet(32, vehicle=car).trips
own, test = trips[:20], trips[20:]
errors, half_widths = [], []
for count in COUNTS:
    model = tw.adapt(base, own[:count], car) if count else tw.for_car(base, car)
    forecasts = [model.forecast(trip) for trip in test]
    expected = np.array([forecast.energy_wh for forecast in forecasts])
    measured = np.array([trip.observed_energy_wh for trip in test])
    width = np.diff([forecast.interval(0.9) for forecast in forecasts], axis=1)[:, 0]
    errors.append(100.0 * np.abs(expected / measured - 1.0))
    half_widths.append(50.0 * width / expected)

figure, axes = plt.subplots(figsize=(6.0, 4.0), layout="constrained")
places = np.arange(len(COUNTS))
axes.plot(places, np.array(errors), ".", color="#0072b2", alpha=0.4)
axes.plot(places, np.mean(errors, axis=1), "o-", color="#0072b2", label="mean error")
axes.plot(
    places,
    np.mean(half_widths, axis=1),
    "s--",
    color="#d55e00",
    label="half of the 90 % interval",
)
axes.set_xticks(places, COUNTS)
axes.set(
    xlabel="trips of the car [1]",
    ylabel="share of the trip's energy [%]",
    ylim=(0, None),
)
axes.set_title(f"{len(test)} other trips of a {car.title}")
axes.legend()
