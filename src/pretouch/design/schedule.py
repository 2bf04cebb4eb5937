"""Optimize a virtual drag whose strength depends on the reading.

Such a drag suits sensors whose output scale is uncertain. If the reflectance of the object is uncertain, so is the
output scale. Let the output scale be theta times that of the calibration. Then the loop reads s = ln xi(l) + ln theta.
If phi has the constant value p_j on each step j of s, then

    Q(l) = (1/M) sum_j p_j int_l^{l_d} [s in step j] g^2 dl

is linear in p. The excursion int (e^Q - 1) dl is convex, and the limit of the contact speed, Q(0) >= ln(1/rho), is
linear. So minimizing the largest excursion over theta is a convex problem. Kelley's cutting planes solve it: each
iteration is a linear program, whose dual proves a lower bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.files import plain
from pretouch._core.numbers import FloatArray, IntArray, finite, float_or_array, positive
from pretouch._core.values import Value
from pretouch.control import Output, Parts, Sample, VirtualDrag, drive, observe, push_by_drag
from pretouch.sensors import SensorModel

from .drag import DragDesign, DragLimits, drag_by, predict_drag

_PIECES: Final = 48  # smallest number of quadrature intervals over the range of s
_BETWEEN: Final = 4  # reflectance intervals between two kinks; at a kink, a step's border is at detection or contact
_CLOSE: Final = 1e-4  # the search ends at this gap, relative to the excursion of the constant drag
_WORTH: Final = 0.1  # smallest relative saving of excursion for which a schedule is worthwhile
_ROUNDS: Final = 300
_CUTS: Final = 8  # cutting planes per round
_TOO_MUCH: Final = 1e3  # no cut is made at an excursion above this multiple of the constant drag's
_HALVINGS: Final = 55
_ROUNDING: Final = 1e-9
_COUNT: Final = 16  # Gauss nodes of a piece
_NODES, _WEIGHTS = legendre.leggauss(_COUNT)
_SO_FAR: Final = (
    legendre.legvander(_NODES, _COUNT)
    @ legendre.legint(np.eye(_COUNT), lbnd=-1)
    @ np.linalg.inv(legendre.legvander(_NODES, _COUNT - 1))
).T  # from values at the nodes to their integral up to each node
_SHARES: Final = np.array([0.0, *(1 + _NODES) / 2, 1.0])  # start, Gauss nodes, end of a piece


@dataclass(frozen=True, slots=True, kw_only=True)
class DragSchedule(Value):
    """A virtual drag whose coefficient depends on the sensor reading.

    The coefficient phi is a function of the log output ln xi.

    Every object, bright or dark, is assumed to be detected at the same distance. The assumptions of `DragDesign` hold.
    Noise has the effect of a change of reflectance.

    Args:
        log_output: the borders of the steps of s, ascending, shape (n + 1,).
        drag: phi on each step [N s^2], shape (n,).
        monotone: whether the search was restricted to schedules that do not fall with s.
        reflectance: the reflectances that were evaluated, relative to that of the calibration, shape (m,).
        ratio: rho for each reflectance: contact speed over approach speed.
        excursion: excursion at contact for each reflectance [m].
        peak: largest acceleration divided by the square of the approach speed, for each reflectance [1/m], to 1e-4.
        constant: the constant drag of the required ratio, which has the same effect at every reflectance.
        rails: the weakest and the strongest constant drag that the schedule may use, and their guarantees.
        lower_bound: lower bound [m], proved by duality, of the largest excursion of any schedule with these steps.
    """

    log_output: FloatArray
    drag: FloatArray
    monotone: bool
    reflectance: FloatArray
    ratio: FloatArray
    excursion: FloatArray
    peak: FloatArray
    constant: DragDesign
    rails: DragLimits
    lower_bound: float

    @property
    def largest_excursion(self) -> float:
        """The largest excursion of the robot [m].

        It is the maximum over all evaluated reflectances of the object.
        """
        return float(self.excursion.max())

    @property
    def gap(self) -> float:
        """The optimality gap of the drag schedule [m].

        It is the largest excursion minus its lower bound for all possible schedules.
        """
        return self.largest_excursion - self.lower_bound

    @property
    def verdict(self) -> str:
        """Comparison of scheduled and constant virtual drag in words."""
        whole = self.constant.excursion
        if whole - self.lower_bound <= 2 * _CLOSE * whole:
            kind = "rising drag schedule" if self.monotone else "drag schedule"
            return (
                f"a constant virtual drag with an excursion of {1e3 * whole:.2f} mm is optimal. Every {kind} with the "
                "same steps of ln xi (xi: sensor output) needs an excursion of at least "
                f"{1e3 * self.lower_bound:.2f} mm"
            )
        saved = 1 - self.largest_excursion / whole
        return (
            "compared with a constant drag, the drag schedule is "
            f"{('worthwhile' if saved >= _WORTH else 'not worthwhile')}: the excursion is "
            f"{100 * saved:.0f} % smaller ({1e3 * self.largest_excursion:.1f} mm instead of "
            f"{1e3 * whole:.1f} mm). The peak acceleration is "
            f"{self.peak.max() / self.constant.peak:.1f} times as large"
        )

    def drag_at(self, log_output: ArrayLike) -> Any:
        """Return the drag coefficient for given logarithms of the sensor output.

        The drag phi is in N s^2, the log output is ln xi. Beyond the ends of the schedule, the drag is constant.
        """
        step = np.searchsorted(self.log_output[1:-1], finite(log_output, "log_output"), side="right")
        return float_or_array(self.drag[step])

    def sampled(self, drag: VirtualDrag) -> ScheduledDrag:
        """Return the sampled control law of the scheduled drag.

        Noise, dead zone and smoothing are those of `drag`.
        """
        return ScheduledDrag(schedule=self, drag=drag)

    def to_dict(self) -> dict[str, Any]:
        """Return the scheduled drag as a JSON object.

        The predicted approaches are included. Numbers are in SI units.
        """
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return dict(plain({**values, "gap": self.gap, "verdict": self.verdict}))


@dataclass(frozen=True, slots=True, kw_only=True)
class ScheduledDrag(Value):
    """Sampled control law of a scheduled virtual drag.

    It selects the drag coefficient phi at each reading. `DragSchedule.sampled` makes it. It runs in Python, so it is
    simulated like a custom law. As the period tends to 0, its motion tends to the one that the schedule predicts, with
    an error of first order.

    Args:
        schedule: phi over ln xi.
        drag: noise, dead zone and smoothing of the drag; its phi is not used.
    """

    schedule: DragSchedule
    drag: VirtualDrag

    def numbers(self, controller: Any) -> Any:
        """Return the controller parameters for a drag coefficient of 1.

        The coefficient is phi = 1 N s^2. The method `step` multiplies the impulse by the scheduled phi.
        """
        return self.drag.with_value(1.0).numbers(controller)

    def start(self) -> Any:
        """Return the state of the controller before the first reading."""
        return self.drag.start()

    def step(self, parameters: Parts, state: Parts, sample: Sample) -> tuple[Parts, Output]:
        """Compute one controller step with the scheduled drag, as described in `pretouch.control.Law`."""
        sensing, observation = observe(parameters.sensing, state.sensing, sample)
        law, push = push_by_drag(parameters.law, state.law, observation, state.drive)
        if observation.usable:
            push.impulse *= self.schedule.drag_at(math.log(observation.level))
        driven, output = drive(parameters.drive, state.drive, observation, push, sample)
        return Parts(sensing, driven, law), output


def schedule_drag(
    sensor: SensorModel,
    distance: float,
    mass: float,
    *,
    ratio: float,
    reflectance: tuple[float, float] = (0.5, 2.0),
    monotone: bool = True,
    rails: DragLimits | tuple[float, float] = (0.5, 2.0),
    steps: int = 48,
) -> DragSchedule:
    """Find the drag schedule that minimizes the largest excursion.

    The drag phi(ln xi) is optimal for a range of reflectance.

    Args:
        sensor: the sensor curve, which must be valid down to contact and whose ln xi must fall with the distance.
        distance: detection distance l_d of an object of any reflectance [m].
        mass: M of the virtual object [kg].
        ratio: largest rho in (0, 1), contact speed over approach speed, for every reflectance.
        reflectance: smallest and largest factor of the output scale relative to the curve; may be equal.
        monotone: whether phi must not fall with s. If so, the darkest object is the fastest at contact, and the plant
            retreats farthest from the brightest.
        rails: two constant drags, the weakest and the strongest; phi stays between them. Or two factors relative to
            the constant drag of `ratio`: with 0.5 and 2, no object in uniform motion keeps more than sqrt(rho) of its
            speed.
        steps: number of steps of equal width in s, from the darkest object at l_d to the brightest at contact.

    Returns:
        The schedule.

    Raises:
        InvalidInputError: an argument is out of range, the curve rises or is not valid down to contact, or the rails
            belong to another encounter or do not enclose the constant drag.

    Examples:
        >>> from pretouch.sensors import InversePower
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> schedule = schedule_drag(sensor, 0.0422, 1.0, ratio=0.26, reflectance=(0.9, 1.1), steps=24)
        >>> print(schedule.verdict.partition(": ")[2])
        the excursion is 28 % smaller (24.7 mm instead of 34.2 mm). The peak acceleration is 2.0 times as large
    """
    low, high = np.log(_pair(reflectance, "reflectance"))
    if np.ndim(ratio) or not positive(ratio, "ratio") < 1:
        raise InvalidInputError(
            f"ratio: found {ratio}, expected a single speed ratio below 1; a ratio of 1 means no virtual drag"
        )
    if type(steps) is not int or steps < 1:
        raise InvalidInputError(f"steps: found {steps!r}, expected a positive whole number of steps of ln xi")
    constant = drag_by(sensor, distance, mass, ratio=ratio)
    between = _rails(constant, rails)
    ends = np.asarray(sensor.log_output(np.array([distance, 0.0])))
    borders = np.linspace(ends[0] + low, ends[1] + high, steps + 1)
    kinks = (borders[:, None] - ends).ravel()  # reflectances at which a border is at detection or at contact
    kinks = np.unique([low, *kinks[(kinks > low + _ROUNDING) & (kinks < high - _ROUNDING)], high])
    offsets = np.interp(np.arange((len(kinks) - 1) * _BETWEEN + 1) / _BETWEEN, np.arange(len(kinks)), kinks)
    paths = _split_paths(constant, borders, offsets)
    shares, lower = _search(paths, between, constant, monotone=monotone)
    return DragSchedule(
        log_output=finite(borders, "log_output"),
        drag=finite(shares * constant.drag, "drag"),
        monotone=monotone,
        reflectance=finite(np.exp(offsets), "reflectance"),
        ratio=finite(np.exp(-paths.rows @ shares), "ratio"),
        excursion=finite(paths.excursions(shares)[0], "excursion"),
        peak=finite(paths.peaks(shares), "peak"),
        constant=constant,
        rails=between,
        lower_bound=lower,
    )


def _pair(value: tuple[float, float], name: str) -> FloatArray:
    pair = np.asarray(positive(value, name))
    if pair.shape != (2,) or pair[0] > pair[1]:
        raise InvalidInputError(f"{name}: found {value}, expected two positive factors, the smaller factor first")
    return pair


def _rails(constant: DragDesign, rails: DragLimits | tuple[float, float]) -> DragLimits:
    """Return the limits of the drag coefficient."""
    if not isinstance(rails, DragLimits):
        drags = [float(factor * constant.drag) for factor in _pair(rails, "rails")]
        weak, strong = (predict_drag(constant.sensor, constant.detection_distance, constant.mass, d) for d in drags)
        rails = DragLimits(weak=weak, strong=strong)
    rail, design = ((d.sensor, d.mass, d.detection_distance) for d in (rails.weak, constant))
    if rail != design:
        raise InvalidInputError(
            "rails: found limits for another curve, mass or detection distance, expected the values of this design"
        )
    if not rails.weak.drag <= constant.drag <= rails.strong.drag:
        raise InvalidInputError(
            f"rails: the required ratio of contact speed to approach speed is {constant.ratio:g}, expected a ratio "
            f"between {rails.weak.ratio:g} (weak drag) and {rails.strong.ratio:g} (strong drag)"
        )
    return rails


class _Paths(NamedTuple):
    """The approach of an object for each reflectance.

    The distance is divided into short intervals.

    Args:
        step: index of the schedule's step on each piece, shape (m, pieces).
        length: dl/dz [m], shape (m, pieces, 1).
        strength: k g^2 of the constant drag [1/m] at the start, the nodes and the end of each piece.
        rows: derivative of Q(0) by the share of the constant drag on each step, shape (m, steps).
    """

    step: IntArray
    length: FloatArray
    strength: FloatArray
    rows: FloatArray

    def growth(self, shares: FloatArray) -> FloatArray:
        """Return the decay exponent Q of the speed along each approach.

        The speed at each point is exp(-Q) times the approach speed.
        """
        rate, share = self.strength[..., 1:-1] * self.length, shares[self.step][..., None]
        ends = np.cumsum(share * (rate @ _WEIGHTS)[..., None], axis=1)
        starts = np.concatenate([np.zeros_like(ends[:, :1]), ends[:, :-1]], axis=1)
        return np.concatenate([starts, starts + share * (rate @ _SO_FAR), ends], axis=2)

    def excursions(self, shares: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the excursion for each reflectance [m].

        Return also its derivatives with respect to the drag of each step.
        """
        growth = self.growth(shares)[..., 1:-1]
        grown = np.exp(growth) * self.length
        to_come = np.cumsum((grown @ _WEIGHTS)[:, ::-1], axis=1)[:, ::-1, None] - grown @ _SO_FAR
        excursion = ((np.expm1(growth) * self.length) @ _WEIGHTS).sum(axis=1)
        weighted = (self.strength[..., 1:-1] * self.length * to_come) @ _WEIGHTS
        return excursion, _by_step(self.step, weighted, len(shares))

    def peaks(self, shares: FloatArray) -> FloatArray:
        """Return the peak acceleration divided by the squared approach speed [1/m].

        There is one value for each reflectance.
        """
        pull = shares[self.step][..., None] * self.strength * np.exp(-2 * self.growth(shares))
        return np.asarray(np.where(self.length > 0, pull, 0.0).max(axis=(1, 2)))


