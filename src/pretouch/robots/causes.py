"""Find out why a simulated encounter of a robot differs from its prediction.

The distance is l = x - s with the motion x of the object and s of the site along the axis. A difference of the distance
is therefore the sum of four parts, in the frame of the prediction:

- the object does not move as at the detection,
- the site does not follow the reference,
- the reference differs, because the readings are not those of a facing surface at this distance,
- the reference differs, because the controller is sampled.

The controller is run again for the last two: on the readings of such a surface at the simulated distance, and at the
predicted one. What the reference changes only because the distance has changed is no cause. A contact that begins
before the distance is 0 is a fifth part.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity

from .dynamics import Drivetrain, axis_motion, free_acceleration, posture_dynamics
from .model import Data, Model, mujoco, names_of
from .result import BodyContact, DetectedEncounter, PredictedCourse, RobotTrace, SiteContact, course_of
from .sight import FARTHEST
from .site_law import SiteLaw

_PART: Final = 0.3  # of the largest part, from which another part is a cause as well
_LATE: Final = 4.0  # durations of the predicted impact, after which a peak is not that of the impact
_PUSHES: Final = 0.05  # share of the momentum of the impact, from which drives change the peak force by as much
_EXPLAINED: Final = 1.1  # ratio of forces, in units of that of the impulses, up to which the drives explain it
_ALIKE: Final = (0.8, 1.25)  # impulse until the peak, in units of the momentum of an impact: the masses are right
_NOTHING: Final = 1e-9  # m
_NO_SHAPE: Final = (
    "no shape of the model is at the site, so that the object passes it without a force: take the site to a surface of "
    "the robot, or add a shape to the model"
)


@dataclass(frozen=True, slots=True)
class RobotEncounterRun:
    """One run of a site, with all that its explanation needs.

    Args:
        model: the model of the simulation.
        drivetrain: the degrees of freedom.
        law: the law of the site.
        site: number of the site.
        contact: the simulated contact.
        predicted: its prediction.
        touches: all contacts of the robot in this run.
        trace: the time series of this run.
    """

    model: Model
    drivetrain: Drivetrain
    law: SiteLaw
    site: int
    contact: SiteContact
    predicted: SiteContact
    touches: Sequence[BodyContact]
    trace: RobotTrace


def causes_of(run: RobotEncounterRun) -> tuple[str, ...]:
    """Return the causes of a difference in contact speed, time and excursion, the largest first.

    Args:
        run: the run, with a detection.

    Returns:
        Clauses such as "the site does not follow its reference (12 mm)".
    """
    detection = run.contact.detection
    course = None if detection is None else course_of(run.law, detection)
    if detection is None or course is None:
        return ()
    parts = dict(_parts(run, detection, course))
    largest = max((abs(size) for size in parts.values()), default=0.0)
    ranked = sorted(parts.items(), key=lambda item: -abs(item[1]))
    return tuple(
        words if math.isinf(size) else f"{words} ({format_quantity(abs(size), 'm', 2)})"
        for words, size in ranked
        if abs(size) >= _PART * largest and abs(size) > _NOTHING
    )


def _parts(
    run: RobotEncounterRun, detection: DetectedEncounter, course: PredictedCourse
) -> Iterator[tuple[str, float]]:
    """Yield the parts of the difference of the distance at the first of both contacts [m], with their words."""
    trace, contact, period = run.trace, run.contact, run.law.controller.period
    steps = max(round(period / run.model.opt.timestep), 1)
    rows = np.arange(0, len(trace.time), steps)
    times, distances = trace.time[rows], trace.distance[rows, run.site]
    ends = [contact.time, run.predicted.time, float(times[-1])]
    first = int(np.searchsorted(times, detection.time - period / 2))
    last = int(np.searchsorted(times, min(t for t in ends if not math.isnan(t)) + period / 2)) - 1
    last = min(max(last, first + 1), len(times) - 1)
    share, now = 1 - detection.recoil_share, float(times[last])
    # the row of a period has the reference at its end
    reference = share * (float(trace.reference[rows[last - 1], run.site]) - detection.position)
    moved = _motion_of_site(run, detection, rows[first], rows[last])
    expected = share * (float(np.interp(now, course.time, course.position)) - detection.position)
    predicted = np.interp(times, course.time, course.distance)
    yield _tracking_words(run), moved - reference
    own = _reference(run, distances, last)
    yield _reading_words(run), reference - share * (own - detection.position)
    sampled = _reference(run, np.where(np.arange(len(times)) <= first, distances, predicted), last)
    yield (
        "the controller is sampled and one-sided, the prediction is continuous",
        share * (sampled - detection.position) - expected,
    )
    if not math.isfinite(distances[last]):
        yield "the object has left the axis of the sensor, so that no ray on it meets the object", math.inf
    else:
        yield (
            _object_words(run),
            float(distances[last] + moved - predicted[last] - expected) + detection.distance - float(distances[first]),
        )
    if not math.isnan(contact.time):
        yield from _gap(run)


def _motion_of_site(run: RobotEncounterRun, detection: DetectedEncounter, first: int, last: int) -> float:
    """Return how far a site has moved along its axis between two rows, without the flight of its base [m]."""
    trace, data = run.trace, mujoco().MjData(run.model)
    start, axis = _place(run, data, first)
    moved = float(axis @ (_place(run, data, last)[0] - start))
    if not len(run.drivetrain.root):
        return moved
    h, since = float(run.model.opt.timestep), float(trace.time[last] - trace.time[first])
    mujoco().mj_forward(run.model, data)
    fall = float(axis @ free_acceleration(run.model, data, run.drivetrain))
    before = max(first - 1, 0)
    step = axis @ (_place(run, data, before + 1)[0] - _place(run, data, before)[0])
    velocity = float(step) / h + fall * h / 2 - (1 - detection.recoil_share) * detection.velocity
    return moved - velocity * since - fall * since**2 / 2


def _place(run: RobotEncounterRun, data: Data, row: int) -> tuple[FloatArray, FloatArray]:
    """Return position and axis of a site in the world frame in a row of the trace."""
    data.qpos[:] = run.trace.configuration[row]
    mujoco().mj_kinematics(run.model, data)
    index = run.drivetrain.site
    turn = np.array(data.site_xmat[index]).reshape(3, 3)
    return np.array(data.site_xpos[index]), np.asarray(turn @ run.law.site.direction)


def _reference(run: RobotEncounterRun, distances: FloatArray, last: int) -> float:
    """Return the reference [m] of a controller whose readings are those of a facing surface at these distances."""
    curve: Any = run.law.site.sensor
    controller, approach, period = run.law.running.begin(), run.law.approach, run.law.controller.period
    seen = np.clip(np.where(np.isfinite(distances), distances, 2 * FARTHEST), max(0.0, curve.valid_range[0]), None)
    readings = np.asarray(curve.output(np.minimum(seen, curve.valid_range[1])), dtype=np.float64)
    position = 0.0
    for j in range(last):
        position = controller.step(
            float(readings[j]), reference_position=approach * j * period, reference_velocity=approach
        ).position
    return float(position)


def _tracking_words(run: RobotEncounterRun) -> str:
    """Say why a site may not follow its reference."""
    contact, model = run.contact, run.model
    if contact.obstacle:
        return f"the reference stops at a {contact.obstacle}"
    hits = [touch for touch in run.touches if not touch.site and not touch.time > contact.time]
    if hits:
        return f"the robot is hit at its body {hits[0].body} before"
    degrees = np.concatenate([run.drivetrain.driven, run.drivetrain.base])
    reasons = (
        (contact.saturated > 0, ", because a drive is at its limit"),
        (run.drivetrain.shared, ", because actuators drive several joints together"),
        (np.asarray(model.dof_frictionloss)[degrees].any(), ", because of dry friction in the joints"),
        (len(run.drivetrain.base) > 0, ", because of the joints without a drive"),
        (True, ""),
    )
    return "the site does not follow its reference" + next(words for holds, words in reasons if holds)


def _reading_words(run: RobotEncounterRun) -> str:
    """Say why readings may not be those of a facing surface on the axis."""
    if run.law.chain is not None:
        return "the sensor chain changes the readings, or the object is no facing surface"
    if run.law.site.field_of_view > 0:
        return "the beam sees an object that is no facing surface"
    return "the axis meets an object that is no facing surface"


def _object_words(run: RobotEncounterRun) -> str:
    """Say why an object may not move as at its detection."""
    before = [touch for touch in run.touches if touch.time < run.contact.time]
    if before:
        return f"the object touches the body {before[0].body} before, which changes its motion"
    return "the object moves otherwise than at its detection, or the axis meets another part of it"


def _gap(run: RobotEncounterRun) -> Iterator[tuple[str, float]]:
    """Yield the distance on the axis at which the contact begins, and why it is not 0."""
    trace, model = run.trace, run.model
    row = min(int(np.searchsorted(trace.time, run.contact.time)), len(trace.time) - 1)
    gap = float(trace.distance[row, run.site])
    data = mujoco().MjData(model)
    position, axis = _place(run, data, row)
    mujoco().mj_fwdPosition(model, data)
    weld, geoms = np.asarray(model.body_weldid), names_of(model, "geom")
    carrier = weld[model.site_bodyid[run.drivetrain.site]]
    for contact in data.contact:
        if min(contact.geom) < 0 or carrier not in weld[np.asarray(model.geom_bodyid)[np.asarray(contact.geom)]]:
            continue
        labels = [geoms[geom] or f"number {geom}" for geom in contact.geom]
        if contact.includemargin > 0 and contact.dist > -contact.includemargin:
            yield (
                f"the margin of the geoms {labels[0]} and {labels[1]} lets them touch ahead of their surfaces",
                max(float(contact.includemargin), abs(gap) if math.isfinite(gap) else 0.0),
            )
            return
        offset = np.cross(axis, np.array(contact.pos) - position)
        if not abs(gap) <= _NOTHING:
            yield (
                f"the object touches {format_quantity(float(np.linalg.norm(offset)), 'm', 2)} beside the axis",
                abs(gap) if math.isfinite(gap) else math.inf,
            )
            return


def cause_of_force(run: RobotEncounterRun, force: float, stiffness: float) -> str:
    """Return why the peak force differs by more than the contact speed does.

    Args:
        run: the run, with a detection and a predicted contact.
        force: the simulated peak force [N].
        stiffness: stiffness of the contact in the prediction [N/m].
    """
    contact, trace, h = run.contact, run.trace, float(run.model.opt.timestep)
    detection, speed = contact.detection, abs(contact.relative_velocity)
    assert detection is not None  # noqa: S101 - there is no prediction without one
    forces = trace.force[:, run.site]
    first = int(np.argmax(forces > 0))
    rest = np.flatnonzero(forces[first:] <= 0)
    end = first + int(rest[0]) if len(rest) else len(forces)
    peak = int(np.argmax(forces))
    if any(touch.time <= trace.time[peak] for touch in run.touches if touch.site != run.law.site.name):
        return "other bodies of the robot share the contact"
    if not first <= peak < end:
        later = f"{format_quantity(float(trace.time[peak]) - contact.time, 's', 2)} later, in another touch"
        return f"the force peaks {later}" if forces[peak] > 0 else _NO_SHAPE
    mass = 1 / (1 / detection.reflected_mass + 1 / detection.obstacle_mass)
    duration = math.pi * math.sqrt(mass / stiffness)
    late = float(trace.time[peak] - trace.time[first])
    pushed = _impulse_of_drives(run, first, max(peak, first + 1)) / (mass * speed) if speed > 0 else 0.0
    if late > _LATE * duration:
        return f"robot and object press: the force peaks {format_quantity(late, 's', 2)} after the touch"
    effective = (force / speed) ** 2 / mass if speed > 0 else math.inf
    stiff = (
        f"the contact of the model acts like a stiffness of {format_quantity(effective, 'N/m', 2)}, and "
        f"contact_stiffness is {format_quantity(stiffness, 'N/m', 2)}"
    )
    compressed = math.fsum(forces[first : peak + 1]) * h / (mass * speed) if speed > 0 else math.inf
    ratio = force / (speed * math.sqrt(stiffness * mass)) if speed > 0 else math.inf
    if pushed > _PUSHES and ratio > 1:
        words = (
            f"the drives push against the impact: until the force peaks, {format_quantity(late, 's', 2)} after the "
            f"touch, they add {100 * pushed:.0f} % of its momentum, and the prediction has no drives"
        )
        return words if ratio < _EXPLAINED * (1 + pushed) else f"{words}; {stiff}"
    if not _ALIKE[0] < compressed < _ALIKE[1]:
        return (
            f"until the force peaks, its impulse is {compressed:.2g} times the momentum of the impact with the "
            "reflected mass, because dry friction or soft constraints change this mass, or the force is not along the "
            "axis"
        )
    return stiff


def _impulse_of_drives(run: RobotEncounterRun, first: int, last: int) -> float:
    """Return the impulse [N s] along the axis by which the torques have changed since the touch."""
    trace, data = run.trace, mujoco().MjData(run.model)
    data.qpos[:] = trace.configuration[first]
    mujoco().mj_forward(run.model, data)
    dynamics = posture_dynamics(run.model, data, run.drivetrain, run.law.site.direction)
    motion = axis_motion(dynamics, run.law.site.hold)
    if motion is None:
        return 0.0
    change = trace.torque[first : last + 1] - trace.torque[max(first - 1, 0)]
    return float((change @ motion.joints).sum() * run.model.opt.timestep)
