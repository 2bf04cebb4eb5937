"""Compute a robot's mass, excursion and drive limits along a sensor axis."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.display import Described
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray, finite_or_none, positive
from pretouch._core.units import format_quantity, to_si
from pretouch._core.values import Value
from pretouch._core.warning_codes import caution
from pretouch.control import Controller
from pretouch.designs import Constraint, Task
from pretouch.motion import Scenario

from .deviations import SIDEWAYS, TURN, with_curved_paths_last
from .drives import (
    AxisLimits,
    Drives,
    HoldError,
    acceleration_limits,
    drives_of,
    force_limits,
    missing_torques,
    speed_limits,
)
from .dynamics import (
    AxisMotion,
    Drivetrain,
    PostureDynamics,
    axis_motion,
    constraint_rows,
    drivetrain_of,
    null_space,
    posture_dynamics,
)
from .model import (
    Data,
    Model,
    check_model,
    idle_actuators,
    is_scalar_joint,
    joint_label,
    joint_speeds_of,
    mujoco,
    notes_of,
    site_index,
    unit_of_joint,
)
from .obstruction import covering_object, take_to_surface
from .path import Excursion, excursion
from .site import SensorSite
from .stance import describe_footholds, forces_of, gap_below, holding_torques, largest_push, supporting_bodies

POOR: Final = 0.2
"""Conditioning below which a projection warns, because the moved mass exceeds 25 times the lightest one."""

_IMPOSSIBLE: Final = 1e-6  # conditioning below which a motion along the axis is rounding
_NOTHING: Final = 1e-9  # m/s^2 or N: rounding of a limit of 0
_SHORT: Final = 1e-3  # m: a retreat that is too short to reduce an impact
_BEYOND: Final = 1.001  # a path that is longer than another one need not be followed farther
_FOLLOWS: Final = 1e-8  # motion of a joint per motion of the others, below which it is rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class Projection(Described, Value):
    """Mass, excursion and limits of a robot along a sensor axis.

    The robot is in one posture. Lengths, speeds, accelerations and forces count along the axis: ahead is toward
    objects, back is away from them. Excursion, speed, acceleration and force are those of the site itself. What a
    floating base or a passive joint takes back by its recoil is subtracted.

    Args:
        site: the sensor site.
        axis: direction toward objects in the world frame, shape (3,).
        position: position of the site in the world frame [m], shape (3,).
        posture: positions of the driven joints by name [rad or m].
        hold: what the joints hold while the site moves relative to the base: pose, position or axis.
        reflected_mass: mass that an impact along the axis meets [kg], 1 / (u^T J M^-1 J^T u). Drives do not count,
            because an impact is shorter than their response.
        moved_mass: effective mass of the motion along the axis for the drives [kg], which includes holding the other
            directions. The motion is that relative to the base.
        recoil_share: share kappa of the motion that the recoil of a floating base takes back, 0 for a fixed base.
        excursion: longest paths along the axis inside all joint ranges, ahead and back.
        acceleration: largest accelerations from rest [m/s^2]; gravity and posture are taken into account.
        speed: largest constant speeds [m/s]; infinite without damping or given joint speeds.
        force: largest forces on a blocked site at rest [N]. A base that recoils accelerates away meanwhile.
        conditioning: 1 in the direction in which the joints move the site most easily, 0 at a singularity.
        joint_motion: joint velocities per velocity of the site relative to the base, by name [rad/m or 1].
        base: degrees of freedom that neither an actuator nor a constraint moves, such as those of a floating base.
        followers: joints without an actuator that constraints move with the driven joints, by name.
        turning: angle by which the axis of the sensor turns per motion of the site [rad/m], by the joints and by the
            recoil of the base.
        sideways: motion across the axis per motion of the site, likewise.
        support: contacts on which the robot stands, as pairs of bodies. They count as fixed in all masses and motions,
            and push and rub in the limits of the drives.
        support_limit: force of an object on the site along the axis [N] from which such a contact lifts or slides while
            the drives keep their torques; infinite without one.
        unsupported_mass: reflected mass without these contacts [kg].
        lag: longest time by which the force of a drive along this motion follows its control [s], such as the time
            constant of a filter or a muscle; NaN for an activation without a known one. The limits do not include it.
        warnings: sentences on properties of the posture or of the model that matter for a design.
    """

    site: SensorSite
    axis: FloatArray
    position: FloatArray
    posture: Mapping[str, float]
    hold: str
    reflected_mass: float
    moved_mass: float
    recoil_share: float
    excursion: tuple[Excursion, Excursion]
    acceleration: AxisLimits
    speed: AxisLimits
    force: AxisLimits
    conditioning: float
    joint_motion: Mapping[str, float]
    base: int
    turning: float
    sideways: float
    followers: tuple[str, ...] = ()
    support: tuple[str, ...] = ()
    support_limit: float = math.inf
    unsupported_mass: float = math.nan
    lag: float = 0.0
    warnings: tuple[str, ...] = ()

    @property
    def retreat(self) -> float:
        """The longest retreat of the site from objects [m].

        It stays within all joint ranges.
        """
        return self.excursion[1].length

    @property
    def _freer_hold(self) -> str:
        """Advice to hold less if holding other directions makes the posture singular, else an empty text."""
        return ', or hold = "axis"' if self.excursion[1].is_singular and self.hold != "axis" else ""

    def constraints(self) -> tuple[Constraint, ...]:
        """Return the robot's limits as constraints of a design.

        The limits are excursion, speed and acceleration. The excursion is that of a retreat. Speed and acceleration
        hold in both directions.

        Returns:
            The constraints, without those that the model does not limit.

        Raises:
            InvalidInputError: the robot has no excursion, speed or acceleration along the axis.
        """
        limits = {"excursion": self.retreat, "speed": self.speed.least, "acceleration": self.acceleration.least}
        for name, limit in limits.items():
            if not limit > 0:
                raise InvalidInputError(
                    f"{name}: the largest {name} of the site {self.site.name!r} along its axis {self.site.axis} is 0 "
                    f"in this posture; choose another posture or axis{self._freer_hold if name == 'excursion' else ''}"
                )
        end = self.excursion[1].reason + (f' with hold = "{self.hold}"; try hold = "axis"' if self._freer_hold else "")
        sources = {"excursion": end, "speed": self.speed.reason}
        sources["acceleration"] = self.acceleration.reason
        return tuple(
            Constraint(name=n, limit=v, source=sources[n] or "robot model")
            for n, v in limits.items()
            if math.isfinite(v)
        )

    def task(self, scenario: Scenario, objective: Any = None, **options: Any) -> Task:
        """Return a design task with the limits of this robot.

        The task describes an encounter along the sensor axis. The task has the sensor curve of the site. `apply` says
        what is changed.

        Args:
            scenario: the encounter, with the admittance that the controller runs.
            objective: the objective of the task.
            **options: further fields of the task.

        Returns:
            The task, for every function that takes one.

        Raises:
            InvalidInputError: the site has no sensor curve.
        """
        if self.site.sensor is None:
            raise InvalidInputError(
                f"site {self.site.name!r}: this site has no sensor curve; set one with SensorSite(name, sensor=curve)"
            )
        return self.apply(Task(scenario, self.site.sensor, objective, **options))

    def apply(self, task: Task) -> Task:
        """Add the robot's limits and base recoil to a design task.

        The given task is not changed. The controller moves the site relative to the base, M s'' + D s' + K s = F_p. The
        base recoils, so that the encounter sees x = (1 - kappa) s. This is the motion of an admittance with M, D and K
        divided by 1 - kappa; a sampled controller is treated in the same way. Of two constraints on one quantity, the
        tighter one remains.

        Args:
            task: the task, with the admittance that the controller runs.

        Returns:
            The task for this robot.
        """
        share = 1 - self.recoil_share
        own = {limit.name: limit for limit in self.constraints()}
        limits = {limit.name: limit.limit for limit in task.limits}
        kept = [
            c
            for c, limit in zip(task.constraints, task.limits, strict=True)
            if not (limit.name in own and own[limit.name].limit < limit.limit)
        ]
        added = [limit for name, limit in own.items() if limit.limit < limits.get(name, math.inf)]
        changes: dict[str, Any] = {"constraints": (*kept, *added), "warnings": (*task.warnings, *self.warnings)}
        if self.recoil_share:
            if task.loop is not None:
                changes["loop"] = self._seen_loop(task.loop)
            a = task.scenario.admittance
            divided = replace(a, mass=a.mass / share, damping=a.damping / share, stiffness=a.stiffness / share)
            changes["scenario"] = replace(task.scenario, admittance=divided)
        return task.replace(**changes)

    def _seen_loop(self, loop: Any) -> Any:
        """Return a sampled loop whose controller moves as much as the site moves relative to an object.

        Raises:
            InvalidInputError: the loop has a custom controller.
        """
        if not isinstance(loop.law, Controller):
            raise InvalidInputError(
                f"loop: found a controller of the class {type(loop.law).__name__} on a floating base, expected the "
                "class Controller; remove the loop, or use a robot with a fixed base. Only the class Controller has a "
                "known admittance, which the recoil of the base changes",
                value=type(loop.law).__name__,
            )
        share = 1 - self.recoil_share
        return replace(loop, law=loop.law.scale_motion(share), recoil_share=self.recoil_share)

    def to_dict(self) -> dict[str, Any]:
        """Return all results of the projection as a dictionary for JSON.

        All values are in SI units. None stands for no limit.
        """
        spans = {
            name: {
                "ahead": finite_or_none(span.ahead),
                "back": finite_or_none(span.back),
                "reasons": list(span.reasons),
            }
            for name, span in (("acceleration", self.acceleration), ("speed", self.speed), ("force", self.force))
        }
        paths = zip(("ahead", "back"), self.excursion, strict=True)
        return {
            "site": self.site.name,
            "site_axis": self.site.axis if isinstance(self.site.axis, str) else list(self.site.axis),
            "axis": self.axis.tolist(),
            "position": self.position.tolist(),
            "posture": dict(self.posture),
            "hold": self.hold,
            "reflected_mass": self.reflected_mass,
            "moved_mass": self.moved_mass,
            "recoil_share": self.recoil_share,
            "excursion": {name: {"length": path.length, "reason": path.reason} for name, path in paths},
            **spans,
            "conditioning": self.conditioning,
            "joint_motion": dict(self.joint_motion),
            "base": self.base,
            "turning": self.turning,
            "sideways": self.sideways,
            "followers": list(self.followers),
            "support": list(self.support),
            "support_limit": finite_or_none(self.support_limit),
            "unsupported_mass": finite_or_none(self.unsupported_mass),
            "lag": finite_or_none(self.lag),
            "warnings": list(self.warnings),
        }


@check_arguments
def project_site(
    model: Model,
    data: Data,
    site: SensorSite,
    *,
    joint_speeds: Mapping[str, Any] | None = None,
) -> Projection:
    """Compute a robot's mass and limits along the axis of a sensor.

    They are inputs of a 1-D gain design. Degrees of freedom that no actuator moves form the base. They are a floating
    base or passive joints, and are treated as free, at rest in a frame that falls with the robot.

    Args:
        model: a `mujoco.MjModel`, such as from `load_model`.
        data: its `mujoco.MjData` in the posture, such as from `make_data`; velocities are ignored.
        site: the sensor.
        joint_speeds: largest speeds of joints by name [rad/s or m/s], as numbers or as text such as "90 deg/s"; MuJoCo
            models do not contain them.

    Returns:
        The projection, with warnings near a singularity.

    Raises:
        InvalidInputError: the model has no such site, or the site cannot move along the axis.
    """
    check_model(model)
    index = site_index(model, site.name)
    data = _at_rest(model, data)
    model, data, moved = take_to_surface(model, data, [site])
    drivetrain = drivetrain_of(model, data, index)
    dynamics = posture_dynamics(model, data, drivetrain, site.direction)
    motion = axis_motion(dynamics, site.hold)
    if motion is None or motion.conditioning < _IMPOSSIBLE:
        raise InvalidInputError(
            f"site {site.name!r}: in this posture, the joints cannot move the site along its axis {site.axis}"
            + ("" if site.hold in {"auto", "axis"} else f" while they hold its {site.hold}")
            + "; choose another axis or posture"
        )
    names = [joint_label(model, int(joint)) for joint in drivetrain.joints]
    movable = [int(joint) for joint in (*drivetrain.joints, *_follower_joints(model, drivetrain, dynamics))]
    units = {joint_label(model, joint): f"{unit_of_joint(model, joint)}/s" for joint in movable}
    stated = {name: speed for name, speed in joint_speeds_of(model).items() if name in units}
    speeds = {**stated, **_speeds(units, joint_speeds or {})}
    drives = drives_of(model, data, drivetrain, speeds)
    share = _site_share(dynamics, motion)
    if share <= _IMPOSSIBLE:
        raise InvalidInputError(_reversed_motion(model, site, drivetrain, dynamics, motion))
    limits, weak = _limits(model, drives, drivetrain, dynamics, motion)
    ahead, back = (
        path.of_site(share)
        for path in (
            excursion(model, data, drivetrain, site.direction, hold=motion.hold, ahead=side) for side in (True, False)
        )
    )
    places = np.asarray(model.jnt_qposadr)[drivetrain.joints]
    return Projection(
        site=site,
        axis=dynamics.axis,
        position=dynamics.position,
        posture=dict(zip(names, np.array(data.qpos)[places].tolist(), strict=True)),
        hold=motion.hold,
        reflected_mass=dynamics.reflected_mass,
        moved_mass=motion.moved_mass,
        recoil_share=1 - share,
        excursion=(ahead, back),
        acceleration=limits[0],
        speed=limits[1],
        force=limits[2],
        conditioning=motion.conditioning,
        joint_motion=dict(zip(names, motion.joints.tolist(), strict=True)),
        base=dynamics.reduction.loose.shape[1],
        turning=motion.turning / share,
        sideways=motion.sideways / share,
        followers=_followers(model, drivetrain, dynamics),
        support=describe_footholds(model, drivetrain.footholds),
        support_limit=support_limit(model, data, drivetrain, dynamics),
        unsupported_mass=_unsupported_mass(model, data, drivetrain, dynamics),
        lag=_longest_lag(drives, motion),
        warnings=with_curved_paths_last(
            (
                *notes_of(model),
                *moved,
                *weak,
                *([] if weak else _missing_directions(limits[0], limits[2])),
                *_object_warnings(model, data, site, index),
                *posture_warnings(
                    model, drivetrain, dynamics, motion, lambda _: back.length, limited=drives.has_force_limits
                ),
                *_passive_ends(back),
                *_short_retreat(back, motion),
                *_falling_warnings(model, data, drivetrain),
                *drive_warnings(drives, motion),
            )
        ),
    )


def _passive_ends(back: Excursion) -> Iterator[str]:
    """Yield a warning if the range of a joint that recoils ends the retreat of a site."""
    if back.passive:
        yield caution(
            "PT503",
            f"After a retreat of {format_quantity(back.length, 'm', 3)}, the recoil takes {', '.join(back.passive)} to "
            "the end of its range, where pretouch ends the retreat: lock this joint, or widen its range. Beyond, the "
            "mass and the motion of the site change.",
        )


def _reversed_motion(
    model: Model, site: SensorSite, drivetrain: Drivetrain, dynamics: PostureDynamics, motion: AxisMotion
) -> str:
    """Say that the recoil of a robot outweighs the motion of its site, what recoils, and what to do about it."""
    passive = [
        joint_label(model, joint)
        for joint in _passive_joints(model, drivetrain, dynamics)
        if is_scalar_joint(model, joint)
    ]
    moving = [joint_label(model, int(joint)) for joint in drivetrain.joints] + list(
        _followers(model, drivetrain, dynamics)
    )
    named = ", ".join(f'"{name}"' for name in moving)
    many, options = len(passive) > 1, " ".join(f"--joint {name}" for name in moving)
    what = f"the passive joint{'s' if many else ''} {', '.join(passive)}" if passive else "the floating base"
    remedy = (
        f"lock {'them' if many else 'it'} with joints = [{named}] ({options})"
        if passive
        else 'hold it with base = "fixed", choose another posture'
    )
    return (
        f"site {site.name!r}: {what} {'let' if many else 'lets'} the site move the other way than the "
        f"drives push it along its axis {site.axis} ({1 - motion.recoil_share:.2g} times as far): {remedy}, or move "
        "the site"
    )


def _site_share(dynamics: PostureDynamics, motion: AxisMotion) -> float:
    """Return the motion of a site itself per motion relative to its base, 1 - kappa: 1 without a base that recoils."""
    return 1 - motion.recoil_share if dynamics.reduction.loose.size else 1.0


def _passive_joints(model: Model, drivetrain: Drivetrain, dynamics: PostureDynamics) -> list[int]:
    """Return the joints that neither an actuator nor a constraint moves, also those of a floating base."""
    free = np.abs(dynamics.reduction.loose).max(axis=1, initial=0.0) > _FOLLOWS
    return list(dict.fromkeys(np.asarray(model.dof_jntid)[drivetrain.base[free]].tolist()))


def _unexpected_passive_joints(model: Model, drivetrain: Drivetrain, dynamics: PostureDynamics) -> Iterator[str]:
    """Yield the passive joints that are not a floating base on purpose: an actuator without effect also counts."""
    root = set(np.asarray(model.dof_jntid)[drivetrain.root].tolist())
    for joint in _passive_joints(model, drivetrain, dynamics):
        idle = idle_actuators(model, joint)
        if joint not in root or idle:
            by = f" with gear 0 of {', '.join(idle)}" if idle else ""
            yield joint_label(model, joint) + by


def _short_retreat(back: Excursion, motion: AxisMotion) -> Iterator[str]:
    """Yield a warning if a site can hardly retreat although no joint is at the end of its range."""
    if back.length < _SHORT and back.is_singular:
        less = "" if motion.hold == "axis" else f', or hold = "axis" instead of {motion.hold!r}'
        yield caution(
            "PT622",
            f"The site can retreat by only {format_quantity(back.length, 'm', 2)}, because {back.reason}: choose "
            f"another posture{less}. A gain within this retreat hardly reduces an impact.",
        )


def support_limit(model: Model, data: Data, drivetrain: Drivetrain, dynamics: PostureDynamics) -> float:
    """Return the force of an object on a site [N] from which a contact of a robot that stands lifts or slides.

    It is infinite without such contacts.
    """
    footholds, base = drivetrain.footholds, drivetrain.base
    if not footholds:
        return math.inf
    every, equality = np.concatenate([base, drivetrain.driven]), constraint_rows(model, data)
    rest = holding_torques(model, data, base, footholds, equality) - np.array(data.qfrc_bias - data.qfrc_passive)
    edges = forces_of(model, data, footholds)[:, every]
    push = -dynamics.axis @ dynamics.full[:3]
    return largest_push((dynamics.mass, dynamics.reduction.allowed), (rest[every], edges, equality[:, every]), push)


def _unsupported_mass(model: Model, data: Data, drivetrain: Drivetrain, dynamics: PostureDynamics) -> float:
    """Return the reflected mass if no contact holds the robot [kg]."""
    every = np.concatenate([drivetrain.base, drivetrain.driven])
    return dynamics.mass_with(null_space(constraint_rows(model, data)[:, every]))


def _falling_warnings(model: Model, data: Data, drivetrain: Drivetrain) -> Iterator[str]:
    """Yield a warning if a robot touches something, but does not stand on it."""
    if not len(drivetrain.root) or not np.any(model.opt.gravity):
        return
    degrees = np.concatenate([drivetrain.base, drivetrain.driven])
    pairs, (lowest, gap) = supporting_bodies(model, data, degrees), gap_below(model, data, degrees)
    if not pairs and gap > 0 and math.isfinite(gap):
        yield caution(
            "PT555",
            f"The robot is just above the ground ({lowest}, {format_quantity(gap, 'm', 2)}): lower it if it is meant "
            "to stand. pretouch treats it as a robot that falls freely.",
        )
    if pairs:
        yield caution(
            "PT555",
            f"The robot touches the ground, but cannot stand in this posture ({', '.join(pairs)}): choose a posture in "
            "which it balances and its contacts do not slide. pretouch treats it as a robot that falls freely.",
        )


def _limits(
    model: Model, drives: Drives, drivetrain: Drivetrain, dynamics: PostureDynamics, motion: AxisMotion
) -> tuple[tuple[AxisLimits, AxisLimits, AxisLimits], tuple[str, ...]]:
    """Return the limits of acceleration, speed and force, and warnings about joints that the drives cannot hold.

    Joints that do not move the site count as held, because their drives do not matter for the motion of the site.
    """
    matter = np.ones(len(drives.load), dtype=bool)
    matter[: len(motion.joints)] = np.abs(np.vstack([dynamics.own, dynamics.reduction.coupling])).max(axis=0) > 0
    try:
        return _spans(drives, dynamics, motion), ()
    except HoldError:
        missing = missing_torques(drives, matter)
    if np.any(missing[matter]):
        return (AxisLimits(0.0, 0.0),) * 3, tuple(_weakness(model, drives, drivetrain, np.where(matter, missing, 0.0)))
    return _spans(replace(drives, load=drives.load - missing), dynamics, motion), ()


def _spans(drives: Drives, dynamics: PostureDynamics, motion: AxisMotion) -> tuple[AxisLimits, AxisLimits, AxisLimits]:
    """Return the limits of acceleration, speed and force of the site itself."""
    share = _site_share(dynamics, motion)
    return (
        acceleration_limits(drives, dynamics, motion).scaled(share),
        speed_limits(drives, dynamics, motion).scaled(share),
        force_limits(drives, dynamics, motion),
    )


def _missing_directions(acceleration: AxisLimits, force: AxisLimits) -> Iterator[str]:
    """Yield a warning about drives that can move a site in one direction only, or not at all."""
    names = ("toward objects", "away from objects")
    still = {
        name: reasons
        for name, accelerates, presses, *reasons in zip(
            names,
            (acceleration.ahead, acceleration.back),
            (force.ahead, force.back),
            acceleration.reasons,
            force.reasons,
            strict=True,
        )
        if min(accelerates, presses) <= _NOTHING
    }
    if still:
        reasons = ", ".join(dict.fromkeys(reason for pair in still.values() for reason in pair if reason))
        yield caution(
            "PT627",
            f"The drives cannot push the site {' or '.join(still)} ({reasons or 'limits of the actuators'}): correct "
            "these limits if the real drives push both ways, or choose another posture. The table shows 0, the smaller "
            "limit of both directions.",
        )


def _weakness(model: Model, drives: Drives, drivetrain: Drivetrain, missing: FloatArray) -> Iterator[str]:
    """Yield a warning about the joints of a site that the drives cannot hold at rest."""
    parts = []
    for i in np.flatnonzero(missing[: len(drivetrain.joints)]):
        unit = "N m" if unit_of_joint(model, int(drivetrain.joints[i])) == "rad" else "N"
        names = ", ".join(drives.names[row] for row in np.flatnonzero(drives.moment[:, i]))
        parts.append(
            f"the joint {drives.joint_names[i]} lacks {abs(missing[i]):.3g} of {abs(drives.load[i]):.3g} {unit} "
            f"(actuator {names})"
        )
    yield caution(
        "PT546",
        "In this posture, the drives cannot hold the site at rest against gravity and springs "
        f"({'; '.join(parts) or 'its contacts do not hold it'}): choose another posture, or raise forcerange or "
        "ctrlrange of these actuators. Acceleration, speed and force along the axis are therefore 0.",
    )


def _object_warnings(model: Model, data: Data, site: SensorSite, index: int) -> Iterator[str]:
    """Yield a warning if an object or another robot covers a sensor site."""
    label = covering_object(model, data, site, index)
    if label:
        yield caution(
            "PT544",
            f"In this posture, the site {site.name} is inside the geom {label}, which does not belong to its robot: "
            "choose another posture before you simulate the robot. Masses and limits do not depend on it.",
        )


def warnings_of_site(model: Model, data: Data, site: SensorSite) -> tuple[str, ...]:
    """Return the warnings about posture and model for one sensor axis.

    The whole projection is not computed.

    Args:
        model: a `mujoco.MjModel`.
        data: its state in the posture.
        site: the sensor.

    Returns:
        The sentences; none if the joints cannot move the site.
    """
    data = _at_rest(model, data)
    drivetrain = drivetrain_of(model, data, site_index(model, site.name))
    dynamics = posture_dynamics(model, data, drivetrain, site.direction)
    motion = axis_motion(dynamics, site.hold)
    if motion is None:
        return ()
    drives = drives_of(model, data, drivetrain, {})

    share = abs(_site_share(dynamics, motion))

    def retreat(enough: float) -> float:
        way = enough / share if share else math.inf
        path = excursion(*(model, data, drivetrain, site.direction), hold=motion.hold, ahead=False, enough=way)
        return share * path.length  # a path that ends at this length may be shorter for the site itself

    return (
        *posture_warnings(model, drivetrain, dynamics, motion, retreat, limited=drives.has_force_limits),
        *drive_warnings(drives, motion),
    )


def _longest_lag(drives: Drives, motion: AxisMotion) -> float:
    """Return the longest lag of the drives that a motion needs [s]; NaN if one is unknown."""
    lags = drives.lags[_drives_along(drives, motion)]
    return float(lags.max(initial=0.0)) if np.isfinite(lags).all() else math.nan


def _drives_along(drives: Drives, motion: AxisMotion) -> IntArray:
    """Return the actuators that move along with a motion."""
    rates = np.abs(drives.moment @ motion.joints)
    return np.flatnonzero(rates > _FOLLOWS * rates.max(initial=0.0))


def drive_warnings(drives: Drives, motion: AxisMotion) -> Iterator[str]:
    """Yield warnings about actuators whose model is not that of a drive.

    Args:
        drives: the actuators.
        motion: the motion of the joints along the axis of a sensor.

    Yields:
        Sentences, for a warning.
    """
    along = _drives_along(drives, motion)
    forces = drives.bare_servos[along]
    if forces.any():
        named = ", ".join(f"{drives.names[i]} {f:.3g}" for i, f in zip(along, forces, strict=True) if f > 0)
        yield caution(
            "PT556",
            f"Only the control range limits the force of these servos ({named} N or N m): add forcerange to each. The "
            "number is the gain times the range of the control from this posture. A real drive may have less.",
        )
    lag = _longest_lag(drives, motion)
    if math.isnan(lag):
        named = ", ".join(drives.names[i] for i in along if not math.isfinite(drives.lags[i]))
        yield caution(
            "PT557",
            f"pretouch does not know the activation dynamics of these actuators ({named}): measure how fast their "
            "force follows the control. The limits and the simulation assume that it follows at once.",
        )
    elif lag > 0:
        named = ", ".join(f"{drives.names[i]} {drives.lags[i]:.3g} s" for i in along if drives.lags[i] > 0)
        yield caution(
            "PT557",
            f"The force of these actuators follows its control late ({named}): count on the largest acceleration only "
            "after as long. The simulation has no such lag; PositionControl with a bandwidth of "
            f"{1 / (2 * math.pi * lag):.2g} Hz has one.",
        )


def _followers(model: Model, drivetrain: Drivetrain, dynamics: PostureDynamics) -> tuple[str, ...]:
    """Return the joints that constraints move with the driven joints."""
    return tuple(joint_label(model, joint) for joint in _follower_joints(model, drivetrain, dynamics))


def _follower_joints(model: Model, drivetrain: Drivetrain, dynamics: PostureDynamics) -> list[int]:
    moved = drivetrain.base[(np.abs(dynamics.reduction.forced) > _FOLLOWS).any(axis=1)]
    return list(dict.fromkeys(np.asarray(model.dof_jntid)[moved].tolist()))


def _at_rest(model: Model, data: Data) -> Data:
    """Copy a MuJoCo state without velocities and applied forces."""
    copy = mujoco().MjData(model)
    copy.qpos[:] = data.qpos
    mujoco().mj_forward(model, copy)
    return copy


def _speeds(units: Mapping[str, str], limits: Mapping[str, Any]) -> dict[str, float]:
    """Return the largest speeds of joints that move, by name."""
    for name in limits:
        if name not in units:
            raise InvalidInputError(
                f"joint_speeds: found {name!r}, expected driven joints: {', '.join(units)}", value=name
            )
    labels = {name: f"joint_speeds {name}" for name in limits}
    return {
        name: positive(to_si(limits[name], units[name], name=label), label, units[name])
        for name, label in labels.items()
    }


def posture_warnings(
    model: Model,
    drivetrain: Drivetrain,
    dynamics: PostureDynamics,
    motion: AxisMotion,
    retreat: Callable[[float], float],
    *,
    limited: bool,
) -> Iterator[str]:
    """Yield warnings about a robot's posture and model for a gain design.

    Args:
        model: the model.
        drivetrain: its degrees of freedom.
        dynamics: the posture.
        motion: the motion of the joints along the axis of a sensor.
        retreat: function that returns the longest path away from objects [m]. It may end at a length of its argument.
        limited: whether the model limits the forces of all actuators.

    Yields:
        Sentences, for a warning.
    """
    if motion.conditioning < POOR:
        yield caution(
            "PT501",
            "The posture is close to a singularity: choose another posture if a design needs more acceleration than "
            f"the drives allow. Beyond this acceleration, the robot does not follow the prediction. The mass that the "
            f"drives move along the sensor axis is {motion.conditioning**-2:.0f} times the mass along the easiest "
            "direction.",
        )
    share = abs(_site_share(dynamics, motion))
    turning, sideways = (rate / share if share > _IMPOSSIBLE else 0.0 for rate in (motion.turning, motion.sideways))
    rates = ((TURN, turning), (SIDEWAYS, sideways))
    straight = min((limit / rate for limit, rate in rates if rate > 0), default=math.inf)
    if math.isfinite(straight) and straight < retreat(_BEYOND * straight):
        yield caution(
            "PT504",
            f"Per 100 mm of motion, the sensor turns by {math.degrees(turning) / 10:.2g} deg and moves "
            f"{format_quantity(sideways / 10, 'm', 2)} off its axis: simulate the robot. After an excursion of "
            f"{format_quantity(straight, 'm', 2)}, contact speeds may differ from the prediction by 3 % or more.",
        )
    if not limited:
        yield caution(
            "PT502",
            "The model does not limit the forces of all actuators, so that acceleration and force have no limit.",
        )
    endless = [joint_label(model, int(j)) for j in drivetrain.joints if not model.jnt_limited[j]]
    if endless:
        yield caution(
            "PT508",
            f"The model has no range for these joints, so pretouch lets them move without limit "
            f"({', '.join(endless)}): add the range of each joint that cannot move endlessly. With a range, the robot "
            "may retreat less.",
        )
    if drivetrain.shared:
        yield caution(
            "PT558",
            "Actuators drive several joints of the robot together, so that some motions of these joints have no drive: "
            "add an equality constraint if the joints are coupled. pretouch lets these motions keep their momentum, as "
            "those of passive joints.",
        )
    passive = list(_unexpected_passive_joints(model, drivetrain, dynamics))
    if passive:
        yield caution(
            "PT503",
            "No actuator moves these joints, so pretouch lets them move freely "
            f"({', '.join(passive)}): add actuators, or lock the joints.",
        )
