"""How fast the GAMM engine is, on the regressions of the 60 TUM trips: `python -m benchmarks.gam`.

One thread: set OMP_NUM_THREADS=1. CPU seconds of this process. The peer is R's mgcv, run beside where Rscript is
present, else the time stored with its fit.
"""

from __future__ import annotations

import resource
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from tools import REFERENCE, command

from benchmarks.measure import Row, not_measured, report, seconds
from tripwatt_gamm import GAMM, Formula, Parametric, RandomEffect, Smooth, Tensor, Term

HERTZ = 10
ROWS_AT_10_HZ = 787_129
R_CODE = """
suppressMessages(library(mgcv))
d <- read.csv(commandArgs(TRUE)[1], stringsAsFactors = TRUE)
t0 <- proc.time()
b <- bam(y ~ weather + s(time, bs="ps", k=20) + s(tamb, bs="ps", k=12) + s(vel, bs="ps", k=12) +
  s(delev, bs="ps", k=12) + ti(tamb, delev, bs="ps", k=c(6,6)) + s(trip, bs="re"),
  family = scat(), data = d, method = "fREML", discrete = TRUE, nthreads = 1)
t1 <- proc.time() - t0
cat(t1[1] + t1[2])
"""


def formulas() -> dict[str, Formula]:
    """The models that are timed."""
    weather, season, trip = Parametric("weather"), Parametric("season"), RandomEffect("trip")
    surface = Smooth(("tamb", "delev"), k=30)
    wiggly = ("tamb", "vel", "delev")
    ps: tuple[Term, ...] = (
        weather,
        Smooth(("time",), "ps", 20),
        *(Smooth((name,), "ps", 12) for name in wiggly),
        Tensor(("tamb", "delev"), "ps", (6, 6)),
        trip,
    )
    paper: tuple[Term, ...] = (
        weather,
        season,
        Smooth(("time",), by="season"),
        Smooth(("tamb",)),
        Smooth(("vel",), by="season"),
        Smooth(("delev",), by="season"),
        surface,
        trip,
    )
    table2: tuple[Term, ...] = (
        weather,
        *(Smooth((name,)) for name in ("time", *wiggly)),
        Smooth(("time",), by="winter"),
        Smooth(("tamb",), by="winter"),
        surface,
        trip,
    )
    return {"ps": Formula("y", ps), "paper": Formula("y", paper), "table2": Formula("y", table2)}


def at_1_hz(folder: Path) -> pd.DataFrame:
    """The stored regression, one row a second."""
    columns = ["trip", "season", "weather", "time", "vel", "tamb", "delev", "y"]
    frame = pd.read_parquet(folder / "tum_1hz.parquet", columns=columns)
    frame = frame.astype(dict.fromkeys(("trip", "season", "weather"), "category"))
    return frame.assign(winter=(frame["season"] == "winter").astype(float))


def at_10_hz(frame: pd.DataFrame) -> pd.DataFrame:
    """Ten rows a second, interpolated within each trip: the size matters, not the values."""
    row = np.repeat(np.arange(len(frame)), HERTZ)[:ROWS_AT_10_HZ]
    share = np.tile(np.arange(HERTZ) / HERTZ, len(frame))[:ROWS_AT_10_HZ]
    trip = frame["trip"].cat.codes.to_numpy()
    after = np.minimum(row + 1, len(frame) - 1)
    after = np.where(trip[after] == trip[row], after, row)
    out = {}
    for name in ("time", "vel", "tamb", "delev", "y"):
        values = frame[name].to_numpy(dtype=float)
        out[name] = values[row] * (1 - share) + values[after] * share
    for name in ("trip", "season", "weather"):
        out[name] = frame[name].array.take(row)
    return pd.DataFrame(out)


def cpu_seconds(job: Callable[[], object], runs: int = 1) -> float:
    """Least CPU time [s] of some runs."""
    return seconds(job, runs, of=min, clock=time.process_time, warm_up=False)


def peer_seconds(folder: Path, frame: pd.DataFrame) -> tuple[str, float]:
    """CPU time [s] of mgcv's bam(discrete) on the model `ps` at 1 Hz, and how it was come by."""
    rscript = shutil.which("Rscript")
    if rscript is not None:
        with tempfile.TemporaryDirectory() as scratch:
            table, code = Path(scratch) / "rows.csv", Path(scratch) / "fit.R"
            frame.to_csv(table, index=False)
            code.write_text(R_CODE, encoding="utf-8")
            done = subprocess.run(
                [rscript, str(code), str(table)], capture_output=True, text=True, check=False
            )
        if done.returncode == 0:
            return "mgcv bam(discrete=TRUE), same run", float(done.stdout.split()[-1])
    stored = pd.read_csv(folder / "ps1hz_bamd_scat" / "scalars.csv")
    return "mgcv bam(discrete=TRUE), stored with its fit", float(stored["user"].iloc[0])


