"""Draw random samples of uncertain inputs, and solve the resulting encounters."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.messages import not_one_of
from pretouch._core.numbers import FloatArray, finite
from pretouch._core.units import format_quantity, format_range
from pretouch._core.values import Value
from pretouch.motion import DAMPER, DRAG, ContactResult, ContinuousLaw, Scenario
from pretouch.motion.evaluator import Evaluator, ManySensorEvaluator, with_noise_after
from pretouch.motion.many_curves import ManyCurves, many_curves
from pretouch.motion.scenario import input_units, map_fields, scenario_with, sensor_with
from pretouch.motion.similarity import EncounterSimilarity, find_similarity
from pretouch.sensors import SensorModel

from .distributions import Interval, JointDistribution
from .sobol import MOST_DIMENSIONS, scrambled_sobol

Uncertainty: TypeAlias = Mapping[str, JointDistribution]
"""Distributions of inputs by name, such as `obstacle.velocity`; a joint distribution has any name."""

SAMPLINGS: Final = ("sobol", "latin-hypercube", "random")
MOST_SAMPLES: Final = 1_000_000
"""The largest number of samples that are drawn at once."""


def names_of(uncertainty: Uncertainty) -> tuple[str, ...]:
    """Return the names of all uncertain inputs.

    Raises:
        InvalidInputError: there is no input, an input has two distributions, or a value is no distribution.
    """
    for name, distribution in uncertainty.items():
        if not isinstance(distribution, JointDistribution):
            raise InvalidInputError(
                f"uncertainty {name}: found {type(distribution).__name__}, expected a distribution such as "
                "Uniform. A custom distribution must inherit from pt.uncertainty.Distribution and define its members "
                "support and _quantile"
            )
    names = [member for name, distribution in uncertainty.items() for member in distribution.inputs(name)]
    if not names:
        raise InvalidInputError('uncertainty: found none, expected inputs such as {"obstacle.velocity": Uniform(...)}')
    for name in names:
        if names.count(name) > 1:
            raise InvalidInputError(
                f"uncertainty: the input {name} has two distributions; remove one of the two distributions"
            )
    return tuple(names)


@check_arguments
def sample_inputs(
    uncertainty: Uncertainty, count: int, *, seed: int = 0, sampling: str = "sobol"
) -> dict[str, FloatArray]:
    """Draw random samples of uncertain inputs.

    The same seed gives the same samples on every machine.

    Args:
        uncertainty: the distributions of the inputs; different distributions are independent.
        count: number of samples.
        seed: seed of NumPy's generator.
        sampling: "sobol" (scrambled Sobol sequence, whose averages converge faster than 1/sqrt(n)), "latin-hypercube",
            or "random" (independent samples, for which confidence intervals are valid).

    Returns:
        The samples by input, shape (count,) each.

    Raises:
        InvalidInputError: an argument is invalid, or a distribution returns samples of a wrong shape.

    Examples:
        >>> from pretouch.uncertainty import Uniform
        >>> drawn = sample_inputs({"obstacle.velocity": Uniform(low=-0.4, high=-0.2)}, 1024)
        >>> bool(abs(drawn["obstacle.velocity"].mean() + 0.3) < 1e-3)
        True
    """
    check_draw(count, seed=seed, sampling=sampling)
    points, at = _points(count, len(names_of(uncertainty)), seed, sampling), 0
    samples: dict[str, FloatArray] = {}
    for name, distribution in uncertainty.items():
        members = distribution.inputs(name)
        values = np.asarray(distribution.draw(points[:, at : at + len(members)]))
        if values.shape != (count, len(members)):
            raise InvalidInputError(
                f"uncertainty {name}: the distribution {type(distribution).__name__} returned samples of the "
                f"shape {values.shape}, expected the shape {(count, len(members))}. The array needs "
                "one row for each sample and one column for each input"
            )
        at += len(members)
        samples |= {member: np.ascontiguousarray(values[:, i]) for i, member in enumerate(members)}
    return samples


def check_draw(count: int, *, seed: int, sampling: str) -> None:
    """Check the number of samples, the seed and the sampling method.

    Raises:
        InvalidInputError: one of them is invalid.
    """
    if sampling not in SAMPLINGS:
        raise InvalidInputError(**not_one_of("sampling", sampling, SAMPLINGS))
    if type(count) is not int or count < 1:
        raise InvalidInputError(f"samples: found {count!r}, expected a positive whole number", value=count)
    if count > MOST_SAMPLES:
        raise InvalidInputError(
            f"samples: found {count:,}, expected at most {MOST_SAMPLES:,} samples. More samples do not "
            "reduce the error of the sensor and motion models",
            value=count,
            limit=MOST_SAMPLES,
        )
    if type(seed) is not int or seed < 0:
        raise InvalidInputError(f"seed: found {seed!r}, expected 0 or a positive whole number", value=seed)


def _points(count: int, dimensions: int, seed: int, sampling: str) -> FloatArray:
    """Return random sample points in a unit cube. Each uncertain input is one dimension."""
    rng = np.random.default_rng(seed)
    doublings = max(count - 1, 0).bit_length()  # the Sobol sequence is balanced for powers of two
    if sampling == "random":
        points = rng.random((count, dimensions))
    elif sampling == "sobol" and dimensions <= MOST_DIMENSIONS:
        points = scrambled_sobol(doublings, dimensions, rng)[:count]
    else:
        from scipy.stats import qmc  # noqa: PLC0415 - half a second to load, only when it is needed

        if sampling == "sobol":
            points = qmc.Sobol(dimensions, rng=rng).random_base2(doublings)[:count]
        else:
            points = qmc.LatinHypercube(dimensions, rng=rng).random(count)
    return np.asarray(np.clip(points, 2.0**-54, 1 - 2.0**-53))


def share_in_words(share: float) -> str:
    """Format a number from 0 to 1 as a percentage.

    The percentage is rounded down, so that only 1 gives 100 %.

    Returns:
        Text such as `99.99 %`, also for 0.99998.
    """
    return f"{math.floor(1e4 * share + 1e-9) / 100:g} %"


def uncertainty_in_words(uncertainty: Uncertainty, sensor: SensorModel) -> list[tuple[str, str]]:
    """Return names and distributions of all uncertain inputs as text."""
    units = input_units(sensor)
    return [row for name, distribution in uncertainty.items() for row in distribution.rows(name, units)]


_ALIKE: Final = 1e-9  # relative rounding error of a value at an end of a range
_CENTRAL: Final = (0.025, 0.975)  # probabilities between which the value of the encounter has to lie


def contradictions(uncertainty: Uncertainty, scenario: Scenario, sensor: SensorModel) -> Iterator[tuple[str, str]]:
    """Yield the inputs whose nominal value contradicts their distribution.

    Each input is yielded with an explanation. With such a contradiction, a gain would be designed for one encounter and
    verified in others, for example at another speed.
    """
    units, parameters = input_units(sensor), sensor.parameters
    for name, distribution in uncertainty.items():
        for i, member in enumerate(distribution.inputs(name)):
            if member not in units:  # reported where the encounters are made
                continue
            part, _, attribute = member.partition(".")
            value = parameters.get(attribute) if part == "sensor" else getattr(getattr(scenario, part), attribute)
            one = distribution.alone(i)
            low, high = one.support if isinstance(one, Interval) else one.quantile(_CENTRAL)
            slack = _ALIKE * max(abs(low), abs(high))
            if value is not None and np.ndim(value) == 0 and not low - slack <= value <= high + slack:
                unit = units.get(member, "")
                yield (
                    member,
                    f"the nominal value of {member} is {format_quantity(value, unit)}, but its distribution covers "
                    f"{format_range((low, high), unit)}; change the value or the distribution",
                )


def check_nominal(uncertainty: Uncertainty, scenario: Scenario, sensor: SensorModel) -> None:
    """Check the nominal input values against the distributions of the inputs.

    Raises:
        InvalidInputError: the value of an uncertain input is outside the central 95 % of its distribution.
    """
    if uncertainty:
        names_of(uncertainty)
    for name, text in contradictions(uncertainty, scenario, sensor):
        raise InvalidInputError(f"uncertainty {name}: {text}")


_REMEDY: Final = (
    "; a distribution with tails may contain impossible values: exclude them, for example by a truncated normal "
    "distribution"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ensemble(Value):
    """Many encounters that differ in some inputs.

    Random samples of uncertain inputs are an example.

    Args:
        scenario: the encounters, of the shape (n,) or of a shape that broadcasts with it.
        sensor: the nominal sensor.
        values: the inputs that differ, in SI, shape (n,) each; empty if only noise differs.
        count: the number n of encounters.
        likeness: the scaling that maps all sensors to one sensor; None if there is none.
        many: the different sensors, if they can be solved together.
        method: the method of solution, as in `find_contact`.
        horizon: longest time to wait for contact [s].
        law: the law in continuous time.
        evaluator: solves encounters instead of `find_contact`, if given; the i-th encounter has the noise of run i.
    """

    scenario: Scenario
    sensor: SensorModel
    values: Mapping[str, FloatArray]
    count: int
    likeness: EncounterSimilarity | None
    many: ManyCurves | None
    method: str
    horizon: float
    law: ContinuousLaw = DAMPER
    evaluator: Evaluator | None = None

    def __len__(self) -> int:
        return self.count

    @property
    def speed(self) -> Any:
        """Initial speed of the obstacle in each encounter [m/s]."""
        return np.abs(np.broadcast_to(self.scenario.obstacle.velocity, (len(self),)))

    def contacts(self, gain: Any, *, peaks: Sequence[str] = ()) -> ContactResult:
        """Find time and state of contact in all encounters.

        The last axis of the gains is 1 or n. The `peaks` that will be read, such as `largest_excursion`, are computed
        together with the contacts where the law can.

        Returns:
            The contacts, for one gain or an array of gains.
        """
        gains = np.asarray(gain, dtype=np.float64)
        gains = np.broadcast_to(gains, (*gains.shape[:-1], len(self)))
        if self.evaluator is not None:
            return self._evaluated(self.evaluator, gains)
        options: dict[str, Any] = {"method": self.method, "horizon": self.horizon}
        if peaks and self.law == DAMPER:
            options["peaks"] = peaks
        likeness = self.likeness
        if likeness is not None and likeness.sensor is self.sensor:
            return self.law.contact(self.scenario, self.sensor, gains, **options)
        if likeness is not None:
            result = self.law.contact(
                likeness.scenario(self.scenario), likeness.sensor, gains * likeness.gain, **options
            )
            return likeness.result(result, self.scenario)
        if self.many is not None:
            options["many"] = self.many
            return self.law.contact(self.scenario, self.sensor, gains, **options)
        return _stacked([self.law.contact(*self.at(i), gains[..., i], **options) for i in range(len(self))])

    def _evaluated(self, evaluator: Evaluator, gains: FloatArray) -> ContactResult:
        """Solve all encounters by a custom solver.

        A solver that accepts only one sensor gets one encounter at a time.

        Returns:
            The contacts.
        """
        if not any(map(_of_sensor, self.values)):
            return evaluator(self.scenario, self.sensor, gains)
        if isinstance(evaluator, ManySensorEvaluator):
            return evaluator.with_each(self.scenario, self.sensors(), gains)
        return _stacked([with_noise_after(evaluator, i)(*self.at(i), gains[..., i]) for i in range(len(self))])

    def sensors(self) -> tuple[SensorModel, ...]:
        """Return the sensor curve of each encounter."""
        return tuple(self._sensor(i) for i in range(len(self)))

    def slope(self, result: ContactResult, quantity: str, name: str) -> Any:
        """Return the derivative of a contact quantity with respect to an input.

        If the natural frequency is an input, a change of the mass keeps the frequency.
        """
        of, frequency = result.gradients.of, "admittance.natural_frequency"
        if name not in {frequency, "admittance.damping_ratio", "admittance.mass"}:
            return of(quantity, name)
        keeps_frequency = frequency in self.values or "admittance.damping_ratio" in self.values
        if name == "admittance.mass" and not keeps_frequency:
            return of(quantity, name)
        a = self.scenario.admittance
        omega = np.sqrt(np.asarray(a.stiffness) / a.mass)
        by_damping, by_stiffness = of(quantity, "admittance.damping"), of(quantity, "admittance.stiffness")
        if name == frequency:
            return 2 * omega * a.mass * by_stiffness + a.damping / omega * by_damping
        if name == "admittance.damping_ratio":
            return 2 * omega * a.mass * by_damping
        return of(quantity, name) + omega**2 * by_stiffness + a.damping / a.mass * by_damping

    def at(self, index: int) -> tuple[Scenario, SensorModel]:
        """Return one encounter and its sensor curve."""
        return map_fields(self.scenario, lambda v: float(v[index]) if np.ndim(v) else v), self._sensor(index)

    def _sensor(self, index: int) -> SensorModel:
        if self.many is not None:
            return self.many.sensors[index]
        parameters = {
            name.removeprefix("sensor."): float(v[index]) for name, v in self.values.items() if _of_sensor(name)
        }
        return sensor_with(self.sensor, parameters) if parameters else self.sensor


@dataclass(frozen=True, slots=True)
class _Stacked(Value):
    """Results of several solver calls, combined in arrays along the last axis."""

    parts: list[ContactResult]

    def column(self, name: str) -> Any:
        """Return one contact quantity from all solver calls as an array."""
        return np.stack([part.columns.column(name) for part in self.parts], axis=-1)

    @property
    def gradients(self) -> _Stacked:
        """This object itself, whose method `of` returns the derivatives."""
        return self

    def of(self, quantity: str, by: str) -> Any:
        """Return derivatives of a contact quantity with respect to one input.

        One array contains the derivatives from all solver calls.
        """
        return np.stack([part.gradients.of(quantity, by) for part in self.parts], axis=-1)


def _stacked(parts: list[ContactResult]) -> ContactResult:
    return ContactResult(_Stacked(parts), parts[0].method)


def make_ensemble(
    scenario: Scenario,
    sensor: SensorModel,
    values: Mapping[str, Any],
    *,
    count: int | None = None,
    method: str = "auto",
    horizon: float = 600.0,
    law: ContinuousLaw = DAMPER,
    evaluate: Evaluator | None = None,
) -> Ensemble:
    """Create many encounters from sampled input values.

    Args:
        scenario: one encounter.
        sensor: its sensor.
        values: inputs such as `obstacle.velocity` or `sensor.exponent` and their values in SI, shape (n,) each.
        count: number of encounters, if no input differs.
        method: the method of solution, as in `find_contact`.
        horizon: longest time to wait for contact [s].
        law: the law in continuous time.
        evaluate: solves encounters instead of `find_contact`, as in `design`.

    Returns:
        The encounters.

    Raises:
        InvalidInputError: an input is unknown, a value is impossible, or inputs have different numbers of values.

    Examples:
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> several = make_ensemble(
        ...     Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ...     ),
        ...     InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        ...     {"sensor.exponent": [3.0, 3.5], "obstacle.velocity": [-0.3, -0.25]},
        ... )
        >>> several.contacts(-0.7).contact.relative_velocity.round(3)
        array([-0.085, -0.071])
    """
    if scenario.shape != ():
        raise InvalidInputError(
            f"scenario: found an array of encounters of shape {scenario.shape}, expected a single encounter"
        )
    units = input_units(sensor)
    checked: dict[str, FloatArray] = {}
    for name, samples in values.items():
        if name not in units:
            similar = get_close_matches(name, units, n=1)
            hint = f"did you mean {similar[0]}?" if similar else f"expected one of {', '.join(units)}"
            raise InvalidInputError(
                f"uncertainty: found {name!r}, which is no input; {hint}",
                value=name,
                limit=tuple(units),
                remedy=similar[0] if similar else "",
            )
        checked[name] = np.atleast_1d(finite(samples, name, units[name]))
    equal_rows = len({v.shape for v in checked.values()}) == 1 and next(iter(checked.values())).ndim == 1
    if (checked or count is None) and not equal_rows:
        shapes = ", ".join(f"{v.shape} for {name}" for name, v in checked.items()) or "none"
        raise InvalidInputError(
            f"uncertainty: found input values of different shapes ({shapes}), expected lists of equal length"
        )
    size = len(next(iter(checked.values()))) if checked else count or 0
    parameters = {name.removeprefix("sensor."): v for name, v in checked.items() if _of_sensor(name)}
    try:
        several = scenario_with(scenario, {name: v for name, v in checked.items() if not _of_sensor(name)})
        likeness, many = _sensors(sensor, parameters, several, law, method)
    except InvalidInputError as impossible:
        raise InvalidInputError(f"uncertainty: {impossible}{_REMEDY}", **impossible.fields) from None
    if evaluate is not None and several.shape == ():  # the encounters differ only in their noise
        position = np.full(size, several.obstacle.position)
        several = replace(several, obstacle=replace(several.obstacle, position=position))
    fields: dict[str, Any] = {"scenario": several, "values": checked, "count": size, "likeness": likeness, "many": many}
    return Ensemble(**fields, sensor=sensor, method=method, horizon=horizon, law=law, evaluator=evaluate)


def _sensors(
    sensor: SensorModel, parameters: Mapping[str, FloatArray], several: Scenario, law: ContinuousLaw, method: str
) -> tuple[EncounterSimilarity | None, ManyCurves | None]:
    """Prepare the sensor curves of many encounters for one solver call."""
    if not parameters:
        return EncounterSimilarity(sensor=sensor, length=1.0, gain=1.0), None
    if law.degree is not None and (likeness := find_similarity(sensor, parameters, several.distance)) is not None:
        return likeness.of_degree(law.degree), None
    # every sensor is built here, so that an impossible one is named before anything is solved
    rows = (dict(zip(parameters, map(float, row), strict=True)) for row in zip(*parameters.values(), strict=True))
    each = tuple(sensor_with(sensor, row) for row in rows)
    return None, many_curves(sensor, parameters, each, method) if law in {DAMPER, DRAG} else None


def _of_sensor(name: str) -> bool:
    return name.startswith("sensor.")