def _by_step(step: IntArray, values: FloatArray, count: int) -> FloatArray:
    sums = np.zeros((len(step), count))
    np.add.at(sums, (np.arange(len(step))[:, None], step), values)
    return sums


def _split_paths(constant: DragDesign, borders: FloatArray, offsets: FloatArray) -> _Paths:
    """Split each approach into intervals with a constant drag."""
    sensor, farthest = constant.sensor, constant.detection_distance
    steps = len(borders) - 1
    fine = np.linspace(borders[0], borders[-1], steps * -(-_PIECES // steps) + 1)
    low, high = np.zeros((len(offsets), len(fine))), np.full((len(offsets), len(fine)), farthest)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        beyond = np.asarray(sensor.log_output(middle)) > fine - offsets[:, None]
        low, high = np.where(beyond, middle, low), np.where(beyond, high, middle)
    fixed = [0.0, farthest, *(knot for knot in sensor.knots if 0 < knot < farthest)]
    distances = -np.sort(-np.hstack([high, np.tile(fixed, (len(offsets), 1))]), axis=1)
    start, width = distances[:, :-1, None], -np.diff(distances, axis=1)[..., None]
    middle = np.asarray(sensor.log_output(start - width / 2))[..., 0] + offsets[:, None]
    step = np.searchsorted(borders[1:-1], middle, side="right")
    slope = np.asarray(sensor.log_slope(np.clip(start - width * _SHARES, 0.0, farthest)))
    strength = constant.drag / constant.mass * slope**2
    whole = (strength[..., 1:-1] * width / 2) @ _WEIGHTS
    return _Paths(step, width / 2, strength, _by_step(step, whole, steps))


def _search(paths: _Paths, rails: DragLimits, constant: DragDesign, *, monotone: bool) -> tuple[FloatArray, float]:
    """Minimize the largest excursion over all drag schedules."""
    from scipy.optimize import linprog  # noqa: PLC0415 - keeps `import pretouch` fast

    rows = paths.rows / math.log(1 / constant.ratio)
    count, scale, fixed = rows.shape[1], constant.excursion, len(rows) + (paths.rows.shape[1] - 1) * monotone
    low, high = min(rails.weak.drag / constant.drag, 1.0), max(rails.strong.drag / constant.drag, 1.0)
    matrix = np.vstack([-rows, -np.diff(np.eye(count), axis=0)])[:fixed]
    matrix, right = np.pad(matrix, ((0, 0), (0, 1))), np.repeat([-1.0, 0.0], [len(rows), fixed - len(rows)])
    best = shares = np.ones(count)
    smallest, lower = math.inf, 0.0
    for _ in range(_ROUNDS):
        excursion, slope = (values / scale for values in paths.excursions(shares))
        if not excursion.max() < _TOO_MUCH:
            shares = (shares + best) / 2
            continue
        if excursion.max() < smallest:
            best, smallest = shares, float(excursion.max())
        which = np.argsort(-excursion)[:_CUTS]
        matrix = np.vstack([matrix, np.column_stack([slope[which], -np.ones(len(which))])])
        right = np.concatenate([right, slope[which] @ shares - excursion[which]])
        box = [(low, high)] * count + [(0.0, None)]
        solution = linprog(np.append(np.zeros(count), 1.0), A_ub=matrix, b_ub=right, bounds=box, method="highs")
        if solution.x is None:
            break
        y = np.maximum(-solution.ineqlin.marginals, 0.0)  # weak duality holds for any y >= 0, at any solver tolerance
        y /= max(1.0, y[fixed:].sum())  # the dual constraint of the excursion, which has no upper bound
        reduced = (y @ matrix)[:-1]
        lower = max(lower, float(np.minimum(reduced * low, reduced * high).sum() - y @ right))
        if smallest - lower <= _CLOSE:
            break
        shares = (
            np.clip(solution.x[:-1], low, high) + best
        ) / 2  # damping, because corners of the polytope are far from optimal
        reached = rows @ shares  # then the schedule moves toward the strong rail until every reflectance has the ratio
        shares = shares + (np.maximum(1 - reached, 0.0) / np.maximum(high - reached, 1e-300)).max() * (high - shares)
    return best, lower * scale
