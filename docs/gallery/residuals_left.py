"""Residuals before and after the correction.

Each synthetic trip is forecast by a fit on the others. A point is what is left: measured less forecast energy, against the outside
temperature and the mean speed. The lines are trends. Physics with published values leaves them, because the car differs from its data
sheet and its climate control from the simulated one. The correction removes them. What remains is wind, traffic and chance.
"""

import matplotlib.pyplot as plt
import numpy as np

import tripwatt as tw
from tripwatt.study.evaluation import Execution
from tripwatt.study.synthetic import synthetic_fleet

MODELS = {
    "physics": ("physics alone", "#d55e00", "x"),
    "power-linear": ("with correction", "#0072b2", "o"),
}
trips = tw.audit(synthetic_fleet(40)).trips
run = tw.evaluate(
    trips,
    protocol="forecast",
    models=list(MODELS),
    hold_outs="leave_one_trip_out",
    execution=Execution(n_jobs=1),
)
about = {
    trip.trip_id: (
        trip.departure.ambient_temperature_degc,
        3.6 * trip.distance_m / trip.duration_s,
    )
    for trip in trips
}

figure, panels = plt.subplots(
    1, 2, figsize=(6.0, 4.0), sharey=True, layout="constrained"
)
for name, (label, colour, marker) in MODELS.items():
    rows = run.folds[run.folds["model"] == name]
    left = 100.0 * (rows["observed_energy_wh"] / rows["predicted_energy_wh"] - 1.0)
    for axes, x in zip(
        panels, np.array([about[trip] for trip in rows["trip"]]).T, strict=True
    ):
        axes.plot(x, left, marker, color=colour, alpha=0.6, ls="", label=label)
        ends = np.array([x.min(), x.max()])
        axes.plot(ends, np.polyval(np.polyfit(x, left, 1), ends), color=colour)
        axes.axhline(0.0, color="#999999", lw=0.8)
panels[0].set(xlabel="outside temperature [°C]", ylabel="measured less forecast [%]")
panels[1].set(xlabel="mean speed [km/h]")
figure.legend(
    *panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=2
)
