"""Measure sweeps: computing and writing, memory, and the overhead of chunks, blocks and tasks.

`python -m benchmarks.sweeping --encounters 1e8 --folder .` needs 9 bytes of disk per encounter and result.
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import pretouch as pt
from pretouch.designs import Constraint
from pretouch.motion import Stretch
from pretouch.sweeps import Progress
from pretouch.sweeps.axes import Axes
from pretouch.sweeps.executors import run_block
from pretouch.sweeps.plan import Plan, make_plan
from pretouch.sweeps.stores import MemoryStore, ZarrStore

from .solving import OBJECTIVE, SCENARIO, SENSORS

QUICK = ("time", "relative_velocity", "displacement", "virtual_force")
CASES = (
    ("exponential-1", ("relative_velocity",)),
    ("exponential-1", QUICK),
    ("inverse-power", QUICK),
)


def grid(count: int) -> dict[str, np.ndarray]:
    """Return velocities and gains with about this many combinations."""
    gains = int(np.sqrt(count))
    return {"obstacle.velocity": np.linspace(-1.0, -0.05, count // gains), "gain": -np.geomspace(2.0, 0.05, gains)}


def plain_writing(folder: Path, size: float) -> float:
    """Write this many bytes to files of 8 MB; return the seconds until the disk has them."""
    block = np.random.default_rng(1).random(1 << 20)
    _sync()
    with tempfile.TemporaryDirectory(dir=folder) as place:
        start = time.perf_counter()
        for i in range(int(size) // block.nbytes):
            Path(place, str(i)).write_bytes(block.data)
        _sync()
        return time.perf_counter() - start


def _sync() -> None:
    """Wait until all data are on disk."""
    if hasattr(os, "sync"):
        os.sync()


def sweep_row(sensor: str, results: tuple[str, ...], count: int, folder: Path) -> str:
    """Sweep into a store; return a row."""
    last: list[Progress] = []
    _sync()
    axes = grid(count)
    with tempfile.TemporaryDirectory(dir=folder) as place:
        start = time.perf_counter()
        dataset = pt.sweep(
            pt.Task(SCENARIO, SENSORS[sensor]),
            axes,
            results=results,
            output=Path(place, "out.zarr"),
            progress=last.append,
        )
        wall = time.perf_counter() - start
        _sync()
        durable = time.perf_counter() - start
        size = sum(f.stat().st_size for f in Path(place).rglob("*") if f.is_file())
        total = int(np.prod(dataset["status"].shape))
    done, plain = last[-1], plain_writing(folder, size)
    each = 1e9 / total
    return (
        f"{sensor:14s} {len(results):7d} {total:12,d} {wall:7.1f} s {durable:7.1f} s"
        f" {done.computing * each:8.1f} ns {done.writing * each:7.1f} ns {done.computing / done.writing:10.2f}"
        f" {size / 1e9:7.2f} GB {plain:6.1f} s {durable / plain:9.2f}x"
    )


def shortest(work: Callable[[], object], rounds: int = 20) -> float:
    """Return the shortest time of some calls [s]."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def tiny(blocks: int) -> Plan:
    """Return a plan whose blocks hold a single encounter."""
    held = pt.Task(SCENARIO, SENSORS["exponential-1"], gain=-0.5)
    axes = {"obstacle.velocity": np.linspace(-1.0, -0.05, blocks)}
    return make_plan(held, axes, results=["relative_velocity"], chunk_size=1)


def overheads(folder: Path) -> list[str]:
    """Measure the overhead of a block, a chunk and a worker's check of the store, with almost no computation."""
    plan = tiny(1000)
    in_memory = MemoryStore(plan, 1)
    rows = [f"block of one chunk, in memory          {shortest(lambda: run_block(plan, in_memory, 0)) * 1e3:8.2f} ms"]
    with tempfile.TemporaryDirectory(dir=folder) as place:
        path = Path(place, "tiny.zarr")
        start = time.perf_counter()
        store = ZarrStore.create(path, plan, 1)
        rows.append(f"making a store                         {(time.perf_counter() - start) * 1e3:8.2f} ms")
        rows.append(
            f"block of one chunk, two files, ledger  {shortest(lambda: run_block(plan, store, 0)) * 1e3:8.2f} ms"
        )
        rows.append(f"  of it the ledger                     {shortest(lambda: store.finish(1)) * 1e3:8.2f} ms")
        rows.append(f"opening a store on a worker            {shortest(lambda: ZarrStore(path, plan)) * 1e3:8.2f} ms")
        rows.append(f"reading a ledger of 1,000 blocks       {shortest(store.finished, 5) * 1e3:8.2f} ms")
    return rows


