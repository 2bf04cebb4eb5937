"""Two bodies on slides in MuJoCo, and a law that is stepped beside them.

MuJoCo's contact is a soft constraint. With the impedance d and a direct `solref` = (-k', -c') the depth delta gets the
acceleration a_1 = (1 - d) a_0 - k' delta - c' delta', where a_0 is the one without contact. That is a force of

    m k' delta + m c' delta' + d m a_0,        never below 0, with m the reduced mass of both bodies.

So k' = k / m and c' = c / m make it a spring with a damper for d -> 0, and d is the smallest that MuJoCo takes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.extras import require
from pretouch._core.numbers import FloatArray
from pretouch.control import Sample
from pretouch.control.steps import as_step
from pretouch.motion import Scenario

from .contact import SpringDamper
from .law import SampledLaw

__all__ = ["SLIDE_COLUMNS", "Slides", "run_slides"]

SLIDE_COLUMNS: Final = (
    "time",
    "distance",
    "position",
    "velocity",
    "obstacle_position",
    "obstacle_velocity",
    "drive_force",
    "contact_force",
)
_DRIVEN: Final = 1e9  # times the mass of the robot: an obstacle that does not yield
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
# Without a tolerance the solver goes on until nothing improves. Its measure is relative to the mean of the masses:
# beside an obstacle of 1e9 times the robot's, its usual 1e-8 ends it early, with forces that are off by 0.2 %.


@dataclass(frozen=True, slots=True, kw_only=True)
class Slides:
    """One encounter as MuJoCo is to run it.

    Args:
        scenario: the encounter.
        law: the controller.
        drive: the coefficients of the plant.
        contact: the contact.
        reading: what the law reads of a distance.
        parts: how many steps of MuJoCo make a period of the law.
        horizon: how long to wait for contact [s].
        follow: how long to go on after it [s].

    Attributes:
        step: of MuJoCo [s].
        obstacle_mass: of the body that stands for the obstacle [kg].
        reduced_mass: of both bodies [kg].
    """

    scenario: Scenario
    law: SampledLaw
    drive: tuple[float, ...]
    contact: SpringDamper
    reading: Callable[[float], float]
    parts: int
    horizon: float
    follow: float

    @property
    def step(self) -> float:
        """The step of MuJoCo [s]."""
        return self.law.period / self.parts

    @property
    def obstacle_mass(self) -> float:
        """The mass of the body that stands for the obstacle [kg]."""
        return self.contact.obstacle_mass if math.isfinite(self.contact.obstacle_mass) else _DRIVEN * self.drive[0]

    @property
    def reduced_mass(self) -> float:
        """The reduced mass of both bodies [kg]."""
        return 1 / (1 / self.drive[0] + 1 / self.obstacle_mass)


def run_slides(slides: Slides) -> tuple[FloatArray, bool]:
    """Run an encounter in MuJoCo.

    Args:
        slides: the encounter.

    Returns:
        A row per step of MuJoCo, by SLIDE_COLUMNS, and whether MuJoCo warned.
    """
    mujoco = require("mujoco", extra="mujoco")
    e, law, model = slides, slides.law, mujoco.MjModel.from_xml_string(_text(slides))
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
        target = (*virtual, output.position, output.velocity, output.acceleration)
        for i in range(e.parts):
            (x, x_o), (v, v_o) = data.qpos.tolist(), data.qvel.tolist()
            push, servo = _drive(e, i / e.parts, target, (x, v, servo))
            data.qfrc_applied[:] = push, e.obstacle_mass * obstacle.acceleration
            mujoco.mj_step(model, data)
            force = float(data.efc_force[0]) if data.nefc else 0.0
            rows.append((t + i * step, x_o - x, x, v, x_o, v_o, push, force))
            if force > 0.0:
                first = min(first, t + i * step)
        virtual = output.position, output.velocity
        if t + law.period - first >= e.follow:
            break
    return np.array(rows), any(warning.number for warning in data.warning)


def _text(slides: Slides) -> str:
    """Return the model as MuJoCo reads it."""
    return _MODEL.format(
        step=slides.step,
        mass=slides.drive[0],
        obstacle_mass=slides.obstacle_mass,
        stiffness=slides.contact.stiffness / slides.reduced_mass,
        damping=slides.contact.damping / slides.reduced_mass,
        impedance=_IMPEDANCE,
    )


def _drive(
    slides: Slides, s: float, target: tuple[float, ...], state: tuple[float, float, float]
) -> tuple[float, float]:
    """Return the force on the robot at the part s of a period, and that of its servo; see `PlantModel`."""
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