CURVES = {
    "two periods of a sine": lambda x: np.sin(4 * np.pi * x),
    "two humps": lambda x: (0.2 * x**11 * (10 * (1 - x)) ** 6 + 10 * (10 * x) ** 3 * (1 - x) ** 10) / 4,
    "an exponential": lambda x: np.exp(2 * x) / 3,
    "a smooth step": lambda x: np.tanh(12 * (x - 0.4)),
}


def covered(curve: Callable[[np.ndarray], np.ndarray], simulations: int, level: float = 0.95) -> float:
    """Share of simulations in which a simultaneous band holds a whole known curve at 400 rows."""
    grid = pd.DataFrame({"x": np.linspace(0, 1, 200)})
    truth, held = curve(grid["x"].to_numpy()), 0
    for seed in range(simulations):
        rng = np.random.default_rng(seed)
        x = rng.uniform(size=400)
        frame = pd.DataFrame({"x": x, "y": curve(x) + rng.normal(0, 0.5, 400)})
        band = GAMM("y ~ s(x, k=20)").fit(frame).intervals(grid, level, simultaneous=True)
        held += bool(((band["lower"] <= truth) & (truth <= band["upper"])).all())
    return held / simulations


def grouped(rows: int, levels: int) -> pd.DataFrame:
    """Two known curves, and random intercepts of many levels."""
    rng = np.random.default_rng(0)
    frame = pd.DataFrame({"x": rng.uniform(size=rows), "z": rng.uniform(size=rows)})
    level = rng.integers(0, levels, rows)
    curves = np.sin(6 * frame["x"]) + frame["z"] ** 2
    y = curves + rng.normal(0, 0.7, levels)[level] + rng.normal(0, 0.5, rows)
    return frame.assign(y=y, g=pd.Categorical([f"g{code}" for code in level]))


def many_levels() -> Iterator[Row]:
    """Fits with and without a random intercept of 2,000 levels."""
    frame = grouped(50_000, 2000)
    for text, formula, most in (
        ("two curves", "y ~ s(x) + s(z)", 0.2),
        ("two curves and 2,000 levels", 'y ~ s(x) + s(z) + s(g, bs="re")', 5.0),
    ):
        took = cpu_seconds(lambda formula=formula: GAMM(formula).fit(frame), runs=3)
        yield Row(f"gam gaussian, 50,000 rows, {text}", took, "CPU s", most=most)


def run() -> Iterator[Row]:
    """All measurements; those of real trips only where the regressions and mgcv's fits of them are not at hand."""
    # the band has its coverage on average over curves that its prior draws: those of even curvature have more, others less
    shares = {name: 100 * covered(curve, 500) for name, curve in CURVES.items()}
    for name, share in shares.items():
        yield Row(f"simultaneous 95 % bands that hold {name}, 500 simulations", share, "%")
    mean = sum(shares.values()) / len(shares)
    yield Row("the same, mean of these curves", mean, "%", least=93, most=97)
    yield from many_levels()
    folder = REFERENCE / "mgcv"
    if not folder.is_dir():
        yield not_measured("the GAMM engine", f"no {folder}")
        return
    models, frame = formulas(), at_1_hz(folder)

    def fitted(name: str) -> GAMM:
        return GAMM(models[name], "scat").fit(frame)

    def left_out(name: str) -> np.ndarray:
        return GAMM(models[name], "scat").leave_groups_out(frame, groups="trip")

    took = cpu_seconds(partial(fitted, "ps"), runs=3)
    peer, theirs = peer_seconds(folder, frame)
    text = "gam ps scat, 78,735 rows"
    yield Row(text, took, "CPU s", peer=peer, peer_value=theirs, ratio=theirs / took)
    yield Row(f"{text}, times {peer}", theirs / took, least=5)
    for name in ("paper", "table2"):
        yield Row(f"gam {name} scat, 78,735 rows", cpu_seconds(partial(fitted, name)), "CPU s", most=10)
    for name in models:
        text = f"gam {name} scat, leave one trip out, 60 folds, 78,735 rows"
        yield Row(text, cpu_seconds(partial(left_out, name)), "CPU s", most=60)
    frame = at_10_hz(frame)
    yield Row("gam ps scat, 787,129 rows", cpu_seconds(partial(fitted, "ps")), "CPU s", most=20)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    yield Row("peak memory of all of these", memory, "MB", most=700)


def main() -> int:
    """Print the rows; 1 when a bound is missed."""
    return report(run())


if __name__ == "__main__":
    command.run(main)