def tasks(folder: Path, count: int = 1000) -> str:
    """Run blocks of one encounter on two worker processes; return the time per block."""
    from distributed import LocalCluster  # noqa: PLC0415 - only for this row

    from pretouch.sweeps import cluster  # noqa: PLC0415

    plan = tiny(count)
    with (
        tempfile.TemporaryDirectory(dir=folder) as place,
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as workers,
        cluster.connected(workers.scheduler_address) as client,
    ):
        client.wait_for_workers(2)
        store = ZarrStore.create(Path(place, "tiny.zarr"), plan, 1)
        cluster.run_on(client, store, [0, 1], lambda _: None)  # the workers import pretouch
        start = time.perf_counter()
        cluster.run_on(client, store, list(range(2, count)), lambda _: None)
        each = (time.perf_counter() - start) / (count - 2)
    return f"task on a cluster of two processes     {each * 1e3:8.2f} ms, two at a time"


def _sweep_on(processor: int, output: Path, count: int, parts: int) -> float:
    """Sweep one of equal parts of the grid in this process, on one processor; return its processor time [s]."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {processor})
    axes = grid(count)
    axes["obstacle.velocity"] = axes["obstacle.velocity"][processor::parts]
    pt.sweep(pt.Task(SCENARIO, SENSORS["inverse-power"]), axes, results=QUICK, output=output)
    return _used()[0]


def _used() -> tuple[float, float]:
    """Return processor time [s] and largest memory [MB] of this process."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3  # Linux counts kilobytes


def efficiency(folder: Path, count: int) -> list[str]:
    """Sweep by one process, by two processes and by two Dask workers; return a row for each.

    The processes and workers are new, so that times include the import of pretouch. The efficiency is the time of one
    process on one processor, divided by twice the time on two processors; also with processor times of all processes.
    """
    from distributed import LocalCluster  # noqa: PLC0415 - only for these rows

    from pretouch.sweeps import cluster  # noqa: PLC0415

    rows: list[str] = []
    times: list[tuple[float, float]] = []

    def add(name: str, wall: float, used: float, more: str = "") -> None:
        times.append((wall, used))
        first, spent = times[0]
        share = f"   efficiency {first / 2 / wall:.2f}, of processor time {spent / used:.2f}" if rows else ""
        rows.append(f"{name:30s} {count:12,d} encounters {wall:7.1f} s, {used:7.1f} s of processor{share}{more}")

    for parts, name in ((1, "one process, one processor"), (2, "two processes, half each")):
        with (
            tempfile.TemporaryDirectory(dir=folder) as place,
            ProcessPoolExecutor(parts, mp_context=get_context("spawn")) as pool,
        ):
            start = time.perf_counter()
            running = [pool.submit(_sweep_on, k, Path(place, f"{k}.zarr"), count, parts) for k in range(parts)]
            used = sum(one.result() for one in running)
            add(name, time.perf_counter() - start, used)
    with (
        tempfile.TemporaryDirectory(dir=folder) as place,
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as workers,
        cluster.connected(workers.scheduler_address) as client,
    ):
        client.wait_for_workers(2)
        task, output = pt.Task(SCENARIO, SENSORS["inverse-power"]), Path(place, "out.zarr")
        before, own, start = client.run(_used), _used()[0], time.perf_counter()
        pt.sweep(task, grid(count), results=QUICK, output=output, dask=client)
        wall, own, after = time.perf_counter() - start, _used()[0] - own, client.run(_used)
        used = sum(after[worker][0] - before[worker][0] for worker in after)
        peak = max(memory for _, memory in after.values())
        add("Dask, two workers", wall, used + own, f"; scheduler and client {own:.1f} s; worker {peak:.0f} MB")
    return rows


def designs(count: int) -> list[str]:
    """Sweep designs in memory; return a row for each curve, and for a grid with and without a limit."""
    rows = []
    example = pt.load_scenario(Path(__file__).parents[1] / "examples" / "approach.toml")
    side = round(count**0.5) * 8
    inputs = {"obstacle.velocity": np.linspace(-0.5, -0.1, side), "obstacle.position": np.linspace(0.03, 0.08, side)}
    pt.sweep(example, {name: values[:50] for name, values in inputs.items()})
    for name, limits in (("no limit", ()), ("a limit", example.constraints)):
        start = time.process_time()
        pt.sweep(example.replace(constraints=limits), inputs)
        each = (time.process_time() - start) / side**2
        rows.append(
            f"{name:14s} {side**2:12,d} designs {each * 1e6:8.2f} us each, of the processor: speeds x positions"
        )
    for name, sensor in SENSORS.items():
        axes = {"obstacle.velocity": np.linspace(-1.0, -0.05, count), "admittance.mass": [1.0]}
        task = pt.Task(SCENARIO, sensor, OBJECTIVE, bounds=(-10.0, -0.01))
        pt.sweep(task, axes, results=["gain"])
        start = time.perf_counter()
        pt.sweep(task, axes, results=["gain"])
        rows.append(f"{name:14s} {count:12,d} designs {(time.perf_counter() - start) / count * 1e6:8.2f} us each")
    return rows


