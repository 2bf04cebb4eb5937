"""An earlier build of pretouch as a peer, and whole commands of both builds.

The earlier build is checked out by its commit and compiled in a temporary folder. Its jobs run in a child process.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from .measuring import fresh, timed, used
from .ours import Pretouch
from .protocol import Way
from .work import Column

ROOT = Path(__file__).parents[2]
_VERBS = {
    "design": "approach.toml",
    "fit": "sensor.csv",
    "robust": "robust.toml",
    "pareto": "tradeoff.toml",
    "verify": "loop.toml",
}
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


class Remote:
    """A job of another build, in a child process that solves it on request and times it itself."""

    def __init__(self, tree: Path, sensor: str, cases: str, name: str, *columns: Column) -> None:
        environment = {**os.environ, "PYTHONPATH": str(tree / "src")}
        command = [sys.executable, "-c", "from benchmarks.peers.builds import serve; serve()"]
        self._child = subprocess.Popen(
            command, cwd=ROOT, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        self._ask((sensor, cases, name, columns))

    def __call__(self) -> Column:
        """Return contact times or gains."""
        result: Column = self._ask(0)
        return result

    def timed(self, repeats: int) -> float:
        """Return the mean time of some calls, without the way to the child process [s]."""
        return float(self._ask(repeats))

    def __del__(self) -> None:
        """End the child process, whose input closes."""
        self._child.communicate()

    def _ask(self, request: Any) -> Any:
        assert self._child.stdin  # noqa: S101 - a pipe
        assert self._child.stdout  # noqa: S101
        pickle.dump(request, self._child.stdin)
        self._child.stdin.flush()
        return pickle.load(self._child.stdout)  # noqa: S301 - from the child process


def serve() -> None:
    """Answer the requests of `Remote` from standard input, with the build that is on the path."""
    requests, answers = sys.stdin.buffer, sys.stdout.buffer
    sensor, cases, name, columns = pickle.load(requests)  # noqa: S301 - from the parent process
    ways = (way for way in Pretouch().cases() if (way.sensor, way.cases, way.name) == (sensor, cases, name))
    job, repeats = next(ways).make(*columns), None
    while True:
        answer = None if repeats is None else timed(job, repeats) if repeats else job()
        pickle.dump(answer, answers)
        answers.flush()
        try:
            repeats = pickle.load(requests)  # noqa: S301 - from the parent process
        except EOFError:
            return


class EarlierBuild:
    """An earlier build of pretouch, by its commit and its source tree."""

    def __init__(self, commit: str, tree: Path) -> None:
        self.name, self.tree = f"pretouch {commit[:8]}", tree

    def available(self) -> str:
        """Return an empty reason."""
        return ""

    def cases(self) -> Sequence[Way]:
        """Return the ways of pretouch, each of which runs in a child process."""
        return [
            replace(way, make=partial(Remote, self.tree, way.sensor, way.cases, way.name), grows=False)
            for way in Pretouch().cases()
        ]

    def fresh(self, sensor: str) -> Callable[[], Column]:
        """Return the job of case D."""
        return fresh("pretouch", sensor, self.tree)


@contextmanager
def earlier_build(commit: str) -> Iterator[EarlierBuild]:
    """Check out a commit and compile its core, in a temporary folder that is removed afterwards.

    The folder of a source tree whose core is compiled is used as it is.
    """
    if Path(commit).is_dir():
        yield EarlierBuild(Path(commit).name, Path(commit).resolve())
        return
    git = ["git", "-C", str(ROOT)]
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "build"
        subprocess.run([*git, "worktree", "add", "--quiet", "--detach", str(tree), commit], check=True)
        try:
            environment = {**os.environ, "PYTHONPATH": str(tree / "src")}
            command = [sys.executable, "native/build.py"]
            subprocess.run(command, cwd=tree, env=environment, check=True, stdout=subprocess.DEVNULL)
            yield EarlierBuild(commit, tree)
        finally:
            subprocess.run([*git, "worktree", "remove", "--force", str(tree)], check=True)


class Command(NamedTuple):
    """A command of case G.

    Args:
        name: what it does.
        arguments: arguments of the interpreter.
        start: a command whose time is subtracted, such as the same one without its report.
    """

    name: str
    arguments: tuple[str, ...]
    start: tuple[str, ...] = ()

    def seconds(self, tree: Path, folder: str) -> float:
        """Return the processor time of fresh processes with the build of a source tree [s]."""
        whole = _seconds(self.arguments, tree, folder)
        return max(whole - _seconds(self.start, tree, folder), 1e-3) if self.start else whole


def _seconds(arguments: tuple[str, ...], tree: Path, folder: str) -> float:
    environment = {**os.environ, "PYTHONPATH": str(tree / "src")}
    before = used()
    done = subprocess.run([sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, check=False)
    if done.returncode not in {0, 1}:  # 1: a negative answer, such as the verdict on the example
        raise SystemExit(f"{tree}: {' '.join(arguments)}: {done.stderr.decode()[-500:]}")
    return used() - before


def commands(points: int) -> list[Command]:
    """Return the commands of case G; the sweep is over about so many points."""
    examples, pretouch = ROOT / "examples", ("-m", "pretouch")
    listed = [Command("--help", (*pretouch, "--help"))]
    for verb, file in _VERBS.items():
        command = (*pretouch, verb, str(examples / file))
        text = (*command, "--no-report")
        listed += [
            Command(f"{verb}, text", text),
            Command(f"{verb}, report on top", (*command, "--output", "r.html", "--force"), text),
        ]
    robust = {count: ("-c", _ROBUST, count, str(examples / _VERBS["robust"])) for count in "14"}
    listed.append(Command("three further robust designs", robust["4"], robust["1"]))
    side = max(round(points**0.5), 2)
    axes = (f"obstacle.velocity=-1 m/s:-0.05 m/s:{side}", f"obstacle.position=30 mm:60 mm:{side}")
    sweep = (*pretouch, "sweep", str(examples / "approach.toml"), *(part for axis in axes for part in ("--axis", axis)))
    return [*listed, Command(f"sweep of {side * side:,} designs, limit", sweep)]
