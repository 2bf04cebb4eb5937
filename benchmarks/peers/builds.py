"""Compare whole commands, arrays of designs and sweeps with an earlier build of pretouch.

The earlier build is checked out by its commit and compiled in a temporary folder. Both builds run in turn, each time in
a fresh process. Times are processor times of all threads, with those of child processes.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
_VERBS = {
    "design": "approach.toml",
    "fit": "sensor.csv",
    "robust": "robust.toml",
    "pareto": "tradeoff.toml",
    "verify": "loop.toml",
}
_ARRAY = """
import resource, sys
from dataclasses import replace
import numpy as np
import pretouch as pt
try:
    from pretouch.designs import Constraint, design_gain
except ImportError:  # the name of the folder in earlier builds
    from pretouch.design import Constraint, design_gain
count, limited = int(sys.argv[1]), sys.argv[2] == "limit"
task = pt.load_scenario(sys.argv[3])
obstacle = replace(task.scenario.obstacle, velocity=np.linspace(-1.0, -0.05, count))
limits = [Constraint(name="excursion", limit=0.2)] if limited else []
task = task.replace(scenario=replace(task.scenario, obstacle=obstacle), constraints=limits)
design_gain(task)
"""
_ROBUST = """
import sys
import pretouch as pt
try:
    from pretouch.designs.robust.design import robust
except ImportError:  # the names in earlier builds
    from pretouch.design.robust.design import design_robust_gain as robust
task = pt.load_scenario(sys.argv[2])
for _ in range(int(sys.argv[1])):
    robust(task)
"""


class Build(NamedTuple):
    """A source tree of pretouch with its compiled core."""

    name: str
    tree: Path

    def seconds(self, arguments: tuple[str, ...], folder: str) -> float:
        """Return the processor time of one fresh process [s]."""
        environment = {**os.environ, "PYTHONPATH": str(self.tree / "src")}
        before = _used()
        done = subprocess.run(
            [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, check=False
        )
        if done.returncode not in {0, 1}:  # 1: a negative answer, such as the verdict on the example
            raise SystemExit(f"{self.name}: {' '.join(arguments)}: {done.stderr.decode()[-500:]}")
        return _used() - before


class Job(NamedTuple):
    """A command or program that both builds run."""

    name: str
    arguments: tuple[str, ...]
    start: tuple[str, ...] | None = None  # its time is subtracted, such as that of a command without its report


def _used() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@contextmanager
def earlier_build(commit: str) -> Iterator[Build]:
    """Check out a commit and compile its core, in a temporary folder that is removed afterwards.

    The folder of a source tree whose core is compiled is used as it is.
    """
    if Path(commit).is_dir():
        yield Build(Path(commit).name, Path(commit).resolve())
        return
    git = ["git", "-C", str(ROOT)]
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "build"
        subprocess.run([*git, "worktree", "add", "--quiet", "--detach", str(tree), commit], check=True)
        try:
            environment = {**os.environ, "PYTHONPATH": str(tree / "src")}
            command = [sys.executable, "native/build.py"]
            subprocess.run(command, cwd=tree, env=environment, check=True, stdout=subprocess.DEVNULL)
            yield Build(commit, tree)
        finally:
            subprocess.run([*git, "worktree", "remove", "--force", str(tree)], check=True)


def jobs(designs: int, points: int) -> list[Job]:
    """Return the work: commands, arrays with so many designs, and sweeps over about so many points."""
    examples, pretouch = ROOT / "examples", ("-m", "pretouch")
    listed = [Job("--help", (*pretouch, "--help"))]
    for verb, file in _VERBS.items():
        command = (*pretouch, verb, str(examples / file))
        text = (*command, "--no-report")
        listed += [
            Job(f"{verb}, text", text),
            Job(f"{verb}, report on top", (*command, "--output", "r.html", "--force"), text),
        ]
    robust = {count: ("-c", _ROBUST, count, str(examples / _VERBS["robust"])) for count in "14"}
    listed.append(Job("three further robust designs", robust["4"], robust["1"]))
    scenario = str(examples / "approach.toml")
    array = {kind: ("-c", _ARRAY, str(designs), kind, scenario) for kind in ("free", "limit")}
    load = {kind: ("-c", _ARRAY, "1", kind, scenario) for kind in array}
    listed += [Job(f"{designs:,} designs, {kind}", array[kind], load[kind]) for kind in array]
    side = max(round(points**0.5), 2)
    axes = (f"obstacle.velocity=-1 m/s:-0.05 m/s:{side}", f"obstacle.position=30 mm:60 mm:{side}")
    sweep = (*pretouch, "sweep", scenario, *(part for axis in axes for part in ("--axis", axis)))
    return [*listed, Job(f"sweep of {side * side:,} designs, limit", sweep)]


def compare(commit: str, rounds: int, designs: int, points: int) -> list[dict[str, object]]:
    """Measure both builds in turn, print a row for each job, and return the rows."""
    rows: list[dict[str, object]] = []
    with earlier_build(commit) as old, tempfile.TemporaryDirectory() as folder:
        new = Build("this build", ROOT)
        print(f"\nprocessor time of fresh processes, {rounds} pairs in turn; ratio: median over the pairs")
        print(f"{'':36s} {old.name[:8]:>10s} {'this build':>12s}   ratio")
        for job in jobs(designs, points):
            for build in (old, new):  # warm the caches of the file system
                build.seconds(job.arguments, folder)
            pairs = [tuple(_net(build, job, folder) for build in (old, new)) for _ in range(rounds)]
            first, second = (statistics.median(column) for column in zip(*pairs, strict=True))
            ratio = statistics.median(b / a for a, b in pairs)
            print(f"{job.name:36s} {first:8.3f} s {second:10.3f} s   {ratio:5.2f}", flush=True)
            rows.append({"work": job.name, "old": first, "new": second, "ratio": ratio})
    return rows


def _net(build: Build, job: Job, folder: str) -> float:
    whole = build.seconds(job.arguments, folder)
    return whole if job.start is None else max(whole - build.seconds(job.start, folder), 1e-3)
