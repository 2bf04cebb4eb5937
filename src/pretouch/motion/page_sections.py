"""What every page says of an encounter: its inputs, its sensor, how its motion is solved, and what that assumes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from operator import attrgetter
from typing import Any, Final, Protocol

from pretouch._core.blocks import Block, Cell, Chapter, Listing, Measured, Paragraph, Rows
from pretouch._core.vocabulary import words_for
from pretouch.sensors import SensorModel

from .scenario import SCENARIO_INPUTS, Scenario

Row = tuple[Cell, ...]

METHODS: Final = {
    "closed-form": "Closed form L(10)-(13), exact for a curve of constant slope g.",
    "integration": "Integration of L(1) with L(2) for the sensor curve as it is, with the contact located as a root.",
    "quadrature": (
        "Quadrature over the distance: while the object approaches, the square of l\u2032 follows a linear equation, "
        "whatever the curve; a residual of impulse and moment certifies it."
    ),
    "uniform-motion": (
        "Uniform-motion solution L(16)-(19): one particular motion of the second-order exponential curve, which does "
        "not start from the given state. It shifts the optimal gain by about 10 %."
    ),
    "loop": (
        "The sampled loop: sensor chain, controller with a period of its own, and robot, run with every gain and the "
        "same noise."
    ),
}
"""How encounters were solved, by the name of the method."""

_OF_THE_MOTION: Final = (
    "The plant follows the virtual object exactly, x = x_v: the tracking error of the inner controller is neglected, "
    "and so are friction and modeling errors (the letter's Section II). On the letter's hardware contact came later "
    "than predicted, while the ranking of the gains was kept (Table III).",
    "Up to contact no contact force acts; what happens after l = 0 is not modeled.",
    "Time is continuous; the sensor has no delay, noise, quantization or filter, and its offset is removed before "
    "\u03be is used. Reflectance cancels in \u03be\u2032/\u03be, an offset does not.",
)
_OF_THE_LOOP: Final = (
    "Sensor chain, controller and robot are those of the loop that was given: its noise, delay and rate are "
    "assumptions to be held against the real ones. What it leaves out (other axes, vibration, a part that fails) is "
    "left out here.",
    "Numbers are those until the first contact; the loop's own simulation says what follows.",
)
_OF_A_FUNCTION: Final = (
    "Encounters were solved by a function that the design was handed: what that assumes is not known here.",
)
_OF_ALL: Final = (
    "One dimension; obstacle and reference move with the accelerations stated above, and the obstacle is not "
    "moved by the robot.",
    "Time starts when the object enters the detection range.",
)
_INTEGRATOR: Final = (
    "This page predicts under these assumptions. Whether a robot cell is acceptable is for its integrator to assess, "
    "with measurements on the real machine."
)


class _Answer(Protocol):
    """What comes of encounters."""

    @property
    def method(self) -> str:
        """How they were solved."""

    @property
    def on_evaluator(self) -> bool:
        """Whether by what the user gave."""


def solved_on(answer: _Answer) -> str:
    """Tell what encounters were solved on: `loop`, `other` (a function of the user's) or `motion`, that of L(1)."""
    if not answer.on_evaluator:
        return "motion"
    return "loop" if answer.method == "loop" else "other"


def scenario_rows(scenario: Scenario) -> Iterator[Row]:
    """Yield every input of an encounter."""
    symbols = {"mass": " M_a", "damping": " D_a", "stiffness": " K_a"}
    for name, unit in SCENARIO_INPUTS.items():
        part, _, own = name.partition(".")
        of_response = own in {"natural_frequency", "damping_ratio"}
        if not of_response or scenario.admittance.stiffness > 0:
            label = words_for(own) if of_response else f"{part}: {own}{symbols.get(own, '')}"
            yield label, Measured(float(attrgetter(name)(scenario)), unit)
    for stretch in scenario.obstacle.course:
        yield (
            f"obstacle: acceleration until {float(stretch.until):.4g} s",
            Measured(float(stretch.acceleration), "m/s^2"),
        )
    yield "distance at the start", Measured(float(scenario.distance), "m")


def sensor_rows(sensor: SensorModel) -> Iterator[Row]:
    """Yield the parameters of a curve and where it holds."""
    yield "curve", sensor.name
    part: Any = sensor
    while part := getattr(part, "sensor", None):
        yield "recessed curve", part.name
    for name, value in sensor.parameters.items():
        yield words_for(name), Measured(value, sensor.parameter_units[name], 6)
    low, high = sensor.valid_range
    yield "valid from", Measured(low, "m")
    yield "valid to", Measured(high, "m")


def inputs_section(scenario: Scenario, sensor: SensorModel, *others: Row) -> Chapter:
    """Return the section of a page that lists its inputs: encounter, sensor, and further rows."""
    encounter = Rows(rows=(*scenario_rows(scenario), *others))
    curve = Rows(rows=tuple(sensor_rows(sensor)), wraps=True)
    blocks = (Chapter(title="Encounter", blocks=(encounter,)), Chapter(title="Sensor", blocks=(curve,)))
    return Chapter(title="Inputs", blocks=blocks)


def method_section(method: str, *, solved_on: str = "motion", others: Iterable[Block] = ()) -> Chapter:
    """Return the section of a page that says how encounters were solved, by a key of METHODS or a method's own words.

    What that assumes is known of `motion`, L(1), and of `loop`, not of `other`, a function of the user's. What else a
    page has to say comes before.
    """
    of = {"motion": _OF_THE_MOTION, "loop": _OF_THE_LOOP}.get(solved_on, _OF_A_FUNCTION)
    known = Paragraph(text=METHODS.get(method, method))
    blocks = (*others, known, Listing(items=(*of, *_OF_ALL)), Paragraph(text=_INTEGRATOR, quiet=True))
    return Chapter(title="Method and assumptions", blocks=blocks)
