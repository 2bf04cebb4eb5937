"""Model the robot's motion and its contact force with an obstacle."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from pretouch._core.blocks import Cell, Measured
from pretouch._core.errors import InvalidInputError
from pretouch._core.extensions import Extensions, kind_problem
from pretouch._core.fields import check_declared, flag, quantity
from pretouch._core.numbers import FloatArray, finite
from pretouch._core.units import format_quantity
from pretouch.motion import Admittance

_WORDS: Final = {
    "mass": ("mass", "kg"),
    "stiffness": ("stiffness", "N/m"),
    "reference_damping": ("damping on the reference's velocity", "N*s/m"),
    "own_damping": ("damping on its own velocity", "N*s/m"),
    "feedforward_mass": ("feedforward mass", "kg"),
    "servo_rate": ("rate of the servo", "1/s"),
    "coulomb_friction": ("Coulomb friction", "N"),
    "friction_speed": ("speed of the friction", "m/s"),
}
COEFFICIENTS: Final = tuple(_WORDS)
"""The coefficients of a plant in the compiled loop; a mass of 0 means an ideal plant, a servo rate of 0 no lag."""

_FASTEST: Final = 1e6  # rad/s: a higher natural frequency of a robot indicates a typing error
_FINE: Final = 0.2  # step of the Runge-Kutta method, in shortest time scales of the plant

Row = tuple[str, Cell]


class PlantModel(ABC):
    """Model of a robot that follows the admittance's commanded position.

    The robot yields to a contact force. The equation of motion is m x'' = f - friction(x') - F_contact, where f follows
    k (x_v - x) + d_v x_v' - d_x x' + m_f x_v'' at the servo's rate. A user-defined plant implements `coefficients`. A
    robot with more states, such as flexible joints, is a `LinearPlant` or a `StateSpacePlant`.
    """

    __slots__ = ()

    kind: ClassVar[str] = ""
    """Its name in a scenario file."""

    def system(self) -> Any:
        """Return the state-space model of a linear robot.

        It is None for a robot that `coefficients` describes completely.
        """
        return None

    @abstractmethod
    def coefficients(self) -> tuple[float, ...]:
        """Return the coefficients of the robot model in SI units.

        They include mass, stiffness, damping, friction and the rate of the force controller. The order is m, k, d_v,
        d_x, m_f, rate of the servo (0: no lag), Coulomb friction, friction speed.
        """

    def rows(self) -> Iterator[Row]:
        """Yield table rows with the parameters of the robot.

        By default, they are all values that `coefficients` returns.
        """
        yield "robot", type(self).__name__
        for (label, unit), value in zip(_WORDS.values(), self.coefficients(), strict=True):
            yield label, Measured(value, unit)


@dataclass(frozen=True, slots=True, kw_only=True)
class IdealPlant(PlantModel):
    """An ideal robot without mass, which follows the commanded position exactly.

    The position of the plant is that of the virtual object, x = x_v, as Section II of the letter assumes.

    It has no physical mass and no contact force, so a run ends at contact.
    """

    kind: ClassVar[str] = "ideal"

    def coefficients(self) -> tuple[float, ...]:
        """Return the coefficients of the robot model in SI units.

        They include mass, stiffness, damping, friction and the rate of the force controller.
        """
        return (0.0,) * len(COEFFICIENTS)

    def rows(self) -> Iterator[Row]:
        """Yield table rows with the parameters of the robot."""
        yield "robot", "ideal: it follows the virtual object exactly and has no mass"


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpedancePlant(PlantModel):
    """An impedance-controlled robot with mass, friction and a force controller.

    Args:
        mass: the *physical* reflected mass at the contact point m > 0 [kg], not the virtual mass M_a.
        stiffness: K_c > 0 of the impedance controller [N/m].
        damping: D_c >= 0 of the impedance controller [N s/m], on the velocity error.
        bandwidth: bandwidth of the force servo, a first-order lag [Hz]; infinite for no lag.
        viscous_friction: viscous friction coefficient [N s/m].
        coulomb_friction: Coulomb friction, which only depends on the sign of the velocity [N].
        friction_speed: speed at which three quarters of the Coulomb friction act [m/s]; the friction follows tanh(x' /
            friction_speed).
        feedforward: whether the controller adds m x_v''.

    Examples:
        >>> ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0).mass
        2.0
    """

    kind: ClassVar[str] = "impedance"

    mass: float = quantity("kg", sign="positive", example='"4 kg"')
    stiffness: float = quantity("N/m", sign="positive", example='"10 kN/m"')
    damping: float = quantity("N*s/m", sign="nonnegative", example='"100 N*s/m"')
    bandwidth: float = quantity("Hz", math.inf, sign="positive", infinite=True)
    viscous_friction: float = quantity("N*s/m", 0.0, sign="nonnegative")
    coulomb_friction: float = quantity("N", 0.0, sign="nonnegative")
    friction_speed: float = quantity("m/s", 1e-3, sign="positive")
    feedforward: bool = flag(True)

    def __post_init__(self) -> None:
        check_declared(self)
        frequency = math.sqrt(self.stiffness / self.mass)
        if frequency > _FASTEST:
            raise InvalidInputError(
                f"stiffness: the stiffness of {self.stiffness:g} N/m is too high for the mass of {self.mass:g} kg. The "
                f"natural frequency is {frequency:.3g} rad/s, expected at most {_FASTEST:,.0f} rad/s. Check the units "
                "of stiffness and mass",
                limit=_FASTEST,
            )

    def coefficients(self) -> tuple[float, ...]:
        """Return the coefficients of the robot model in SI units.

        They include mass, stiffness, damping, friction and the rate of the force controller.

        Raises:
            InvalidInputError: viscous friction is combined with a finite bandwidth.
        """
        rate = 0.0 if math.isinf(self.bandwidth) else 2 * math.pi * self.bandwidth
        own_damping = self.damping + (self.viscous_friction if rate == 0 else 0.0)
        ahead = self.mass if self.feedforward else 0.0
        friction = self.coulomb_friction, self.friction_speed
        if rate and self.viscous_friction:
            raise InvalidInputError(
                "viscous_friction: allowed only without a servo bandwidth; use coulomb_friction instead"
            )
        return (self.mass, self.stiffness, self.damping, own_damping, ahead, rate, *friction)

    def rows(self) -> Iterator[Row]:
        """Yield table rows with the parameters of the robot."""
        yield "robot", "a mass behind an impedance controller"
        yield "physical mass m", Measured(self.mass, "kg")
        yield "stiffness K_c", Measured(self.stiffness, "N/m")
        yield "damping D_c", Measured(self.damping, "N*s/m")
        yield "bandwidth of the force servo", Measured(self.bandwidth, "Hz")
        yield "viscous friction", Measured(self.viscous_friction, "N*s/m")
        yield "Coulomb friction", Measured(self.coulomb_friction, "N")
        yield "acceleration feedforward", "yes" if self.feedforward else "no"


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionPlant(PlantModel):
    """A position-controlled robot, which follows the commanded position with second-order dynamics.

    The equation of motion is x'' = w^2 (x_v - x) - 2 zeta w x'.

    It follows a steady motion with a delay of 2 zeta / w. A contact force acts on its mass and the stiffness m w^2.

    Args:
        mass: the physical reflected mass at the contact point m > 0 [kg].
        bandwidth: w / (2 pi) > 0 of the position loop [Hz].
        damping_ratio: zeta > 0.

    Examples:
        >>> PositionPlant(mass=2.0, bandwidth=20.0).damping_ratio
        1.0
    """

    kind: ClassVar[str] = "position"

    mass: float = quantity("kg", sign="positive", example='"4 kg"')
    bandwidth: float = quantity("Hz", sign="positive", example='"20 Hz"')
    damping_ratio: float = quantity("", 1.0, sign="positive")

    def __post_init__(self) -> None:
        check_declared(self)
        if 2 * math.pi * self.bandwidth > _FASTEST:
            raise InvalidInputError(
                f"bandwidth: found {self.bandwidth:g} Hz, expected at most {_FASTEST / (2 * math.pi):,.0f} Hz",
                value=self.bandwidth,
            )

    def coefficients(self) -> tuple[float, ...]:
        """Return the coefficients of the robot model in SI units.

        They include mass, stiffness, damping, friction and the rate of the force controller.
        """
        omega = 2 * math.pi * self.bandwidth
        return (self.mass, self.mass * omega**2, 0.0, 2 * self.damping_ratio * omega * self.mass, 0.0, 0.0, 0.0, 1.0)

    def rows(self) -> Iterator[Row]:
        """Yield table rows with the parameters of the robot."""
        yield "robot", "position-controlled: a second-order lag"
        yield "physical mass m", Measured(self.mass, "kg")
        yield "bandwidth", Measured(self.bandwidth, "Hz")
        yield "damping ratio", Measured(self.damping_ratio)


PLANT_KINDS: Final = Extensions(
    group="pretouch.plants",
    built_in=lambda: {plant.kind: plant for plant in (IdealPlant, ImpedancePlant, PositionPlant)},
    problem=kind_problem(PlantModel, "pretouch.simulation.PlantModel"),
)
"""The robots that files may name: those of pretouch, and those of installed packages."""


def checked_numbers(model: object, values: tuple[float, ...], names: tuple[str, ...]) -> tuple[float, ...]:
    """Return model parameters after checking that they are finite numbers."""
    if len(values) != len(names) or not all(map(math.isfinite, values)):
        raise InvalidInputError(
            f"{type(model).__name__}: found {values}, expected {len(names)} finite numbers: {', '.join(names)}",
            value=values,
        )
    return values


def linear_plant(admittance: Admittance, plant: PlantModel) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the linear system from virtual force to robot position.

    It includes the admittance and the robot, without Coulomb friction.

    Returns:
        A, B and C of s' = A s + B F_p, x = C s. The state s has the virtual position and velocity, then position,
        velocity and servo force of the plant, if the plant has them.

    Raises:
        InvalidInputError: the admittance is an array.
    """
    m_a, d_a, k_a = (finite(v, "admittance") for v in (admittance.mass, admittance.damping, admittance.stiffness))
    if not all(isinstance(v, float) for v in (m_a, d_a, k_a)):
        raise InvalidInputError("admittance: found an array, expected one admittance")
    system = plant.system()
    if system is not None:
        own, inputs, output = system.arrays
        a, b = np.zeros((2 + len(output), 2 + len(output))), np.zeros(2 + len(output))
        a[0, 1], a[1, :2], b[1] = 1.0, (-k_a / m_a, -d_a / m_a), 1 / m_a
        a[2:, 2:], a[2:, :2] = own, inputs[:, :2] + np.outer(inputs[:, 2], a[1, :2])
        b[2:] = inputs[:, 2] / m_a
        return a, b, np.concatenate([[0.0, 0.0], output])
    mass, k, d_v, d_x, ahead, rate, *_ = checked_numbers(plant, plant.coefficients(), COEFFICIENTS)
    size = 2 if mass == 0 else 4 if rate == 0 else 5
    a, b, c = np.zeros((size, size)), np.zeros(size), np.zeros(size)
    a[0, 1] = 1.0
    a[1, :2], b[1] = (-k_a / m_a, -d_a / m_a), 1 / m_a
    if mass == 0:
        c[0] = 1.0
        return a, b, c
    c[2] = 1.0
    a[2, 3] = 1.0
    command = np.array([k - ahead * k_a / m_a, d_v - ahead * d_a / m_a, -k, -d_x])
    if rate == 0:
        a[3, :4], b[3] = command / mass, ahead / m_a / mass
    else:
        a[3, 4] = 1 / mass
        a[4, :4], a[4, 4], b[4] = rate * command, -rate, rate * ahead / m_a
    return a, b, c


