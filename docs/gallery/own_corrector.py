"""A corrector of your own.

Any regressor of scikit-learn can correct the simulation, on trips that are tables of pandas. The
boosting below is fitted on fourteen real trips and forecasts the last one; then it is scored beside
the linear correction of tripwatt and physics alone, on five parts of the trips in turn. A box is the
middle half of the errors, a diamond their mean. The title has the forecast of the last trip.
"""

import matplotlib.pyplot as plt
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.model_selection import KFold

import tripwatt as tw
from tripwatt.study.evaluation import Execution

tables = {log.trip_id: log.to_frame() for log in tw.sample_trips().logs}
logs = tw.read_logs(tables)
*known, last = tw.audit(logs).trips

boosting = HistGradientBoostingRegressor(max_iter=60, max_leaf_nodes=4, random_state=0)
model = tw.fit(known, "bmw_i3_60ah", corrector=boosting)
low, high = (energy / 1000.0 for energy in model.forecast(last).interval(0.9))

run = tw.evaluate(
    logs,
    protocol="forecast",
    models={"physics": "physics", "linear": "power-linear", "boosting": boosting},
    hold_outs=KFold(5),
    execution=Execution(n_jobs=1),
)

figure, axes = plt.subplots(figsize=(6.0, 3.8), layout="constrained")
run.plot(axes)
axes.set_ylabel("model")
measured = (last.observed_energy_wh or 0.0) / 1000.0
axes.set_title(f"last trip: {low:.1f} to {high:.1f} kWh, measured {measured:.1f} kWh")
