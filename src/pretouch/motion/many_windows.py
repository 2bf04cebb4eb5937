"""The windows of many curves in one table, as the block kernel reads it: made together, not one curve after another.

Curves may be one curve on other scales of distance: ln xi_i(l) = ln xi(s_i l + t_i) + constant. A sensor behind the
surface is its curve shifted. A parameter whose derivative is `stretch` l g, with the product of stretch and parameter
the same number k wherever it is looked at, scales the distance: d ln xi / d ln p = k l g has the solution ln xi(p^k l).
The rate of a Mittag-Leffler curve is one with k = 1, the width of a Gaussian one with k = -1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray, chebyshev_basis, chebyshev_extremes, chebyshev_nodes
from pretouch.sensors import PiecewiseCubic, SensorModel
from pretouch.sensors.sensitivity import curve_sensitivity

from .curve import (
    EDGE,
    HIGH_DEGREE,
    LOW,
    LOW_DEGREE,
    MIDDLE,
    SLACK,
    SWITCH,
    TERMS,
    TOLERANCE,
    TOP,
    curve_windows,
    polynomial_windows,
    power_window,
)

_BETWEEN: Final = 4.0  # times the tolerance: for a curve between those for which the windows were chosen
_COUNTS: Final = (16, 20, 24, 32, 48, 64)  # nodes of one polynomial over all windows
_FEW_TESTED: Final = 11
_SAME: Final = 1e-12  # of k: what rounding leaves of it
_LOOKED_AT: Final = 17  # distances in a window at which the sign of g is looked at


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ManyWindows:
    """Windows of many curves.

    Args:
        table: the windows as `curve_windows` has them, those of the first curve first; a curve that cannot be met has
            none.
        starts: the row at which the windows of each curve start, and the row after the last, shape (n + 1,).
        falling: whether every curve has windows, and its ln xi falls with the distance on all of them.
    """

    table: FloatArray
    starts: IntArray
    falling: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Images:
    """How many curves are one: that curve, and s and t [m] of each, shape (n,)."""

    sensor: SensorModel
    scale: FloatArray
    shift: FloatArray


def find_images(sensor: SensorModel, values: Mapping[str, FloatArray]) -> Images | None:
    """Find the one curve of which many that differ in parameters, (n,) each, are images; None where there is none."""
    if not values:  # curves that differ in their points
        return None
    curve, own = sensor.bare
    recess = np.atleast_1d(values.get("recess", own))
    values = {name: value for name, value in values.items() if name != "recess"}
    scale, count = np.ones(1), len(next(iter(values.values()), recess))
    for name, value in values.items():
        power = _power_of_stretch(curve, name, value)
        if power is None:
            return None
        if power != 0:
            scale = scale * (value / getattr(curve, name)) ** power
    if (scale != 1).any():
        curve = replace(curve, maximum_distance=np.inf)  # where an image ends is said by its own range
    scale = np.broadcast_to(scale, (count,))
    return Images(sensor=curve, scale=scale, shift=np.asarray(scale * recess))


def _power_of_stretch(sensor: SensorModel, name: str, values: FloatArray) -> float | None:
    """Return k of a parameter that scales the distance, 0 for one without effect; None for any other."""
    own = float(getattr(sensor, name))
    powers = []
    for value in (float(values.min()), own, float(values.max())):
        change = curve_sensitivity(replace(sensor, **{name: value}), name)
        if change.slope is not None or change.output or change.shift:
            return None
        powers.append(change.stretch * value)
    power = powers[1]
    if not any(powers):
        return 0.0
    if not (np.all(values * own > 0) and np.ptp(powers) <= _SAME * abs(power)):
        return None
    return float(np.round(power)) if abs(power - np.round(power)) <= _SAME else power


def windows_of_images(images: Images, tops: FloatArray) -> ManyWindows:
    """Scale and shift the windows of one curve, from l = 0 up to where those of each end [m], shape (n,)."""
    sensor, scale, shift = images.sensor, images.scale, images.shift
    low, high = sensor.valid_range
    ends = scale * tops + shift
    one = curve_windows(sensor, max(float(shift.min()), low), min(float(ends.max()), high))
    if not len(one):
        return _joined([one] * len(tops))
    first = np.maximum(np.searchsorted(one[:, LOW], shift, side="right") - 1, 0)
    last = np.minimum(np.searchsorted(one[:, TOP], ends, side="left"), len(one) - 1)
    counts = last - first + 1
    starts = np.concatenate([[0], np.cumsum(counts)])
    owner = np.repeat(np.arange(len(tops)), counts)
    table = one[np.arange(starts[-1]) + np.repeat(first - starts[:-1], counts)]
    table[:, :TERMS] = (table[:, :TERMS] - shift[owner, None]) / scale[owner, None]
    if table.shape[1] > TERMS + 1:
        table[:, TERMS:] *= scale[owner, None] ** np.arange(table.shape[1] - TERMS)
    table[:, TOP] = np.minimum(table[:, TOP], tops[owner])
    table[starts[:-1], EDGE] = table[starts[:-1], LOW] = 0.0
    return _finished(table, starts, falling=_falls(one))


def windows_side_by_side(
    sensors: Sequence[SensorModel], values: Mapping[str, FloatArray], tops: FloatArray
) -> ManyWindows:
    """Meet curves of one kind on common windows, and those that need others on their own.

    The windows are chosen for the curves with the smallest and the largest value of each parameter and one in the
    middle. All curves are then looked at where these were, and each must be met there.

    Returns:
        Their windows, from l = 0 up to where those of each end [m].
    """
    if all(isinstance(sensor, PiecewiseCubic) for sensor in sensors):
        return _joined([_of_cubics(sensor) for sensor in sensors if isinstance(sensor, PiecewiseCubic)])
    places = [place for value in values.values() for place in (np.argmin(value), np.argmax(value))]
    chosen = [sensors[i] for i in dict.fromkeys([len(sensors) // 2, *map(int, places)])]
    top = float(tops.min())
    if any(sensor.knots for sensor in chosen) or power_window(chosen[0], 0.0, top) is not None:
        return _one_by_one(sensors, tops)
    whole = _whole(chosen, top)
    look = whole.slope if whole else lambda distance: np.stack([s.log_slope(distance) for s in chosen])
    frame = polynomial_windows(look, (0.0, top), LOW_DEGREE, most=4)
    if frame is None:
        frame = polynomial_windows(look, (0.0, top), HIGH_DEGREE)
    if frame is None:
        return _one_by_one(sensors, tops)
    terms, met = _on_frame(sensors, whole, frame)
    table = np.tile(frame, (len(sensors), 1))
    table[:, TERMS:] = terms.reshape(-1, terms.shape[-1])
    if met.all():
        return _finished(table, len(frame) * np.arange(len(sensors) + 1))
    each, degree = table.reshape(len(sensors), *frame.shape), frame.shape[1] - TERMS - 1
    return _joined([each[i] if met[i] else _own(sensor, float(tops[i]), degree) for i, sensor in enumerate(sensors)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Whole:
    """One polynomial of g over all windows, for each of some curves.

    Windows overlap and are short where a curve bends: one polynomial needs a curve at fewer distances.

    Args:
        nodes: where curves are evaluated [m], shape (m,).
        to_terms: from g there to coefficients of Chebyshev's polynomials, shape (m, m).
        terms: those of the chosen curves, shape (m, k).
        top: where the windows end [m].
    """

    nodes: FloatArray
    to_terms: FloatArray
    terms: FloatArray
    top: float

    def basis(self, distance: FloatArray) -> FloatArray:
        """Return Chebyshev's polynomials at distances [m]."""
        return np.asarray(np.polynomial.chebyshev.chebvander(2 * distance / self.top - 1, len(self.nodes) - 1))

    def slope(self, distance: FloatArray) -> FloatArray:
        """Return g [1/m] of the chosen curves."""
        return np.asarray((self.basis(distance) @ self.terms).T)


