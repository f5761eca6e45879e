"""Executors: this process, its cores, a cluster."""

import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.fleet.executors import _TASKS_PER_WORKER, Workers, executor_for
from tripwatt.fleet.mapping import file_tasks, map_store, read_rows

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def test_processes_of_this_machine_are_an_executor():
    with executor_for(2) as workers:
        assert workers.number == 2
        assert sorted(workers.map(abs, [-3, 2, -1])) == [1, 2, 3]
        assert workers.executor.submit(os.getpid).result() != os.getpid()


def test_dask_with_a_killed_worker_gives_the_same_rows(fleet):
    distributed = pytest.importorskip("distributed", reason="needs the extra tripwatt[fleet]")
    _, store, model, folder = fleet
    tasks = file_tasks(store, store.trip_rows(), folder / "dask")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        with distributed.Client(cluster, set_as_default=False) as client:
            victim = next(iter(client.run(os.getpid).values()))
        done = []

        def kill(finished, total):
            if not done:
                os.kill(victim, signal.SIGKILL)
            done.append(finished)

        with executor_for(cluster=cluster.scheduler_address) as workers:
            assert workers.number == 2
            rows = read_rows(map_store(tasks, workers, kill))
    assert done[-1] == len(tasks)
    assert np.array_equal(rows.sums.xx, model.sums.xx)


def test_executors_keep_few_tasks_waiting_and_pass_errors_on():
    running, most = [], []

    def work(task):
        running.append(task)
        most.append(len(running))
        time.sleep(0.005)
        running.remove(task)
        return task

    with ThreadPoolExecutor(2) as pool:
        assert sorted(Workers(pool, 2).map(work, list(range(40)))) == list(range(40))
    assert max(most) <= 2
    submitted = []

    class Counting(ThreadPoolExecutor):
        def submit(self, fn, /, *args, **kwargs):
            submitted.append(args)
            return super().submit(fn, *args, **kwargs)

    results = Workers(Counting(1)).map(abs, range(50))
    next(results)
    assert len(submitted) == _TASKS_PER_WORKER
    with pytest.raises(ZeroDivisionError):
        list(Workers().map(lambda x: 1 / x, [1, 0]))
    assert list(Workers().map(abs, [])) == []
    with pytest.raises(InvalidInput, match="n_jobs: got 0"), executor_for(0):
        pass


def test_a_cluster_that_is_not_there_is_one_error(monkeypatch):
    pytest.importorskip("distributed", reason="needs the extra tripwatt[fleet]")
    monkeypatch.setattr("tripwatt.fleet.executors.CLUSTER_WAIT_S", 1.0)
    with pytest.raises(InvalidInput, match="no cluster"), executor_for(cluster="tcp://127.0.0.1:9"):
        pass
