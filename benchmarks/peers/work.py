"""Define the test cases in plain numbers, independent of pretouch."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Any, Final, TypeAlias

if TYPE_CHECKING:
    import numpy as np

Column: TypeAlias = "np.ndarray[Any, np.dtype[np.float64]]"

MASS: Final = 1.0
DAMPING: Final = 10.0
STIFFNESS: Final = 25.0
DISTANCE: Final = 0.0422  # of the obstacle at t = 0 [m]; the plant rests at 0 m
VELOCITY: Final = -0.3  # of the obstacle in case A and D [m/s]

SENSORS: Final = ("exponential-1", "inverse-power")
RATE: Final = -61.0  # Table I: ln xi = ln 0.458 - 61 l
OFFSET: Final = 0.0419  # Table I: ln xi = ln 1.30e-5 - 3.32 ln(l + 0.0419)
EXPONENT: Final = 3.32

POSITION_SCALE: Final = 0.5  # x_typ and l'_typ of the objective f_1
VELOCITY_SCALE: Final = 0.3
EXCURSION: Final = 0.08  # limits of case E: distance from the reference [m], and time to contact [s]
LATEST: Final = 1.2
BOUNDS: Final = (-10.0, -0.01)  # of the gain [N s]

CASES: Final = {
    "A": "one design, warm",
    "B": "contacts, v in [-1, -0.05] m/s, D_p in [-2, -0.05] N s",
    "C": "designs, v in [-1, -0.05] m/s",
    "D": "a fresh process that designs one gain",
    "E": "designs with two limits: 80 mm from the reference and contact within 1.2 s",
    "F": "contacts of a virtual drag, v in [-1, -0.05] m/s, phi in [0.001, 0.02] N s^2",
    "G": "whole commands: processor time of fresh processes",
}
SIZES: Final = {"A": 1, "B": 100_000, "C": 10_000, "D": 1, "E": 10_000, "F": 100_000, "G": 1_000_000}
QUICK: Final = {"A": 1, "B": 2_000, "C": 200, "D": 1, "E": 200, "F": 2_000, "G": 400}
ACCURACY: Final = {
    "A": 1e-7,
    "B": 1e-9,
    "C": 1e-7,
    "D": 1e-7,
    "E": 1e-7,
    "F": 1e-9,
}  # relative, in the gain or in the contact time
_SEED: Final = 20261121


def contacts(count: int) -> tuple[Column, Column]:
    """Draw v [m/s] and D_p [N s] of case B; a smaller set is the start of a larger one."""
    import numpy as np  # noqa: PLC0415 - a fresh process pays only for what its peer needs

    draws = np.random.default_rng(_SEED).uniform(size=(count, 2))
    return -1.0 + 0.95 * draws[:, 0], -2.0 + 1.95 * draws[:, 1]


def drags(count: int) -> tuple[Column, Column]:
    """Draw v [m/s] and phi [N s^2] of case F; a smaller set is the start of a larger one."""
    v, gain = contacts(count)
    return v, 1e-3 + 0.019 * (gain + 2.0) / 1.95


def designs(count: int) -> Column:
    """Draw v [m/s] of cases C and E; one is that of case A and D."""
    import numpy as np  # noqa: PLC0415

    if count == 1:
        return np.array([VELOCITY])
    return np.random.default_rng(_SEED + 1).uniform(-1.0, -0.05, count)


def latest(velocity: float) -> float:
    """Return the latest contact [s] that both limits of case E allow, since the robot is at l(0) + v t at contact."""
    return min(LATEST, (EXCURSION + DISTANCE) / -velocity)


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def first_guess(sensor: str, speed: Any, log: Any = math.log) -> Any:
    """Estimate ln(-D_p) of the optimum from |v| by a line through a few designs, for every peer."""
    return 0.22 + 0.34 * log(speed) if sensor == "exponential-1" else 0.17 + 0.39 * log(speed)
