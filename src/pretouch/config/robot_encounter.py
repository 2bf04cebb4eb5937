"""Simulate the encounter of a scenario file with a whole robot."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError, ScenarioFileError
from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
from pretouch.designs.impact import SpringImpact
from pretouch.motion import DAMPER
from pretouch.simulation import SensorChain
from pretouch.verification.verdict import chosen_gain

from .document import read_document
from .reading import Reading
from .robot import read_robot, robot_file_of
from .robot_section import has_model
from .schema import FREE

if TYPE_CHECKING:
    from pretouch.designs import Task
    from pretouch.robots import RobotSimulation

_PERIOD: Final = 1e-3  # s, of the controller of a file without [controller]
_BELOW: Final = 0.5  # the floor of this controller, as a share of the sensor output at the start


@check_arguments
def simulate_robot_file(
    path: str | os.PathLike[str], task: Task, *, runs: int = 1, seed: int | None = None
) -> RobotSimulation:
    """Simulate the encounter of a scenario file with a whole robot.

    The scenario file gives the sensor, the posture and the motion of the object. The object is the one that the sensor
    sees in the robot model, or otherwise a ball that is added to the model. The controller is that of the scenario
    file. Without [chain] and [controller], it is a virtual damper at 1 kHz, and the sensor has no noise and no delay.
    The section [tracking] says how the joints follow.

    Args:
        path: the scenario file, with `model` in its section [robot].
        task: the task of this file, from `load_scenario`; a gain in the task replaces the designed gain.
        runs: number of runs, each with its own noise.
        seed: seed of the noise; None for the seed in the file.

    Returns:
        The simulation, next to the prediction.

    Raises:
        ScenarioFileError: the file names no robot model, or its encounter cannot be simulated on the robot.
    """
    from pretouch.robots import SiteLaw, simulate_robot  # noqa: PLC0415 - MuJoCo, only with a robot model
    from pretouch.robots.deviations import with_curved_paths_last  # noqa: PLC0415
    from pretouch.robots.scene import Approach, make_scene  # noqa: PLC0415

    _, _, content = read_document(path)
    source: Any = task.source
    file = Reading(source, content)
    values = file.values("robot")
    if values is None or not has_model(content):
        raise ScenarioFileError(
            f'{path}: found no robot model, expected [robot] with model = "arm.xml" and site = "fingertip"'
        )
    _refuse_other_motion(Path(path), task)
    robot_file = robot_file_of(source, values)
    robot = read_robot(robot_file, values, task.sensor)
    scenario = task.scenario
    approach = Approach(
        distance=float(scenario.distance),
        obstacle_velocity=float(scenario.obstacle.velocity),
        robot_velocity=float(scenario.reference.velocity),
        mass=math.nan if task.impact is None else float(task.impact.obstacle_mass),
        radius=values.get("object_radius", math.nan),
    )
    scene = make_scene(robot_file, robot.model, robot.data, robot.site, approach)
    controller, chain = _control(file, task)
    steps = math.ceil(controller.period / scene.model.opt.timestep - 1e-9)
    scene.model.opt.timestep = controller.period / steps
    law = SiteLaw(site=robot.site, controller=controller, chain=chain, approach=approach.robot_velocity)
    noise = seed if seed is not None else 0 if task.loop is None else task.loop.seed
    stiffness = task.impact.stiffness if isinstance(task.impact, SpringImpact) else None
    options = {"follow_time": values["follow_time"]} if "follow_time" in values else {}
    result = simulate_robot(
        *(scene.model, scene.data, [law]),
        tracking=file.make("tracking"),
        runs=runs,
        seed=noise,
        contact_stiffness=stiffness,
        **options,
    )
    return replace(
        result, notes=(scene.note, *result.notes), warnings=with_curved_paths_last((*scene.warnings, *result.warnings))
    )


def _refuse_other_motion(path: Path, task: Task) -> None:
    """Refuse a motion that the whole-robot simulation does not support."""
    scenario = task.scenario
    zero = {
        "plant.velocity": scenario.plant.velocity,
        "reference.acceleration": scenario.reference.acceleration,
        "reference.position": scenario.reference.position - scenario.plant.position,
    }
    wrong = [name for name, value in zero.items() if value]
    if scenario.obstacle.course:
        wrong.append("obstacle.course")
    if wrong:
        raise ScenarioFileError(
            f"{path}: the key {wrong[0]} is not allowed with a robot model. Remove this key, or simulate the "
            "encounter with the Python function simulate_robot. Reason: a robot model starts at its reference with a "
            "constant velocity, and the object moves freely"
        )


def _control(file: Reading, task: Task) -> tuple[Controller, SensorChain | None]:
    """Return the controller and sensor chain of the robot simulation."""
    gain = chosen_gain(task)
    if task.loop is not None:
        law: Any = task.loop.robot_law
        return law.with_value(gain), task.loop.chain
    if task.law != DAMPER:
        raise InvalidInputError(
            f"law: a robot simulation with the control law {task.law.kind} needs the sections [chain] and "
            "[controller]; add both sections to the scenario file"
        )
    virtual = file.make("admittance", tuple(FREE))  # that of the file, without the recoil of a floating base
    floor = _BELOW * float(task.sensor.output(task.scenario.distance))
    controller = Controller(
        period=_PERIOD,
        conditioning=Conditioning(floor=floor),
        law=VirtualDamper(gain=gain),
        admittance=VirtualAdmittance(mass=virtual.mass, damping=virtual.damping, stiffness=virtual.stiffness),
    )
    return controller, None
