"""The virtual admittance of L(1): force in, motion out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.declared import check_declared, quantity
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import float_or_array, nonnegative, positive
from pretouch._core.values import Value

__all__ = ["Admittance"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Admittance(Value):
    """Virtual mass, damping and stiffness M_a, D_a, K_a of L(1); each a number or an array.

    Args:
        mass: M_a > 0 [kg]. It is virtual: the robot's own inertia is another quantity.
        damping: D_a >= 0 [N s/m].
        stiffness: K_a >= 0 [N/m].

    Examples:
        >>> Admittance(mass=1.0, damping=10.0, stiffness=25.0).damping_ratio
        1.0
    """

    mass: Any = quantity("kg", sign="positive", example='"1 kg"')
    damping: Any = quantity("N*s/m", sign="nonnegative", example='"10 N*s/m"')
    stiffness: Any = quantity("N/m", sign="nonnegative", example='"25 N/m"')

    def __post_init__(self) -> None:
        check_declared(self, arrays=True)

    @classmethod
    def from_natural_frequency(
        cls, *, mass: ArrayLike, natural_frequency: ArrayLike, damping_ratio: ArrayLike = 1.0
    ) -> Admittance:
        """Make an admittance from its free response; critically damped by default, as in the letter.

        Args:
            mass: M_a > 0 [kg].
            natural_frequency: sqrt(K_a / M_a) >= 0 [rad/s].
            damping_ratio: D_a / (2 sqrt(M_a K_a)) >= 0.

        Returns:
            The admittance.

        Examples:
            >>> Admittance.from_natural_frequency(mass=1.0, natural_frequency=5.0)
            Admittance(mass=1.0, damping=10.0, stiffness=25.0)
        """
        m = np.asarray(positive(mass, "mass", "kg"))
        omega = np.asarray(nonnegative(natural_frequency, "natural_frequency", "rad/s"))
        zeta = np.asarray(nonnegative(damping_ratio, "damping_ratio"))
        return cls(mass=m, damping=2 * zeta * omega * m, stiffness=omega**2 * m)

    @property
    def natural_frequency(self) -> Any:
        """The undamped natural frequency sqrt(K_a / M_a) [rad/s]."""
        return float_or_array(np.sqrt(np.asarray(self.stiffness) / self.mass))

    @property
    def damping_ratio(self) -> Any:
        """The damping ratio D_a / (2 sqrt(M_a K_a)).

        Raises:
            InvalidInputError: the stiffness is zero, so there is no such ratio.
        """
        if np.any(np.asarray(self.stiffness) == 0):
            raise InvalidInputError("damping_ratio: not defined for a stiffness of 0 N/m")
        return float_or_array(np.asarray(self.damping) / (2 * np.sqrt(np.asarray(self.stiffness) * self.mass)))
