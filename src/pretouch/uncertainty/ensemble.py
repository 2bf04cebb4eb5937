"""Sample uncertain inputs, and solve the encounters with these samples."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite
from pretouch._core.values import Value
from pretouch.motion import DAMPER, ContactResult, ContinuousLaw, Scenario
from pretouch.motion.evaluator import Evaluator, ManySensorEvaluator, with_noise_after
from pretouch.motion.many_curves import ManyCurves, many_curves
from pretouch.motion.request import make_request
from pretouch.motion.scenario import input_units, map_fields, scenario_with, sensor_with
from pretouch.motion.similar import Likeness, find_likeness
from pretouch.motion.solution import Solution
from pretouch.sensors import SensorModel

from .distributions import JointDistribution

Uncertainty: TypeAlias = Mapping[str, JointDistribution]
"""What is known of inputs, by name, such as `obstacle.velocity`; under a free name, of several that go together."""

SAMPLINGS: Final = ("sobol", "latin-hypercube", "random")
MOST_SAMPLES: Final = 1_000_000
"""How many samples are drawn at once."""


def names_of(uncertainty: Uncertainty) -> tuple[str, ...]:
    """Return the names of the inputs, in order; refuse an uncertainty of none, or one that names an input twice."""
    for name, known in uncertainty.items():
        if not isinstance(known, JointDistribution):
            raise InvalidInputError(
                f"uncertainty {name}: found {type(known).__name__}, expected a distribution, such as a Uniform, "
                "or a class of your own that inherits from pt.robust.Distribution and defines support and _quantile"
            )
    names = [member for name, known in uncertainty.items() for member in known.inputs(name)]
    if not names:
        raise InvalidInputError('uncertainty: found none, expected inputs such as {"obstacle.velocity": Uniform(...)}')
    for name in names:
        if names.count(name) > 1:
            raise InvalidInputError(f"uncertainty: found {name} twice, expected every input once")
    return tuple(names)


@check_arguments
def sample_inputs(
    uncertainty: Uncertainty, count: int, *, seed: int = 0, sampling: str = "sobol"
) -> dict[str, FloatArray]:
    """Draw samples of inputs, the same for the same seed on every machine.

    Args:
        uncertainty: what is known of them; inputs that are not correlated are independent.
        count: how many samples.
        seed: of NumPy's generator.
        sampling: "sobol" (scrambled Sobol sequence: what it averages converges faster than 1/sqrt(n)),
            "latin-hypercube", or "random" (independent samples, for which confidence intervals hold).

    Returns:
        The samples by input, shape (count,) each.

    Raises:
        InvalidInputError: a request makes no sense, or a distribution does not draw one of each input for each point.

    Examples:
        >>> from pretouch.uncertainty import Uniform
        >>> drawn = sample_inputs({"obstacle.velocity": Uniform(low=-0.4, high=-0.2)}, 1024)
        >>> bool(abs(drawn["obstacle.velocity"].mean() + 0.3) < 1e-3)
        True
    """
    check_draw(count, seed=seed, sampling=sampling)
    points, at = _points(count, len(names_of(uncertainty)), seed, sampling), 0
    found: dict[str, FloatArray] = {}
    for name, known in uncertainty.items():
        members = known.inputs(name)
        drawn = np.asarray(known.draw(points[:, at : at + len(members)]))
        if drawn.shape != (count, len(members)):
            raise InvalidInputError(
                f"uncertainty {name}: found samples of shape {drawn.shape} from {type(known).__name__}, expected "
                f"{(count, len(members))}: one of each of its inputs for each point"
            )
        at += len(members)
        found |= {member: np.ascontiguousarray(drawn[:, i]) for i, member in enumerate(members)}
    return found


def check_draw(count: int, *, seed: int, sampling: str) -> None:
    """Refuse numbers of samples, seeds and ways of sampling that make no sense; arguments as in `sample_inputs`."""
    if sampling not in SAMPLINGS:
        raise InvalidInputError(f"sampling: found {sampling!r}, expected one of {', '.join(SAMPLINGS)}")
    if type(count) is not int or count < 1:
        raise InvalidInputError(f"samples: found {count!r}, expected a positive whole number")
    if count > MOST_SAMPLES:
        raise InvalidInputError(
            f"samples: found {count:,}, expected at most {MOST_SAMPLES:,}: the error of a sample falls with the square "
            "root of its size, and that of the model does not"
        )
    if type(seed) is not int or seed < 0:
        raise InvalidInputError(f"seed: found {seed!r}, expected a whole number that is not negative")


def _points(count: int, dimensions: int, seed: int, sampling: str) -> FloatArray:
    """Return points of the open unit cube."""
    rng = np.random.default_rng(seed)
    if sampling == "random":
        points = rng.random((count, dimensions))
    else:
        from scipy.stats import qmc  # noqa: PLC0415 - half a second to load, only when something is sampled

        if sampling == "sobol":  # a power of two is what its balance is proved for
            points = qmc.Sobol(dimensions, rng=rng).random_base2(max(count - 1, 0).bit_length())[:count]
        else:
            points = qmc.LatinHypercube(dimensions, rng=rng).random(count)
    return np.asarray(np.clip(points, 2.0**-54, 1 - 2.0**-53))


def share_in_words(share: float) -> str:
    """Write a share from 0 to 1 in percent, rounded down: a bound from below stays one, what is not all is not 100 %.

    Returns:
        Text such as `99.99 %`, also for 0.99998.
    """
    return f"{math.floor(1e4 * share + 1e-9) / 100:g} %"


def uncertainty_in_words(uncertainty: Uncertainty, sensor: SensorModel) -> list[tuple[str, str]]:
    """Say what is known of each uncertain input, those of the sensor among them: name and text."""
    units = input_units(sensor)
    return [row for name, known in uncertainty.items() for row in known.rows(name, units)]


_REMEDY: Final = (
    "; an input that is drawn from a distribution with tails may come out impossible: leave such values out, for "
    "example by a truncated normal distribution"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ensemble(Value):
    """Encounters that differ in their inputs, those of the sensor among them.

    Args:
        scenario: the encounters, of the shape (n,) or of a shape that broadcasts with it.
        sensor: the sensor as given.
        values: the inputs that differ, in SI, shape (n,) each; none where only noise differs.
        count: n, how many there are.
        likeness: how their sensors are one; None where they are not.
        many: their sensors, where they are not one but may be solved together.
        method: how encounters are solved, as in `find_contact`.
        horizon: how long to wait for contact [s].
        law: the law in continuous time.
        evaluator: solves encounters in the place of `find_contact`, where given; the i-th of them meets the noise of
            run i.
    """

    scenario: Scenario
    sensor: SensorModel
    values: Mapping[str, FloatArray]
    count: int
    likeness: Likeness | None
    many: ManyCurves | None
    method: str
    horizon: float
    law: ContinuousLaw = DAMPER
    evaluator: Evaluator | None = None

    def __len__(self) -> int:
        return self.count

    @property
    def speed(self) -> Any:
        """|x_o'| of each encounter at the start [m/s]."""
        return np.abs(np.broadcast_to(self.scenario.obstacle.velocity, (len(self),)))

    def contacts(self, gain: Any) -> ContactResult:
        """Find the contacts of all encounters with one gain, or an array of them whose last axis is 1 or n."""
        gains = np.asarray(gain, dtype=np.float64)
        gains = np.broadcast_to(gains, (*gains.shape[:-1], len(self)))
        if self.evaluator is not None:
            return self._evaluated(self.evaluator, gains)
        options: dict[str, Any] = {"method": self.method, "horizon": self.horizon}
        one = self.likeness
        if one is not None and one.sensor is self.sensor:
            return self.law.contact(self.scenario, self.sensor, gains, **options)
        if one is not None:
            found = self.law.contact(one.scenario(self.scenario), one.sensor, gains * one.gain, **options)
            return one.result(found, self.scenario)
        if self.many is not None:
            request = make_request(self.scenario, self.sensor, gains, self.method, self.horizon, many=self.many)
            return ContactResult(Solution(request), request.method)
        return _stacked([self.law.contact(*self.at(i), gains[..., i], **options) for i in range(len(self))])

    def _evaluated(self, evaluator: Evaluator, gains: FloatArray) -> ContactResult:
        """Have somebody else solve the encounters: at once, or one by one where it takes one sensor at a time."""
        if not any(map(_of_sensor, self.values)):
            return evaluator(self.scenario, self.sensor, gains)
        if isinstance(evaluator, ManySensorEvaluator):
            return evaluator.with_each(self.scenario, self.sensors(), gains)
        return _stacked([with_noise_after(evaluator, i)(*self.at(i), gains[..., i]) for i in range(len(self))])

    def sensors(self) -> tuple[SensorModel, ...]:
        """Return the sensor of each encounter."""
        return tuple(self._sensor(i) for i in range(len(self)))

    def slope(self, result: ContactResult, quantity: str, name: str) -> Any:
        """Differentiate a quantity of `ContactGradients` by an input; a mass keeps a frequency that is an input."""
        of, frequency = result.gradients.of, "admittance.natural_frequency"
        if name not in {frequency, "admittance.damping_ratio", "admittance.mass"}:
            return of(quantity, name)
        tied = frequency in self.values or "admittance.damping_ratio" in self.values
        if name == "admittance.mass" and not tied:
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
        """Return one encounter and its sensor."""
        return map_fields(self.scenario, lambda v: float(v[index]) if np.ndim(v) else v), self._sensor(index)

    def _sensor(self, index: int) -> SensorModel:
        if self.many is not None:
            return self.many.sensors[index]
        own = {name.removeprefix("sensor."): float(v[index]) for name, v in self.values.items() if _of_sensor(name)}
        return sensor_with(self.sensor, own) if own else self.sensor


