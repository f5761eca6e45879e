"""What the residual power depends on.

Measured less simulated power of half-minute segments of 15 real trips, explained by a generalised additive mixed model. The
curves are smooth effects with their 95 % bands. At the same time each trip has a random intercept and a random slope of speed, because
the segments of a trip share its load, wind and road. Without them the bands would be too narrow.
"""

import matplotlib.pyplot as plt
import numpy as np

import tripwatt as tw
from tripwatt.hybrid import segment_trips
from tripwatt_gamm import GAMM

trips = tw.audit(tw.sample_trips()).trips
table = segment_trips(trips, tw.load_vehicle("bmw_i3_60ah"))
segments = table.features.assign(
    residual_kw=table.residual_w / 1000.0,
    trip=np.array(table.trip_ids)[table.groups],
)
model = GAMM(
    "residual_kw ~ s(speed_m_s) + s(ambient_temperature_degc)"
    ' + s(trip, bs="re") + s(trip, speed_m_s, bs="re")'
).fit(segments)

figure, panels = plt.subplots(2, 2, figsize=(6.0, 4.8), layout="constrained")
titles = (
    "smooth of speed",
    "smooth of temperature",
    "intercept of each trip",
    "slope of each trip",
)
axis = (
    "speed [m/s]",
    "outside temperature [°C]",
    "normal quantile [kW]",
    "normal quantile [kW s/m]",
)
for axes, effect, title, label in zip(
    panels.flat, model.effects(segments).values(), titles, axis, strict=True
):
    effect.plot(axes)
    unit = "[kW]" if "slope" not in title else "[kW s/m]"
    axes.set(title=title, xlabel=label, ylabel=f"effect {unit}")
