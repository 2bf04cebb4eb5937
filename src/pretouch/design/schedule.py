"""A schedule of the virtual drag, phi(s), for a sensor whose output scale is known within two factors.

Let the reflectance be theta times that of the calibration: the loop reads s = ln xi(l) + ln theta. With phi(s) the sum
of p_j over steps of s,

    Q(l) = (1/M) sum_j p_j int_l^{l_d} [s in step j] g^2 dl

is linear in p, the excursion int (e^Q - 1) dl convex, and Q(0) >= ln(1/rho) linear. So the smallest of the largest
excursions over theta is a convex problem: Kelley's cuts, each a linear program, whose dual proves a lower bound.
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
from pretouch.motion.drag_path import NODES, WEIGHTS, so_far
from pretouch.sensors import SensorModel

from .drag import DragDesign, DragRails, drag_by, predict_drag

_PIECES: Final = 48  # of the range of s at least, for the quadrature
_BETWEEN: Final = 4  # reflectances between two at which a border of a step comes into sight or reaches contact
_CLOSE: Final = 1e-4  # the gap at which the search ends, over the excursion of the constant drag
_WORTH: Final = 0.1  # less excursion than this share is not worth a schedule
_ROUNDS: Final = 300
_CUTS: Final = 8  # a round
_TOO_MUCH: Final = 1e3  # times the excursion of the constant drag: a cut there says nothing
_HALVINGS: Final = 55
_ROUNDING: Final = 1e-9
_SHARES: Final = np.array([0.0, *(1 + legendre.leggauss(NODES)[0]) / 2, 1.0])  # of a piece: start, nodes, end


@dataclass(frozen=True, slots=True, kw_only=True)
class DragSchedule(Value):
    """A drag that follows s = ln xi, what it does to each reflectance, and what no other schedule goes below.

    Each object, bright or dark, is seen from one distance on; what `DragDesign` assumes holds; noise counts as
    reflectance.

    Args:
        log_output: the borders of the steps of s, ascending, shape (n + 1,).
        drag: phi on each step [N s^2], shape (n,).
        monotone: whether only schedules were looked at that never fall with s.
        reflectance: those that were looked at, over that of the calibration, shape (m,).
        ratio: rho of each, contact speed over approach speed.
        excursion: of each, at contact [m].
        peak: of each, the largest acceleration over the square of the approach speed [1/m], to 1e-4.
        constant: the constant drag of the ratio that was asked for, the same for every reflectance.
        rails: the constant drags that it stays between, and what they keep.
        lower_bound: below which no schedule of these steps has its largest excursion [m], by the program's dual.
    """

    log_output: FloatArray
    drag: FloatArray
    monotone: bool
    reflectance: FloatArray
    ratio: FloatArray
    excursion: FloatArray
    peak: FloatArray
    constant: DragDesign
    rails: DragRails
    lower_bound: float

    @property
    def largest_excursion(self) -> float:
        """The excursion of the reflectance that has the largest [m]."""
        return float(self.excursion.max())

    @property
    def gap(self) -> float:
        """By how much the largest excursion may exceed the smallest that is possible [m]: the certificate."""
        return self.largest_excursion - self.lower_bound

    @property
    def verdict(self) -> str:
        """Whether the schedule is worth it, and its price, in one sentence."""
        whole = self.constant.excursion
        if whole - self.lower_bound <= 2 * _CLOSE * whole:
            return (
                f"a constant drag is optimal: no {'rising ' * self.monotone}schedule of these steps has a largest "
                f"excursion below {1e3 * self.lower_bound:.2f} mm, and the constant one has {1e3 * whole:.2f} mm"
            )
        saved = 1 - self.largest_excursion / whole
        return (
            f"{'worth it' if saved >= _WORTH else 'not worth it'}: {100 * saved:.0f} % less excursion "
            f"({1e3 * self.largest_excursion:.1f} mm instead of {1e3 * whole:.1f} mm) "
            f"at {self.peak.max() / self.constant.peak:.1f} times the peak acceleration"
        )

    def drag_at(self, log_output: ArrayLike) -> Any:
        """Return phi [N s^2] at readings s = ln xi; beyond the range that of the nearest step."""
        step = np.searchsorted(self.log_output[1:-1], finite(log_output, "log_output"), side="right")
        return float_or_array(self.drag[step])

    def to_dict(self) -> dict[str, Any]:
        """Return the schedule as one JSON object, in SI."""
        told = {f.name: getattr(self, f.name) for f in fields(self)}
        return dict(plain({**told, "gap": self.gap, "verdict": self.verdict}))


def schedule_drag(
    sensor: SensorModel,
    distance: float,
    mass: float,
    *,
    ratio: float,
    reflectance: tuple[float, float] = (0.5, 2.0),
    monotone: bool = True,
    rails: DragRails | tuple[float, float] = (0.5, 2.0),
    steps: int = 48,
) -> DragSchedule:
    """Find the drag over s = ln xi of the smallest excursion, the largest over a range of reflectance.

    Args:
        sensor: the sensor curve, which holds down to contact, and whose ln xi falls with the distance.
        distance: l_d [m], from which on an object is seen, whatever its reflectance.
        mass: M of the virtual object [kg].
        ratio: rho in (0, 1), contact speed over approach speed, which each reflectance keeps.
        reflectance: the least and the largest factor of the output scale, over that of the curve; may be equal.
        monotone: whether phi must not fall with s: the darkest object is then the fastest at contact, and the brightest
            goes back the farthest.
        rails: between which constant drags phi stays, or between which factors of the constant drag of that ratio; with
            half and twice of it no uniform object keeps more than sqrt(rho) of its speed.
        steps: of equal width in s, from the darkest object at l_d to the brightest at contact.

    Returns:
        The schedule.

    Raises:
        InvalidInputError: a number without a meaning, a curve that does not hold or rises, rails of another encounter
            or that the constant drag lies outside of.

    Examples:
        >>> from pretouch.sensors import InversePower
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> found = schedule_drag(sensor, 0.0422, 1.0, ratio=0.26, reflectance=(0.9, 1.1), steps=24)
        >>> print(found.verdict)
        worth it: 28 % less excursion (24.7 mm instead of 34.2 mm) at 2.0 times the peak acceleration
    """
    low, high = np.log(_pair(reflectance, "reflectance"))
    if np.ndim(ratio) or not positive(ratio, "ratio") < 1:
        raise InvalidInputError(f"ratio: found {ratio}, expected one number below 1: at 1 there is no drag to schedule")
    if type(steps) is not int or steps < 1:
        raise InvalidInputError(f"steps: found {steps!r}, expected a whole number from 1 on")
    constant = drag_by(sensor, distance, mass, ratio=ratio)
    between = _rails(constant, rails)
    ends = np.asarray(sensor.log_output(np.array([distance, 0.0])))
    borders = np.linspace(ends[0] + low, ends[1] + high, steps + 1)
    kinks = (borders[:, None] - ends).ravel()  # where a border comes into sight or reaches contact
    kinks = np.unique([low, *kinks[(kinks > low + _ROUNDING) & (kinks < high - _ROUNDING)], high])
    offsets = np.interp(np.arange((len(kinks) - 1) * _BETWEEN + 1) / _BETWEEN, np.arange(len(kinks)), kinks)
    ways = _ways(constant, borders, offsets)
    shares, lower = _search(ways, between, constant, monotone=monotone)
    return DragSchedule(
        log_output=finite(borders, "log_output"),
        drag=finite(shares * constant.drag, "drag"),
        monotone=monotone,
        reflectance=finite(np.exp(offsets), "reflectance"),
        ratio=finite(np.exp(-ways.rows @ shares), "ratio"),
        excursion=finite(ways.excursions(shares)[0], "excursion"),
        peak=finite(ways.peaks(shares), "peak"),
        constant=constant,
        rails=between,
        lower_bound=lower,
    )


def _pair(value: tuple[float, float], name: str) -> FloatArray:
    found = np.asarray(positive(value, name))
    if found.shape != (2,) or found[0] > found[1]:
        raise InvalidInputError(f"{name}: found {value}, expected the least and the largest factor")
    return found


def _rails(constant: DragDesign, given: DragRails | tuple[float, float]) -> DragRails:
    """Return the rails, between which the constant drag lies."""
    if not isinstance(given, DragRails):
        drags = [float(factor * constant.drag) for factor in _pair(given, "rails")]
        weak, strong = (predict_drag(constant.sensor, constant.detection_distance, constant.mass, d) for d in drags)
        given = DragRails(weak=weak, strong=strong)
    one, other = ((d.sensor, d.mass, d.detection_distance) for d in (given.weak, constant))
    if one != other:
        raise InvalidInputError("rails: found those of another curve, mass or detection distance")
    if not given.weak.drag <= constant.drag <= given.strong.drag:
        raise InvalidInputError(
            f"rails: found constant drags of the ratios {given.weak.ratio:g} and {given.strong.ratio:g}, between which "
            f"the ratio that is asked for, {constant.ratio:g}, must lie"
        )
    return given


class _Ways(NamedTuple):
    """The reflectances, a row each, on pieces of the distance from l_d down to contact.

    Args:
        step: of the schedule, on each piece, shape (m, pieces).
        length: dl/dz [m], shape (m, pieces, 1).
        strength: k g^2 of the constant drag [1/m] at the start of each piece, its nodes and its end.
        rows: Q(0) by the share of the constant drag on each step, shape (m, steps).
    """

    step: IntArray
    length: FloatArray
    strength: FloatArray
    rows: FloatArray

    def growth(self, shares: FloatArray) -> FloatArray:
        """Return Q where the strength is known."""
        rate, share = self.strength[..., 1:-1] * self.length, shares[self.step][..., None]
        ends = np.cumsum(share * (rate @ WEIGHTS)[..., None], axis=1)
        starts = np.concatenate([np.zeros_like(ends[:, :1]), ends[:, :-1]], axis=1)
        return np.concatenate([starts, starts + share * so_far(rate), ends], axis=2)

    def excursions(self, shares: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the excursion of each reflectance [m], shape (m,), and its derivatives by the shares."""
        growth = self.growth(shares)[..., 1:-1]
        grown = np.exp(growth) * self.length
        to_come = np.cumsum((grown @ WEIGHTS)[:, ::-1], axis=1)[:, ::-1, None] - so_far(grown)
        excursion = ((np.expm1(growth) * self.length) @ WEIGHTS).sum(axis=1)
        weighted = (self.strength[..., 1:-1] * self.length * to_come) @ WEIGHTS
        return excursion, _by_step(self.step, weighted, len(shares))

    def peaks(self, shares: FloatArray) -> FloatArray:
        """Return the largest acceleration of each reflectance over v^2 [1/m]."""
        pull = shares[self.step][..., None] * self.strength * np.exp(-2 * self.growth(shares))
        return np.asarray(np.where(self.length > 0, pull, 0.0).max(axis=(1, 2)))


