"""Approximate many related sensor curves by piecewise polynomials at once, to save computing time.

Curves may be images of one curve under scaling and shift of the distance: ln xi_i(l) = ln xi(s_i l + t_i) + constant. A
recessed sensor is a shifted curve. A parameter p scales the distance if its derivative is `stretch` l g and the product
k = `stretch` p is constant, since d ln xi / d ln p = k l g has the solution ln xi(p^k l). Examples are the rate of a
Mittag-Leffler curve with k = 1 and the width of a Gaussian curve with k = -1.
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
    windows_of_pieces,
)

_BETWEEN: Final = 4.0  # times the tolerance, for curves other than those for which the windows were chosen
_COUNTS: Final = (16, 20, 24, 32, 48, 64)  # tried numbers of nodes of one polynomial over all windows
_TEST_STEP: Final = 11  # every 11th probe is tested if one polynomial describes all windows
_SAME: Final = 1e-12  # relative rounding error of k
_SIGN_PROBES: Final = 17  # distances per window at which the sign of g is checked


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ManyWindows:
    """Table with the polynomials that approximate many sensor curves.

    Args:
        table: windows as from `curve_windows`, curve by curve; a curve that cannot be approximated has none.
        starts: first row of each curve, and the number of rows, shape (n + 1,).
        falling: whether every curve has windows, and its ln xi falls with the distance on all of them.
    """

    table: FloatArray
    starts: IntArray
    falling: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Images:
    """Scaled and shifted variants of one sensor curve.

    The distance is scaled and shifted. Each has a scale s and a shift t [m], shape (n,).
    """

    sensor: SensorModel
    scale: FloatArray
    shift: FloatArray


def find_images(sensor: SensorModel, values: Mapping[str, FloatArray]) -> Images | None:
    """Express all sensor curves as scaled and shifted variants of one curve; None if this is not possible."""
    if not values:  # curves that differ in the points of a table
        return None
    curve, default = sensor.bare
    recess = np.atleast_1d(values.get("recess", default))
    values = {name: value for name, value in values.items() if name != "recess"}
    scale, count = np.ones(1), len(next(iter(values.values()), recess))
    for name, value in values.items():
        power = _power_of_stretch(curve, name, value)
        if power is None:
            return None
        if power != 0:
            scale = scale * (value / getattr(curve, name)) ** power
    if (scale != 1).any():
        curve = replace(curve, maximum_distance=np.inf)  # each image has its own range
    scale = np.broadcast_to(scale, (count,))
    return Images(sensor=curve, scale=scale, shift=np.asarray(scale * recess))


def _power_of_stretch(sensor: SensorModel, name: str, values: FloatArray) -> float | None:
    """Return k if a parameter p scales the distance by p^k, 0 without effect; None for another effect."""
    nominal = float(getattr(sensor, name))
    powers = []
    for value in (float(values.min()), nominal, float(values.max())):
        change = curve_sensitivity(replace(sensor, **{name: value}), name)
        if change.slope is not None or change.output or change.shift:
            return None
        powers.append(change.stretch * value)
    power = powers[1]
    if not any(powers):
        return 0.0
    if not (np.all(values * nominal > 0) and np.ptp(powers) <= _SAME * abs(power)):
        return None
    return float(np.round(power)) if abs(power - np.round(power)) <= _SAME else power


def windows_of_images(images: Images, tops: FloatArray) -> ManyWindows:
    """Return the polynomials of scaled and shifted variants of one curve.

    The windows reach from l = 0 to the upper end of each curve, `tops` [m], shape (n,).
    """
    sensor, scale, shift = images.sensor, images.scale, images.shift
    low, high = sensor.valid_range
    ends = scale * tops + shift
    windows = curve_windows(sensor, max(float(shift.min()), low), min(float(ends.max()), high))
    if not len(windows):
        return _join([windows] * len(tops))
    first = np.maximum(np.searchsorted(windows[:, LOW], shift, side="right") - 1, 0)
    last = np.minimum(np.searchsorted(windows[:, TOP], ends, side="left"), len(windows) - 1)
    counts = last - first + 1
    starts = np.concatenate([[0], np.cumsum(counts)])
    owner = np.repeat(np.arange(len(tops)), counts)
    table = windows[np.arange(starts[-1]) + np.repeat(first - starts[:-1], counts)]
    table[:, :TERMS] = (table[:, :TERMS] - shift[owner, None]) / scale[owner, None]
    if table.shape[1] > TERMS + 1:
        table[:, TERMS:] *= scale[owner, None] ** np.arange(table.shape[1] - TERMS)
    table[:, TOP] = np.minimum(table[:, TOP], tops[owner])
    table[starts[:-1], EDGE] = table[starts[:-1], LOW] = 0.0
    return _make_windows(table, starts, falling=_falls(windows))


def windows_side_by_side(
    sensors: Sequence[SensorModel], values: Mapping[str, FloatArray], tops: FloatArray
) -> ManyWindows:
    """Approximate many sensor curves by polynomials on the same intervals.

    All curves have the same class. Curves that need other intervals get their own.

    The windows are chosen for the curves with the smallest and the largest value of each parameter, and one between
    them. The approximation of every curve is then tested on these windows.

    Returns:
        The windows from l = 0 to the upper end of each curve [m].
    """
    if all(isinstance(sensor, PiecewiseCubic) for sensor in sensors):
        return _join([_of_cubics(sensor) for sensor in sensors if isinstance(sensor, PiecewiseCubic)])
    places = [place for value in values.values() for place in (np.argmin(value), np.argmax(value))]
    chosen = [sensors[i] for i in dict.fromkeys([len(sensors) // 2, *map(int, places)])]
    top = float(tops.min())
    if any(sensor.knots for sensor in chosen) or power_window(chosen[0], 0.0, top) is not None:
        return _one_by_one(sensors, tops)
    whole = _whole(chosen, top)
    slope = whole.slope if whole else lambda distance: np.stack([s.log_slope(distance) for s in chosen])
    frame = polynomial_windows(slope, (0.0, top), LOW_DEGREE, most=4)
    if frame is None:
        frame = polynomial_windows(slope, (0.0, top), HIGH_DEGREE)
    if frame is None:
        return _one_by_one(sensors, tops)
    terms, fits = _on_frame(sensors, whole, frame)
    table = np.tile(frame, (len(sensors), 1))
    table[:, TERMS:] = terms.reshape(-1, terms.shape[-1])
    if fits.all():
        return _make_windows(table, len(frame) * np.arange(len(sensors) + 1))
    each, degree = table.reshape(len(sensors), *frame.shape), frame.shape[1] - TERMS - 1
    return _join(
        [each[i] if fits[i] else _own_windows(sensor, float(tops[i]), degree) for i, sensor in enumerate(sensors)]
    )


def windows_from_pieces(sensors: Sequence[SensorModel], tops: FloatArray) -> ManyWindows:
    """Return as many polynomials as each sensor curve needs.

    The polynomials reach from contact to the upper end [m] of the curve.
    """
    return _join([windows_of_pieces(sensor, 0.0, float(top)) for sensor, top in zip(sensors, tops, strict=True)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Whole:
    """Slope polynomials of sensor curves, each over the whole distance range.

    Windows overlap and are short where a curve bends, so one polynomial needs fewer evaluations of a curve.

    Args:
        nodes: distances at which curves are evaluated [m], shape (m,).
        to_terms: matrix from g at the nodes to coefficients of Chebyshev polynomials, shape (m, m).
        terms: coefficients of the chosen curves, shape (m, k).
        top: upper end of the windows [m].
    """

    nodes: FloatArray
    to_terms: FloatArray
    terms: FloatArray
    top: float

    def basis(self, distance: FloatArray) -> FloatArray:
        """Return the values of the Chebyshev polynomials at given distances [m]."""
        return np.asarray(np.polynomial.chebyshev.chebvander(2 * distance / self.top - 1, len(self.nodes) - 1))

    def slope(self, distance: FloatArray) -> FloatArray:
        """Return the approximated sensor slopes g [1/m] at given distances [m]."""
        return np.asarray((self.basis(distance) @ self.terms).T)


def _whole(chosen: Sequence[SensorModel], top: float) -> _Whole | None:
    """Approximate each curve's slope by one polynomial, tested between its nodes; None if the error is too large."""
    for count in _COUNTS:
        basis = chebyshev_basis(count)
        at, between = ((1 + z) * top / 2 for z in (basis.nodes, chebyshev_extremes(count)))
        slopes = np.stack([sensor.log_slope(np.concatenate([at, between])) for sensor in chosen])
        with np.errstate(invalid="ignore"):  # a curve with infinite slopes fails the test
            whole = _Whole(nodes=at, to_terms=basis.to_terms, terms=basis.to_terms @ slopes[:, :count].T, top=top)
            if (np.abs(whole.slope(between) - slopes[:, count:]) <= TOLERANCE * np.abs(slopes[:, count:])).all():
                return whole
    return None


