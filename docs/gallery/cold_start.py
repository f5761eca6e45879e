"""A cold start, minute by minute.

Where the power of a Volkswagen ID.3 goes on a frosty morning in town, by physics alone. At first the climate control heats a cold
cabin, then it replaces what the cabin loses. Driving takes as much at the end as at the start. The lower panel is the consumption
from departure up to each minute: the shorter the trip, the more energy it takes for each kilometre.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import cumulative_trapezoid

import tripwatt as tw

STEP_MIN = 2
speeds_m_s = (9.0, 13.0, 8.0, 14.0) * 18
town = tw.read_route(
    [{"length_m": 300.0, "speed_m_s": speed, "grade": 0.0} for speed in speeds_m_s]
)
frost = tw.Departure(
    soc=0.8,
    ambient_temperature_degc=-10.0,
    cabin_temperature_degc=-10.0,
    battery_temperature_degc=-10.0,
)
car = tw.load_vehicle("vw_id3")
run = tw.simulate(town, car, frost)
minutes = np.arange(0, run.time_s[-1] / 60.0, STEP_MIN)
by_cause_wh = {
    cause: np.interp(60.0 * minutes, run.time_s, energy_wh)
    for cause, energy_wh in run.cumulative_by_cause_wh.items()
}
total_wh = sum(by_cause_wh.values())
causes_wh = {
    "base load": by_cause_wh["base_load"],
    "climate": by_cause_wh["climate"],
}
causes_wh = {"driving": total_wh - sum(causes_wh.values()), **causes_wh}

figure, (power, so_far) = plt.subplots(
    2,
    1,
    figsize=(6.0, 4.6),
    sharex=True,
    layout="constrained",
    height_ratios=(3, 2),
)
floor_kw = np.zeros(len(minutes) - 1)
for (name, energy_wh), colour in zip(
    causes_wh.items(), ("#7f8fa6", "#e69f00", "#d55e00"), strict=True
):
    mean_kw = np.diff(energy_wh) / 1000.0 * 60.0 / STEP_MIN
    power.bar(
        minutes[:-1],
        mean_kw,
        0.95 * STEP_MIN,
        floor_kw,
        align="edge",
        color=colour,
        label=name,
    )
    floor_kw += mean_kw
power.set(ylabel="mean power [kW]", ylim=(0, 1.2 * floor_kw.max()))
power.set_title(f"{car.title} in town at {frost.ambient_temperature_degc:.0f} °C")
power.legend(ncols=3, loc="upper center", frameon=False)
driven_m = cumulative_trapezoid(
    town.to_frame()["speed_m_s"], run.time_s, initial=0.0
)
distance_km = np.interp(60.0 * minutes[1:], run.time_s, driven_m) / 1000.0
so_far.plot(
    minutes[1:], total_wh[1:] / distance_km / 10.0, "o-", ms=3, color="#0072b2"
)
so_far.set(xlabel="time since departure [min]", ylabel="so far [kWh/100 km]")
