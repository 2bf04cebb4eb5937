"""What simulated runs say of the quantities that objectives and limits speak of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.design import ImpactModel
from pretouch.motion import ContactState
from pretouch.simulation import ClosedLoop, SimulationResult

__all__ = ["simulated_quantity", "simulated_state", "source_of"]


def simulated_quantity(
    name: str, result: SimulationResult, gain: float, loop: ClosedLoop, impact: ImpactModel | None
) -> FloatArray:
    """Read a quantity of every run.

    Args:
        name: the quantity, one of those of objectives and limits, or `peak_force`.
        result: the runs.
        gain: D_p of the runs [N s].
        loop: what they ran on.
        impact: physical properties, where given; the ideal design has refused what needs them and has none.

    Returns:
        The quantity in SI with its sign, NaN in runs without contact where it speaks of contact.
    """
    if name == "gain":
        return np.full(result.shape, gain)
    known: Any = impact
    if name == "impact_force" and loop.contact is None:
        return np.asarray(known.peak_force(result.relative_velocity))
    if name == "impact_force":
        return np.where(result.touched, result.impact_force, np.nan)
    if name == "drive_force":
        mass = loop.plant.coefficients()[0] or known.robot_mass  # an ideal robot has no mass of its own
        return mass * np.asarray(result.largest_acceleration)
    return np.asarray(getattr(result, name), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class _Runs(Value):
    """The quantities of simulated runs, as a ContactState reads them."""

    result: SimulationResult
    gain: float
    loop: ClosedLoop
    impact: ImpactModel | None

    def column(self, name: str) -> FloatArray:
        """Return a quantity of every run."""
        return simulated_quantity(name, self.result, self.gain, self.loop, self.impact)


def simulated_state(
    result: SimulationResult, gain: float, loop: ClosedLoop, impact: ImpactModel | None
) -> ContactState:
    """Read the state of every run at its first contact, for an objective of a user's own.

    Args:
        result: the runs.
        gain: D_p of the runs [N s].
        loop: what they ran on.
        impact: physical properties, where given.

    Returns:
        The state; NaN in runs without contact where it speaks of contact.
    """
    return ContactState(_Runs(result, gain, loop, impact))


def source_of(name: str, loop: ClosedLoop) -> str:
    """Say where a quantity of a run comes from.

    Args:
        name: the quantity.
        loop: what the runs ran on.

    Returns:
        Words, such as `simulated contact force`.
    """
    if name == "impact_force":
        return "impact model at the simulated speed of contact" if loop.contact is None else "simulated contact force"
    return "robot mass times largest simulated acceleration" if name == "drive_force" else "simulated"
