"""Check the inputs of a robot simulation, and prepare the model that all its runs share."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray

from .centering import Centering, pair_of
from .drives import Drives, drives_of
from .dynamics import Drivetrain, drivetrain_of, joined
from .model import Data, Model, mujoco, site_index
from .obstruction import refuse_covered_sensor, refuse_overlap
from .reference import JointPath
from .sight import FARTHEST, Sight
from .site_law import SiteLaw
from .tracking import Tracking

_FINEST: Final = 0.5  # largest product of the feedback's angular frequency and the time step
_OPPOSED: Final = -0.99  # cosine of the angle between the axes of two fingers that face each other


@dataclass(frozen=True, slots=True)
class RunScene:
    """Inputs and prepared model that all runs of a simulation share."""

    model: Model
    data: Data
    laws: tuple[SiteLaw, ...]
    tracking: Tracking
    centering: Centering | None
    drivetrains: tuple[Drivetrain, ...]
    drives: Drives
    highest: FloatArray
    forces: FloatArray | None
    path: JointPath
    steps: int
    period: float
    horizon: float
    follow_time: float

    @classmethod
    def of(
        cls,
        model: Model,
        data: Data,
        laws: Sequence[SiteLaw],
        *,
        tracking: Tracking,
        centering: Centering | None,
        horizon: float,
        follow_time: float,
    ) -> RunScene:
        """Check the inputs of a simulation, and copy the robot model.

        Returns:
            The scene of the simulation, with a copy in which joint torques replace the actuators.

        Raises:
            InvalidInputError: an input is invalid, or the time step does not fit the controller period.
        """
        library = mujoco()
        laws = tuple(laws)
        names = [law.site.name for law in laws]
        if not laws or len(set(names)) < len(names):
            raise InvalidInputError(
                f"laws: found control laws for the sites {names}, expected at least one law, and at most one law per "
                "site",
                value=names,
            )
        periods = {law.controller.period for law in laws}
        if len(periods) > 1:
            listed = ", ".join(f"{p:g} s" for p in sorted(periods))
            raise InvalidInputError(
                f"laws: found controllers with different periods ({listed}), expected the same period for all"
            )
        (period,) = periods
        steps = round(period / model.opt.timestep)
        if steps < 1 or abs(period / model.opt.timestep - steps) > 1e-6 * steps:
            raise InvalidInputError(
                f"model: the time step of {model.opt.timestep:g} s does not divide the controller period of "
                f"{period:g} s. Set <option timestep=.../> to the period divided by a whole number"
            )
        _check_bandwidth(tracking, model.opt.timestep)
        copied = copy.copy(model)
        copied.opt.disableflags |= int(library.mjtDisableBit.mjDSBL_ACTUATION)
        start = library.MjData(model)
        start.qpos[:], start.qvel[:] = data.qpos, data.qvel
        library.mj_forward(model, start)
        indices = [site_index(model, name) for name in names]
        drivetrains = joined([drivetrain_of(model, start, index) for index in indices])
        tree = np.concatenate([drivetrains[0].driven, drivetrains[0].base])
        start.qvel[tree[: len(drivetrains[0].driven)]] = 0.0
        library.mj_forward(model, start)
        for law, index in zip(laws, indices, strict=True):
            curve: Any = law.site.sensor
            glance = Sight(model, law.site, index, curve, FARTHEST).glance(start)
            refuse_overlap(model, start, law.site, index, glance.distance)
            refuse_covered_sensor(model, start, law.site, index)
        if centering is not None:
            _check_opposed(start, centering, laws, indices)
        still = library.MjData(model)
        still.qpos[:] = data.qpos
        library.mj_forward(model, still)
        drives = drives_of(model, still, drivetrains[0], {})
        return cls(
            model=copied,
            data=start,
            laws=laws,
            tracking=tracking,
            centering=centering,
            drivetrains=drivetrains,
            drives=drives,
            highest=_largest_torques(drives),
            forces=_largest_forces(drives) if ((drives.moment != 0).sum(axis=1) > 1).any() else None,
            path=JointPath(copied, start, drivetrains, [law.site for law in laws]),
            steps=steps,
            period=period,
            horizon=horizon,
            follow_time=follow_time,
        )


def _check_opposed(data: Data, centering: Centering, laws: Sequence[SiteLaw], indices: Sequence[int]) -> None:
    """Raise an error if two fingers do not face each other."""
    first, second = (
        np.array(data.site_xmat[indices[i]]).reshape(3, 3) @ laws[i].site.direction for i in pair_of(centering, laws)
    )
    if float(first @ second) > _OPPOSED:
        angle = math.degrees(math.acos(max(-1.0, min(1.0, float(first @ second)))))
        raise InvalidInputError(
            f"centering: found an angle of {angle:.3g} deg between the axes of the sites "
            f"{' and '.join(centering.sites)}, expected opposed axes (180 deg)",
            value=angle,
        )


def _check_bandwidth(tracking: Tracking, step: float) -> None:
    """Raise an error if the joint controller's bandwidth is too high."""
    bandwidth = getattr(tracking, "bandwidth", 0.0)
    if 2 * math.pi * bandwidth * step > _FINEST:
        raise InvalidInputError(
            f"bandwidth: found {bandwidth:g} Hz, expected at most {_FINEST / (2 * math.pi * step):.3g} Hz for the "
            f"model's time step of {step:g} s. Reduce the bandwidth of the joint controller, or reduce the time step",
            value=bandwidth,
        )


def _largest_forces(drives: Drives) -> FloatArray:
    """Return the smallest and largest forces of the actuators, shape (rows, 2)."""
    by_control = np.sort(drives.gain[:, None] * drives.controls + drives.constant[:, None], axis=1)
    by_control = np.where(drives.gain[:, None] == 0, (-math.inf, math.inf), by_control)
    low = np.maximum(drives.lowest, by_control[:, 0])
    return np.column_stack([low, np.minimum(drives.highest, by_control[:, 1])])


def _largest_torques(drives: Drives) -> FloatArray:
    """Return the smallest and largest actuator torques per joint, shape (n, 2)."""
    torques = np.zeros((drives.moment.shape[1], 2))
    for row, (least, most) in zip(drives.moment, _largest_forces(drives), strict=True):
        for joint in np.flatnonzero(row):
            ends = sorted((row[joint] * least, row[joint] * most))
            torques[joint] += ends
    return np.clip(torques, drives.torques[:, :1], drives.torques[:, 1:])