def _on_frame(sensors: Sequence[SensorModel], whole: _Whole | None, frame: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return ln xi of many curves as coefficients (n, windows, terms), and which curves are accurate."""
    degree = frame.shape[1] - TERMS - 1
    nodes, probes = chebyshev_nodes(degree), chebyshev_extremes(degree)
    low, high = frame[:, LOW, None], frame[:, TOP, None]
    half = (high - low) / 2
    at_nodes, at_probes = (np.clip(frame[:, MIDDLE, None] + half * z, low, high) for z in (nodes, probes))
    samples, step = (at_nodes.ravel(), 1) if whole is None else (whole.nodes, _TEST_STEP)
    distance = np.concatenate([samples, at_probes.ravel()[::step]])
    evaluated = np.stack([sensor._log_slope(distance) for sensor in sensors])  # all distances are valid
    with np.errstate(invalid="ignore"):
        slopes = evaluated[:, : len(samples)]
        if whole is not None:
            slopes = slopes @ (whole.basis(at_nodes.ravel()) @ whole.to_terms).T
        slopes = slopes.reshape(-1, *at_nodes.shape)
        terms = slopes @ np.linalg.inv(np.vander(nodes, increasing=True)).T
        predicted = (terms @ np.vander(probes, degree, increasing=True).T).reshape(len(sensors), -1)[:, ::step]
        largest = np.repeat(np.abs(slopes).max(axis=-1), len(probes), axis=1)[:, ::step]
        fits = (np.abs(predicted - evaluated[:, len(samples) :]) <= _BETWEEN * TOLERANCE * largest).all(axis=1)
    powers = np.arange(1, degree + 1)
    terms = terms / powers / half ** (powers - 1.0)
    return np.concatenate([np.zeros((*terms.shape[:-1], 1)), terms], axis=-1), np.asarray(fits)


def _of_cubics(sensor: PiecewiseCubic) -> FloatArray:
    """Return the polynomial table of a piecewise cubic sensor curve."""
    edges = np.array(sensor.distances)
    low, top = edges[:-1], edges[1:]
    slack = SLACK * (top - low)
    table = np.zeros((len(low), TERMS + LOW_DEGREE + 1))
    table[:, EDGE], table[:, LOW], table[:, TOP], table[:, SWITCH] = low - slack, low, top, low + slack
    table[0, EDGE] = low[0]
    table[:, MIDDLE], table[:, TERMS:-1] = (low + top) / 2, sensor.coefficients()
    return table


def _own_windows(sensor: SensorModel, top: float, degree: int) -> FloatArray:
    """Approximate one curve by polynomials on its own intervals; empty if none are accurate enough."""
    windows = polynomial_windows(sensor.log_slope, (0.0, top), degree)
    return np.zeros((0, TERMS + degree + 1)) if windows is None else windows


def _one_by_one(sensors: Sequence[SensorModel], tops: FloatArray) -> ManyWindows:
    """Approximate many sensor curves by polynomials, one curve at a time."""
    tables = [curve_windows(sensor, 0.0, float(top)) for sensor, top in zip(sensors, tops, strict=True)]
    widths = {table.shape[1] for table in tables if len(table)}
    if len(widths) > 1:  # all rows of the table must have the same width
        tables = [_own_windows(sensor, float(top), HIGH_DEGREE) for sensor, top in zip(sensors, tops, strict=True)]
    width = tables[0].shape[1] if len(widths) > 1 else max(widths, default=TERMS + 1)
    return _join([table if len(table) else np.zeros((0, width)) for table in tables])


def _join(tables: list[FloatArray]) -> ManyWindows:
    return _make_windows(np.concatenate(tables), np.concatenate([[0], np.cumsum([len(table) for table in tables])]))


def _make_windows(table: FloatArray, starts: IntArray, *, falling: bool | None = None) -> ManyWindows:
    table, starts = np.ascontiguousarray(table), starts.astype(np.int64)
    for array in (table, starts):
        array.setflags(write=False)  # they are cached
    complete = bool((np.diff(starts) > 0).all())
    return ManyWindows(table=table, starts=starts, falling=complete and (_falls(table) if falling is None else falling))


def _falls(table: FloatArray) -> bool:
    """Return True if the sensor slope is negative on all intervals."""
    middle, terms = table[:, MIDDLE], table[:, TERMS:]
    if terms.shape[1] == 1:
        ends = terms / (table[:, [LOW, TOP]] - middle[:, None])
        return bool((ends < 0).all())
    z = np.linspace(table[:, LOW], table[:, TOP], _SIGN_PROBES) - middle
    slope = np.zeros_like(z)
    for j in range(terms.shape[1] - 1, 0, -1):
        slope = slope * z + j * terms[:, j]
    return bool((slope < 0).all())
