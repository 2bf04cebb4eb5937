"""The same sweep on a real cluster of two worker processes, one of which is killed in the middle."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch.sweeps import cluster as cluster_module
from refusals import refused
from sweep_samples import CURVED, SCENARIO, cut_small

distributed = pytest.importorskip("distributed", reason="needs the extra 'dask'")
xr = pytest.importorskip("xarray", reason="needs the extra 'sweep'")
pytest.importorskip("zarr", reason="needs the extra 'sweep'")

AXES = {"obstacle.velocity": np.linspace(-1.0, -0.05, 60), "gain": np.linspace(-2.0, -0.05, 100)}
RESULTS = ("time", "relative_velocity", "largest_excursion")


@pytest.fixture
def cluster() -> Any:
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs="CRITICAL"
    ) as found:
        yield found


def run(cluster: Any, output: Path, **how: Any) -> Any:
    return pt.sweep(
        pt.Task(SCENARIO, CURVED), AXES, results=RESULTS, output=output, **how, dask=cluster.scheduler_address
    ).load()


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_a_worker_that_is_killed_in_the_middle_changes_nothing(
    cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cut_small(monkeypatch.setattr, encounters=100)
    with distributed.Client(cluster) as client:
        first = client.run(os.getpid)
    assert len(set(first.values())) == 2
    assert os.getpid() not in first.values()
    told: list[Any] = []

    def kill_one(progress: Any) -> None:
        told.append(progress)
        if len(told) == 10:
            os.kill(next(iter(first.values())), signal.SIGKILL)

    found = run(cluster, tmp_path / "out.zarr", progress=kill_one)
    with distributed.Client(cluster) as client:
        assert set(client.run(os.getpid).values()) != set(first.values()), "one worker was lost"
    assert told[-1].finished == told[-1].total == 6000
    assert told[-1].computed <= 6000, "no block is told of twice"
    xr.testing.assert_equal(found, pt.sweep(pt.Task(SCENARIO, CURVED), AXES, results=RESULTS))


@pytest.mark.slow
def test_a_cluster_goes_on_with_what_one_process_has_begun(
    cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cut_small(monkeypatch.setattr, encounters=100)

    def give_up(progress: Any) -> None:
        if progress.finished >= 2000:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pt.sweep(pt.Task(SCENARIO, CURVED), AXES, results=RESULTS, output=tmp_path / "out.zarr", progress=give_up)
    told: list[Any] = []
    found = run(cluster, tmp_path / "out.zarr", progress=told.append)
    assert (told[0].finished, told[-1].finished, told[-1].computed) == (2000, 6000, 4000)
    xr.testing.assert_equal(found, pt.sweep(pt.Task(SCENARIO, CURVED), AXES, results=RESULTS))


def test_a_cluster_needs_an_output_and_an_address_that_answers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "_TIMEOUT", "1 s")
    with refused("dask"):
        pt.sweep(pt.Task(SCENARIO, CURVED), AXES, dask="tcp://127.0.0.1:9")
    with refused("dask", value="tcp://127.0.0.1:9"):
        pt.sweep(pt.Task(SCENARIO, CURVED), AXES, dask="tcp://127.0.0.1:9", output=tmp_path / "out.zarr")
    assert not (tmp_path / "out.zarr").exists()
