"""Mass and tyres.

The consumption of a Peugeot e-208 over its mass and the rolling resistance of its tyres, on one trip and by physics alone. Each line joins
cars with the same consumption: along it, better tyres make up for more mass. The cross is the car of the library.
"""

import matplotlib.pyplot as plt
import numpy as np

import tripwatt as tw

town = [
    {"length_m": 500.0, "speed_m_s": speed, "grade": 0.0} for speed in (8.0, 14.0) * 10
]
trip = tw.read_route([*town, {"length_m": 10_000.0, "speed_m_s": 25.0, "grade": 0.0}])
car = tw.load_vehicle("peugeot_e_208")
crr = "road_load.rolling_resistance_coefficient"
values = {
    "body.curb_mass_kg": np.linspace(1200.0, 2000.0, 9),
    crr: np.linspace(0.006, 0.012, 7),
}
table = tw.sweep(
    trip, car, values, tw.Departure(soc=0.8, ambient_temperature_degc=20.0)
)
table["consumption"] = table["energy_wh"] / table["distance_m"] * 100.0
grid = table.pivot_table(index=crr, columns="body.curb_mass_kg", values="consumption")

figure, axes = plt.subplots(figsize=(6.0, 4.2), layout="constrained")
masses_kg, rolling = grid.columns, grid.index
axes.pcolormesh(masses_kg, rolling, grid, shading="gouraud", cmap="cividis")
lines = axes.contour(masses_kg, rolling, grid, np.arange(10, 19), colors="white")
axes.clabel(lines, fmt="%.0f")
of_car = car.body.curb_mass_kg, car.entries[crr].value
axes.plot(*of_car, "x", color="white", ms=10, mew=2.5)
axes.set(xlabel="kerb mass [kg]", ylabel="rolling resistance coefficient [1]")
axes.set_title("consumption [kWh/100 km]")
