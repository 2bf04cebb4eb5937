"""Compute the results of motions under a custom force: final states, peaks, impulse balance and samples."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.polynomial.legendre import leggauss

from pretouch._core.numbers import FloatArray
from pretouch._core.progress import note_solved
from pretouch._core.values import Value

from .contact import ContactResult, ContactState, KnownColumns, Motion
from .custom_force import ForceLaw
from .custom_motion import ALONG, APPROACH, CustomMotion, MotionPart, follow_all
from .layout import PEAKS, ContactStatus
from .obstacle_path import Encounters, encounters_of
from .request import Request

_PEAK_OF: Final = dict(zip(PEAKS, ("displacement", "travel", "velocity", "acceleration", "virtual_force"), strict=True))
_LATER: Final = (*PEAKS, "impulse_residual")
_COLUMNS: Final = (
    *ContactState.names(),
    *("status", "gain", "closest_distance", "settling_distance", "impulse_residual"),
)
_COURSE: Final = (
    *("time", "distance", "position", "velocity", "acceleration", "displacement", "relative_velocity"),
    "virtual_force",
)
_NODES: Final = 8  # Gauss points of each integration step
_FINE: Final = 17  # points on which a peak is searched
_ROUNDS: Final = 4  # refinements of these points


class CustomColumns(Value):
    """Results of encounters under a custom law.

    The final states are computed at once. Peaks and the impulse balance need the motion between the integration steps.
    They are computed when one of them is first read, by a second integration that keeps this motion.

    Args:
        request: the encounters.
        law: the force along the sensor curve.
    """

    __slots__ = ("_columns", "_encounters", "_law", "_request")

    def __init__(self, request: Request, law: ForceLaw) -> None:
        self._request, self._law = request, law
        self._encounters = encounters_of(request)
        self._columns: dict[str, Any] = {}
        rows: list[dict[str, float]] = []
        for motion in follow_all(self._encounters, law, request.horizon):
            last = motion.parts[-1]
            end = {name: float(values[-1]) for name, values in _quantities(motion, last, last.times[-1:]).items()}
            ended = {"status": float(motion.status), "closest_distance": motion.closest}
            rows.append({**end, **ended, "settling_distance": motion.settling})
            note_solved(1)
        names = [name for name in _COLUMNS if name not in {*_LATER, "gain"}]
        self._keep({name: np.array([row[name] for row in rows]) for name in names})
        self._keep({"gain": self._encounters.value})

    def _keep(self, columns: dict[str, FloatArray]) -> None:
        for name, flat in columns.items():
            values = flat.reshape(self._request.shape)
            values = values.astype(np.int64) if name == "status" else values
            values.setflags(write=False)
            self._columns[name] = values

    def column(self, name: str) -> Any:
        """Return one result quantity, such as the contact time."""
        if name in _LATER and name not in self._columns:
            rows = [_peaks_and_residual(motion) for motion in self.follow()]
            self._keep({name: np.array([row[name] for row in rows]) for name in _LATER})
        values = self._columns[name]
        return values if values.ndim else values.item()

    def follow(self) -> Iterator[CustomMotion]:
        """Integrate the encounters again, and keep the motion between the integration steps."""
        dense = self._columns["status"].ravel() != ContactStatus.UNRESOLVED  # else too short steps to interpolate
        return follow_all(self._encounters, self._law, self._request.horizon, dense)

    def _compared(self) -> tuple[Any, ...]:
        return tuple(self.column(name) for name in _COLUMNS)

    def __reduce__(self) -> Any:
        for name in _COLUMNS:
            self.column(name)
        return KnownColumns, (dict(self._columns),)


def custom_motion(request: Request, law: ForceLaw, samples: int) -> Motion:
    """Compute sampled motions until the first contact."""
    columns = CustomColumns(request, law)
    rows = []
    for motion in columns.follow():
        times = np.linspace(0.0, motion.parts[-1].times[-1], samples)
        ends = np.array([part.times[-1] for part in motion.parts])
        which = np.minimum(np.searchsorted(ends, times), len(ends) - 1)
        parts = [_quantities(motion, part, times[which == i]) for i, part in enumerate(motion.parts)]
        rows.append({name: np.concatenate([part[name] for part in parts]) for name in _COURSE})
    shape = (*request.shape, samples)
    arrays = {name: np.array([row[name] for row in rows]).reshape(shape) for name in _COURSE}
    return Motion(**arrays, result=ContactResult(columns, "integration"))


def _quantities(motion: CustomMotion, part: MotionPart, times: FloatArray) -> dict[str, FloatArray]:
    """Return all motion quantities at given times of a part."""
    distance, speed = part.at(times)
    at_end = times == part.times[-1]
    distance = np.where(at_end, part.states[0, -1], distance)
    speed = np.where(at_end, part.states[1, -1], speed)
    e: Encounters = motion.encounters
    since, start, velocity, push = motion.sections[part.section]
    after = times - since
    path, path_velocity = start + (velocity + push * after / 2) * after, velocity + push * after
    force = motion.law.at(e.value, distance, speed)
    pull = motion.stiffness * (path - distance) + motion.damping * (path_velocity - speed)
    acting = np.maximum(pull, 0.0) if motion.law.suspends_admittance and part.course == APPROACH else pull
    if part.course == ALONG:
        acting = force - motion.mass * push
    acceleration = (force - acting) / motion.mass
    v, a = e.reference_velocity[0], e.reference_acceleration[0]
    displacement = path - distance
    drift = (v + a * times / 2) * times
    return {
        "time": times,
        "distance": distance,
        "relative_velocity": speed,
        "displacement": displacement,
        "displacement_velocity": path_velocity - speed,
        "virtual_force": force,
        "held": pull - acting,
        "travel": displacement - e.displacement[0] + drift,
        "position": displacement + e.reference[0] + drift,
        "velocity": path_velocity - speed + v + a * times,
        "acceleration": acceleration + a,
    }


def _peaks_and_residual(motion: CustomMotion) -> dict[str, float]:
    """Return the largest magnitudes during a motion, and the residual of the impulse balance."""
    nodes, weights = leggauss(_NODES)
    largest = dict.fromkeys(PEAKS, 0.0)
    integrals = dict.fromkeys(("displacement", "virtual_force", "held"), 0.0)
    for part in motion.parts:
        duration = np.diff(part.times)
        inside = (part.times[:-1, None] + duration[:, None] * (nodes + 1) / 2).ravel()
        times = np.sort(np.concatenate([part.times, inside]))
        found = _quantities(motion, part, times)
        for name, of in _PEAK_OF.items():
            largest[name] = max(largest[name], _largest(motion, part, of, times, np.abs(found[of])))
        found = _quantities(motion, part, inside)
        weight = (duration[:, None] * weights / 2).ravel()
        for name in integrals:
            integrals[name] += float(weight @ found[name])
    return {**largest, "impulse_residual": _residual(motion, integrals)}


def _largest(motion: CustomMotion, part: MotionPart, of: str, times: FloatArray, magnitude: FloatArray) -> float:
    """Find the largest magnitude of a quantity in a part, next to the largest one at the given times."""
    best = int(magnitude.argmax())
    largest = float(magnitude[best])
    low, high = times[max(best - 1, 0)], times[min(best + 1, len(times) - 1)]
    for _ in range(_ROUNDS if high > low else 0):
        fine = np.linspace(low, high, _FINE)
        magnitude = np.abs(_quantities(motion, part, fine)[of])
        best = int(magnitude.argmax())
        largest = max(largest, float(magnitude[best]))
        low, high = fine[max(best - 1, 0)], fine[min(best + 1, _FINE - 1)]
    return largest


def _residual(motion: CustomMotion, integrals: dict[str, float]) -> float:
    """Return the relative residual of the impulse balance.

    The integrals use other points of each step than the integration, and the force there.
    """
    e, last = motion.encounters, motion.parts[-1]
    end = {name: float(values[-1]) for name, values in _quantities(motion, last, last.times[-1:]).items()}
    terms = [
        motion.mass * (end["displacement_velocity"] - e.displacement_velocity[0]),
        motion.damping * (end["displacement"] - e.displacement[0]),
        motion.stiffness * integrals["displacement"],
        -integrals["virtual_force"],
        -integrals["held"],
    ]
    speed = e.velocity[0, 0] - e.displacement_velocity[0]
    scale = max(*map(abs, terms), motion.mass * abs(speed), motion.damping * motion.start)
    return float(abs(sum(terms)) / scale) if scale > 0 else 0.0