def example() -> list[str]:
    """Run the worked example of docs/how-to/sweeps.md; return a row with the time of each of its sweeps."""
    task = pt.load_scenario(Path(__file__).parents[1] / "examples" / "approach.toml")
    speeds = np.linspace(-1.0, -0.01, 100)
    rng = np.random.default_rng(20261121)
    sample = {"obstacle.velocity": -rng.uniform(0.2, 0.4, 500), "sensor.exponent": rng.normal(3.32, 0.05, 500)}
    sweeps: dict[str, tuple[Axes, list[str] | None]] = {
        "contacts": (
            {"obstacle.velocity": speeds, "gain": np.linspace(-2.0, -0.02, 80)},
            ["relative_velocity", "largest_excursion"],
        ),
        "designs with limits": (
            {"constraint.excursion": [0.05, 0.1, 0.2], "obstacle.velocity": speeds},
            ["gain", "relative_velocity"],
        ),
        "sampled inputs": ({"sample": sample, "gain": np.linspace(-2.0, -0.1, 40)}, None),
    }
    rows = []
    for name, (axes, results) in sweeps.items():
        start = time.perf_counter()
        size = pt.sweep(task, axes, results=results)["status"].size
        rows.append(f"example, {name:20s} {size:6,d} encounters {time.perf_counter() - start:6.2f} s")
    return rows


def chunks(count: int = 1024) -> list[str]:
    """Measure what a chunk costs, by kind of work; a block holds at least one chunk."""
    given = {"objective": OBJECTIVE, "bounds": (-10.0, -0.01)}
    limits = (Constraint(name="excursion", limit=0.1), Constraint(name="acceleration", limit=5.0))
    obstacle = replace(SCENARIO.obstacle, course=(Stretch(until=0.05), Stretch(until=0.1, acceleration=-1.0)))
    kinds: dict[str, dict[str, Any]] = {
        "designs": given,
        "designs with two limits": {**given, "constraints": limits},
        "designs of a drag": {"objective": OBJECTIVE, "bounds": (1e-4, 0.05), "law": "virtual-drag"},
        "designs with a course": {**given, "scenario": replace(SCENARIO, obstacle=obstacle)},
        "contacts with a course": {"gain": -0.7, "scenario": replace(SCENARIO, obstacle=obstacle)},
    }
    rows = []
    for name, options in kinds.items():
        task = pt.Task(options.pop("scenario", SCENARIO), SENSORS["inverse-power"], **options)
        axes = {"admittance.mass": np.linspace(0.8, 1.2, 1000), "obstacle.velocity": np.linspace(-0.6, -0.1, 1000)}
        plan = make_plan(task, axes, results=["relative_velocity"])
        small = plan.thinned(min(count, int(np.prod(plan.chunk))))
        small.evaluate(small.region(0))
        start = time.perf_counter()
        small.evaluate(small.region(0))
        each, chunk = (time.perf_counter() - start) / small.size, int(np.prod(plan.chunk))
        rows.append(f"{name:26s} {each * 1e6:10.1f} us each, chunks of {chunk:9,d}: {each * chunk:6.2f} s")
    return rows


def main() -> None:
    """Print all results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.sweeping", description=__doc__.splitlines()[0])
    parser.add_argument("--encounters", type=float, default=1e7, help="of each sweep (default 1e7)")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()), help="on the disk to be measured")
    parser.add_argument("--no-dask", action="store_true", help="without a local cluster")
    parser.add_argument("--efficiency", action="store_true", help="only one and two processes, and two Dask workers")
    asked = parser.parse_args()
    if asked.efficiency:
        print("\n".join(efficiency(asked.folder, int(asked.encounters))))
        return
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    print(f"{cores} cores; plain: time of writing as many bytes to files of 8 MB")
    for sensor in SENSORS:  # the kernels are compiled once
        pt.sweep(pt.Task(SCENARIO, SENSORS[sensor]), grid(1000), results=QUICK)
    print("\nsensor         results   encounters  finished   on disk   computing    writing", end="")
    print("  comp/write       size    plain  to plain")
    for sensor, results in CASES:
        print(sweep_row(sensor, results, int(asked.encounters), asked.folder), flush=True)
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6  # Linux counts kilobytes
    print(f"peak memory of this process: {largest:.2f} GB")
    print("\n" + "\n".join(designs(4096)))
    print("\n" + "\n".join(example()))
    print("\n" + "\n".join(chunks()))
    print("\n" + "\n".join(overheads(asked.folder)))
    if not asked.no_dask:
        print(tasks(asked.folder))
        print("\n" + "\n".join(efficiency(asked.folder, int(asked.encounters))))


if __name__ == "__main__":
    main()
