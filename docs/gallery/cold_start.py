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
PARTS = {"driving": "#7f8fa6", "base_load": "#e69f00", "climate": "#d55e00"}
speeds_m_s = (9.0, 13.0, 8.0, 14.0) * 18
town = tw.read_route(
    [{"length_m": 300.0, "speed_m_s": speed, "grade": 0.0} for speed in speeds_m_s]
)
frost_degc = -10.0
departure = tw.Departure(
    soc=0.8,
    ambient_temperature_degc=frost_degc,
    cabin_temperature_degc=frost_degc,
    battery_temperature_degc=frost_degc,
)
car = tw.load_vehicle("vw_id3")
run = tw.simulate(town, car, departure)
every = slice(None, None, 60 * STEP_MIN)  # of the samples, one each second
table = run.to_frame()[every]
driven_km = (
    cumulative_trapezoid(town.to_frame()["speed_m_s"], initial=0.0)[every] / 1000.0
)
in_step_wh = table.filter(like="energy").diff().dropna()
others_wh = in_step_wh["energy_base_load_wh"] + in_step_wh["energy_climate_wh"]
in_step_wh["energy_driving_wh"] = in_step_wh["energy_wh"] - others_wh

figure, (power, so_far) = plt.subplots(
    2, 1, figsize=(6.0, 4.6), sharex=True, layout="constrained", height_ratios=(3, 2)
)
minutes, floor_kw = table["time_s"].to_numpy() / 60.0, np.zeros(len(in_step_wh))
for part, colour in PARTS.items():
    kw = in_step_wh[f"energy_{part}_wh"].to_numpy() / 1000.0 * 60.0 / STEP_MIN
    at = {"width": 0.95 * STEP_MIN, "bottom": floor_kw, "align": "edge"}
    power.bar(minutes[:-1], kw, color=colour, label=part.replace("_", " "), **at)
    floor_kw = floor_kw + kw
power.set(ylabel="mean power [kW]", ylim=(0, 1.2 * floor_kw.max()))
power.set_title(f"{car.title} in town at {frost_degc:.0f} °C")
power.legend(ncols=3, loc="upper center", frameon=False)
per_km = table["energy_wh"].to_numpy()[1:] / driven_km[1:]
so_far.plot(minutes[1:], per_km / 10.0, "o-", ms=3, color="#0072b2")
so_far.set(xlabel="time since departure [min]", ylabel="so far [kWh/100 km]")
