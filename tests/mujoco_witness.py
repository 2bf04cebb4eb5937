"""Simulate an encounter in MuJoCo, as an independent check of the function `simulate`.

MuJoCo's contact is a soft constraint. With the impedance d and a direct `solref` = (-k', -c'), the depth delta has the
acceleration a_1 = (1 - d) a_0 - k' delta - c' delta', where a_0 is the acceleration without contact. That is a force of

    m k' delta + m c' delta' + d m a_0,        never below 0, with m the reduced mass of both bodies.

So k' = k / m and c' = c / m make it a spring with a damper for d -> 0, and d is the smallest that MuJoCo accepts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.control import Sample
from pretouch.control.laws import as_step
from pretouch.motion import ContactStatus, Scenario
from pretouch.sensors import SensorModel
from pretouch.simulation.law import SampledLaw
from pretouch.simulation.result import FOLLOW, HORIZON
from pretouch.simulation.robot import PlantModel, SpringDamper

_COARSEST: Final = 0.2  # largest step of the first-order method, in shortest time scales
_DRIVEN: Final = 1e9  # mass of a driven obstacle that does not yield, in masses of the robot
_IMPEDANCE: Final = 1e-4  # mjMINIMP
_MODEL: Final = """
<mujoco>
  <option timestep="{step!r}" integrator="Euler" gravity="0 0 0" solver="Newton" tolerance="0" ls_tolerance="1e-6"/>
  <worldbody>
    <body name="robot">
      <joint type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="{mass!r}" diaginertia="1 1 1"/>
      <geom name="tip" type="sphere" size="1" pos="-1 0 0" contype="0" conaffinity="0"/>
    </body>
    <body name="obstacle">
      <joint type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="{obstacle_mass!r}" diaginertia="1 1 1"/>
      <geom name="face" type="box" size="1 1 1" pos="1 0 0" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <contact>
    <pair geom1="tip" geom2="face" condim="1" solref="-{stiffness!r} -{damping!r}"
          solimp="{impedance!r} {impedance!r} 1 0.5 1"/>
  </contact>
