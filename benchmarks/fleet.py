"""A fleet beyond one machine, measured: `python -m benchmarks.fleet [scale] [add] [store] [truth] [update] [batch] [peers] [real] [same]`.

    scale   store add and fleet fit on a local Dask cluster at two sizes (--trips SMALL LARGE --workers N)
    same    forecasts of one process, of a Dask cluster and of a cluster with a killed worker
    add     CPU cost of adding 1, 4 and 16 times as many trips, in commits of one size
    store   four writers at once, one killed; a million rows listed and filtered
    truth   deviations of vehicles found again; errors by number of own trips; coverage by car model
    update  one night against the whole fit, and the report after it
    batch   a thousand planned trips on two processes; cost and memory at two sizes (--trips SMALL LARGE)
    peers   statsmodels MixedLM and single fits on the same rows
    real    the TUM i3 and the Leafs of the VED set as one fleet

Prints each bar with its figure, and writes those of `scale` into docs/howto/fleet.md with --write. The synthetic fleet and its seed
are fixed.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from tools import DATA
from tools.command import run
from tools.docs import pages
from typer import Argument, BadParameter, Option

from benchmarks.many_vehicles import CAR_MODELS, FleetPlan, block_of_logs, many_vehicles, vehicle_truth
from benchmarks.measure import Row, not_measured, report
from tripwatt.fleet.executors import Workers
from tripwatt.fleet.features import FEATURES, SCALES, START
from tripwatt.fleet.mapping import (
    drive_row,
    drive_segments,
    file_tasks,
    map_store,
    read_rows,
    store_rows,
    usable_trips,
)
from tripwatt.fleet.model import fit_fleet, predict_rows, update_fleet
from tripwatt.fleet.registry import Registry
from tripwatt.fleet.statistics import ROWS, TripRows
from tripwatt.fleet.store import add_files, create_store, open_store
from tripwatt.fleet.store.rows import TRIPS, bucket_of
from tripwatt.hybrid.groups import fit_scales, group_posterior
from tripwatt.study.evaluation.fleets import evaluate_rows, mean_error
from tripwatt.study.report.fleets import ManagerReport
from tripwatt.trips import Trip

COMMAND = "python -m benchmarks.fleet"
MB = 1.0 / 1024.0


def cpu_s() -> float:
    """CPU time of this process and of its finished children."""
    return time.process_time() + sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])


@contextmanager
def dask(workers: int) -> Iterator[Any]:
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        Client(cluster) as client,
    ):
        yield cluster, client


def worker_figures() -> tuple[float, float]:
    """CPU time [s] and peak memory [MB] of a worker."""
    return time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * MB


def add_blocks(place: str, plan: Any, blocks: list[tuple[int, int]]) -> int:
    """Make and add some blocks; runs on a worker."""
    store = open_store(place)
    return sum(
        store.add(block_of_logs(plan, model, block), car_model=plan.car_models[model]).added
        for model, block in blocks
    )


def filled(place: str, plan: Any, workers: Workers) -> None:
    """A store with a synthetic fleet, added by all workers at once."""
    create_store(place, buckets=8)
    blocks = plan.blocks()
    several = [blocks[k :: 4 * workers.number] for k in range(4 * workers.number)]
    done = [workers.executor.submit(add_blocks, place, plan, part) for part in several if part]
    assert sum(f.result() for f in done) == plan.trips


def scale_once(trips: int, processes: int) -> dict[str, float]:
    """CPU and wall time and memory of adding and fitting one synthetic fleet."""
    plan = FleetPlan(trips, vehicles=min(200, max(8, trips // 10)))
    folder = tempfile.mkdtemp()
    try:
        with dask(processes) as (_, client):
            workers = Workers(client.get_executor(pure=False), processes)
            began, own = time.time(), time.process_time()
            filled(f"{folder}/s", plan, workers)
            added = time.time()
            cpu_added = sum(c for c, _ in client.run(worker_figures).values())
            store = open_store(f"{folder}/s")
            tasks = file_tasks(store, store.trip_rows(), f"{folder}/mapped")
            list(map_store(tasks, workers))
            cpu_mapped = sum(c for c, _ in client.run(worker_figures).values())
            again = time.time()
            model = fit_fleet(store, f"{folder}/w", workers)
            fitted = time.time()
            figures = client.run(worker_figures).values()
            return {
                "trips": float(model.trips),
                "wall_min": (fitted - again + added - began) / 60.0,
                "add_ms": 1000.0 * cpu_added / trips,
                "map_ms": 1000.0 * (cpu_mapped - cpu_added) / trips,
                "cpu_s": sum(c for c, _ in figures) + time.process_time() - own - (cpu_mapped - cpu_added),
                "worker_mb": max(m for _, m in figures),
            }
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def scale(small: int, large: int, workers: int) -> Iterator[Row]:
    sizes = [scale_once(n, workers) for n in (small, large)]
    exponent = float(np.log(sizes[1]["cpu_s"] / sizes[0]["cpu_s"]) / np.log(large / small))
    per_trip = sizes[1]["wall_min"] / large
    yield Row(
        f"20,000 trips on {workers} processes, from {large}",
        20_000 * per_trip,
        "min",
        note="≤ 20 for 2 processes",
    )
    yield Row(f"exponent of the CPU cost, {small} to {large} trips", exponent, most=1.05)
    yield Row("peak memory of a worker", sizes[1]["worker_mb"] / 1024.0, "GB", most=1.2)
    yield Row("the same at the smaller size", sizes[0]["worker_mb"] / 1024.0, "GB", note="flat")
    yield Row("from store to statistics", sizes[1]["map_ms"], "ms CPU a trip", most=15.0)
    yield Row("making and adding", sizes[1]["add_ms"], "ms CPU a trip")
    minutes = 1e6 * sizes[1]["cpu_s"] / large / 16.0 / 60.0
    yield Row("1e6 trips on 16 cores, on paper", minutes, "min", note="≤ 30")


def fitted(trips: int, vehicles: int, models: int = 4, days: float = 3.65) -> tuple[Any, Any, Any, str]:
    """Plan, store, model and folder of a synthetic fleet, in this process."""
    plan = FleetPlan(trips, vehicles=vehicles, car_models=CAR_MODELS[:models], days_between=days)
    folder = tempfile.mkdtemp()
    filled(f"{folder}/s", plan, Workers())
    store = open_store(f"{folder}/s")
    return plan, store, fit_fleet(store, f"{folder}/w", Workers()), folder


def rows_of(store: Any, folder: str) -> Any:
    return read_rows(map_store(file_tasks(store, store.trip_rows(), f"{folder}/rows"), Workers()))


def truth(trips: int = 1200, vehicles: int = 60) -> Iterator[Row]:
    """Twenty trips a vehicle by default."""
    plan, store, model, folder = fitted(trips, vehicles, days=18.0)  # a year of 20 trips
    rows = rows_of(store, folder)
    X, models = rows.X, rows.texts("car_model")
    own = {vehicle_truth(plan, n).vehicle_id: vehicle_truth(plan, n) for n in range(vehicles)}
    names = sorted(own)
    ids, who, simulated = rows.texts("vehicle_id"), rows.texts("driver"), rows.numbers("simulated_wh")
    estimated, true, driven = [], [], []
    for name in names:
        its = models == own[name].car_model
        shares = {driver: share for driver, _, share in own[name].drivers}
        driven.append(np.mean([shares[driver] for driver in who[ids == name]]) * simulated[its].mean())
        usual = X[its].mean(axis=0)
        base, _ = model.posterior.weights(own[name].car_model)
        estimated.append(float(usual @ (model.posterior.weights(own[name].car_model, name)[0] - base)))
        true.append(own_energy_wh(plan, own[name], rows.where(its)))
    together = [a + b for a, b in zip(true, driven, strict=True)]
    centred = [[v - np.mean([w for w, n in zip(values, names, strict=True) if own[n].car_model == own[m].car_model])
                for v, m in zip(values, names, strict=True)] for values in (estimated, true, together)]  # fmt: skip
    correlation = float(np.corrcoef(centred[0], centred[1])[0, 1])
    yield Row(
        f"deviations of vehicles at {trips // vehicles} trips, correlation with the truth",
        correlation,
        least=0.9,
    )
    text = "the same against the vehicle with the drivers of its trips"
    yield Row(text, float(np.corrcoef(centred[0], centred[2])[0, 1]))
    text = "the vehicle against the vehicle with its drivers, both true: what no estimate can part"
    yield Row(text, float(np.corrcoef(centred[1], centred[2])[0, 1]))
    evaluation = evaluate_rows(rows)
    for row in evaluation.own.to_dict("records"):
        best = min(row["own_only"], row["fleet_only"])
        yield Row(
            f"pooled error at {row['own_trips']:.0f} own trips over the better of own and fleet only",
            row["pooled"] / best,
            most=1.0,
        )

    later = FleetPlan(
        trips + 4 * vehicles, vehicles, plan.car_models, plan.seed, plan.minutes, plan.days_between
    )
    known = set(rows.texts("drive").tolist())
    inside: dict[str, list[bool]] = {}
    for log in many_vehicles(later):
        if log.trip_id in known:
            continue
        forecast = model.forecast(Trip.from_log(log), vehicle_id=log.context.car, driver=log.context.driver)
        low, high = forecast.interval(0.9)
        inside.setdefault(own[str(log.context.car)].car_model, []).append(
            low <= (log.observed_energy_wh or 0.0) <= high
        )
    for name, its in inside.items():
        share = 100.0 * float(np.mean(its))
        yield Row(f"90 % intervals of {name}, {len(its)} later trips", share, "%", least=87.0, most=93.0)
    shutil.rmtree(folder, ignore_errors=True)


def own_energy_wh(plan: Any, truth_: Any, rows: Any) -> float:
    """Energy that a vehicle's own deviations add to the mean trip of its model, from the simulated energy by cause."""
    x = rows.X.mean(axis=0) / SCALES
    energy = dict(zip(FEATURES, x, strict=True))
    rolling, drag, heat, base = truth_.own
    return float(
        rolling * energy["rolling"]
        + drag * energy["air"]
        + heat * energy["climate"]
        + base * energy["base_load"]
    )


