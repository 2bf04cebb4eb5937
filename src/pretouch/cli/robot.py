"""Implement the command `pretouch robot` for whole-robot simulations."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .terminal import Presentation, option, verb
from .verbs import LoopGain, LoopSeed, load_loop

RobotFile = Annotated[Path, typer.Argument(metavar="FILE", help="Scenario file (TOML) with a robot model in [robot].")]


@verb
def robot(
    shown: Presentation,
    *,
    file: RobotFile,
    gain: LoopGain = None,
    runs: Annotated[int, option("NUMBER", "Number of runs, each with its own noise.", min=1)] = 1,
    seed: LoopSeed = None,
    view: Annotated[bool, typer.Option("--view", help="Open the first run in MuJoCo's viewer.")] = False,
) -> None:
    """Simulate the encounter of a scenario file with a whole robot.

    The section [robot] of the file names the robot model. The sensor meets the object that it sees in the model, or
    else an added ball. Prints the simulated contact next to the prediction. Writes a report with a film of the
    encounter and its time series, STEM-robot.html in this folder. This command needs MuJoCo: pip install
    'pretouch[mujoco]'.

    Exit status: 0 the robot touched the object, 1 it did not, 2 a mistake in the request.
    """
    from pretouch.config.robot_encounter import simulate_robot_file  # noqa: PLC0415 - keeps `--help` quick

    task = load_loop(file, "simulating the robot", gain, seed)
    result = simulate_robot_file(file, task, runs=runs, seed=seed)
    if view:
        from pretouch.robots import view_robot  # noqa: PLC0415

        view_robot(result)
    shown.show(result, f"{file.stem}-robot.html", task, good=bool(result.order()))
