"""Where the linear loop leaves stability: the smallest damping with which an eigenvalue leaves the unit circle.

The eigenvalues of the closed loop solve 1 + d P(z) = 0. At d = 0 they are those of the plant's own motion, of the
filter and of the delay. One that lies on the circle there, an undamped oscillation, moves in or out as soon as d > 0.
Any other can reach the circle only where P(exp(i omega T)) is real and negative, with d = -1 / P; its modulus then
changes with d as P^2 Im(dP/domega) / |dP/domega|^2, so that it leaves where the imaginary part of P rises.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray

from .linear_loop import ComplexArray, LinearLoop
from .zeros import zero_between

__all__ = ["Crossover", "first_crossover", "spectral_radius"]

_LOWEST: Final = 1e-6  # of omega T, without a delay: a crossover below is none within 10^6 periods
_TURN: Final = 0.2  # rad between two neighbors: a phase that turns less cannot cross unseen
_POINTS: Final = 20_000
_SILENT: Final = 1e-12  # of the largest response: below, as where a low-pass has its zeros, the phase is rounding
_UNDAMPED: Final = 1e-12  # of the fastest mode of the plant: what its eigenvalues are off by rounding
_BESIDE: Final = 1e-7  # of the angle of an undamped mode, around which P is beyond all bounds
_NUDGE: Final = 1e-6  # of an eigenvalue: its second order is 1e-12, above rounding
_FLAT: Final = 1e-9  # of P: an imaginary part below is rounding
_DENSE: Final = 300  # periods of delay up to which all eigenvalues are computed


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossover:
    """An eigenvalue that leaves the unit circle.

    Args:
        angle: omega T of the oscillation.
        damping: d there [N s/m]; 0 where the loop is unstable with any damping, however weak.
        growth: ln |z| of an eigenvalue that is outside right after a damping of 0; NaN for any other.
    """

    angle: float
    damping: float
    growth: float = math.nan


def first_crossover(loop: LinearLoop) -> Crossover | None:
    """Find the smallest damping with which the loop is no longer stable; None where none makes it unstable."""
    fastest = float(np.abs(loop.modes).max())
    for mode in loop.modes[loop.modes.real > _UNDAMPED * fastest]:
        return Crossover(angle=_folded(mode), damping=0.0, growth=float(mode.real))
    undamped = loop.modes[(np.abs(loop.modes.real) <= _UNDAMPED * fastest) & (loop.modes.imag > 0)]
    poles = sorted({_folded(mode) for mode in undamped} - {0.0})
    for pole in poles:
        growth = _departure(loop, pole)
        if growth > 0:
            return Crossover(angle=pole, damping=0.0, growth=growth)
    angle, response = _resolved(loop, poles)
    found = _departures(loop, angle, response, poles)
    values = loop.response(np.array(found)).real
    pairs = [(-1 / float(v), w) for w, v in zip(found, values, strict=True) if v < 0]
    return Crossover(damping=min(pairs)[0], angle=min(pairs)[1]) if pairs else None


def spectral_radius(loop: LinearLoop, damping: float, *, free: bool, beside: float) -> float:
    """Return the largest modulus of the closed loop's eigenvalues at a damping d [N s/m].

    Args:
        loop: the loop.
        damping: d [N s/m].
        free: whether the position is a free integrator, that no force reads: its eigenvalue of 1 is left out.
        beside: angle of the crossover near which d is. Where forces act beyond 300 periods after their readings the
            matrix is too large: then the modulus of the one eigenvalue beside it is returned, NaN without one.
    """
    if loop.remembered > _DENSE:
        return math.nan if math.isnan(beside) else _moved(loop, beside, damping)
    values = np.linalg.eigvals(loop.closed(damping))
    if free:
        values = np.delete(values, np.argmin(np.abs(values - 1)))
    return float(np.abs(values).max())


def _folded(mode: complex) -> float:
    """Return the angle in [0, pi] at which readings see a mode."""
    return abs(math.remainder(mode.imag, 2 * math.pi))


def _departure(loop: LinearLoop, pole: float) -> float:
    """Return ln |z| of the eigenvalue that leaves an undamped mode z_0 of the plant, for a damping that moves it 1e-6.

    With z = z_0 exp(i e) and Q(e) = (exp(i e) - 1) P(z), which is finite at z_0, 1 + d P = 0 is exp(i e) = 1 - d Q(e).
    """

    def weight(e: complex) -> complex:
        return complex((cmath.exp(1j * e) - 1) * loop.response(np.array([pole + e]))[0])

    nudge = _NUDGE * min(pole, math.pi - pole or math.pi)  # small beside the way to the conjugate mode
    first = weight(nudge)
    if abs(first) < 0.5 * abs(weight(100 * nudge)):  # it falls with e: no pole, but a mode that no reading sees
        return 0.0
    e, damping = complex(nudge), nudge / abs(first)
    for _ in range(3):  # each gains six digits
        e = -1j * cmath.log(1 - damping * weight(e))
    return -e.imag


def _moved(loop: LinearLoop, angle: float, damping: float) -> float:
    """Return the modulus of the eigenvalue beside exp(i angle), for a damping beside that of its crossover: Newton."""
    at, step = complex(angle), 1e-6 * angle
    with np.errstate(all="ignore"):  # where two eigenvalues meet, Newton's steps go anywhere
        for _ in range(5):
            before, here, after = loop.response(np.array([at - step, at, at + step]))
            at -= complex((here + 1 / damping) * 2 * step / (after - before))
        return float(np.exp(-at.imag))


def _departures(loop: LinearLoop, angle: FloatArray, response: ComplexArray, poles: list[float]) -> list[float]:
    """Return the angles at which the imaginary part of P rises through 0, those of the smallest dampings at least."""
    rising = _changes(response) & np.signbit(response.imag[:-1]) & ~_holds_any(angle, poles) & _heard(response)
    # at pi P is real, and with a double eigenvalue it is flat there: the sign is that of the last angle with any
    certain = response.imag[np.abs(response.imag) > _FLAT * np.abs(response)]
    found = [math.pi] if math.pi not in poles and (not len(certain) or certain[-1] < 0) else []
    for i in np.flatnonzero(rising & (angle[1:] < math.pi)):
        # the signs at both ends are those of the scan: computed one by one they may differ by rounding
        below, above = ((float(angle[j]), float(response[j].imag)) for j in (i, i + 1))
        found.append(
            zero_between(lambda w: float(loop.response(np.array([w]))[0].imag), below, above, 1e-14 * below[0])
        )
    return found


def _resolved(loop: LinearLoop, poles: list[float]) -> tuple[FloatArray, ComplexArray]:
    """Return angles from nearly 0 to pi between which the phase of P turns little, and P there.

    Where P is too small for the smallest damping there is nothing to resolve.
    """
    lowest = _LOWEST / (1 + loop.remembered)
    angle = np.unique([*np.geomspace(lowest, math.pi, 400), *np.linspace(0, math.pi, 400)[1:], math.pi * (1 - _BESIDE)])
    for pole in poles:
        beside = [w for w in (pole * (1 - _BESIDE), pole * (1 + _BESIDE)) if w <= math.pi]
        angle = np.unique([*angle[np.abs(angle - pole) > _BESIDE * pole], *beside])
    response = loop.response(angle)
    while len(angle) < _POINTS:
        turn = np.abs(np.angle(response[1:] / response[:-1]))
        wide = (turn > _TURN) & (np.diff(angle) > 1e-9 * angle[1:]) & _heard(response) & ~_holds_any(angle, poles)
        if not wide.any():
            break
        between = (angle[:-1] + angle[1:])[wide] / 2
        order = np.argsort(np.concatenate([angle, between]), kind="stable")
        response = np.concatenate([response, loop.response(between)])[order]
        angle = np.concatenate([angle, between])[order]
    return angle, response


def _changes(response: ComplexArray) -> BoolArray:
    """Tell between which neighbors the imaginary part changes its sign."""
    return np.asarray(np.signbit(response.imag[1:]) != np.signbit(response.imag[:-1]))


def _heard(response: ComplexArray) -> BoolArray:
    """Tell between which neighbors P may be as large as at the crossover of the smallest damping."""
    size = np.abs(response)
    left = _changes(response) & (response.real[1:] < 0) & (response.real[:-1] < 0)
    largest = np.minimum(size[1:], size[:-1])[left].max(initial=0.0)
    return np.asarray(np.maximum(size[1:], size[:-1]) > max(0.5 * largest, _SILENT * size.max()))


def _holds_any(angle: FloatArray, poles: list[float]) -> BoolArray:
    """Tell between which neighbors an undamped mode lies, across which P changes its sign without a crossover."""
    held = np.zeros(len(angle) - 1, dtype=bool)
    for pole in poles:
        held |= (angle[:-1] < pole) & (pole <= angle[1:])
    return held
