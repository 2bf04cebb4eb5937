"""Create distributions and chance constraints from `[uncertainty]` and `[robust]` of a scenario file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from pretouch._core.errors import InvalidInputError
from pretouch.designs.constraints import Constraint
from pretouch.designs.robust.required import Required
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
from pretouch.uncertainty.ensemble import contradictions

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
    """Return a task's uncertain inputs and probabilistic constraints.

    Contradictions are recorded as mistakes of the file. The arguments are None if they could not be built.
    """
    settings = file.settings("robust")
    if "robust" in file.data and "uncertainty" not in file.data:
        file.refuse(
            ("robust",),
            "found this section without [uncertainty], expected [uncertainty] with an input such as "
            'obstacle.velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }',
        )
    uncertainty = _uncertainty(file, settings["measure"], sensor, calibration)
    if scenario is not None and sensor is not None and uncertainty and not file.mistakes:
        _check_means(file, scenario, sensor, uncertainty)
    limits = tuple(_required(file, settings.get("required", {}), constraints))
    return {"uncertainty": uncertainty, "constraints": limits}


def _required(
    file: Reading, probabilities: Mapping[str, float], constraints: tuple[Constraint, ...]
) -> Iterator[Constraint | Required]:
    """Yield the constraints, with their required probabilities if the scenario file has them."""
    limited = {c.name for c in constraints}
    for name in probabilities:
        if name not in limited:
            file.refuse(
                ("robust", "required", name),
                f"found a required probability for {name}, but no limit; add a limit for {name} to the section "
                "[constraints]",
            )
    for constraint in constraints:
        probability = probabilities.get(constraint.name)
        yield constraint if probability is None else Required(constraint=constraint, probability=probability)


def _uncertainty(
    file: Reading, measure: str, sensor: SensorModel | None, calibration: CalibrationReport | None
) -> dict[str, JointDistribution]:
    """Build the probability distribution of each uncertain input from the scenario file."""
    distributions: dict[str, JointDistribution] = {}
    parts = file.values("uncertainty")
    if parts is None:
        return distributions
    lines = file.source.lines
    names = [(part, key) for part, inputs in parts.items() for key in inputs]
    for part, key in sorted(names, key=lambda name: lines["uncertainty", *name]):  # in the order of the file
        path, values = ("uncertainty", part, key), parts[part][key]
        if part == "sensor" and key == FROM_CALIBRATION:
            fitted = _fitted(file, path, calibration)
            distributions |= {} if fitted is None else {"calibration": fitted}
            continue
        if part == "sensor" and sensor is not None and f"sensor.{key}" not in sensor_inputs(sensor):
            inputs = [name.removeprefix("sensor.") for name in sensor_inputs(sensor)]
            parameters = ", ".join(name for name in inputs if name != "scale") or "none"
            file.refuse(path, f"the sensor curve {sensor.name} has no parameter {key}; its parameters are {parameters}")
            continue
        if "interval" in values and measure != "worst-case":
            file.refuse(
                (*path, "interval"),
                f'the risk measure "{measure}" needs probabilities, but an interval has none. Use uniform if all '
                'values are equally likely. Otherwise, set measure = "worst-case"',
            )
        distribution = file.attempt("", partial(_distribution, values), path)
        distributions |= {} if distribution is None else {f"{part}.{key}": distribution}
    if not distributions and not file.mistakes:
        file.refuse(
            ("uncertainty",),
            'found no input, expected one or more, such as obstacle.velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }',
        )
    return distributions


def _fitted(file: Reading, path: tuple[str, ...], calibration: CalibrationReport | None) -> CorrelatedNormal | None:
    """Return the joint distribution of the fitted sensor parameters. It is computed from their covariance."""
    if calibration is None or calibration.best is None:
        if "calibration" not in file.data.get("sensor", {}):
            file.refuse(
                path, 'found "calibration" without a calibration in [sensor], expected calibration = "sensor.csv" there'
            )
        return None
    best = calibration.best
    return file.attempt("", lambda: parameter_distribution(best), path)


def _distribution(values: Mapping[str, Any]) -> Distribution:
    """Make the probability distribution of one uncertain input."""
    if "between" in values:
        (mean, deviation), (low, high) = values["normal"], values["between"]
        return TruncatedNormal(location=mean, deviation=deviation, low=low, high=high)
    if "normal" in values:
        mean, deviation = values["normal"]
        return Normal(mean=mean, deviation=deviation)
    if "samples" in values:
        return Empirical(samples=tuple(values["samples"]))
    (chosen,) = values.values()
    if isinstance(chosen, Distribution):  # of an installed package
        return chosen
    kind = Uniform if "uniform" in values else Interval
    low, high = values["uniform" if "uniform" in values else "interval"]
    return kind(low=low, high=high)


def _check_means(file: Reading, scenario: Scenario, sensor: SensorModel, uncertainty: Uncertainty) -> None:
    """Check that the means of the uncertain inputs are consistent and form a valid encounter."""
    means: dict[str, list[float]] = {}
    for name, value in uncertainty.items():
        if name in means:
            file.refuse(
                ("uncertainty", *name.split(".")),
                f"the uncertainty of the input {name} is given twice: with its own key, and with the key "
                f"sensor.{FROM_CALIBRATION}; remove one of the two keys",
            )
        means |= {member: [mean] for member, mean in zip(value.inputs(name), value.means(), strict=True)}
    for name, text in contradictions(uncertainty, scenario, sensor):
        file.refuse(("uncertainty", *name.split(".")), text)
    try:
        make_ensemble(scenario, sensor, means)
    except InvalidInputError as error:
        file.refuse(("uncertainty",), str(error).removeprefix("uncertainty: "))