def _by_step(step: IntArray, values: FloatArray, count: int) -> FloatArray:
    found = np.zeros((len(step), count))
    np.add.at(found, (np.arange(len(step))[:, None], step), values)
    return found


def _ways(constant: DragDesign, borders: FloatArray, offsets: FloatArray) -> _Ways:
    """Cut the way of each reflectance where its ln xi passes a border, and at the knots of the curve."""
    sensor, farthest = constant.sensor, constant.detection_distance
    steps = len(borders) - 1
    fine = np.linspace(borders[0], borders[-1], steps * -(-_PIECES // steps) + 1)
    low, high = np.zeros((len(offsets), len(fine))), np.full((len(offsets), len(fine)), farthest)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        beyond = np.asarray(sensor.log_output(middle)) > fine - offsets[:, None]
        low, high = np.where(beyond, middle, low), np.where(beyond, high, middle)
    known = [0.0, farthest, *(knot for knot in sensor.knots if 0 < knot < farthest)]
    distances = -np.sort(-np.hstack([high, np.tile(known, (len(offsets), 1))]), axis=1)
    start, width = distances[:, :-1, None], -np.diff(distances, axis=1)[..., None]
    middle = np.asarray(sensor.log_output(start - width / 2))[..., 0] + offsets[:, None]
    step = np.searchsorted(borders[1:-1], middle, side="right")
    slope = np.asarray(sensor.log_slope(np.clip(start - width * _SHARES, 0.0, farthest)))
    strength = constant.drag / constant.mass * slope**2
    whole = (strength[..., 1:-1] * width / 2) @ WEIGHTS
    return _Ways(step, width / 2, strength, _by_step(step, whole, steps))


def _search(ways: _Ways, rails: DragRails, constant: DragDesign, *, monotone: bool) -> tuple[FloatArray, float]:
    """Return the shares of the constant drag on the steps, and the lower bound of the largest excursion [m]."""
    from scipy.optimize import linprog  # noqa: PLC0415 - `import pretouch` stays quick

    rows = ways.rows / math.log(1 / constant.ratio)
    count, scale, fixed = rows.shape[1], constant.excursion, len(rows) + (ways.rows.shape[1] - 1) * monotone
    low, high = min(rails.weak.drag / constant.drag, 1.0), max(rails.strong.drag / constant.drag, 1.0)
    matrix = np.vstack([-rows, -np.diff(np.eye(count), axis=0)])[:fixed]
    matrix, right = np.pad(matrix, ((0, 0), (0, 1))), np.repeat([-1.0, 0.0], [len(rows), fixed - len(rows)])
    best = shares = np.ones(count)
    smallest, lower = math.inf, 0.0
    for _ in range(_ROUNDS):
        excursion, slope = (found / scale for found in ways.excursions(shares))
        if not excursion.max() < _TOO_MUCH:
            shares = (shares + best) / 2
            continue
        if excursion.max() < smallest:
            best, smallest = shares, float(excursion.max())
        which = np.argsort(-excursion)[:_CUTS]
        matrix = np.vstack([matrix, np.column_stack([slope[which], -np.ones(len(which))])])
        right = np.concatenate([right, slope[which] @ shares - excursion[which]])
        box = [(low, high)] * count + [(0.0, None)]
        found = linprog(np.append(np.zeros(count), 1.0), A_ub=matrix, b_ub=right, bounds=box, method="highs")
        if found.x is None:
            break
        y = np.maximum(-found.ineqlin.marginals, 0.0)  # weak duality holds for any, whatever the solver's tolerance
        y /= max(1.0, y[fixed:].sum())  # the excursion has no upper limit
        reduced = (y @ matrix)[:-1]
        lower = max(lower, float(np.minimum(reduced * low, reduced * high).sum() - y @ right))
        if smallest - lower <= _CLOSE:
            break
        shares = (np.clip(found.x[:-1], low, high) + best) / 2  # corners lie far from what is best
        reached = rows @ shares  # raised toward the strong rail, as far as it takes for all to keep the ratio
        shares = shares + (np.maximum(1 - reached, 0.0) / np.maximum(high - reached, 1e-300)).max() * (high - shares)
    return best, lower * scale
