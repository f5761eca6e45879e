"""Mass and tyres.

The consumption of a Nissan Leaf over its mass and the rolling resistance of its tyres, on one trip and by physics alone. Each line joins
cars with the same consumption: along it, better tyres make up for more mass. The cross is the car of the library.
"""

import matplotlib.pyplot as plt
import numpy as np

import tripwatt as tw

town = [
    {"length_m": 500.0, "speed_m_s": speed, "grade": 0.0}
    for speed in (8.0, 14.0) * 10
]
trip = tw.read_route(
    [*town, {"length_m": 10_000.0, "speed_m_s": 25.0, "grade": 0.0}]
)
departure = tw.Departure(soc=0.8, ambient_temperature_degc=20.0)
masses_kg = np.linspace(1200.0, 2000.0, 9)
rolling = np.linspace(0.006, 0.012, 7)
wh = [
    [
        tw.simulate(
            trip,
            tw.load_vehicle(
                "nissan_leaf_24",
                overrides={
                    "body.curb_mass_kg": m,
                    "road_load.rolling_resistance_coefficient": r,
                },
            ),
            departure,
        ).simulated_energy_wh
        for m in masses_kg
    ]
    for r in rolling
]
consumption = np.array(wh) / trip.distance_m * 100.0

figure, axes = plt.subplots(figsize=(6.0, 4.2), layout="constrained")
axes.pcolormesh(masses_kg, rolling, consumption, shading="gouraud", cmap="cividis")
lines = axes.contour(
    masses_kg,
    rolling,
    consumption,
    levels=np.arange(10, 25),
    colors="white",
    linewidths=1,
)
axes.clabel(lines, fmt="%.0f")
base = tw.load_vehicle("nissan_leaf_24")
axes.plot(
    base.body.curb_mass_kg,
    base.road_load.rolling_resistance_coefficient,
    "x",
    color="#d55e00",
    ms=10,
    mew=2.5,
)
axes.set(
    xlabel="kerb mass [kg]",
    ylabel="rolling resistance coefficient [1]",
    title="consumption [kWh/100 km]",
)