def _whole(chosen: Sequence[SensorModel], top: float) -> _Whole | None:
    """Return one polynomial that meets each of some curves at points in between, or None."""
    for count in _COUNTS:
        basis = chebyshev_basis(count)
        at, between = ((1 + z) * top / 2 for z in (basis.nodes, chebyshev_extremes(count)))
        found = np.stack([sensor.log_slope(np.concatenate([at, between])) for sensor in chosen])
        with np.errstate(invalid="ignore"):  # a curve without a finite slope is not met
            whole = _Whole(nodes=at, to_terms=basis.to_terms, terms=basis.to_terms @ found[:, :count].T, top=top)
            if (np.abs(whole.slope(between) - found[:, count:]) <= TOLERANCE * np.abs(found[:, count:])).all():
                return whole
    return None


def _on_frame(sensors: Sequence[SensorModel], whole: _Whole | None, frame: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the coefficients of ln xi of every curve on common windows, (n, windows, terms), and which it meets."""
    degree = frame.shape[1] - TERMS - 1
    nodes, probes = chebyshev_nodes(degree), chebyshev_extremes(degree)
    low, high = frame[:, LOW, None], frame[:, TOP, None]
    half = (high - low) / 2
    at_nodes, at_probes = (np.clip(frame[:, MIDDLE, None] + half * z, low, high) for z in (nodes, probes))
    given, step = (at_nodes.ravel(), 1) if whole is None else (whole.nodes, _FEW_TESTED)
    distance = np.concatenate([given, at_probes.ravel()[::step]])
    found = np.stack([sensor._log_slope(distance) for sensor in sensors])  # the distances are known to be valid
    with np.errstate(invalid="ignore"):
        slopes = found[:, : len(given)]
        if whole is not None:
            slopes = slopes @ (whole.basis(at_nodes.ravel()) @ whole.to_terms).T
        slopes = slopes.reshape(-1, *at_nodes.shape)
        terms = slopes @ np.linalg.inv(np.vander(nodes, increasing=True)).T
        predicted = (terms @ np.vander(probes, degree, increasing=True).T).reshape(len(sensors), -1)[:, ::step]
        largest = np.repeat(np.abs(slopes).max(axis=-1), len(probes), axis=1)[:, ::step]
        met = (np.abs(predicted - found[:, len(given) :]) <= _BETWEEN * TOLERANCE * largest).all(axis=1)
    powers = np.arange(1, degree + 1)
    terms = terms / powers / half ** (powers - 1.0)
    return np.concatenate([np.zeros((*terms.shape[:-1], 1)), terms], axis=-1), np.asarray(met)


def _of_cubics(sensor: PiecewiseCubic) -> FloatArray:
    """Return one window for each interval of a curve that consists of cubic polynomials."""
    edges = np.array(sensor.distances)
    low, top = edges[:-1], edges[1:]
    slack = SLACK * (top - low)
    table = np.zeros((len(low), TERMS + LOW_DEGREE + 1))
    table[:, EDGE], table[:, LOW], table[:, TOP], table[:, SWITCH] = low - slack, low, top, low + slack
    table[0, EDGE] = low[0]
    table[:, MIDDLE], table[:, TERMS:-1] = (low + top) / 2, sensor.coefficients()
    return table


def _own(sensor: SensorModel, top: float, degree: int) -> FloatArray:
    """Return the windows of one curve in polynomials of a degree; no row where they do not meet it."""
    found = polynomial_windows(sensor.log_slope, (0.0, top), degree)
    return np.zeros((0, TERMS + degree + 1)) if found is None else found


def _one_by_one(sensors: Sequence[SensorModel], tops: FloatArray) -> ManyWindows:
    """Make the windows of each curve for itself."""
    tables = [curve_windows(sensor, 0.0, float(top)) for sensor, top in zip(sensors, tops, strict=True)]
    widths = {table.shape[1] for table in tables if len(table)}
    if len(widths) > 1:  # only a table of one kind goes into a kernel
        tables = [_own(sensor, float(top), HIGH_DEGREE) for sensor, top in zip(sensors, tops, strict=True)]
    width = tables[0].shape[1] if len(widths) > 1 else max(widths, default=TERMS + 1)
    return _joined([table if len(table) else np.zeros((0, width)) for table in tables])


def _joined(tables: list[FloatArray]) -> ManyWindows:
    return _finished(np.concatenate(tables), np.concatenate([[0], np.cumsum([len(table) for table in tables])]))


def _finished(table: FloatArray, starts: IntArray, *, falling: bool | None = None) -> ManyWindows:
    table, starts = np.ascontiguousarray(table), starts.astype(np.int64)
    for array in (table, starts):
        array.setflags(write=False)  # they are kept
    known = bool((np.diff(starts) > 0).all())
    return ManyWindows(table=table, starts=starts, falling=known and (_falls(table) if falling is None else falling))


def _falls(table: FloatArray) -> bool:
    """Tell whether g < 0 on all windows."""
    middle, terms = table[:, MIDDLE], table[:, TERMS:]
    if terms.shape[1] == 1:
        ends = terms / (table[:, [LOW, TOP]] - middle[:, None])
        return bool((ends < 0).all())
    z = np.linspace(table[:, LOW], table[:, TOP], _LOOKED_AT) - middle
    slope = np.zeros_like(z)
    for j in range(terms.shape[1] - 1, 0, -1):
        slope = slope * z + j * terms[:, j]
    return bool((slope < 0).all())
