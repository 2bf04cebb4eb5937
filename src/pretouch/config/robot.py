"""Project the robot model of a scenario file onto its sensor axis.

The projection gives the mass and the limits of the robot along this axis.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pretouch._core.errors import InvalidInputError

from .reading import Reading, ScenarioSource
from .robot_section import MODEL, has_model

if TYPE_CHECKING:
    from pretouch.robots import Projection, RobotFile, SensorSite
    from pretouch.sensors import SensorModel


@dataclass(frozen=True, slots=True)
class RobotInPosture:
    """A robot model with its sensor in a given posture.

    Args:
        model: a `mujoco.MjModel`.
        data: its state.
        site: the sensor.
    """

    model: Any
    data: Any
    site: SensorSite


def project_robot(file: Reading) -> Projection | None:
    """Return mass and limits of a robot along its sensor axis.

    The result is None without a valid robot model.
    """
    values = file.values("robot")
    if values is None or not has_model(file.data):
        return None
    return file.attempt("robot", lambda: _project(file, values))


def check_tracking(file: Reading) -> None:
    """Check the section [tracking], which needs a robot model."""
    if "tracking" in file.data and not has_model(file.data):
        file.refuse(
            ("tracking",),
            'found a joint controller without a robot model, expected [robot] with model = "arm.xml" and site = '
            '"fingertip". A robot of another kind describes how it follows by its own keys in [robot]',
        )
    file.make("tracking")


def _project(file: Reading, values: Mapping[str, Any]) -> Projection:
    from pretouch.robots import project_site  # noqa: PLC0415 - only with a robot model

    robot_file = robot_file_of(file.source, values)
    robot = read_robot(robot_file, values)
    path = robot_file.file
    file.source = replace(file.source, model_files=(path,) if path.is_file() else ())
    return project_site(robot.model, robot.data, robot.site, joint_speeds=values.get("joint_speeds"))


def robot_file_of(source: ScenarioSource, values: Mapping[str, Any]) -> RobotFile:
    """Return the robot model that the section [robot] names, with its choices."""
    from pretouch.robots import RobotFile, SiteOnBody  # noqa: PLC0415 - only with a robot model

    folder, name = source.path.parent, str(values[MODEL])
    path = folder / name
    is_name = not path.is_file() and not path.suffix and "/" not in name
    sites = (SiteOnBody(values["body"], values["axis"], values.get("offset")),) if "body" in values else ()
    return RobotFile(
        name if is_name else str(path),
        packages=tuple(str(folder / package) for package in values.get("packages", ())),
        base=values.get("base"),
        joints=tuple(values.get("joints", ())),
        posture=values.get("posture"),
        sites=sites,
    )


def read_robot(robot: RobotFile, values: Mapping[str, Any], sensor: SensorModel | None = None) -> RobotInPosture:
    """Load the robot model in the posture that the section [robot] of the scenario file sets."""
    from pretouch.robots import SensorSite, load_model, make_data  # noqa: PLC0415 - only with a robot model

    try:
        model = load_model(robot)
    except InvalidInputError as error:
        # A scenario may name any file, so the message must not reveal the content of that file.
        path = robot.file
        if not path.is_file() or error.argument != "model":
            raise
        raise InvalidInputError(
            f"model: MuJoCo cannot read the robot model {path.name}; for details, run: pretouch project "
            f"{shlex.quote(robot.path)}"
        ) from None
    options = {name: values[name] for name in ("axis", "field_of_view", "hold") if name in values}
    site = SensorSite(robot.sites[0].name if robot.sites else values["site"], sensor, **options)
    posture = {name: v for name, v in values.get("posture", {}).items() if not robot.joints or name in robot.joints}
    return RobotInPosture(model, make_data(model, posture, keyframe=values.get("keyframe")), site)
