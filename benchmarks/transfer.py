"""The paper's correctors on another vehicle: python -m benchmarks.transfer [--draws 4] [--write] [--resume].

Every ordered pair of the four vehicles: a corrector is fitted to the residuals of the source's trips and of 0, 5 or 20 own trips of the target, which
join the source's without a weight, and is scored on the target's other trips. Beside it: the same learners without physics, the learners
fitted to the own trips alone, the physics alone, and the population of all other cars. Values of the library that come from the target's set
are replaced in both vehicles. No model has season and weather, which the TUM's set alone names; heights are left out of pairs with the Leaf.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np
import pandas as pd
from PIL import Image
from tools import DOCS, ROOT
from tools.command import run
from tools.docs import pages
from tools.docs.transfer_page import figure_of, text_of

from benchmarks.cars import cars
from tripwatt.arrays import IntArray
from tripwatt.hybrid import EnergyModel, TripTable, build_table
from tripwatt.hybrid.factors import TripEvidence
from tripwatt.hybrid.learning import Experts
from tripwatt.hybrid.parameters import on_road
from tripwatt.learners.folds import Split
from tripwatt.population.adapting import in_order
from tripwatt.population.prior import population
from tripwatt.study.evaluation.cars import MIN_SCORED, CarTrips, evidence_of, population_without
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.folds import Execution, run_folds
from tripwatt.study.evaluation.hold_outs import HoldOut, random_draws
from tripwatt.study.evaluation.metrics import bootstrap_interval, paired_difference
from tripwatt.study.evaluation.table_models import PHYSICS, table_model
from tripwatt.study.evaluation.tasks import Fitted, Method, ModelSpec
from tripwatt.study.paper.correctors import boosting, forest, gamm
from tripwatt.study.report.html import png_bytes
from tripwatt.vehicles import without_data

OWN: Final = (0, 5, 20)
DRAWS: Final = 4
"""Random draws of own trips: a choice, because the forest's fits then take minutes."""
EVERY: Final = 60
"""Every so many rows of 1 s are kept for all learners, and the last of a trip: those of the GAMM elsewhere."""
COVARIATES: Final = ("time_s", "speed_m_s", "ambient_temperature_degc", "elevation_difference_m")
NONE: Final = ""
"""Source of what has rows of the target alone, and of the population."""
POPULATION: Final = "population"


MAKERS: Final[Mapping[str, Callable[..., EnergyModel]]] = {
    "gamm": partial(gamm, every_rows=1),
    "forest": forest,
    "boosting": boosting,
}
"""The paper's correctors with their settings; the rows are thinned already."""
LEARNERS: Final = tuple(
    table_model(f"{kind}{suffix}", kind, partial(make, simulation=simulation), simulation)
    for kind, make in MAKERS.items()
    for suffix, simulation in (("", "physics"), ("-without-physics", None))
)


@dataclass(frozen=True, slots=True)
class Adapted(Method[TripEvidence]):
    """The population of the other cars, adapted to the own trips."""

    experts: Experts

    def fit(self, data: TripEvidence, train: IntArray, seed: int) -> Fitted:
        """Adapt the population's experts to the own trips."""
        adapted = self.experts.learn(data.take(train))[0]

        def predict(test: IntArray) -> Any:
            scored = data.take(test)
            return scored.observed_wh - scored.residual_wh + adapted.predict(scored)[0]

        return Fitted(predict)

    def required_data(self, hold_out: HoldOut[Any], scored: IntArray) -> TripEvidence:
        """The evidence of the target's trips."""
        return hold_out.data


def table_of(car: CarTrips, dataset: str) -> TripTable:
    """Thinned rows of a vehicle's trips, simulated without values from a data set."""
    table = build_table(in_order(car.trips), {"physics": on_road(without_data(car.vehicle, dataset))})
    place = np.arange(len(table.groups)) - table.offsets[table.groups]
    kept = np.flatnonzero((place % EVERY == 0) | np.isin(np.arange(len(place)), table.last_rows))
    return replace(
        table,
        offsets=np.append(0, np.cumsum(np.bincount(table.groups[kept]))),
        covariates=table.covariates.reindex(columns=list(COVARIATES)).iloc[kept].dropna(axis=1, how="all"),
        observed_wh=table.observed_wh[kept],
        simulated_wh={"physics": table.simulated("physics")[kept]},
        totals=table.totals.iloc[kept],
    )


def joined(source: TripTable, target: TripTable) -> TripTable:
    """Trips of the source, then those of the target, with the covariates that both have."""
    return replace(
        target,
        trips=source.trips + target.trips,
        offsets=np.append(source.offsets[:-1], source.offsets[-1] + target.offsets),
        covariates=pd.concat([source.covariates, target.covariates], join="inner", ignore_index=True),
        observed_wh=np.append(source.observed_wh, target.observed_wh),
        simulated_wh={"physics": np.append(source.simulated("physics"), target.simulated("physics"))},
        totals=pd.concat([source.totals, target.totals], ignore_index=True),
    )