</mujoco>
"""
# With tolerance 0 the solver continues until nothing improves. Its tolerance is relative to the mean of the masses:
# with an obstacle of 1e9 times the robot's mass, the default 1e-8 stops it early, with errors of 0.2 % in the force.


@dataclass(frozen=True, slots=True, kw_only=True)
class WitnessTrace:
    """Time series of one encounter in MuJoCo, one element per step of MuJoCo; each array has the shape (n,).

    Args:
        time: t [s].
        distance: l [m]; below 0 where the bodies press into each other.
        position: x of the robot [m].
        velocity: x' of the robot [m/s].
        obstacle_position: x_o [m].
        obstacle_velocity: x_o' [m/s].
        drive_force: force of the robot's drive minus friction [N], from this step to the next.
        contact_force: force of MuJoCo's contact [N], from this step to the next.
    """

    time: FloatArray
    distance: FloatArray
    position: FloatArray
    velocity: FloatArray
    obstacle_position: FloatArray
    obstacle_velocity: FloatArray
    drive_force: FloatArray
    contact_force: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class WitnessResult:
    """What `witness_encounter` returns; the quantities are those of `SimulationResult`.

    Args:
        status: contact, horizon, or unresolved if MuJoCo warned.
        time: time of the first contact [s]; NaN without a contact, like the next three.
        position: x at contact [m].
        velocity: x' at contact [m/s].
        relative_velocity: l' at contact [m/s].
        peak_force: largest contact force [N].
        impact_force: largest contact force within the duration of an impact without loss and drive [N].
        impulse: impulse of all contact forces [N s].
        rebound_velocity: l' at the end of the first contact [m/s]; NaN if it does not end.
        trace: the time series.
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
    contact: SpringDamper,
    time_step: float = 2e-5,
    horizon: float = HORIZON,
    follow_time: float = FOLLOW,
) -> WitnessResult:
    """Simulate one encounter in MuJoCo, for comparison with the result of `simulate`.

    The law is called from Python.

    The model has two bodies, each on a slide, without gravity and friction between them. MuJoCo integrates it by its
    semi-implicit Euler method, with its own contact. The sensor is ideal: it is read at each step of the law, without
    noise and delay. Motion and contact share no code with `simulate`; differences are of the first order in the time
    step.

    Args:
        scenario: one encounter.
        sensor: the sensor curve.
        law: the controller.
        plant: the robot and its drive, with a mass.
        contact: a SpringDamper, the only contact model that MuJoCo can represent at every depth.
        time_step: step of MuJoCo [s], an integer fraction of the law's period.
        horizon: longest time to wait for contact [s].
        follow_time: time to continue after contact [s].

    Returns:
        The first contact, the largest forces, and the time series.

    Raises:
        ValueError: an array of encounters, a plant without mass, another contact, or a step that is too long.
    """
    coefficients = plant.coefficients()
    if scenario.shape or coefficients[0] == 0 or plant.system() is not None or not isinstance(contact, SpringDamper):
        raise ValueError("expected one encounter, a plant with mass that is no state space, and a SpringDamper")
    parts = round(law.period / time_step)
    if abs(law.period / time_step - parts) > 1e-9 * parts:
        raise ValueError(f"time_step: found {time_step:g} s, expected an integer fraction of {law.period:g} s")
    slides = _Slides(
        scenario=scenario,
        law=law,
        drive=coefficients,
        contact=contact,
        reading=_reading_of(sensor),
        parts=parts,
        horizon=horizon,
        follow_time=follow_time,
    )
    _check_step(slides)
    return _result(*_run(slides), slides)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Slides:
    """One encounter, prepared for MuJoCo as two bodies that slide along one axis.

    `parts` is the number of MuJoCo steps in a period of the law.
    """

    scenario: Scenario
    law: SampledLaw
    drive: tuple[float, ...]
    contact: SpringDamper
    reading: Callable[[float], float]
    parts: int
    horizon: float
    follow_time: float

    @property
    def step(self) -> float:
        """The time step of MuJoCo [s]."""
        return self.law.period / self.parts

    @property
    def obstacle_mass(self) -> float:
        """The mass of the body that represents the obstacle [kg]."""
        return self.contact.obstacle_mass if math.isfinite(self.contact.obstacle_mass) else _DRIVEN * self.drive[0]

    @property
    def reduced_mass(self) -> float:
        """The reduced mass of robot and obstacle [kg]."""
        return 1 / (1 / self.drive[0] + 1 / self.obstacle_mass)

    @property
    def text(self) -> str:
        """The model of robot and obstacle in MuJoCo's XML format."""
        spring, damper = self.contact.stiffness / self.reduced_mass, self.contact.damping / self.reduced_mass
        masses = {"mass": self.drive[0], "obstacle_mass": self.obstacle_mass}
        return _MODEL.format(step=self.step, stiffness=spring, damping=damper, impedance=_IMPEDANCE, **masses)


def _check_step(slides: _Slides) -> None:
    mass, stiffness, _, damping, _, servo, coulomb, speed = slides.drive
    contact, reduced = slides.contact, slides.reduced_mass
    drive = max(math.sqrt(stiffness / mass), damping / mass, servo, coulomb / speed / mass)
    fastest = max(drive, math.sqrt(contact.stiffness / reduced), contact.damping / reduced)
    if slides.step * fastest > _COARSEST:
        raise ValueError(
            f"time_step: found {slides.step:g} s, too long for the shortest time scale of robot and contact, "
            f"{1 / fastest:.3g} s; use at most {_COARSEST / fastest:.3g} s"
        )


def _reading_of(sensor: SensorModel) -> Callable[[float], float]:
    """Return the sensor output as a function of the distance."""
    # The output is 0 beyond the curve, and constant below its start and in contact.
    low, high = sensor.valid_range
    return lambda distance: 0.0 if distance > high else math.exp(float(sensor.log_output(max(distance, low))))