@dataclass(frozen=True, slots=True)
class _Stacked(Value):
    """The columns of results that belong together, side by side, and their derivatives at contact."""

    parts: list[ContactResult]

    def column(self, name: str) -> Any:
        """Return a quantity of every run."""
        return np.stack([part.columns.column(name) for part in self.parts], axis=-1)

    @property
    def gradients(self) -> _Stacked:
        """What derivatives are asked of."""
        return self

    def of(self, quantity: str, by: str) -> Any:
        """Return the derivative of a quantity at contact by an input."""
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
    """Put samples of inputs into an encounter.

    Args:
        scenario: one encounter.
        sensor: its sensor.
        values: inputs such as `obstacle.velocity` or `sensor.exponent` and their values in SI, shape (n,) each.
        count: how many encounters, where no input differs.
        method: how encounters are solved, as in `find_contact`.
        horizon: how long to wait for contact [s].
        law: the law in continuous time.
        evaluate: solves encounters in the place of `find_contact`, as in `design_gain`.

    Returns:
        The encounters.

    Raises:
        InvalidInputError: an input is unknown, a value is impossible, or there are not as many of each.

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
        raise InvalidInputError(f"scenario: found encounters of shape {scenario.shape}, expected one")
    known = input_units(sensor)
    checked: dict[str, FloatArray] = {}
    for name, given in values.items():
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]}?" if near else f"expected one of {', '.join(known)}"
            raise InvalidInputError(f"uncertainty: found {name!r}, which is no input; {hint}")
        checked[name] = np.atleast_1d(finite(given, name, known[name]))
    even = len({v.shape for v in checked.values()}) == 1 and next(iter(checked.values())).ndim == 1
    if (checked or count is None) and not even:
        shapes = ", ".join(f"{v.shape} for {name}" for name, v in checked.items()) or "none"
        raise InvalidInputError(f"uncertainty: found values of shapes {shapes}, expected a row of as many for each")
    size = len(next(iter(checked.values()))) if checked else count or 0
    own = {name.removeprefix("sensor."): v for name, v in checked.items() if _of_sensor(name)}
    try:
        several = scenario_with(scenario, {name: v for name, v in checked.items() if not _of_sensor(name)})
        likeness, many = _sensors(sensor, own, several, law, method)
    except InvalidInputError as impossible:
        raise InvalidInputError(f"uncertainty: {impossible}{_REMEDY}") from None
    if evaluate is not None and several.shape == ():  # alike but for the noise, of which each element has its own
        position = np.full(size, several.obstacle.position)
        several = replace(several, obstacle=replace(several.obstacle, position=position))
    found: dict[str, Any] = {"scenario": several, "values": checked, "count": size, "likeness": likeness, "many": many}
    return Ensemble(**found, sensor=sensor, method=method, horizon=horizon, law=law, evaluator=evaluate)


def _sensors(
    sensor: SensorModel, own: Mapping[str, FloatArray], several: Scenario, law: ContinuousLaw, method: str
) -> tuple[Likeness | None, ManyCurves | None]:
    """Find how the sensors are one, or put them side by side; refuse values that no such curve has."""
    if not own:
        return Likeness(sensor=sensor, length=1.0, gain=1.0), None
    if law.degree is not None and (found := find_likeness(sensor, own, several.distance)) is not None:
        return found.of_degree(law.degree), None
    # every sensor is built here, so that an impossible one is named before anything is solved
    rows = (dict(zip(own, map(float, row), strict=True)) for row in zip(*own.values(), strict=True))
    each = tuple(sensor_with(sensor, row) for row in rows)
    return None, many_curves(sensor, own, each, method) if law == DAMPER else None


def _of_sensor(name: str) -> bool:
    return name.startswith("sensor.")