def with_source(hold_out: HoldOut[Any], source: TripTable) -> HoldOut[Any]:
    """The same scored trips, and the source's trips before the own ones."""
    n = len(source)
    splits = tuple(
        Split(s.number, np.append(np.arange(n), n + s.train), n + s.test, s.draw) for s in hold_out.splits
    )
    return replace(hold_out, table=joined(source, hold_out.table), data=None, splits=splits)


def comparisons(
    every: Sequence[CarTrips], draws: int, seed: int
) -> Iterator[tuple[dict[str, Any], Comparison]]:
    """Each target with each source, and with none: what is compared, and its splits. All sources have the same own trips."""
    bundled = population().without({car.dataset for car in every})
    for target in every:
        experts = population_without(every, target, bundled).experts(
            without_data(target.vehicle, target.dataset)
        )
        others = [c for c in every if c.dataset != target.dataset and c.vehicle.name != target.vehicle.name]
        sources = {c.name: table_of(c, target.dataset) for c in others if len(c.trips) >= 2 * MIN_SCORED}
        table, (_, evidence, _) = table_of(target, target.dataset), evidence_of(target, target.dataset)
        trips = HoldOut("transfer", target.name, table, evidence, ())
        adapted = ModelSpec(POPULATION, "population of cars", Adapted(experts))
        for own in OWN:
            drawn = random_draws(trips, (own,), draws if own else 1, MIN_SCORED, seed)
            if len(target.trips) < 2 * MIN_SCORED or not drawn.splits:
                continue
            about = {"target": target.name, "own": own, "scored": len(drawn.scored)}
            alone = (PHYSICS, adapted, *(LEARNERS if own else ()))
            yield {"source": NONE, **about}, Comparison(drawn, alone)
            for name, source in sources.items():
                yield (
                    {"source": name, **about},
                    Comparison(with_source(drawn, source), (PHYSICS, *LEARNERS)),
                )


def evaluate_transfer(
    every: Sequence[CarTrips], draws: int = DRAWS, seed: int = 0, execution: Execution | None = None
) -> dict[str, Any]:
    """The mean absolute percentage error of every model on every target, by source and own trips, with intervals by day."""
    about, planned = zip(*comparisons(every, draws, seed), strict=True)
    done = run_folds(planned, seed, execution or Execution(n_jobs=1))
    return {
        "kind": "transfer",
        "given": "given the driven speed trace",
        "draws": draws,
        "seed": seed,
        "cars": {car.name: car.vehicle.title for car in every},
        "rows": [
            {**where, **score}
            for where, comparison in zip(about, done, strict=True)
            for score in scores(comparison, seed)
        ],
    }


def scores(comparison: Comparison, seed: int) -> Iterator[dict[str, Any]]:
    """Each model's error, and its difference from the physics alone on the same trips; both intervals draw days."""
    days = [comparison.hold_out.table.days[i] for i in comparison.hold_out.scored]
    alone = comparison.ape(PHYSICS.name)
    for spec in comparison.specs:
        ape = comparison.ape(spec.name)
        less = paired_difference(ape, alone, seed, days)
        yield {
            "model": spec.name,
            "mape": float(ape.mean()),
            "mape_ci95": list(bootstrap_interval(ape, seed, days)),
            "less_physics": less.diff,
            "less_physics_ci95": list(less.ci95),
            "differs": less.significant,
        }


def publish(results: dict[str, Any]) -> None:
    """The results, the figure, and the generated part of docs/explanation/cars.md."""
    text = json.dumps(results, indent=1, ensure_ascii=False) + "\n"
    (DOCS / "results" / "transfer.json").write_text(text, encoding="utf-8")
    with Image.open(io.BytesIO(png_bytes(figure_of(results)))) as image:
        image.convert("RGB").quantize(64).save(DOCS / "images" / "transfer.png", optimize=True)
    pages.renew("explanation/cars.md", "transfer", text_of(results))


def main(draws: int = DRAWS, write: bool = False, resume: bool = False, jobs: int = -1) -> None:
    """Print the tables; `--write` renews the results, the figure and the part of docs/explanation/cars.md."""
    execution = Execution(
        jobs, ROOT / "out" / "transfer", resume, lambda k, n: print(f"{k} of {n}", flush=True)
    )
    results = evaluate_transfer(cars(), draws, execution=execution)
    print(text_of(results))
    if write:
        publish(results)


if __name__ == "__main__":
    run(main)