def _result(rows: FloatArray, warned: bool, slides: _Slides) -> WitnessResult:
    trace = WitnessTrace(**{f.name: np.ascontiguousarray(c) for f, c in zip(fields(WitnessTrace), rows.T, strict=True)})
    distance, force = trace.distance, trace.contact_force
    closing = trace.obstacle_velocity - trace.velocity
    touched = bool(distance.min() <= 0)
    status = ContactStatus.UNRESOLVED if warned else ContactStatus.CONTACT if touched else ContactStatus.HORIZON
    if not touched:
        none = dict.fromkeys(("time", "position", "velocity", "relative_velocity", "rebound_velocity"), math.nan)
        return WitnessResult(status=status, peak_force=0.0, impact_force=0.0, impulse=0.0, trace=trace, **none)
    after = int(np.argmax(distance <= 0))  # at least 1, because an encounter starts before contact
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


def _run(slides: _Slides) -> tuple[FloatArray, bool]:
    """Return a row per step of MuJoCo, with the columns of `WitnessTrace`, and whether MuJoCo warned."""
    import mujoco

    e, law, model = slides, slides.law, mujoco.MjModel.from_xml_string(slides.text)
    data = mujoco.MjData(model)
    plant, obstacle, reference = e.scenario.plant, e.scenario.obstacle, e.scenario.reference
    data.qpos[:] = plant.position, obstacle.position
    data.qvel[:] = plant.velocity, obstacle.velocity
    step_law, parameters = as_step(law.step), law.parameters()
    state = law.start(position=plant.position - reference.position, velocity=plant.velocity - reference.velocity)
    virtual, servo = (plant.position, plant.velocity), 0.0
    step, force, first = e.step, 0.0, math.inf
    rows: list[tuple[float, ...]] = []
    for j in range(math.ceil(e.horizon / law.period - 1e-9)):
        t = j * law.period
        x, x_o = data.qpos.tolist()
        state, output = step_law(
            parameters,
            state,
            Sample(
                reading=e.reading(x_o - x),
                contact_force=-force,
                reference_position=reference.position + t * (reference.velocity + t / 2 * reference.acceleration),
                reference_velocity=reference.velocity + t * reference.acceleration,
                reference_acceleration=reference.acceleration,
            ),
        )
        obstacle_rates = (
            np.diff(obstacle.velocity_at(t + step * np.arange(e.parts + 1))) / step
        )  # mean acceleration over each step
        target = (*virtual, output.position, output.velocity, output.acceleration)
        for i in range(e.parts):
            (x, x_o), (v, v_o) = data.qpos.tolist(), data.qvel.tolist()
            push, servo = _drive(e, i / e.parts, target, (x, v, servo))
            data.qfrc_applied[:] = push, e.obstacle_mass * obstacle_rates[i]
            mujoco.mj_step(model, data)
            force = float(data.efc_force[0]) if data.nefc else 0.0
            rows.append((t + i * step, x_o - x, x, v, x_o, v_o, push, force))
            if force > 0.0:
                first = min(first, t + i * step)
        virtual = output.position, output.velocity
        if t + law.period - first >= e.follow_time:
            break
    return np.array(rows), any(warning.number for warning in data.warning)


def _drive(
    slides: _Slides, s: float, target: tuple[float, ...], state: tuple[float, float, float]
) -> tuple[float, float]:
    """Return the force of the robot's drive and of its servo at a moment within a controller period."""
    # `PlantModel` states the equation of motion.
    period, (x, v, lagging) = slides.law.period, state
    _, stiffness, reference_damping, own_damping, ahead, servo, coulomb, friction_speed = slides.drive
    x_0, v_0, x_1, v_1, a_v = target
    r = 1.0 - s  # the cubic through both ends
    x_v = r * r * ((1 + 2 * s) * x_0 + s * period * v_0) + s * s * ((3 - 2 * s) * x_1 - r * period * v_1)
    v_v = 6 * s * r * (x_1 - x_0) / period + r * (1 - 3 * s) * v_0 + s * (3 * s - 2) * v_1
    command = stiffness * (x_v - x) + reference_damping * v_v - own_damping * v + ahead * a_v
    if servo == 0.0:
        lagging = command
    force = lagging - coulomb * math.tanh(v / friction_speed)
    return force, lagging - math.expm1(-servo * slides.step) * (command - lagging)
