"""Build report sections on encounter, sensor and solution method."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from operator import attrgetter
from typing import Any, Final, Protocol

import numpy as np

from pretouch._core.blocks import Block, Cell, Listing, Measured, PageSection, PageTable, Paragraph
from pretouch._core.units import format_quantity
from pretouch._core.vocabulary import words_for
from pretouch.sensors import SensorModel

from .laws import LawNumber
from .scenario import SCENARIO_INPUTS, Scenario

Row = tuple[Cell, ...]

METHODS: Final = {
    "closed-form": "Closed form L(10)-(13), exact for a curve of constant slope g.",
    "integration": "Integration of L(1) with the virtual force L(2) for the sensor curve; the contact is a root of l.",
    "quadrature": (
        "Quadrature over the distance: while the object approaches, the square of l\u2032 follows a linear equation, "
        "for every curve. The residuals of impulse and moment certify the result."
    ),
    "uniform-motion": (
        "Uniform-motion solution L(16)-(19): one particular motion of the second-order exponential curve. It does not "
        "start from the given state and shifts the optimal gain by about 10 %."
    ),
    "loop": (
        "Simulation of the sampled loop: sensor chain, controller with its own period, and robot. All gains are run "
        "with the same noise."
    ),
}
"""Description of each method by its name."""

_OF_THE_MOTION: Final = (
    "The plant follows the virtual object exactly, x = x_v. The tracking error of the robot's own controller, friction "
    "and modeling errors are neglected (the letter's Section II). On the letter's hardware contact occurred later than "
    "predicted, but the ranking of the gains was the same (Table III).",
    "No contact force acts before contact; the motion after l = 0 is not modeled.",
    "Time is continuous. The sensor has no delay, noise, quantization or filter, and its offset is removed before "
    "\u03be is used. Reflectance cancels in \u03be\u2032/\u03be; an offset does not.",
)
_OF_THE_LOOP: Final = (
    "Sensor chain, controller and robot are those of the specified loop. Its noise, delay and sampling rate are "
    "assumptions that must be compared with the real values. Effects that it omits (other axes, vibration, failing "
    "parts) are omitted here.",
    "Results cover the time until the first contact; a simulation of the loop shows the time after it.",
)
_OF_A_FUNCTION: Final = (
    "Encounters were solved by an evaluator that was passed to the design; its assumptions are unknown here.",
)
_OF_ALL: Final = (
    "The motion has one dimension. Obstacle and reference move with the accelerations stated above, and the obstacle "
    "is not moved by the robot.",
    "Time starts when the object enters the detection range.",
)
_INTEGRATOR: Final = (
    "The predictions on this page hold under these assumptions. Whether a robot cell is acceptable is for its "
    "integrator to assess, with measurements on the real machine."
)


class _Answer(Protocol):
    """Interface of a design result with the method that solved its encounters."""

    @property
    def method(self) -> str:
        """The name of the method that solved the encounters of a design."""

    @property
    def on_evaluator(self) -> bool:
        """Whether a loop simulation or a custom solver solved the encounters."""


def solved_on(answer: _Answer) -> str:
    """Return the kind of solver that a design used.

    The kinds are `motion` (motion equations), `loop` (simulated control loop) and `other` (custom solver).
    """
    if not answer.on_evaluator:
        return "motion"
    return "loop" if answer.method == "loop" else "other"


RECEDING: Final = "give the obstacle a negative velocity: this object moves away"
"""The next step if an object recedes and never comes into contact."""

RESTING: Final = "give the obstacle a negative velocity: this object does not move"
"""The next step if an object is at rest and never comes into contact."""


def approach_step(scenario: Scenario) -> str:
    """Return advice for an object that does not approach the robot.

    The text is empty for other objects.
    """
    speed = np.max(scenario.relative_velocity)
    if speed > 0 and outruns(scenario):
        return "let the robot recede more slowly: it recedes faster than the object approaches"
    return RECEDING if speed > 0 else RESTING if speed == 0 and not scenario.obstacle.course else ""


def outruns(scenario: Scenario) -> bool:
    """Return True if the robot recedes faster than an approaching object."""
    return bool(np.min(scenario.relative_velocity) > 0 and np.max(scenario.obstacle.velocity) < 0)


def mitigating_step(number: LawNumber, gain: float) -> str:
    """Return advice for a gain with the wrong sign."""
    return f"use a {number.mitigating} {number.name}, such as {number.equals(-gain)}"


def scenario_rows(scenario: Scenario) -> Iterator[Row]:
    """Yield all inputs of an encounter as table rows for a report."""
    symbols = {"mass": " M_a", "damping": " D_a", "stiffness": " K_a"}
    for name, unit in SCENARIO_INPUTS.items():
        part, _, field = name.partition(".")
        of_response = field in {"natural_frequency", "damping_ratio"}
        if not of_response or scenario.admittance.stiffness > 0:
            label = words_for(field) if of_response else f"{part}: {field}{symbols.get(field, '')}"
            yield label, Measured(float(attrgetter(name)(scenario)), unit)
    for stretch in scenario.obstacle.course:
        yield (
            f"obstacle: acceleration until {float(stretch.until):.4g} s",
            Measured(float(stretch.acceleration), "m/s^2"),
        )
    yield "distance at the start", Measured(float(scenario.distance), "m")


def sensor_rows(sensor: SensorModel) -> Iterator[Row]:
    """Yield report rows with parameters and range of a sensor curve."""
    yield "curve", sensor.name
    part: Any = sensor
    while part := getattr(part, "sensor", None):
        yield "recessed curve", part.name
    for name, value in sensor.parameters.items():
        yield words_for(name), Measured(value, sensor.parameter_units[name], 6)
    low, high = sensor.valid_range
    yield "valid from", Measured(low, "m")
    yield "valid to", Measured(high, "m")


def inputs_section(scenario: Scenario, sensor: SensorModel, *others: Row) -> PageSection:
    """Create the report section that lists all inputs of an encounter."""
    encounter = PageTable(rows=(*scenario_rows(scenario), *others))
    curve = PageTable(rows=tuple(sensor_rows(sensor)), wraps=True)
    blocks = (PageSection(title="Encounter", blocks=(encounter,)), PageSection(title="Sensor", blocks=(curve,)))
    return PageSection(title="Inputs", blocks=blocks)


def mounting_in_words(sensor: SensorModel | None) -> Iterator[str]:
    """Describe how far the sensor is mounted behind the contact surface."""
    recess = getattr(sensor, "recess", 0.0)
    if recess:
        yield (
            f"The sensor is mounted {format_quantity(recess, 'm')} behind the contact surface. Positions and distances "
            "count from the contact surface."
        )


def method_section(
    method: str, sensor: SensorModel | None = None, *, solved_on: str = "motion", others: Iterable[Block] = ()
) -> PageSection:
    """Create the report section on the solution method and its assumptions.

    Args:
        method: a key of METHODS, or a description of the method.
        sensor: the sensor, whose mounting is an assumption.
        solved_on: `motion` (L(1)), `loop` or `other`, as from `solved_on`; the assumptions of `other` are unknown.
        others: further blocks, which come first.

    Returns:
        The section.
    """
    assumptions = {"motion": _OF_THE_MOTION, "loop": _OF_THE_LOOP}.get(solved_on, _OF_A_FUNCTION)
    description = Paragraph(text=METHODS.get(method, method))
    assumed = Listing(items=(*mounting_in_words(sensor), *assumptions, *_OF_ALL))
    blocks = (*others, description, assumed, Paragraph(text=_INTEGRATOR, quiet=True))
    return PageSection(title="Method and assumptions", blocks=blocks)
