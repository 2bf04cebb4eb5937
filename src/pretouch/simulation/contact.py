"""What two bodies do to each other where they touch: Hunt and Crossley's law, and a spring with a damper."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from pretouch._core.blocks import Measured
from pretouch._core.declared import check_declared, quantity
from pretouch._core.errors import InvalidInputError
from pretouch._core.units import format_quantity

from .plant import Row

__all__ = ["ContactModel", "HuntCrossley", "SpringDamper"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactModel(ABC):
    """A normal contact force F(d, d') >= 0 of the depth d = -l.

    Args:
        obstacle_mass: mass of the obstacle [kg]; infinite where it is driven and does not yield. A finite mass keeps
            the acceleration of the scenario, and the contact force comes on top.
    """

    kind: ClassVar[str] = ""
    """What a scenario file calls it."""

    obstacle_mass: float = quantity("kg", math.inf, sign="positive", infinite=True)

    def __post_init__(self) -> None:
        check_declared(self)

    @abstractmethod
    def numbers(self) -> tuple[float, float, float, bool, float]:
        """Return stiffness, damping, exponent, whether damping grows with depth, and 1 / obstacle_mass."""

    def rows(self) -> Iterator[Row]:
        """Yield what a page says of the force and what it meets: names and numbers."""
        yield from self.force_rows()
        driven = math.isinf(self.obstacle_mass)
        yield "obstacle", "driven: it does not yield" if driven else f"of {format_quantity(self.obstacle_mass, 'kg')}"

    def force_rows(self) -> Iterator[Row]:
        """Yield what a page says of the force; a class that says nothing of its own what the loop is handed."""
        stiffness, damping, exponent, grows, _ = self.numbers()
        yield "contact", type(self).__name__
        yield "stiffness", Measured(stiffness, "N/m^n")
        yield "exponent", Measured(exponent)
        yield "damping", f"{damping:.4g}, {'which grows with depth' if grows else 'the same at any depth'}"


@dataclass(frozen=True, slots=True, kw_only=True)
class HuntCrossley(ContactModel):
    """F = k d^n (1 + a d'): damping grows with depth, so that the force starts and ends at 0.

    After K. H. Hunt, F. R. E. Crossley, "Coefficient of restitution interpreted as damping in vibroimpact", J. Appl.
    Mech. 42 (1975) 440-445, where a = 3/2 alpha and the restitution is e = 1 - alpha v for slow impacts. For any speed
    a v - ln(1 + a v) = -a e v - ln(1 - a e v), for a given a whatever k, n and the masses.

    Args:
        obstacle_mass: mass of the obstacle [kg]; infinite where it is driven.
        stiffness: k > 0 [N/m^n].
        dissipation: a >= 0 [s/m]; 0 for an elastic contact.
        exponent: n >= 1; 3/2 for a sphere, after Hertz.

    Examples:
        >>> HuntCrossley(stiffness=1e6, dissipation=1.5).exponent
        1.5
    """

    kind: ClassVar[str] = "hunt-crossley"

    stiffness: float = quantity("N/m^n", sign="positive", example='"1e6 N/m^1.5"')
    dissipation: float = quantity("s/m", 0.0, sign="nonnegative")
    exponent: float = quantity("", 1.5, sign="positive")

    def __post_init__(self) -> None:
        ContactModel.__post_init__(self)
        if not self.exponent >= 1:
            raise InvalidInputError(f"exponent: found {self.exponent:g}, which must be at least 1")

    def numbers(self) -> tuple[float, float, float, bool, float]:
        """Return stiffness, damping, exponent, whether damping grows with depth, and 1 / obstacle_mass."""
        return self.stiffness, self.dissipation * self.stiffness, self.exponent, True, 1 / self.obstacle_mass

    def force_rows(self) -> Iterator[Row]:
        """Yield what a page says of the force."""
        yield "contact", "Hunt and Crossley: F = k d^n (1 + a d')"
        yield "stiffness k", Measured(self.stiffness, "N/m^n")
        yield "exponent n", Measured(self.exponent)
        yield "dissipation a", Measured(self.dissipation, "s/m")


@dataclass(frozen=True, slots=True, kw_only=True)
class SpringDamper(ContactModel):
    """F = max(0, k d + c d'), Kelvin and Voigt's contact; it jumps at the touch where c > 0.

    The force never pulls; its restitution without pull is that of T. Schwager, T. Poeschel, "Coefficient of
    restitution and linear-dashpot model revisited", Granular Matter 9 (2007) 465-469.

    Args:
        obstacle_mass: mass of the obstacle [kg]; infinite where it is driven.
        stiffness: k > 0 [N/m].
        damping: c >= 0 [N s/m].

    Examples:
        >>> SpringDamper(stiffness=1e4).damping
        0.0
    """

    kind: ClassVar[str] = "spring-damper"

    stiffness: float = quantity("N/m", sign="positive", example='"10 kN/m"')
    damping: float = quantity("N*s/m", 0.0, sign="nonnegative")

    def numbers(self) -> tuple[float, float, float, bool, float]:
        """Return stiffness, damping, exponent, whether damping grows with depth, and 1 / obstacle_mass."""
        return self.stiffness, self.damping, 1.0, False, 1 / self.obstacle_mass

    def force_rows(self) -> Iterator[Row]:
        """Yield what a page says of the force."""
        yield "contact", "spring and damper: F = max(0, k d + c d')"
        yield "stiffness k", Measured(self.stiffness, "N/m")
        yield "damping c", Measured(self.damping, "N*s/m")
