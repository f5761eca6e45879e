"""What speed and cold cost.

The consumption of a BMW i3 on a flat road, at one constant speed after another and in three kinds of weather. Each band is the 90 %
interval. Air drag grows with the square of the speed. Heating takes its power for as long as the trip lasts, so the cold costs most at
low speed, and the most economical speed, marked by a dot, is higher in the cold.
"""

import matplotlib.pyplot as plt
import numpy as np

import tripwatt as tw

LENGTH_KM = 20.0
model = tw.load_model("bmw_i3_tum")
speeds_km_h = np.arange(20, 131, 10)
figure, axes = plt.subplots(figsize=(6.0, 4.2), layout="constrained")
for ambient_degc, colour in (
    (-10.0, "#0072b2"),
    (5.0, "#555555"),
    (20.0, "#d55e00"),
):
    departure = tw.Departure(
        soc=0.9,
        ambient_temperature_degc=ambient_degc,
        cabin_temperature_degc=ambient_degc,
        battery_temperature_degc=ambient_degc,
    )
    forecasts = []
    for speed_km_h in speeds_km_h:
        link = {
            "length_m": 1000.0 * LENGTH_KM,
            "speed_m_s": speed_km_h / 3.6,
            "grade": 0.0,
        }
        forecasts.append(model.forecast(tw.read_route([link]), departure))
    expected = np.array([forecast.energy_wh for forecast in forecasts]) / (
        10.0 * LENGTH_KM
    )
    low, high = np.array([forecast.interval(0.9) for forecast in forecasts]).T / (
        10.0 * LENGTH_KM
    )
    least = expected.argmin()
    label = f"{ambient_degc:.0f} °C, least at {speeds_km_h[least]} km/h"
    axes.fill_between(speeds_km_h, low, high, color=colour, alpha=0.18, lw=0)
    axes.plot(speeds_km_h, expected, color=colour, label=label)
    axes.plot(speeds_km_h[least], expected[least], "o", color=colour)
axes.set(
    xlabel="constant speed [km/h]",
    ylabel="consumption [kWh/100 km]",
    ylim=(0, None),
)
axes.set_title(f"{model.vehicle.title}: expected, and 90 % interval")
axes.legend()
