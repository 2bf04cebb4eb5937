"""Define the sections, keys and units of a scenario file.

Messages and the test of docs/reference/scenario-file.md use this schema.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, Final

from pretouch._core.errors import InvalidInputError
from pretouch._core.extensions import Extensions
from pretouch._core.units import written_unit
from pretouch.designs.custom_objectives import OBJECTIVE_KINDS
from pretouch.designs.impact import HertzImpact, ImpactModel, SpringImpact
from pretouch.designs.options import ParetoOptions, VerifyOptions
from pretouch.designs.quantities import CONSTRAINT_NAMES, QUANTITY_KINDS, QUANTITY_UNITS, find_quantity
from pretouch.designs.task import Task
from pretouch.motion.bodies import Obstacle, Plant, Reference, Stretch
from pretouch.motion.laws import DAMPER, LAW_KINDS, ContinuousLaw
from pretouch.motion.scenario import Admittance
from pretouch.sensors.registry import CURVE_KINDS

from .quantities import Quantity, UnfitValueError, value_text
from .robust_sections import ROBUST, read_probability, uncertainty_section
from .section import (
    EFFECTS,
    REQUIRED,
    TAG,
    WEIGHT,
    ByLaw,
    Key,
    Section,
    declared_keys,
    described_section,
    example_bounds,
    gain_of,
    list_of,
    name_of,
    one_of,
)
from .sensor import section_of_curve, sensor_variants

_OBSTACLE: Final = ("obstacle speed",)


def _check_second_term(values: Mapping[str, Any]) -> None:
    """Check the second term of an objective with two terms.

    The objective, L(20) or L(22), has either contact velocity or impact force.

    Raises:
        UnfitValueError: both or none of the two are given.
    """
    expected = 'expected either velocity_scale = "0.3 m/s" or force_scale = "100 N"'
    if {"velocity_scale", "force_scale"} <= set(values):
        raise UnfitValueError(f"found both velocity_scale and force_scale, {expected}", "force_scale")
    if not {"velocity_scale", "force_scale"} & set(values):
        raise UnfitValueError(f"missing velocity_scale, {expected}")
    for kind in ("velocity", "force"):
        if f"{kind}_weight" in values and f"{kind}_scale" not in values:
            raise UnfitValueError(
                f"found the key {kind}_weight without the key {kind}_scale; give both keys or neither", f"{kind}_weight"
            )


def _two_term_objective(first: str, unit: str, example: str) -> Section:
    """Describe the section [objective] of a term and the contact velocity or the impact force."""
    return Section(
        {
            "velocity_scale": Key(Quantity("m/s", '"0.3 m/s"', "nonzero", words=_OBSTACLE)),
            "velocity_weight": WEIGHT,
            "force_scale": Key(Quantity("N", '"100 N"', "nonzero")),
            "force_weight": WEIGHT,
            "kind": TAG,
            f"{first}_scale": Key(Quantity(unit, example, "nonzero"), REQUIRED),
            f"{first}_weight": WEIGHT,
        },
        _check_second_term,
    )


def _scale(quantity: str | None) -> Any:
    """Make a parser for the typical value of a quantity. The value is in the unit of the quantity."""
    if quantity is None:  # another check refuses this
        return lambda _: 1.0
    words = _OBSTACLE if "velocity" in quantity or "speed" in quantity else ()
    return Quantity(QUANTITY_UNITS[quantity], "", "nonzero", words=words)


def _quantity_name(value: Any) -> str:
    """Parse the name of a quantity. The quantity is built in or comes from an installed package."""
    try:
        quantity = None if not isinstance(value, str) else find_quantity(value)
    except InvalidInputError as error:
        raise UnfitValueError(f"found {value_text(value)}, but {error}") from None
    if quantity is None:
        raise UnfitValueError(one_of(value, tuple(dict.fromkeys((*QUANTITY_UNITS, *QUANTITY_KINDS.names())))))
    return str(value)


_TERM: Final = Section(
    {
        "quantity": Key(_quantity_name, REQUIRED, '"time"'),
        "scale": Key(_scale(None), REQUIRED, '"1 s"', after=("quantity", _scale)),
        "weight": WEIGHT,
    },
    example='{ quantity = "time", scale = "1 s" }',
)
"""One term of an objective: weight * (quantity / scale)^2."""

_TERMS: Final = 'a list of terms such as { quantity = "time", scale = "1 s", weight = 1.0 }'

OBJECTIVE_VARIANTS: Final[dict[str, Section]] = {
    "excursion": _two_term_objective("position", "m", '"0.5 m"'),
    "time": _two_term_objective("time", "s", '"1 s"'),
    "custom": Section(
        {"kind": TAG, "terms": Key(list_of(_TERM, 1, None, _TERMS), REQUIRED, '[{ quantity = "time", scale = "1 s" }]')}
    ),
}
"""The variants of [objective], by `kind`: f_1 of L(20), f_2 of L(22), or any weighted sum of contact quantities."""


_MASS: Final = Quantity("kg", '"1 kg"', "positive")
_FREQUENCY: Final = Quantity("rad/s", '"5 rad/s"', "nonnegative")
_RATIO: Final = Quantity("", "1.0", "nonnegative")
_PAIR: Final = "a list of two {}, the lower bound first"
FREE: Final = {
    "natural_frequency_bounds": Key(list_of(_FREQUENCY, 2, 2, _PAIR.format("quantities in rad/s"))),
    "damping_ratio_bounds": Key(list_of(_RATIO, 2, 2, _PAIR.format("numbers"))),
}
"""The keys of [admittance] with bounds; the admittance is then designed within them, together with the gain."""


def _check_order(*keys: str, unit: str = "", what: str = "the lower first") -> Callable[[Mapping[str, Any]], None]:
    """Make a check that lower bounds are below upper bounds."""

    def check(values: Mapping[str, Any]) -> None:
        for key in keys:
            low, high = values.get(key, (0, 1))
            if not low < high:
                raise UnfitValueError(f"found bounds from {low:g}{unit} to {high:g}{unit}, expected {what}", key)

    return check


def _impact(model: type[ImpactModel]) -> Section:
    """Describe the keys of an impact model. The mass of the robot is required unless [robot] names a model."""
    keys = declared_keys(model)
    return Section({**keys, "robot_mass": replace(keys["robot_mass"], default=None)}, make=model)


_BY_FREQUENCY: Final = {
    **FREE,
    "mass": Key(_MASS, REQUIRED),
    "natural_frequency": Key(_FREQUENCY, REQUIRED),
    "damping_ratio": Key(_RATIO, 1.0),  # critically damped, as in the letter
}


def _gain(law: ContinuousLaw) -> Section:
    unit = law.number.unit
    bounds = list_of(gain_of(law), 2, 2, _PAIR.format(f"quantities in {written_unit(unit)}"))
    return Section(
        {"bounds": Key(bounds, REQUIRED, example_bounds(law))},
        _check_order("bounds", unit=f" {written_unit(unit)}", what="the lower bound first"),
    )


def _limit(unit: str) -> Key:
    return Key(Quantity(unit, sign="positive"))


def _added_limit(name: str) -> Key | None:
    """Return the key of a constraint on a user-defined quantity. The result is None if no such quantity exists."""
    if name in QUANTITY_KINDS.built_in() or find_quantity(name) is None:
        return None
    return _limit(QUANTITY_UNITS[name])


def _limits(law: ContinuousLaw) -> Section:
    keys = {name: _limit(QUANTITY_UNITS[quantity]) for name, quantity in CONSTRAINT_NAMES.items()}
    if law != DAMPER:
        del keys["gain"]
    return Section(keys, more=(QUANTITY_KINDS, _added_limit))


_METHOD: Final = Key(name_of("auto", "closed-form", "integration", "uniform-motion"), "auto")
_TRADED: Final = 'a list of two or three quantities such as "displacement", "relative_velocity"'
_QUANTITIES: Final = Key(list_of(_quantity_name, 2, 3, _TRADED))


def _pareto(law: ContinuousLaw) -> Section:
    return Section({"quantities": _QUANTITIES, "choice": Key(gain_of(law))}, make=ParetoOptions)


_STRETCHES: Final = 'one or more of [[obstacle.course]] with until = "0.1 s" and acceleration = "3 m/s²"'
_OBSTACLE_KEYS: Final = {
    "position": Key(Quantity("m", '"42.2 mm"'), REQUIRED),
    **declared_keys(Obstacle, without=("position",)),
    "course": Key(list_of(Section(declared_keys(Stretch)), 1, None, _STRETCHES)),
}


def _check_course(values: Mapping[str, Any]) -> None:
    ends = [stretch["until"] for stretch in values.get("course", ())]
    for i, (before, after) in enumerate(pairwise(ends), 1):
        if not after > before:
            sentence = (
                f"this stretch of the obstacle's motion ends at {after:g} s, but must end after the previous "
                f"stretch, which ends at {before:g} s"
            )
            raise UnfitValueError(sentence, "course", i, "until")


def _obstacle(course: Sequence[Mapping[str, float]] = (), **initial: float) -> Obstacle:
    return Obstacle(**initial, course=tuple(Stretch(**stretch) for stretch in course))


_ALWAYS: Final[Mapping[str, Mapping[str, Section]]] = {
    "admittance": {
        "damping": Section({**FREE, **declared_keys(Admittance)}, _check_order(*FREE), Admittance),
        "natural_frequency": Section(_BY_FREQUENCY, _check_order(*FREE), Admittance.from_natural_frequency),
    },
    "obstacle": {"": Section(_OBSTACLE_KEYS, _check_course, _obstacle)},
    "plant": {"": Section(declared_keys(Plant), make=Plant)},
    "reference": {"": Section(declared_keys(Reference), make=Reference)},
    "objective": OBJECTIVE_VARIANTS,
    "gain": ByLaw(_gain),
    "constraints": ByLaw(_limits),
    "impact": {"stiffness": _impact(SpringImpact), "radius": _impact(HertzImpact)},
    "motion": {"": Section({"method": _METHOD, **declared_keys(Task)})},
    "pareto": ByLaw(_pareto),
    "robust": {"": ROBUST},
    "verify": {
        "": Section({**declared_keys(VerifyOptions), "confidence": Key(read_probability, 0.95)}, make=VerifyOptions)
    },
}
OPTIONS: Final = ("pareto", "robust", "verify")
"""The sections that are options of one verb; each is the field of the task with the same name."""

LOOP_SECTIONS: Final = ("chain", "controller", "robot", "contact", "loop", "verify", "disturbance")
"""The sections of a sampled loop; a file with any of them needs the first two."""

ARRAYS: Final = {
    "disturbance": 'one or more of [[disturbance]] with, for example, kind = "cable" and distance = "20 mm"',
}
"""The sections that are arrays of tables, with an example for messages."""

OF_A_LAW: Final = ("gain", "constraints", "pareto", "controller")
"""The sections whose keys or units depend on the kind of the law."""

SECTIONS: Final = (
    *("sensor", "admittance", "obstacle", "plant", "reference", "objective", "gain", "constraints", "impact", "motion"),
    *("pareto", "uncertainty", "robust", *LOOP_SECTIONS, "tracking", "law"),
)
"""The names of all sections."""

_REQUIRED_SECTIONS: Final[Mapping[str, str]] = {
    "sensor": 'calibration = "sensor.csv"',
    "admittance": 'mass = "1 kg", damping = "10 N*s/m", stiffness = "25 N/m"',
    "obstacle": 'position = "42.2 mm", velocity = "-0.3 m/s"',
    "objective": 'kind = "excursion", position_scale = "0.5 m", velocity_scale = "0.3 m/s"',
}


def required_sections(law: ContinuousLaw, chosen: Iterable[str]) -> dict[str, str]:
    """Return the required sections with example keys.

    Args:
        law: the law, or its class.
        chosen: the keys of [law] in the file.
    """
    if set(EFFECTS) & set(chosen):
        return {name: text for name, text in _REQUIRED_SECTIONS.items() if name != "objective"}
    return {**_REQUIRED_SECTIONS, "gain": f"bounds = {example_bounds(law)}"}


def variants(section: str) -> Mapping[str, Section]:
    """Return the variants of a section of the scenario file.

    For example, each sensor model has its own variant.
    """
    if section == "sensor":
        return sensor_variants()
    if section == "uncertainty":
        return {"": uncertainty_section()}
    if section in _ALWAYS:
        return _ALWAYS[section]
    if section == "tracking":
        from pretouch.robots.tracking import TRACKINGS  # noqa: PLC0415 - only for a file with it

        return {kind: described_section(tracking) for kind, tracking in TRACKINGS.items()}
    from .loop_sections import LOOP_VARIANTS  # noqa: PLC0415 - the simulation, only for a file with a loop or law

    return LOOP_VARIANTS[section]


def extensions_of(section: str) -> tuple[Extensions, Callable[[Any], Section]] | None:
    """Return the types that installed packages add to a section.

    The second element is the function that describes the keys of a type.
    """
    if section == "sensor":
        return CURVE_KINDS, section_of_curve
    if section == "objective":
        return OBJECTIVE_KINDS, described_section
    if section == "law":
        from .loop_sections import law_section  # noqa: PLC0415 - the simulation, only for a file with a loop or law

        return LAW_KINDS, law_section
    if section == "robot":
        from pretouch.simulation.robot import PLANT_KINDS  # noqa: PLC0415 - the same

        return PLANT_KINDS, described_section
    return None


def keys_of(section: str) -> tuple[str, ...]:
    """Return all possible keys of a scenario-file section.

    The keys are in the documented order.
    """
    return tuple(dict.fromkeys(key for variant in variants(section).values() for key in variant.keys))
