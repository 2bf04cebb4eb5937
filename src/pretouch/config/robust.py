"""What a scenario file says of inputs that are not known exactly, as what `design_robust_gain` takes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, cast

from pretouch._core.errors import InvalidInputError
from pretouch.design.constraints import Constraint
from pretouch.design.robust.measures import ConditionalValueAtRisk, Expected, Measure, Quantile, Required, WorstCase
from pretouch.motion.inputs import sensor_inputs
from pretouch.motion.scenario import Scenario
from pretouch.sensors import SensorModel
from pretouch.uncertainty import (
    CorrelatedNormal,
    Distribution,
    Empirical,
    Interval,
    JointDistribution,
    Normal,
    TruncatedNormal,
    Uncertainty,
    Uniform,
    make_ensemble,
    parameter_distribution,
)

from .positions import KeyPath
from .robust_sections import FROM_CALIBRATION, KnownInput, RobustSection, UncertaintySection

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport

    from .building import Builder

__all__ = ["robust_fields"]


def robust_fields(
    builder: Builder,
    *,
    scenario: Scenario | None,
    sensor: SensorModel | None,
    calibration: CalibrationReport | None,
    constraints: tuple[Constraint, ...],
) -> dict[str, Any]:
    """Build what is asked of a robust gain; what contradicts itself becomes a mistake of the builder.

    Args:
        builder: the builder of the file.
        scenario: the encounter; None where it has mistakes.
        sensor: the sensor; None where it has mistakes.
        calibration: the report of its fit, where it was fitted.
        constraints: the limits.

    Returns:
        The fields of the task that speak of a robust gain, and the constraints with their probabilities.
    """
    section = cast("RobustSection", builder.sections.get("robust", RobustSection()))
    if "robust" in builder.document.data and "uncertainty" not in builder.document.data:
        builder.refuse(
            ("robust",),
            "found no [uncertainty] beside it, expected what is known of inputs, such as "
            'obstacle.velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }',
        )
    known = _uncertainty(builder, section.measure, sensor, calibration)
    if scenario is not None and sensor is not None and known and not builder.mistakes:
        _check_middle(builder, scenario, sensor, known)
    same = ("samples", "validation", "seed", "sampling", "confidence")
    return {
        "uncertainty": known,
        "measure": _measure(section),
        "constraints": tuple(_required(builder, section, constraints)),
        **{name: getattr(section, name) for name in same},
    }


def _measure(section: RobustSection) -> Measure:
    p = section.probability
    if section.measure == "quantile" and p is not None:
        return Quantile(probability=p)
    if section.measure == "tail-mean" and p is not None:
        return ConditionalValueAtRisk(probability=p)
    return WorstCase() if section.measure == "worst-case" else Expected()


def _required(
    builder: Builder, section: RobustSection, constraints: tuple[Constraint, ...]
) -> Iterator[Constraint | Required]:
    limited = {c.name for c in constraints}
    for name in section.required:
        if name not in limited:
            builder.refuse(
                ("robust", "required", name),
                f"found a probability for a limit that is not given, expected {name} in [constraints]",
            )
    for constraint in constraints:
        probability = section.required.get(constraint.name)
        yield constraint if probability is None else Required(constraint=constraint, probability=probability)


def _uncertainty(
    builder: Builder, measure: str, sensor: SensorModel | None, calibration: CalibrationReport | None
) -> dict[str, JointDistribution]:
    """Build what is known of each input."""
    section = builder.sections.get("uncertainty")
    found: dict[str, JointDistribution] = {}
    if not isinstance(section, UncertaintySection):
        return found
    for part in UncertaintySection.model_fields:
        inputs = getattr(section, part)
        for key in inputs.model_fields_set if inputs is not None else ():
            path, given = ("uncertainty", part, key), getattr(inputs, key)
            if part == "sensor" and key == FROM_CALIBRATION:
                fitted = _fitted(builder, path, calibration)
                found |= {} if fitted is None else {"calibration": fitted}
                continue
            if part == "sensor" and sensor is not None and f"sensor.{key}" not in sensor_inputs(sensor):
                known = [name.removeprefix("sensor.") for name in sensor_inputs(sensor)]
                has = ", ".join(name for name in known if name != "scale") or "none"
                builder.refuse(path, f"found a parameter that the {sensor.name} curve has not, expected one of: {has}")
                continue
            if given.interval is not None and measure != "worst-case":
                builder.refuse(
                    (*path, "interval"),
                    f'found an interval, which says nothing about what is likely, beside measure = "{measure}"; '
                    'expected uniform where all of it is equally likely, or measure = "worst-case"',
                )
            made = builder.attempt("", partial(_distribution, given), path)
            found |= {} if made is None else {f"{part}.{key}": made}
    if not found and not builder.mistakes:
        builder.refuse(
            ("uncertainty",),
            'found no input, expected one or more, such as obstacle.velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }',
        )
    return _in_order(builder, found)


def _in_order(builder: Builder, found: Mapping[str, Any]) -> dict[str, Any]:
    """Sort inputs by their lines, so that a report has them as the file does."""
    lines = builder.document.lines

    def line(name: str) -> int:
        path: KeyPath = ("uncertainty", *name.split("."))
        return lines.get(path, lines.get(("uncertainty", "sensor", FROM_CALIBRATION), 0))

    return {name: found[name] for name in sorted(found, key=line)}


def _fitted(builder: Builder, path: KeyPath, calibration: CalibrationReport | None) -> CorrelatedNormal | None:
    """Take the covariance of the fitted curve."""
    if calibration is None or calibration.best is None:
        if "calibration" not in builder.document.data.get("sensor", {}):
            builder.refuse(
                path, 'found "calibration" for a sensor that is given by its parameters, expected [sensor] calibration'
            )
        return None
    best = calibration.best
    return builder.attempt("", lambda: parameter_distribution(best), path)


def _distribution(given: KnownInput) -> Distribution:
    """Make the distribution that an input is given by."""
    if given.normal is not None and given.between is not None:
        low, high = given.between
        return TruncatedNormal(location=given.normal[0], deviation=given.normal[1], low=low, high=high)
    if given.normal is not None:
        return Normal(mean=given.normal[0], deviation=given.normal[1])
    if given.uniform is not None:
        return Uniform(low=given.uniform[0], high=given.uniform[1])
    if given.interval is not None:
        return Interval(low=given.interval[0], high=given.interval[1])
    return Empirical(samples=tuple(given.samples or ()))


def _check_middle(builder: Builder, scenario: Scenario, sensor: SensorModel, known: Uncertainty) -> None:
    """Refuse inputs that exclude each other, or whose means already are no encounter."""
    means: dict[str, list[float]] = {}
    for name, value in known.items():
        if name in means:
            builder.refuse(("uncertainty", *name.split(".")), f"found {name} beside sensor.{FROM_CALIBRATION}")
        means |= {member: [mean] for member, mean in zip(value.inputs(name), value.means(), strict=True)}
    try:
        make_ensemble(scenario, sensor, means)
    except InvalidInputError as error:
        builder.refuse(("uncertainty",), str(error).removeprefix("uncertainty: "))
