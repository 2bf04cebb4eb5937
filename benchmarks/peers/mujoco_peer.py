"""MuJoCo with Optuna: trial and error in simulation, the usual practice.

A slider carries the admittance; at each step the program reads the sensor curve, forms the virtual force from two
readings, and applies it. The gain is searched by Optuna's tree-structured Parzen estimator.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache, partial
from typing import Any

from . import closed_form
from .protocol import Job, Way, missing, one_by_one
from .work import BOUNDS, DAMPING, DISTANCE, EXPONENT, MASS, OFFSET, RATE, SENSORS, STIFFNESS, Column

_STEP = 5e-4  # [s]: some thousand steps in a slow encounter
_TRIALS = 100
_HORIZON = 60.0
_MODEL = f"""
<mujoco>
  <option timestep="{_STEP}" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="slide" type="slide" axis="1 0 0" damping="{DAMPING}" stiffness="{STIFFNESS}"/>
      <geom type="sphere" size="0.01" mass="{MASS}" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>
"""


class MuJoCo:
    """Simulated one by one."""

    name = "MuJoCo + Optuna"

    def available(self) -> str:
        """Return an empty reason where both are installed."""
        return missing("mujoco", "optuna")

    def cases(self) -> Sequence[Way]:
        """Return its ways."""
        ways = []
        for sensor in SENSORS:
            on = partial(Way, sensor=sensor)
            ways += [
                on(
                    name="simulated contact",
                    cases="B",
                    make=partial(_contacts, sensor),
                    tolerance=0.05,
                    size=50,
                    grows=sensor == "inverse-power",
                ),
                on(name=f"TPE, {_TRIALS} trials", cases="AD", make=partial(_designs, sensor), tolerance=0.1, size=2),
            ]
        return ways


def _reading(sensor: str, distance: float) -> float:
    if sensor == "exponential-1":
        return 0.458 * math.exp(RATE * distance)
    return 1.30e-5 * (distance + OFFSET) ** -EXPONENT


@lru_cache(maxsize=1)
def _simulator() -> tuple[Any, Any]:
    import mujoco  # noqa: PLC0415

    model = mujoco.MjModel.from_xml_string(_MODEL)
    return model, mujoco.MjData(model)


def _simulate(sensor: str, v: float, gain: float) -> tuple[float, float]:
    """Return t and l' at l = 0, interpolated linearly between two steps."""
    import mujoco  # noqa: PLC0415

    model, data = _simulator()
    mujoco.mj_resetData(model, data)
    position, velocity, force, step = data.qpos, data.qvel, data.qfrc_applied, mujoco.mj_step
    distance = DISTANCE
    xi = _reading(sensor, distance)
    for k in range(1, round(_HORIZON / _STEP)):
        step(model, data)
        before, distance = distance, DISTANCE + v * k * _STEP - float(position[0])
        if distance <= 0:
            t = (k - distance / (distance - before)) * _STEP
            return t, v - float(velocity[0])
        old, xi = xi, _reading(sensor, distance)
        force[0] = gain * (xi - old) / _STEP / xi
    raise ArithmeticError(f"no contact within {_HORIZON:g} s")


def _contacts(sensor: str, v: Column, gain: Column) -> Job:
    return one_by_one(lambda v, gain: _simulate(sensor, v, gain)[0], v, gain)


def _designs(sensor: str, v: Column) -> Job:
    import optuna  # noqa: PLC0415

    optuna.logging.set_verbosity(optuna.logging.ERROR)

    def solve(velocity: float) -> float:
        def objective(trial: Any) -> float:
            gain = -trial.suggest_float("gain", -BOUNDS[1], -BOUNDS[0], log=True)
            t, speed = _simulate(sensor, velocity, gain)
            return float(closed_form.merit(t, velocity, speed))

        study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1))
        study.optimize(objective, n_trials=_TRIALS)
        return -float(study.best_params["gain"])

    return one_by_one(solve, v)
