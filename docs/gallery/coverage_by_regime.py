"""Coverage by regime.

A linear correction of published values is fitted on a quarter of the synthetic trips and forecasts the others. A point is the share of
trips whose measured energy is inside of the interval; it should be on the dashed line of its level. The bar is the 95 % interval of
that share, which is wide where trips are few. Intervals that hold over all trips can be too narrow in one regime and too wide in
another, so each is counted.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import binomtest

import tripwatt as tw
from tripwatt.study.synthetic import synthetic_fleet

trips = tw.audit(synthetic_fleet(96, seed=1)).trips
model = tw.fit(trips[:24], "bmw_i3_60ah", corrector="linear", identified=False)
test = trips[24:]
forecasts = [model.forecast(trip) for trip in test]
measured_wh = np.array([trip.observed_energy_wh for trip in test])
degc = np.array([trip.departure.ambient_temperature_degc for trip in test])
km = np.array([trip.distance_m for trip in test]) / 1000.0
cold, far = 10.0, float(np.median(km))
regimes = {
    "all": km > 0.0,
    f"below {cold:.0f} °C": degc < cold,
    f"{cold:.0f} °C or more": degc >= cold,
    f"below {far:.0f} km": km < far,
    f"{far:.0f} km or more": km >= far,
}

figure, axes = plt.subplots(figsize=(6.0, 4.4), layout="constrained")
for shift, (level, colour) in enumerate(
    {0.9: "#0072b2", 0.8: "#009e73", 0.5: "#d55e00"}.items()
):
    low_wh, high_wh = np.array([forecast.interval(level) for forecast in forecasts]).T
    inside = (low_wh <= measured_wh) & (measured_wh <= high_wh)
    axes.axhline(100.0 * level, color=colour, ls="--", lw=1)
    for place, mask in enumerate(regimes.values()):
        share = binomtest(int(inside[mask].sum()), int(mask.sum()))
        ends = np.array(share.proportion_ci(0.95, "wilson")) * 100.0
        at = place + 0.15 * (shift - 1)
        axes.plot([at, at], ends, color=colour, lw=2)
        label = f"{100 * level:.0f} % interval" if place == 0 else None
        axes.plot(at, 100.0 * share.statistic, "o", color=colour, label=label)
axes.set_xticks(
    range(len(regimes)),
    [f"{name}\n{mask.sum()} trips" for name, mask in regimes.items()],
    fontsize=9,
)
axes.set(ylabel="measured energy inside [% of trips]", ylim=(0, 103))
figure.legend(loc="outside upper center", ncols=3)
