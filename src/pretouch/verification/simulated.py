"""What simulated runs say of the quantities that objectives and limits speak of, and of which they know nothing."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.design import ImpactModel
from pretouch.simulation import ClosedLoop, SimulationResult

__all__ = ["simulated_quantity", "source_of"]

_PLAIN: Final = frozenset(
    {
        "time",
        "position",
        "velocity",
        "acceleration",
        "displacement",
        "relative_velocity",
        "virtual_force",
        "largest_excursion",
        "largest_travel",
        "largest_speed",
        "largest_acceleration",
        "largest_virtual_force",
    }
)
"""Quantities that go by the same name in a simulated run, where the simulation records them."""


def simulated_quantity(
    name: str, result: SimulationResult, gain: float, loop: ClosedLoop, impact: ImpactModel | None
) -> FloatArray | None:
    """Read a quantity of every run.

    Args:
        name: the quantity, as objectives and constraints name it.
        result: the runs.
        gain: D_p of the runs [N s].
        loop: what they ran on.
        impact: physical properties, where given.

    Returns:
        The quantity in SI with its sign, NaN in runs without contact where it speaks of contact; None where the
        simulation does not tell it.
    """
    if name == "gain":
        return np.full(result.shape, gain)
    if name == "impact_force":
        if loop.contact is not None:
            return np.where(result.touched, result.impact_force, np.nan)
        return None if impact is None else np.asarray(impact.peak_force(result.relative_velocity))
    if name == "drive_force":
        mass, acceleration = _robot_mass(loop, impact), _recorded(result, "largest_acceleration")
        return None if mass is None or acceleration is None else mass * acceleration
    return _recorded(result, name) if name in _PLAIN else None


def source_of(name: str, loop: ClosedLoop, impact: ImpactModel | None, known: bool) -> str:
    """Say where a quantity of a run comes from.

    Args:
        name: the quantity.
        loop: what the runs ran on.
        impact: physical properties, where given.
        known: whether the simulation tells it.

    Returns:
        Words, such as `simulated contact force`.
    """
    if not known:
        return "not simulated: nothing is known of it on this loop"
    if name == "impact_force":
        if loop.contact is not None:
            return "simulated contact force"
        return "impact model at the simulated speed of contact" if impact is not None else ""
    return "robot mass times largest simulated acceleration" if name == "drive_force" else "simulated"


def _recorded(result: SimulationResult, name: str) -> FloatArray | None:
    column: Any = getattr(result, name, None)
    return None if column is None else np.asarray(column, dtype=np.float64)


def _robot_mass(loop: ClosedLoop, impact: ImpactModel | None) -> float | None:
    mass = loop.plant.coefficients()[0]
    return mass if mass > 0 else None if impact is None else impact.robot_mass