def add(smallest: int = 512) -> Iterator[Row]:
    costs = []
    for times in (1, 4, 16):
        plan, folder, cost = (
            FleetPlan(times * smallest, minutes=6.0, days_between=3.0),
            tempfile.mkdtemp(),
            0.0,
        )
        store = create_store(f"{folder}/s")
        for model, block in plan.blocks():
            logs = block_of_logs(plan, model, block)
            began = cpu_s()
            store.add(logs, car_model=plan.car_models[model])
            cost += cpu_s() - began
        costs.append(cost)
        yield Row(f"adding {plan.trips} trips", 1000.0 * cost / plan.trips, "ms CPU a trip")
        shutil.rmtree(folder)
    exponent = math.log(costs[-1] / costs[0]) / math.log(16.0)
    yield Row(f"exponent of adding, {smallest} to {16 * smallest} trips", exponent, most=1.05)


def update(trips: int = 5000, vehicles: int = 200) -> Iterator[Row]:
    began = cpu_s()
    plan, store, model, folder = fitted(trips, vehicles)
    whole = cpu_s() - began
    later = FleetPlan(trips + trips // 100, vehicles, plan.car_models)
    known = {row["trip_id"] for row in store.trip_rows()}
    logs: dict[str, list[Any]] = {}
    for log in many_vehicles(later):
        if log.trip_id not in known:
            logs.setdefault(plan.car_models[int(str(log.context.car)[1:]) % len(plan.car_models)], []).append(
                log
            )
    began = cpu_s()
    for car_model, its in logs.items():
        store.add(its, car_model=car_model)
    updated, rows = update_fleet(model, store, f"{folder}/w", Workers())
    night = cpu_s() - began
    yield Row(f"a night of {len(rows)} trips, share of the cost of all {trips}", night / whole, most=0.03)
    began = cpu_s()
    every, _ = store_rows(store, usable_trips(store), f"{folder}/w", Workers())
    ManagerReport.of({}, updated, every).write(Path(folder) / "report")
    yield Row(f"the report of {vehicles} vehicles after it", cpu_s() - began, "s CPU", most=5.0)
    full = group_posterior(rows_of(store, folder).sums, model.posterior.scales)
    worst = float(np.abs(full.mean - updated.posterior.mean).max() / np.abs(full.mean).max())
    yield Row("weights of the update against those of all trips, relative", worst, most=1e-10)
    shutil.rmtree(folder, ignore_errors=True)


def links_file(path: Path, trips: int, vehicles: int, links: int = 60) -> None:
    """Planned trips of some links each, of 100 m to 1 km, written a thousand at a time."""
    rng = np.random.default_rng(1)
    writer = None
    for first in range(0, trips, 1000):
        some = np.arange(first, min(first + 1000, trips))
        of_link = np.repeat(some, links)
        table = pa.table(
            {
                "trip": [f"T{trip:06d}" for trip in of_link],
                "vehicle_id": [f"V{trip % vehicles:05d}" for trip in of_link],
                "length_m": rng.uniform(100.0, 1000.0, len(of_link)),
                "speed_m_s": rng.uniform(7.0, 30.0, len(of_link)),
                "grade": rng.normal(0.0, 0.01, len(of_link)),
                "soc": np.repeat(rng.uniform(0.6, 0.95, len(some)), links),
                "ambient_temperature_degc": np.repeat(rng.uniform(-5.0, 25.0, len(some)), links),
            }
        )
        writer = writer or pq.ParquetWriter(path, table.schema)
        writer.write_table(table)
    assert writer is not None
    writer.close()


MEASURED = """
import re, sys, time
from pathlib import Path
from tripwatt.command import app
app(sys.argv[1:], standalone_mode=False)
print(time.process_time(), re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1])
"""
"""Runs a command, then prints its CPU time [s] and its peak memory [KB]; `ru_maxrss` would have that of the benchmark."""


def batch_once(folder: str, trips: int, vehicles: int, jobs: int) -> tuple[float, float, float]:
    """Wall time [s] of `tripwatt fleet batch`, and CPU time [s] and peak memory [GB] of its first process."""
    links, out = Path(folder) / f"{trips}.parquet", Path(folder) / "out.parquet"
    links_file(links, trips, vehicles)
    arguments = ["fleet", "batch", f"{folder}/models", f"{links}", "--out", f"{out}", "--jobs", f"{jobs}"]
    began = time.perf_counter()
    command = [sys.executable, "-c", MEASURED, *arguments]
    printed = subprocess.run(command, capture_output=True, check=True, text=True).stdout
    wall = time.perf_counter() - began
    assert pq.read_metadata(out).num_rows == trips
    spent, peak = printed.split()[-2:]
    return wall, float(spent), float(peak) * MB / 1024.0


def batch(small: int, large: int, vehicles: int = 40) -> Iterator[Row]:
    """Planned trips of 60 links, from file to file."""
    *_, model, folder = fitted(10 * vehicles, vehicles)
    registry = Registry(Path(folder) / "models")
    registry.promote(registry.add(model))
    wall, *_ = batch_once(folder, 1000, vehicles, 2)
    yield Row("1,000 planned trips of 60 links, two processes", wall, "s", most=8.0)
    (_, first_s, first_gb), (_, last_s, last_gb) = (
        batch_once(folder, n, vehicles, 1) for n in (small, large)
    )
    exponent = float(np.log(last_s / first_s) / np.log(large / small))
    yield Row(f"exponent of the CPU cost, {small} to {large} planned trips", exponent, most=1.05)
    yield Row("CPU of each", 1000.0 * last_s / large, "ms")
    yield Row(f"peak memory of {large} planned trips over that of {small}", last_gb / first_gb, most=1.1)
    yield Row(f"peak memory of {large} planned trips", last_gb, "GB")
    shutil.rmtree(folder, ignore_errors=True)


def store_bars(rows: int = 1_000_000) -> Iterator[Row]:
    """Writers at once, and a long table of trips."""
    import pyarrow.dataset as ds

    folder = tempfile.mkdtemp()
    store = create_store(f"{folder}/s")
    vehicles = [f"V{k:05d}" for k in range(5000)]
    buckets = np.array([bucket_of(v, store.buckets) for v in vehicles], dtype=np.int32)
    rng = np.random.default_rng(0)
    which = rng.integers(len(vehicles), size=rows)
    days = rng.integers(365, size=rows)
    base: dict[str, Any] = {
        "bucket": buckets[which],
        "month": "2024-01",
        "batch": "0" * 20 + "-x",
        "digest": [f"{k:064x}" for k in range(rows)],
        "vehicle_id": np.array(vehicles, dtype=object)[which],
        "trip_id": [f"T{k}" for k in range(rows)],
        "car_model": "vw_id3",
        "driver": None,
        "started_at": (np.datetime64("2024-01-01") + days).astype(str).astype(object),
        "energy_from": "voltage and current",
        "as_logged": True,
        "findings": "[]",
        "context": "{}",
        "columns": "[]",
    }
    columns = []
    for field in TRIPS:
        value = base.get(field.name, 1.0 if pa.types.is_floating(field.type) else 1)
        filled_ = [value] * rows if isinstance(value, str | int | float | type(None)) else value
        columns.append(pa.array(filled_, field.type))
    store.rows.append(pa.table(columns, schema=TRIPS))
    store.compact()
    began = time.perf_counter()
    frame = store.trips(vehicle_id="V00017")
    one = time.perf_counter() - began
    began = time.perf_counter()
    some = store.trips(since="2024-05-01", until="2024-05-02", columns=["trip_id", "energy_wh"])
    day = time.perf_counter() - began
    began = time.perf_counter()
    listed = store.rows.read(["vehicle_id", "trip_id", "energy_wh"], ds.field("energy_wh") > 0.0).num_rows
    everything = time.perf_counter() - began
    yield Row(f"trips of one vehicle ({len(frame)}) of {rows} rows", one, "s", most=1.0)
    yield Row(f"trips of one day ({len(some)}) of {rows} rows", day, "s", most=1.0)
    yield Row(f"{listed} rows listed, three columns", everything, "s", most=1.0)
    shutil.rmtree(folder, ignore_errors=True)


def peers(trips: int = 2000, vehicles: int = 100) -> Iterator[Row]:
    """The mixed model of statsmodels on the same rows: random intercepts by vehicle for each of a few features."""
    import statsmodels.api as sm

    rows = synthetic_rows(trips, vehicles)
    # every tenth trip is held out
    held = np.arange(len(rows)) % 10 == 0
    train, test = rows.where(~held), rows.where(held)
    began = time.process_time()
    sums = train.sums
    pooled = group_posterior(sums, fit_scales(sums, START))
    ours_s = time.process_time() - began

    observed = test.numbers("observed_wh")
    ours = float(np.mean(np.abs(predict_rows(pooled, test)[0] - observed) / observed))
    root = 1.0 / np.sqrt(train.numbers("variance_wh2"))
    X, y = train.X * root[:, None], train.residual_wh * root
    keep = np.abs(X).max(axis=0) > 1e-9
    random = np.array([i for i in (0, 1, 6, 7) if keep[i]])  # air, rolling, base load, climate
    began = time.process_time()
    peer = sm.MixedLM(y, X[:, keep], groups=train.texts("vehicle_id"), exog_re=X[:, random]).fit(reml=True)
    theirs_s = time.process_time() - began
    energy = test.numbers("simulated_wh") + test.X[:, keep] @ np.asarray(peer.fe_params)
    for i, name in enumerate(test.texts("vehicle_id")):
        if name in peer.random_effects:
            energy[i] += float(test.X[i, random] @ np.asarray(peer.random_effects[name]))
    theirs = float(np.mean(np.abs(energy - observed) / observed))
    yield Row(f"error over that of statsmodels MixedLM ({100 * theirs:.2f} %)", ours / theirs, most=1.0)
    yield Row("times faster than statsmodels MixedLM", theirs_s / ours_s, least=10.0)
    began = time.process_time()
    names = sorted(set(train.texts("vehicle_id").tolist()))
    for name in names:
        its = train.where(train.texts("vehicle_id") == name).sums
        group_posterior(its, fit_scales(its, START))
    single_s = time.process_time() - began
    yield Row(f"the pooled fit against {len(names)} single fits", single_s / ours_s, "x faster")


def synthetic_rows(trips: int, vehicles: int) -> Any:
    """Rows of a synthetic fleet without a store."""
    plan = FleetPlan(trips, vehicles=vehicles)
    rows = []
    for log in many_vehicles(plan):
        car_model = plan.car_models[int(str(log.context.car)[1:]) % len(plan.car_models)]
        table = drive_segments(Trip.from_log(log), car_model)
        about = {
            "car_model": car_model,
            "vehicle_id": log.context.car,
            "driver": log.context.driver,
            "digest": log.trip_id,
        }
        if table is not None:
            rows.append(drive_row(Trip.from_log(log), table, about))
    return TripRows.join([pa.Table.from_pylist(rows, schema=ROWS)])


def real() -> Iterator[Row]:
    """The i3 of the TUM set and the Leafs of the VED set as one fleet, by their own trips and together."""
    if not (DATA / "tum").is_dir() or not (DATA / "ved").is_dir():
        yield not_measured("real cars as one fleet", f"no {DATA}")
        return
    folder = tempfile.mkdtemp()
    store = create_store(f"{folder}/s")
    add_files(store, DATA / "tum", car_model="bmw_i3_60ah", vehicle_id="i3", dataset="tum")
    add_files(store, DATA / "ved", car_model="nissan_leaf_24", dataset="ved")
    rows = rows_of(store, folder)
    ids = rows.texts("vehicle_id")
    sums = rows.sums
    scales = fit_scales(sums, START)
    fold = np.random.default_rng(0).permutation(len(rows)) % 10
    for vehicle in sorted(set(ids.tolist())):
        its = ids == vehicle
        errors = {"pooled": [], "own": []}  # type: dict[str, list[float]]
        only = fit_scales(rows.where(its).sums, START)
        for k in range(10):
            held = its & (fold == k)
            if not held.any():
                continue
            test = rows.where(held)
            errors["pooled"] += [mean_error(sums - test.sums, scales, test)] * len(test)
            if (its & ~held).any():
                errors["own"] += [mean_error(rows.where(its & ~held).sums, only, test)] * len(test)
        pooled_, own_ = (float(np.mean(e)) if e else float("nan") for e in errors.values())
        text = f"{vehicle} ({int(its.sum())} trips): fleet {100 * pooled_:.2f} %, alone {100 * own_:.2f} %"
        yield Row(f"{text}; ratio", pooled_ / own_, most=1.03 if its.sum() > 10 else math.inf)
    shutil.rmtree(folder, ignore_errors=True)


def same(trips: int = 160, vehicles: int = 16) -> Iterator[Row]:
    """One process, two processes of a cluster, and a cluster one of whose workers is killed."""
    plan = FleetPlan(trips, vehicles=vehicles, car_models=CAR_MODELS[:2])
    folder = tempfile.mkdtemp()
    filled(f"{folder}/s", plan, Workers())
    store = open_store(f"{folder}/s")
    models = {"one process": fit_fleet(store, f"{folder}/a", Workers())}
    with dask(2) as (_, client):
        models["Dask"] = fit_fleet(
            store, f"{folder}/b", Workers(client.get_executor(pure=False, retries=3), 2)
        )
        victim = next(iter(client.run(os.getpid).values()))
        killed: list[int] = []

        def kill(done: int, total: int) -> None:
            if done >= total // 3 and not killed:
                killed.append(victim)
                os.kill(victim, signal.SIGKILL)

        models["Dask, a worker killed"] = fit_fleet(
            store, f"{folder}/c", Workers(client.get_executor(pure=False, retries=3), 2), progress=kill
        )
        assert killed
    first = models.pop("one process")
    logs = [Trip.from_log(log) for log in list(many_vehicles(plan))[::8]]
    for name, model in models.items():
        sums = max(
            float(
                np.abs(getattr(first.sums, n) - getattr(model.sums, n)).max()
                / np.abs(getattr(first.sums, n)).max()
            )
            for n in ("xx", "xy", "yy")
        )
        yield Row(f"sums, {name} against one process, relative", sums, most=1e-10)
        worst = max(
            abs(
                first.forecast(t, vehicle_id=t.context.car).energy_wh
                - model.forecast(t, vehicle_id=t.context.car).energy_wh
            )
            for t in logs
        )
        yield Row(f"forecasts, {name} against one process", worst, "Wh", most=1e-6)
    shutil.rmtree(folder, ignore_errors=True)


def main(
    what: Annotated[list[str] | None, Argument()] = None,
    trips: tuple[int, int] = (2000, 20_000),
    workers: int = 2,
    json_to: Annotated[Path | None, Option("--json")] = None,
    write: bool = False,
) -> int:
    """Print the parts, all unless some are named; 1 when a bound is missed. `--write` renews the costs of `scale` in the docs."""
    parts: dict[str, Callable[[], Iterator[Row]]] = {
        "scale": lambda: scale(*trips, workers),
        "same": same,
        "add": add,
        "store": store_bars,
        "truth": truth,
        "update": update,
        "batch": lambda: batch(*trips),
        "peers": peers,
        "real": real,
    }
    if unknown := set(what or ()) - set(parts):
        raise BadParameter(f"{', '.join(sorted(unknown))}: none of {', '.join(parts)}")
    measured = {name: list(parts[name]()) for name in what or parts}
    if write:
        how = f"{COMMAND} scale --trips {trips[0]} {trips[1]} --workers {workers}"
        rows = "\n".join(f"| {row.name} | {row.figure} |" for row in measured["scale"])
        pages.renew("howto/fleet.md", "costs", f"`{how}` printed:\n\n| what | printed |\n|---|---:|\n{rows}")
    if json_to is not None:
        document = [vars(row) for rows in measured.values() for row in rows]
        json_to.write_text(json.dumps(document, indent=1), encoding="utf-8")
    return report(itertools.chain(*measured.values()))


if __name__ == "__main__":
    run(main)
