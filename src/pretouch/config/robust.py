"""What a scenario file says of inputs that are not known exactly, as what `design_robust_gain` takes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from pretouch._core.errors import InvalidInputError
from pretouch.design.constraints import Constraint
from pretouch.design.robust.measures import ConditionalValueAtRisk, Expected, Measure, Quantile, WorstCase
from pretouch.design.robust.required import Required
from pretouch.motion.scenario import Scenario, sensor_inputs
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

from .robust_sections import FROM_CALIBRATION

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport

    from .reading import Reading


def robust_fields(
    file: Reading,
    scenario: Scenario | None,
    sensor: SensorModel | None,
    calibration: CalibrationReport | None,
    constraints: tuple[Constraint, ...],
) -> dict[str, Any]:
    """Return the fields of a task that speak of a robust gain, and the constraints with their probabilities.

    What contradicts itself becomes a mistake of the file; what has mistakes already is None.
    """
    asked = file.settings("robust")
    if "robust" in file.data and "uncertainty" not in file.data:
        file.refuse(
            ("robust",),
            "found no [uncertainty] beside it, expected what is known of inputs, such as "
            'obstacle.velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }',
        )
    known = _uncertainty(file, asked["measure"], sensor, calibration)
    if scenario is not None and sensor is not None and known and not file.mistakes:
        _check_middle(file, scenario, sensor, known)
    measure = _measure(asked.pop("measure"), asked.pop("probability", 0.0))
    limits = tuple(_required(file, asked.pop("required", {}), constraints))
    return {"uncertainty": known, "measure": measure, "constraints": limits, **asked}


def _measure(name: str, probability: float) -> Measure:
    if name == "quantile":
        return Quantile(probability=probability)
    if name == "tail-mean":
        return ConditionalValueAtRisk(probability=probability)
    return WorstCase() if name == "worst-case" else Expected()


def _required(
    file: Reading, asked: Mapping[str, float], constraints: tuple[Constraint, ...]
) -> Iterator[Constraint | Required]:
    limited = {c.name for c in constraints}
    for name in asked:
        if name not in limited:
            file.refuse(
                ("robust", "required", name),
                f"found a probability for a limit that is not given, expected {name} in [constraints]",
            )
    for constraint in constraints:
        probability = asked.get(constraint.name)
        yield constraint if probability is None else Required(constraint=constraint, probability=probability)


def _uncertainty(
    file: Reading, measure: str, sensor: SensorModel | None, calibration: CalibrationReport | None
) -> dict[str, JointDistribution]:
    """Build what is known of each input."""
    found: dict[str, JointDistribution] = {}
    parts = file.values("uncertainty")
    if parts is None:
        return found
    lines = file.source.lines
    asked = [(part, key) for part, inputs in parts.items() for key in inputs]
    for part, key in sorted(asked, key=lambda each: lines["uncertainty", *each]):  # as a report has them, too
        path, given = ("uncertainty", part, key), parts[part][key]
        if part == "sensor" and key == FROM_CALIBRATION:
            fitted = _fitted(file, path, calibration)
            found |= {} if fitted is None else {"calibration": fitted}
            continue
        if part == "sensor" and sensor is not None and f"sensor.{key}" not in sensor_inputs(sensor):
            known = [name.removeprefix("sensor.") for name in sensor_inputs(sensor)]
            has = ", ".join(name for name in known if name != "scale") or "none"
            file.refuse(path, f"found a parameter that the {sensor.name} curve has not, expected one of: {has}")
            continue
        if "interval" in given and measure != "worst-case":
            file.refuse(
                (*path, "interval"),
                f'found an interval, which says nothing about what is likely, beside measure = "{measure}"; '
                'expected uniform where all of it is equally likely, or measure = "worst-case"',
            )
        made = file.attempt("", partial(_distribution, given), path)
        found |= {} if made is None else {f"{part}.{key}": made}
    if not found and not file.mistakes:
        file.refuse(
            ("uncertainty",),
            'found no input, expected one or more, such as obstacle.velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }',
        )
    return found


def _fitted(file: Reading, path: tuple[str, ...], calibration: CalibrationReport | None) -> CorrelatedNormal | None:
    """Take the covariance of the fitted curve."""
    if calibration is None or calibration.best is None:
        if "calibration" not in file.data.get("sensor", {}):
            file.refuse(
                path, 'found "calibration" for a sensor that is given by its parameters, expected [sensor] calibration'
            )
        return None
    best = calibration.best
    return file.attempt("", lambda: parameter_distribution(best), path)


def _distribution(given: Mapping[str, Any]) -> Distribution:
    """Make the distribution that an input is given by."""
    if "between" in given:
        (mean, deviation), (low, high) = given["normal"], given["between"]
        return TruncatedNormal(location=mean, deviation=deviation, low=low, high=high)
    if "normal" in given:
        mean, deviation = given["normal"]
        return Normal(mean=mean, deviation=deviation)
    if "samples" in given:
        return Empirical(samples=tuple(given["samples"]))
    kind = Uniform if "uniform" in given else Interval
    low, high = given["uniform" if "uniform" in given else "interval"]
    return kind(low=low, high=high)


def _check_middle(file: Reading, scenario: Scenario, sensor: SensorModel, known: Uncertainty) -> None:
    """Refuse inputs that exclude each other, or whose means already are no encounter."""
    means: dict[str, list[float]] = {}
    for name, value in known.items():
        if name in means:
            file.refuse(("uncertainty", *name.split(".")), f"found {name} beside sensor.{FROM_CALIBRATION}")
        means |= {member: [mean] for member, mean in zip(value.inputs(name), value.means(), strict=True)}
    try:
        make_ensemble(scenario, sensor, means)
    except InvalidInputError as error:
        file.refuse(("uncertainty",), str(error).removeprefix("uncertainty: "))
