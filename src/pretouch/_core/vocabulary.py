"""What every quantity is called, how messages show values, and what each numbered equation says.

The numbered equations of the letter, so that code and tests can name them. A function or class carries an equation by
citing its id in the first paragraph of its docstring; a test that checks it by an independent way is marked `equation`.
A test reads both and fails where either is missing.
"""

from __future__ import annotations

import os
import types
from dataclasses import dataclass
from typing import Any, Final

import numpy as np


@dataclass(frozen=True, slots=True)
class Entry:
    """A quantity of an encounter.

    Args:
        words: its name for a person.
        symbol: the letter's symbol.
        unit: its SI unit.
        whole: whether it speaks of the motion as a whole, not only of its end.
    """

    words: str
    symbol: str
    unit: str
    whole: bool = False


QUANTITIES: Final[dict[str, Entry]] = {
    "time": Entry("time of contact", "t", "s"),
    "distance": Entry("distance at contact", "l", "m"),
    "position": Entry("plant position at contact", "x", "m"),
    "velocity": Entry("plant velocity at contact", "x\u2032", "m/s"),
    "acceleration": Entry("plant acceleration at contact", "x\u2033", "m/s^2"),
    "displacement": Entry("deviation from the reference at contact", "x \u2212 x_d", "m"),
    "relative_velocity": Entry("relative velocity at contact", "l\u2032", "m/s"),
    "virtual_force": Entry("virtual force at contact", "F_p", "N"),
    "largest_excursion": Entry("largest excursion", "max |x \u2212 x_d|", "m", whole=True),
    "largest_travel": Entry("largest travel from the start", "max |x \u2212 x(0)|", "m", whole=True),
    "largest_speed": Entry("largest plant speed", "max |x\u2032|", "m/s", whole=True),
    "largest_acceleration": Entry("largest plant acceleration", "max |x\u2033|", "m/s^2", whole=True),
    "largest_virtual_force": Entry("largest virtual force", "max |F_p|", "N", whole=True),
    "closest_distance": Entry("smallest distance", "min l", "m", whole=True),
    "settling_distance": Entry("distance at rest in the end", "l(\u221e)", "m", whole=True),
    "impulse_residual": Entry("residual of the impulse balance", "", "", whole=True),
    "drive_force": Entry("largest drive force", "m max |x\u2033|", "N", whole=True),
    "impact_force": Entry("peak impact force", "F", "N"),
    "peak_force": Entry("peak contact force", "max F", "N", whole=True),
    "impulse": Entry("impulse of all contacts", "\u222bF dt", "N*s", whole=True),
    "rebound_velocity": Entry("relative velocity after impact", "l\u2032", "m/s"),
    "gain": Entry("gain", "D_p", "N*s"),
    "objective": Entry("objective", "f", ""),
}
"""Every quantity that results, objectives, limits and sweeps speak of, by its name in code."""


def words_for(name: str) -> str:
    """Return the words for a name from code, those of the vocabulary where it has it.

    Args:
        name: such as `relative_velocity`.

    Returns:
        Such as `relative velocity at contact`.

    Examples:
        >>> words_for("largest_excursion"), words_for("natural_frequency")
        ('largest excursion', 'natural frequency')
    """
    return QUANTITIES[name].words if name in QUANTITIES else name.replace("_", " ").replace("-", " ")


def in_short(name: str) -> str:
    """Return the words for a quantity beside others of the same contact, such as `relative velocity`."""
    return words_for(name).removesuffix(" at contact")


def unit_of(name: str) -> str:
    """Return the SI unit of a quantity of the vocabulary."""
    return QUANTITIES[name].unit


