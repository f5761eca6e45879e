"""The forecast on the way.

The forecast of a real trip, made again every minute from what the car has measured so far. What was driven is known, and what it
took shows how the rest will go. The interval of the whole trip narrows, and ends at the measured energy.
"""

import matplotlib.pyplot as plt
import numpy as np

import tripwatt as tw

*logged, trip = tw.sample_trips().trips
model = tw.fit(logged, "bmw_i3_60ah")
before = model.forecast(trip)
times_s = np.arange(60.0, trip.duration_s, 60.0)
forecasts = [
    before,
    *(
        before.update(trip.samples[trip.samples["time_s"] <= time_s])
        for time_s in times_s
    ),
]
minutes = np.array([0.0, *times_s]) / 60.0

figure, axes = plt.subplots(figsize=(6.0, 4.0), layout="constrained")
for level, alpha in ((0.9, 0.18), (0.5, 0.28)):
    low, high = (
        np.array([forecast.interval(level) for forecast in forecasts]).T / 1000.0
    )
    axes.fill_between(
        minutes,
        low,
        high,
        color="#0072b2",
        alpha=alpha,
        lw=0,
        label=f"{100 * level:.0f} % interval",
    )
axes.plot(
    minutes,
    [forecast.energy_wh / 1000.0 for forecast in forecasts],
    color="#0072b2",
    label="expected",
)
axes.axhline(
    trip.observed_energy_wh / 1000.0,
    color="#d55e00",
    ls="--",
    label="measured at the end",
)
axes.set(xlabel="time since departure [min]", ylabel="energy of the whole trip [kWh]")
narrower = 1.0 - np.diff(forecasts[len(forecasts) // 2].interval(0.9)) / np.diff(
    before.interval(0.9)
)
axes.set_title(f"half-way the interval is {100 * narrower[0]:.0f} % narrower")
axes.legend()
