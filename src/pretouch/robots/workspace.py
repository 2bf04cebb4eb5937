"""Compute mass and limits of a robot in many postures.

A sweep can then test a gain in each posture and direction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.designs import Task
from pretouch.simulation.result import whole

from .dynamics import drivetrain_of
from .model import Model, joint_label, make_data, site_index, unit_of_joint
from .path import ranges_of
from .projection import Projection, project_site
from .site import SensorSite

PLACE = "place"
"""Name of the axis of a sweep over postures and directions."""

_VARIABLES: Final[dict[str, tuple[str, Callable[[Projection], float]]]] = {
    "reflected_mass": ("kg", lambda p: p.reflected_mass),
    "conditioning": ("1", lambda p: p.conditioning),
    "retreat": ("m", lambda p: p.retreat),
    "available_acceleration": ("m/s^2", lambda p: p.acceleration.least),
    "available_speed": ("m/s", lambda p: p.speed.least),
}


@dataclass(frozen=True, slots=True)
class Workspace(Value):
    """Mass and limits of a robot in many postures and directions.

    They count along the axis of a sensor.

    Args:
        site: the sensor site; its axis is that of the first direction.
        projections: the projections.
        omitted: number of postures and directions along which the site cannot move.
    """

    site: SensorSite
    projections: tuple[Projection, ...]
    omitted: int

    def axes(self, task: Task, **inputs: Any) -> dict[str, Mapping[str, Any]]:
        """Return the sweep axis of the robot's postures and directions.

        Args:
            task: the task of the sweep, whose admittance and impact are changed along the axis.
            **inputs: further inputs that vary along the same axis, one value for each projection, with underscores
                instead of the point, such as `obstacle_velocity=speeds` for random objects.

        Returns:
            The axis "place" with the admittance, divided by 1 - kappa, and the mass of the robot in an impact.
        """
        share = 1 - np.array([p.recoil_share for p in self.projections])
        admittance = task.scenario.admittance
        columns = {f"admittance.{n}": getattr(admittance, n) / share for n in ("mass", "damping", "stiffness")}
        if task.impact is not None:
            columns["impact.robot_mass"] = np.array([p.reflected_mass for p in self.projections])
        return {PLACE: columns | {name.replace("_", ".", 1): value for name, value in inputs.items()}}

    def describe(self, dataset: Any) -> Any:
        """Add the robot's limits to the dataset of a sweep.

        Args:
            dataset: the result of a sweep over `axes`, with the result `largest_excursion`.

        Returns:
            The dataset with position, direction, reflected mass and limits of each place, with `remaining_excursion`,
            the retreat minus the largest excursion [m], and with `holds`: whether no limit of the robot is exceeded.
        """
        columns = {
            name: (PLACE, np.array([value(p) for p in self.projections]), {"units": unit})
            for name, (unit, value) in _VARIABLES.items()
        }
        for name, vectors in (("position", [p.position for p in self.projections]), ("direction", self.directions)):
            for axis, column in zip("xyz", np.array(vectors).T, strict=True):
                columns[f"{name}_{axis}"] = (PLACE, column, {"units": "m" if name == "position" else "1"})
        named = dataset.assign(columns)
        remaining = named["retreat"] - abs(named["largest_excursion"])
        holds = remaining > 0
        for quantity, limit in (("acceleration", "available_acceleration"), ("speed", "available_speed")):
            if f"largest_{quantity}" in named:
                holds = holds & (abs(named[f"largest_{quantity}"]) <= named[limit])
        remaining.attrs.update(units="m", long_name="remaining excursion")
        return named.assign(remaining_excursion=remaining, holds=holds)

    @property
    def directions(self) -> FloatArray:
        """Directions of the sensor axis in the world frame.

        The shape is (places, 3).
        """
        return np.array([p.axis for p in self.projections])


@check_arguments
def project_workspace(
    model: Model,
    site: SensorSite,
    postures: Sequence[Mapping[str, Any]],
    directions: Sequence[Any] = (),
    *,
    joint_speeds: Mapping[str, Any] | None = None,
) -> Workspace:
    """Compute mass and limits of a robot in many postures and directions.

    They count along the axis of a sensor.

    Args:
        model: a `mujoco.MjModel`.
        site: the sensor.
        postures: joint positions by name, such as from `random_postures`.
        directions: axes in the frame of the site, such as "+x" or unit vectors; by default that of the site.
        joint_speeds: largest speeds of joints by name, as in `project`.

    Returns:
        The projections, without those along which the site cannot move.

    Raises:
        InvalidInputError: the site cannot move along any axis in any posture.
    """
    projections, omitted, reason = [], 0, "there are no postures"
    for posture in postures:
        data = make_data(model, posture)
        for axis in directions or (site.axis,):
            try:
                projections.append(project_site(model, data, replace(site, axis=axis), joint_speeds=joint_speeds))
            except InvalidInputError as error:
                omitted, reason = omitted + 1, str(error)
    if not projections:
        raise InvalidInputError(
            f"postures: the motion along the sensor axis cannot be computed in any posture. Last reason: {reason}"
        )
    return Workspace(projections[0].site, tuple(projections), omitted)


@check_arguments
def random_postures(
    model: Model, site: SensorSite, count: int, *, seed: int = 0, margin: float = 0.1
) -> tuple[dict[str, float], ...]:
    """Return random robot postures, uniformly distributed within the joint ranges.

    The robot is the one that carries the sensor site. Hinges without a range are drawn from a whole turn.

    Args:
        model: a `mujoco.MjModel`.
        site: the sensor.
        count: number of postures.
        seed: seed of the random numbers.
        margin: share of each range that is left out at both ends, from 0 to below 0.5.

    Returns:
        Joint positions by name [rad or m].

    Raises:
        InvalidInputError: the margin leaves no range, or a slide joint has no range.
    """
    if not 0 <= margin < 0.5:
        raise InvalidInputError(
            f"margin: found {margin:g}, expected a fraction of each joint range, at least 0 and below 0.5", value=margin
        )
    data = make_data(model)
    drivetrain = drivetrain_of(model, data, site_index(model, site.name))
    ranges = ranges_of(model, drivetrain)
    for joint, span in zip(drivetrain.joints, ranges, strict=True):
        if not np.isfinite(span).all() and unit_of_joint(model, int(joint)) == "m":
            raise InvalidInputError(
                f"joint {joint_label(model, int(joint))!r}: this slide joint has no range in the model, so no "
                "positions can be drawn for it. Add a range to the joint"
            )
    low, high = np.where(np.isfinite(ranges), ranges, (-np.pi, np.pi)).T
    names = [joint_label(model, int(joint)) for joint in drivetrain.joints]
    shares = np.random.default_rng(whole(seed, "seed", 0, 2**64 - 1)).uniform(
        margin, 1 - margin, (whole(count, "count", 1, 10**7), len(names))
    )
    return tuple(dict(zip(names, row.tolist(), strict=True)) for row in low + shares * (high - low))
