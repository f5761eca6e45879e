"""How well the road is known.

One real trip, forecast by a fit on fourteen others from different descriptions of its road: the driven speed trace, links with mean
speeds and heights, and links without heights in four kinds of country. A road of unknown heights may climb or fall, and the interval allows for it. In the
mountains it reaches further up than down, because not all that a climb takes is regained on the way down.
"""

import matplotlib.pyplot as plt
import numpy as np

import tripwatt as tw
from tripwatt.routes import links_of_trip, plan_on_links

LINK_M = 500.0
*logged, trip = tw.sample_trips().trips
model = tw.fit(logged, "bmw_i3_60ah")
links = links_of_trip(trip, LINK_M)
flat_links = [
    {"length_m": length_m, "speed_m_s": speed_m_s}
    for length_m, speed_m_s in zip(links.length_m, links.speed_m_s, strict=True)
]
without_heights = tw.read_route(flat_links).with_departure(trip.departure)
plans = {
    "driven speed trace": trip,
    f"links of {LINK_M:.0f} m": plan_on_links(trip, LINK_M),
}
plans |= {
    f"no heights, {terrain}": without_heights.with_departure(
        tw.Departure(terrain=terrain)
    )
    for terrain in ("flat", "hilly", "mountains", "unknown")
}

figure, axes = plt.subplots(figsize=(6.0, 4.2), layout="constrained")
for row, (name, plan) in enumerate(plans.items()):
    forecast = model.forecast(plan)
    colour = "#d55e00" if "no heights" in name else "#0072b2"
    for level, height in ((0.9, 0.3), (0.5, 0.6)):
        low_kwh, high_kwh = np.array(forecast.interval(level)) / 1000.0
        axes.barh(row, high_kwh - low_kwh, height, low_kwh, color=colour, alpha=0.45)
    axes.plot(forecast.quantile(0.5) / 1000.0, row, "k|", ms=14)
axes.axvline(
    trip.observed_energy_wh / 1000.0, color="#555555", ls="--", label="measured"
)
axes.set_yticks(range(len(plans)), list(plans))
axes.invert_yaxis()
axes.set(xlabel="energy of the trip [kWh]", title="median, 50 % and 90 % interval")
axes.legend()
