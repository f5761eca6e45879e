"""What one trip costs, by car.

The same trip on a cold day, half in town and half on a fast road, with cars of the library and by physics alone. Each bar is the
consumption by cause, and the number its sum. Rolling and air drag depend on mass, tyres and shape, climate on whether a heat pump
or a heater warms the cabin.
"""

import matplotlib.pyplot as plt
import numpy as np

import tripwatt as tw

CARS = (
    "bmw_i3_60ah",
    "hyundai_kona_64",
    "nissan_leaf_24",
    "peugeot_e_208",
    "renault_zoe_ze50_r135",
    "tesla_model_3_sr_plus",
    "vw_e_golf",
    "vw_id3",
)
SHOWN = {
    "air": ("air drag", "#56b4e9"),
    "rolling": ("rolling", "#0072b2"),
    "driving": ("drivetrain and brakes", "#7f8fa6"),
    "base_load": ("base load", "#e69f00"),
    "climate": ("climate", "#d55e00"),
}
town = [
    {"length_m": 500.0, "speed_m_s": speed, "grade": 0.0} for speed in (8.0, 13.0) * 20
]
trip = tw.read_route([*town, {"length_m": 20_000.0, "speed_m_s": 30.0, "grade": 0.0}])
departure = tw.Departure(soc=0.9, ambient_temperature_degc=0.0)
table = tw.sweep(trip, list(CARS), departure=departure).sort_values(
    "energy_wh", ascending=False
)
titles = [tw.load_vehicle(name).title for name in table["car"]]
shown_wh = [f"energy_{cause}_wh" for cause in SHOWN if cause != "driving"]
table["energy_driving_wh"] = table["energy_wh"] - table[shown_wh].sum(axis=1)

figure, axes = plt.subplots(figsize=(6.0, 4.4), layout="constrained")
starts = np.zeros(len(table))
for cause, (label, colour) in SHOWN.items():
    part = (table[f"energy_{cause}_wh"] / table["distance_m"] * 100.0).to_numpy()
    axes.barh(titles, part, left=starts, color=colour, label=label)
    starts += part
for place, total in enumerate(starts):
    axes.annotate(
        f"{total:.1f}",
        (total, place),
        (4, 0),
        textcoords="offset points",
        va="center",
    )
axes.set(xlabel="consumption [kWh/100 km]", xlim=(0, 1.15 * starts.max()))
figure.legend(loc="outside upper center", ncols=3)
