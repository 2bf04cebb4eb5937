"""The same encounter in MuJoCo: another integrator and another contact around the same law. A witness of `simulate`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, nonnegative, positive
from pretouch._core.values import Value
from pretouch.motion import ContactStatus, Scenario
from pretouch.sensors import SensorModel

from .contact import ContactModel, SpringDamper
from .law import SampledLaw
from .mujoco_slides import SLIDE_COLUMNS, Slides, run_slides
from .plant import PlantModel
from .running import FOLLOW, HORIZON

__all__ = ["WitnessResult", "WitnessTrace", "witness_encounter"]

_TIME_STEP: Final = 2e-5
_OF_CONTACT: Final = ("time", "position", "velocity", "relative_velocity", "rebound_velocity")
_COARSEST: Final = 0.2  # of the shortest time scale: what a method of the first order may take at once


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class WitnessTrace(Value):
    """The course of one encounter in MuJoCo, a row per step of MuJoCo; each array has the shape (n,).

    Args:
        time: t [s].
        distance: l [m]; below 0 where the bodies press into each other.
        position: x of the robot [m].
        velocity: x' of the robot [m/s].
        obstacle_position: x_o [m].
        obstacle_velocity: x_o' [m/s].
        drive_force: of the robot's drive, less its friction [N], from this step to the next.
        contact_force: of MuJoCo's contact [N], from this step to the next.
    """

    time: FloatArray
    distance: FloatArray
    position: FloatArray
    velocity: FloatArray
    obstacle_position: FloatArray
    obstacle_velocity: FloatArray
    drive_force: FloatArray
    contact_force: FloatArray

    def __repr__(self) -> str:
        return f"<WitnessTrace: {len(self.time)} steps to {self.time[-1]:.4g} s>"


@dataclass(frozen=True, slots=True, kw_only=True)
class WitnessResult(Value):
    """What `witness_encounter` returns; the quantities are those of `SimulationResult`.

    Args:
        status: contact, horizon, or unresolved where MuJoCo warned.
        time: of the first contact [s]; NaN without one, as all that speaks of it.
        position: x there [m].
        velocity: x' there [m/s].
        relative_velocity: l' there [m/s].
        peak_force: largest contact force [N].
        impact_force: largest contact force within the time that an impact without loss and drive would last [N].
        impulse: of all contact forces [N s].
        rebound_velocity: l' at the end of the first contact [m/s]; NaN where it lasts.
        trace: the whole course.
    """

    status: ContactStatus
    time: float
    position: float
    velocity: float
    relative_velocity: float
    peak_force: float
    impact_force: float
    impulse: float
    rebound_velocity: float
    trace: WitnessTrace


def witness_encounter(
    scenario: Scenario,
    sensor: SensorModel,
    law: SampledLaw,
    *,
    plant: PlantModel,
    contact: ContactModel,
    time_step: float = _TIME_STEP,
    horizon: float = HORIZON,
    follow: float = FOLLOW,
) -> WitnessResult:
    """Run one encounter in MuJoCo, with the law in a loop of Python, to compare with `simulate`.

    Two bodies on a slide each, MuJoCo's semi-implicit Euler method, MuJoCo's contact, no gravity, no friction between
    them. The sensor is ideal: read at each step of the law, without noise and delay. Motion and contact share no code
    with `simulate`; what differs is of the first order in the time step. Needs the extra `mujoco`.

    Args:
        scenario: one encounter.
        sensor: the sensor curve.
        law: the controller.
        plant: the robot and its drive; one with a mass.
        contact: a SpringDamper; MuJoCo knows no other that has the same force at every depth.
        time_step: of MuJoCo [s], a whole part of the law's period.
        horizon: how long to wait for contact [s].
        follow: how long to go on after it [s].

    Returns:
        The first contact, the largest forces, and the whole course.

    Raises:
        InvalidInputError: no single encounter, a plant without mass, another contact, or a step that is too long.

    Examples:
        >>> from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> from pretouch.simulation import ImpedancePlant
        >>> law = Controller(
        ...     period=1e-3,
        ...     conditioning=Conditioning(floor=1e-3),
        ...     law=VirtualDamper(gain=-0.7),
        ...     admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        ... )
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> found = witness_encounter(
        ...     scenario,
        ...     InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        ...     law,
        ...     plant=ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0),
        ...     contact=SpringDamper(stiffness=3e4, damping=30.0, obstacle_mass=1.0),
        ... )
        >>> round(found.relative_velocity, 3)
        -0.082
    """
    coefficients = plant.coefficients()
    if scenario.shape:
        raise InvalidInputError(f"scenario: found encounters of the shape {scenario.shape}, expected one")
    if coefficients[0] == 0:
        raise InvalidInputError("plant: an ideal plant has no mass; choose an ImpedancePlant or a PositionPlant")
    if not isinstance(contact, SpringDamper):
        raise InvalidInputError(f"contact: found {type(contact).__name__}, expected a SpringDamper, as MuJoCo has")
    slides = Slides(
        scenario=scenario,
        law=law,
        drive=coefficients,
        contact=contact,
        reading=_reading_of(sensor),
        parts=_parts(law.period, positive(time_step, "time_step", "s")),
        horizon=positive(horizon, "horizon", "s"),
        follow=nonnegative(follow, "follow", "s"),
    )
    _check_step(slides)
    rows, warned = run_slides(slides)
    return _result(rows, slides, warned=warned)


def _parts(period: float, step: float) -> int:
    parts = round(period / step)
    if parts < 1 or abs(period / step - parts) > 1e-9 * parts:
        raise InvalidInputError(
            f"time_step: found {step:g} s, of which no whole number makes the law's period of {period:g} s"
        )
    return parts


def _check_step(slides: Slides) -> None:
    mass, stiffness, _, damping, _, servo, coulomb, speed = slides.drive
    contact, reduced = slides.contact, slides.reduced_mass
    drive = max(math.sqrt(stiffness / mass), damping / mass, servo, coulomb / speed / mass)
    fastest = max(drive, math.sqrt(contact.stiffness / reduced), contact.damping / reduced)
    if slides.step * fastest > _COARSEST:
        raise InvalidInputError(
            f"time_step: found {slides.step:g} s, which does not resolve the shortest time scale of robot and contact, "
            f"{1 / fastest:.3g} s; take at most {_COARSEST / fastest:.3g} s"
        )


def _reading_of(sensor: SensorModel) -> Callable[[float], float]:
    """Return xi of a distance: 0 beyond the curve, and that of its start below it and in contact."""
    low, high = sensor.valid_range
    return lambda distance: 0.0 if distance > high else math.exp(float(sensor.log_output(max(distance, low))))


def _result(rows: FloatArray, slides: Slides, *, warned: bool) -> WitnessResult:
    trace = WitnessTrace(**{name: np.ascontiguousarray(c) for name, c in zip(SLIDE_COLUMNS, rows.T, strict=True)})
    distance, force = trace.distance, trace.contact_force
    closing = trace.obstacle_velocity - trace.velocity
    touched = bool(distance.min() <= 0)
    status = ContactStatus.UNRESOLVED if warned else ContactStatus.CONTACT if touched else ContactStatus.HORIZON
    if not touched:
        none = dict.fromkeys(_OF_CONTACT, math.nan)
        return WitnessResult(status=status, peak_force=0.0, impact_force=0.0, impulse=0.0, trace=trace, **none)
    after = int(np.argmax(distance <= 0))  # not the first: an encounter starts before contact
    part = distance[after - 1] / (distance[after - 1] - distance[after])
    time, x, v, speed = (
        float(column[after - 1] + part * (column[after] - column[after - 1]))
        for column in (trace.time, trace.position, trace.velocity, closing)
    )
    apart = np.flatnonzero(distance[after:] > 0)
    impact = trace.time <= time + math.pi * math.sqrt(slides.reduced_mass / slides.contact.stiffness)
    return WitnessResult(
        status=status,
        time=time,
        position=x,
        velocity=v,
        relative_velocity=speed,
        peak_force=float(force.max()),
        impact_force=float(force[impact].max()),
        impulse=float(force.sum() * slides.step),
        rebound_velocity=float(closing[after + apart[0]]) if len(apart) else math.nan,
        trace=trace,
    )
