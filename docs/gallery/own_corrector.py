"""A corrector of your own.

Any regressor of scikit-learn can correct the simulation, in place of a corrector of tripwatt. Here two of them stand beside the linear
correction of tripwatt and physics alone. Each is fitted on four fifths of 15 real trips and scored on the rest. A box is the middle
half of the errors, a diamond their mean. The title compares two models trip by trip: a difference counts where its 95 % interval
leaves out zero.
"""

import matplotlib.pyplot as plt
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import RidgeCV
from sklearn.model_selection import KFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

import tripwatt as tw
from tripwatt.study.evaluation import Execution

run = tw.evaluate(
    tw.sample_trips(),
    protocol="forecast",
    models={
        "physics": "physics",
        "power-linear": "power-linear",
        "my ridge": make_pipeline(StandardScaler(), RidgeCV((1e2, 1e3, 1e4))),
        "my boosting": HistGradientBoostingRegressor(
            max_iter=60, max_leaf_nodes=4, random_state=0
        ),
    },
    hold_outs=KFold(5),
    execution=Execution(n_jobs=1),
)
pair = run.compare("my boosting", "power-linear")
low, high = (100.0 * end for end in pair.ci95)

figure, axes = plt.subplots(figsize=(6.0, 3.8), layout="constrained")
run.plot(axes)
axes.set_ylabel("model")
axes.set_title(
    f"my boosting less power-linear: {100.0 * pair.diff:+.1f} points, {low:+.1f} to {high:+.1f}"
)