EXAMPLES: Final = {
    "AdmittanceDesign": "an AdmittanceDesign, which design_admittance returns",
    "Calibration": "a Calibration, such as read_calibration(path) returns",
    "CalibrationReport": "a CalibrationReport, which rank_models returns",
    "ContactModel": "a contact model, such as SpringDamper(stiffness=1e4)",
    "ContinuousLaw": "a law in continuous time, such as pretouch.motion.DRAG",
    "DragDesign": "a DragDesign, which design_drag returns",
    "GainDesign": "a GainDesign, which design_gain returns",
    "ImpactModel": "an impact model, such as SpringImpact(robot_mass=1.0, stiffness=1e4)",
    "JointDistribution": "a distribution, such as Normal(mean=-0.3, deviation=0.02)",
    "SteppedLaw": "a law for a controller, such as VirtualDamper(gain=-0.7)",
    "Measure": "a measure, such as Expected() or Quantile(probability=0.9)",
    "ParetoFront": "a ParetoFront, which pareto_front returns",
    "PlantModel": "a robot, such as ImpedancePlant(mass=4.0, stiffness=4e3, damping=250.0)",
    "RobustDesign": "a RobustDesign, which design_robust_gain returns",
    "SampledLaw": "a sampled law, such as Controller(...)",
    "SensorFit": "a SensorFit, which fit_sensor returns",
    "SensorModel": "a sensor curve, such as InversePower(...)",
    "SimulatedEncounter": "a SimulatedEncounter, which simulate_encounter returns",
    "Task": "a Task, such as load_scenario(path) returns",
    "TunableLaw": "a sampled law, such as Controller(...)",
    "Verdict": "a Verdict, which verify_gain returns",
}
"""What is expected, for classes whose name alone does not say how to come by one."""

_LONGEST: Final = 60  # characters of a value that a message shows
_FEW: Final = 8  # items that are shown


def short_repr(value: Any) -> str:
    """Return a value as a message shows it, in few characters.

    Args:
        value: any.

    Returns:
        Such as `'x'`, `None`, `a Task`, `an array of the shape (3,)`.

    Examples:
        >>> short_repr("x"), short_repr(object()), short_repr(int)
        ("'x'", 'an object', 'the class int')
    """
    container = isinstance(value, tuple | list | dict | set)
    if _is_simple(value) or (container and len(value) <= _FEW and all(map(_is_simple, value))):
        return _cut_repr(value)
    if isinstance(value, np.ndarray) and value.ndim:
        return f"an array of {value.dtype} of the shape {value.shape}"
    if isinstance(value, type | types.FunctionType | types.BuiltinFunctionType):
        return f"the {'class' if isinstance(value, type) else 'function'} {value.__name__}"
    return f"a {type(value).__name__} of {len(value)}" if container else with_article(type(value).__name__)


def _cut_repr(value: Any) -> str:
    try:
        text = repr(value)
    except ValueError:  # of a whole number with thousands of digits
        return with_article(type(value).__name__)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def _is_simple(value: Any) -> bool:
    return isinstance(value, None | bool | int | float | complex | str | bytes | np.generic | os.PathLike)


def with_article(name: str) -> str:
    """Return a name with its article, such as `an Obstacle`."""
    return f"{'an' if name[:1].lower() in 'aeiou' else 'a'} {name}"


EQUATIONS: Final[dict[str, str]] = {
    "L(1)": "virtual admittance: M_a (x'' - x_d'') + D_a (x' - x_d') + K_a (x - x_d) = F_p",
    "L(2)": "virtual force: F_p = D_p xi'/xi",
    "L(3)": "inverse power curve: xi = alpha beta psi / (l + l_0)^n",
    "L(4)": "motion with the inverse power curve",
    "L(5)": "first-order exponential curve: xi = a_1 exp(c_1 l)",
    "L(6)": "second-order exponential curve: xi = a_2 exp(b_2 l^2 + c_2 l)",
    "L(7)": "motion with the first-order exponential curve",
    "L(8)": "the same in the distance l",
    "L(9)": "obstacle in uniform acceleration relative to the reference",
    "L(10)": "closed form of l(t) for L(8)",
    "L(11)": "X_1 of L(10)",
    "L(12)": "X_2 of L(10)",
    "L(13)": "lambda_1, lambda_2 of L(10)",
    "L(14)": "motion with the second-order exponential curve",
    "L(15)": "the same in the distance l, obstacle in uniform motion",
    "L(16)": "uniform motion l = A t + B",
    "L(17)": "A of L(16)",
    "L(18)": "B of L(16)",
    "L(19)": "plant position of the uniform motion over the distance",
    "L(20)": "objective f_1: excursion against relative velocity",
    "L(21)": "evaluated at contact, l = 0",
    "L(22)": "objective f_2: time against relative velocity",
    "L(23)": "evaluated at contact, l = 0",
}
"""What each numbered equation of the letter says, in this project's words."""