def plant_step(plant: PlantModel, period: float) -> float:
    """Return the integration step of a robot model [s].

    It divides the controller period into equal parts.
    """
    mass, stiffness, _, own_damping, _, servo, coulomb, friction_speed = plant.coefficients()
    if mass == 0:
        return period
    system = plant.system()
    if system is not None:
        return float(period / max(math.ceil(period * system.fastest / _FINE), 1))
    # the slope of the friction at rest is the fastest rate; the step only needs to be stable for it
    friction = coulomb / friction_speed / mass / 8
    fastest = max(math.sqrt(stiffness / mass), own_damping / mass, servo, friction)
    return period / max(math.ceil(period * fastest / _FINE), 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactModel(ABC):
    """Model of the normal contact force.

    The force depends on the penetration depth and its rate of change. The force is F(d, d') >= 0 with the depth d = -l.

    Args:
        obstacle_mass: mass of the obstacle [kg]; infinite if it is driven and does not yield. A finite mass has the
            acceleration of the scenario in addition to that of the contact force.
    """

    kind: ClassVar[str] = ""
    """Its name in a scenario file."""

    obstacle_mass: float = quantity("kg", math.inf, sign="positive", infinite=True)

    def __post_init__(self) -> None:
        check_declared(self)

    @abstractmethod
    def numbers(self) -> tuple[float, float, float, bool, float]:
        """Return stiffness, damping and other coefficients of the contact force.

        The others are the exponent, whether damping grows with depth, and the inverse mass of the obstacle. The fourth
        number says whether damping grows with depth.
        """

    def rows(self) -> Iterator[Row]:
        """Yield table rows with parameters of contact force and obstacle."""
        yield from self.force_rows()
        driven = math.isinf(self.obstacle_mass)
        yield "obstacle", "driven: it does not yield" if driven else f"of {format_quantity(self.obstacle_mass, 'kg')}"

    def force_rows(self) -> Iterator[Row]:
        """Yield table rows with the parameters of the contact force.

        By default, they are stiffness, exponent and damping.
        """
        stiffness, damping, exponent, grows, _ = self.numbers()
        yield "contact", type(self).__name__
        yield "stiffness", Measured(stiffness, "N/m^n")
        yield "exponent", Measured(exponent)
        yield "damping", f"{damping:.4g}, {'which grows with depth' if grows else 'the same at any depth'}"


@dataclass(frozen=True, slots=True, kw_only=True)
class HuntCrossley(ContactModel):
    """Contact force with depth-dependent damping after Hunt and Crossley.

    The damping grows with the penetration depth. The force F = k d^n (1 + a d') starts and ends at 0.

    After K. H. Hunt, F. R. E. Crossley, "Coefficient of restitution interpreted as damping in vibroimpact", J. Appl.
    Mech. 42 (1975) 440-445, where a = 3/2 alpha and the restitution is e = 1 - alpha v for slow impacts. For any speed
    v, a v - ln(1 + a v) = -a e v - ln(1 - a e v). So e depends on a and v, not on k, n and the masses.

    Args:
        obstacle_mass: mass of the obstacle [kg]; infinite if it is driven.
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
            raise InvalidInputError(f"exponent: found {self.exponent:g}, which must be at least 1", value=self.exponent)

    def numbers(self) -> tuple[float, float, float, bool, float]:
        """Return stiffness, damping and other coefficients of the contact force.

        The others are the exponent, whether damping grows with depth, and the inverse mass of the obstacle.
        """
        return self.stiffness, self.dissipation * self.stiffness, self.exponent, True, 1 / self.obstacle_mass

    def force_rows(self) -> Iterator[Row]:
        """Yield table rows with the parameters of the contact force."""
        yield "contact", "Hunt and Crossley: F = k d^n (1 + a d')"
        yield "stiffness k", Measured(self.stiffness, "N/m^n")
        yield "exponent n", Measured(self.exponent)
        yield "dissipation a", Measured(self.dissipation, "s/m")


@dataclass(frozen=True, slots=True, kw_only=True)
class SpringDamper(ContactModel):
    """Contact force of a spring and a damper in parallel (Kelvin-Voigt model).

    It is F = max(0, k d + c d'). With c > 0, the force jumps at the touch.

    The force never pulls; its restitution without pull is that of T. Schwager, T. Poeschel, "Coefficient of
    restitution and linear-dashpot model revisited", Granular Matter 9 (2007) 465-469.

    Args:
        obstacle_mass: mass of the obstacle [kg]; infinite if it is driven.
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
        """Return stiffness, damping and other coefficients of the contact force.

        The others are the exponent, whether damping grows with depth, and the inverse mass of the obstacle.
        """
        return self.stiffness, self.damping, 1.0, False, 1 / self.obstacle_mass

    def force_rows(self) -> Iterator[Row]:
        """Yield table rows with the parameters of the contact force."""
        yield "contact", "spring and damper: F = max(0, k d + c d')"
        yield "stiffness k", Measured(self.stiffness, "N/m")
        yield "damping c", Measured(self.damping, "N*s/m")
