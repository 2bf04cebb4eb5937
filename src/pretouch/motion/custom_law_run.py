"""Compute the motion of one encounter under a custom control law by numerical integration.

On a piece l' has one sign and there is no knot of the curve. If the admittance's pull is switched off in approaches,
l'' jumps between an approach and a recession. If l'' points toward l' = 0 from both sides, the plant moves along
with the object, x~'' = a_o, until the object would recede. This is the third kind of piece.
"""

from __future__ import annotations

import math
import threading
import warnings
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch.sensors import SensorModel

from .layout import PEAKS, RESOLUTION, ContactStatus

_PEAK_OF: Final = dict(zip(PEAKS, ("displacement", "travel", "velocity", "acceleration", "virtual_force"), strict=True))
_APPROACH, _ALONG, _RECEDE = -1, 0, 1
_TURN, _BORDER = 0, 1  # events that end a piece
_TOLERANCE: Final = 1e-13
_MAX_EVALUATIONS: Final = 300_000  # evaluations of the force, which take about 5 s; longer runs are unresolved
_LSODA_LOCK: Final = threading.RLock()  # before SciPy 1.17, LSODA keeps its state in globals that threads share
_IMMEDIATE_TURN: Final = ("f(a) and f(b) must have", "`ts` must be strictly")
"""SciPy's errors for a motion that turns within rounding of the start of its piece, as at a jump of the force."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_PROBES: Final = 65  # distances at which the force is checked to exclude a later approach
_AHEAD: Final = 1e3  # the farthest probe, relative to the distance
_SOON: Final = 1e-7  # s; time after which l'' is evaluated if it is zero at the start
_ROUNDS: Final = 4  # refinements of the grid on which a peak is searched


class RelativeEncounter(NamedTuple):
    """Parameters of one encounter, with positions and velocities relative to the moving reference."""

    mass: float
    damping: float
    stiffness: float
    x0: float
    u0: float
    p: float
    v: float
    a: float
    r_v: float
    r_a: float
    r: float
    value: float


class _Piece(NamedTuple):
    """Part of a motion in which the object either approaches, recedes, or keeps its distance.

    x~ [m] and x~' [m/s] are a function of time; the piece ends with an event.
    """

    course: int
    states: Callable[[Any], FloatArray]
    steps: FloatArray
    event: int | None


class _UnresolvedError(Exception):
    """Raised if the integration of a motion needs too many evaluations of the force."""


class CustomLawRun:
    """Motion of one encounter under a custom control law, computed by numerical integration.

    Args:
        encounter: the encounter.
        sensor: the sensor curve.
        force: function of the law's number, s and s' that returns F [N].
        kind: name of the law, for messages.
        suspends_admittance: whether the admittance's pull is switched off in an approach.
        horizon: longest time that is integrated [s].

    Attributes:
        status: how the run ended.
    """

    def __init__(
        self,
        encounter: RelativeEncounter,
        sensor: SensorModel,
        force: Callable[[float, float, float], Any],
        kind: str,
        *,
        suspends_admittance: bool,
        horizon: float,
    ) -> None:
        self.encounter, self.sensor, self.force, self.kind, self.suspends_admittance = (
            encounter,
            sensor,
            force,
            kind,
            suspends_admittance,
        )
        low, high = sensor.valid_range
        self.low, self.high = max(low, 0.0), high
        self.borders = (self.low, *(k for k in sensor.knots if k > self.low), self.high)
        self.pieces: list[_Piece] = []
        self.exact_end: dict[str, float] = {}  # quantities at the end that are known exactly
        self.settling, self.evaluations = math.nan, 0
        self.status = self._integrate(horizon)

    def _distance(self, time: Any, x: Any) -> Any:
        g = self.encounter
        return g.p + (g.v + g.a * time / 2) * time - x

    def _speed(self, time: Any, u: Any) -> Any:
        return self.encounter.v + self.encounter.a * time - u

    def _force(self, distance: float, speed: float) -> float:
        """Return the virtual force [N] at a distance [m] and a relative velocity [m/s]."""
        at = min(max(distance, self.low), self.high)
        return self._checked_force(at, self.sensor.log_output(at), self.sensor.log_slope(at) * speed)

    def _forces(self, distance: FloatArray, speed: FloatArray) -> FloatArray:
        at = np.clip(distance, self.low, self.high)
        outputs, rates = self.sensor.log_output(at), self.sensor.log_slope(at) * speed
        return np.array(list(map(self._checked_force, at.tolist(), outputs.tolist(), rates.tolist())))

    def _checked_force(self, distance: float, output: float, rate: float) -> float:
        """Call the user's force function, and check that it returns a single finite number."""
        force = self.force(self.encounter.value, output, rate)
        if type(force) is float and math.isfinite(force):
            return force
        array = np.asarray(force)
        if array.shape != () or array.dtype.kind not in "iuf" or not np.isfinite(array):
            raise InvalidInputError(
                f"force: the custom law {self.kind} returned {force!r} at a distance of {distance:g} m and a "
                f"rate d ln xi/dt of {rate:g} 1/s, expected a single finite force in N"
            )
        return float(array)

    def _acting(self, course: int, pull: Any, force: Any) -> Any:
        """Return how much of the admittance's spring and damper force acts on the virtual mass [N]."""
        if course == _ALONG:
            return force - self.encounter.mass * self.encounter.a
        return np.maximum(pull, 0.0) if self.suspends_admittance and course == _APPROACH else pull

    def _integrate(self, horizon: float) -> ContactStatus:
        """Integrate the whole motion, and return how the encounter ended."""
        g, time, state = self.encounter, 0.0, np.array([self.encounter.x0, self.encounter.u0])
        distance, speed = self._distance(time, g.x0), self._speed(time, g.u0)
        course = int(np.sign(speed)) or self._course(time, state)
        cell = int(np.searchsorted(self.borders, distance, "left" if course == _APPROACH else "right")) - 1
        while True:
            if course != _APPROACH and self._excludes_approach(distance, float(state[1]), course):
                return self._end_here(state, ContactStatus.NEVER)
            if not 0 <= cell < len(self.borders) - 1:
                return self._end_here(state, ContactStatus.LEFT_RANGE)
            piece = self._piece(time, state, course, self.borders[cell + (course == _RECEDE)], horizon)
            if piece is None:
                return self._end_here(state, ContactStatus.UNRESOLVED)
            self.pieces.append(piece)
            time, state = float(piece.steps[-1]), piece.states(piece.steps[-1])
            distance = self._distance(time, state[0])
            if piece.event is None:
                return ContactStatus.HORIZON
            if course == _APPROACH and cell == 0 and self._has_reached_end(distance):
                return ContactStatus.CONTACT if self.low == 0 else ContactStatus.LEFT_RANGE
            if piece.event == _BORDER:
                cell += course
            else:
                course = _RECEDE if course == _ALONG else self._course(time, state)

    def _end_here(self, state: FloatArray, status: ContactStatus) -> ContactStatus:
        """End the encounter in its present state, also if no motion has been integrated yet."""
        if not self.pieces:
            self.pieces.append(
                _Piece(_RECEDE, lambda t: np.multiply.outer(state, np.ones(np.shape(t))), np.zeros(2), None)
            )
        return status

    def _course(self, time: float, state: FloatArray) -> int:
        """Return whether the object approaches, recedes or rests after a moment of zero relative velocity."""
        x, u = state
        for delay in (0.0, _SOON):
            below, above = self._acceleration_limits(time + delay, (x + u * delay, u + self.encounter.a * delay))
            if below or above:
                break
        return _APPROACH if below < 0 else _RECEDE if above > 0 else _ALONG

    def _acceleration_limits(self, time: float, state: Any) -> tuple[float, float]:
        """Return the relative acceleration after a moment of zero relative velocity, for either direction."""
        # The results are the limits of l'' [m/s^2] at l' = 0 from both sides.
        g, (x, u) = self.encounter, state
        free = g.a - self._force(self._distance(time, x), 0.0) / g.mass
        pull = g.stiffness * x + g.damping * u
        return free + float(self._acting(_APPROACH, pull, 0.0)) / g.mass, free + pull / g.mass

    def _excludes_approach(self, distance: float, u: float, course: int) -> bool:
        """Return True if a receding or resting object certainly never approaches again."""
        g = self.encounter
        if course == _ALONG and g.v == g.a == u == 0:
            self.settling = distance
            return True
        if not self.suspends_admittance or g.a < 0:
            return False
        probes = np.geomspace(distance, max(min(self.high, _AHEAD * distance), distance), _PROBES)
        if (self._forces(probes, np.zeros(_PROBES)) > g.mass * g.a).any():
            return False
        self.settling = math.inf
        return True

    def _has_reached_end(self, distance: float) -> bool:
        """Return True if an approach has reached the lower end of the sensor curve, and end the motion there."""
        from scipy.optimize import brentq  # noqa: PLC0415 - loads slowly

        g, piece = self.encounter, self.pieces[-1]
        time = piece.steps[-1]
        near = RESOLUTION * (abs(g.p) + (abs(g.v) + abs(g.a) * time / 2) * time) if self.low == 0 else 0.0
        if piece.event == _BORDER or distance < self.low - near:
            if piece.event == _TURN:
                root = brentq(lambda t: self._distance(t, piece.states(t)[0]) - self.low, piece.steps[0], time)
                self.pieces[-1] = piece._replace(steps=np.append(piece.steps[piece.steps < root], root))
            self.exact_end = {"distance": self.low}
        elif distance <= self.low + near:
            self.exact_end = {"distance": self.low, "relative_velocity": 0.0}
        return bool(self.exact_end)

    def _piece(self, time: float, state: FloatArray, course: int, border: float, horizon: float) -> _Piece | None:
        """Integrate until the relative velocity changes sign or the sensor curve ends; return None if this fails."""
        # None means that the motion cannot be resolved.
        # LSODA becomes implicit if a motion is stiff. With a tolerance of 1e-13 it is more accurate than DOP853 with
        # 1e-12 and takes half the time. At a gain of -100 N s it takes 30 ms, Radau 0.5 s and DOP853 3 s.
        from scipy.integrate import solve_ivp  # noqa: PLC0415 - loads slowly

        g = self.encounter
        events = [_event(lambda t, y: self._acceleration_limits(t, y)[1], _RECEDE)]
        if course != _ALONG:
            turn = _event(lambda t, y: self._speed(t, y[1]), -course)
            events = [turn, _event(lambda t, y: self._distance(t, y[0]) - border, course)]

        def rates(t: float, y: FloatArray) -> tuple[float, float]:
            self.evaluations += 1
            if self.evaluations > _MAX_EVALUATIONS:
                raise _UnresolvedError
            x, u = y.tolist()
            if course == _ALONG:
                return u, g.a
            force, pull = self._force(self._distance(t, x), self._speed(t, u)), g.stiffness * x + g.damping * u
            return u, (force - (max(pull, 0.0) if self.suspends_admittance and course == _APPROACH else pull)) / g.mass

        options = {"rtol": _TOLERANCE, "atol": _TOLERANCE / 100 * (g.p - g.x0), "dense_output": True}
        try:
            with _LSODA_LOCK, warnings.catch_warnings():
                warnings.filterwarnings("ignore", "lsoda:", UserWarning)  # the status reports this case
                run = solve_ivp(rates, (time, horizon), state, method="LSODA", events=events, **options)
        except _UnresolvedError:
            return None
        except ValueError as error:
            if not str(error).startswith(_IMMEDIATE_TURN):
                raise
            return None
        ended = next((i for i, times in enumerate(run.t_events) if len(times)), None)
        return None if run.status < 0 else _Piece(course, run.sol, run.t, ended)

    def _quantities(self, piece: _Piece, time: FloatArray) -> dict[str, FloatArray]:
        """Return all quantities of the motion, such as the velocity, at given times [s]."""
        g, (x, u) = self.encounter, piece.states(time)
        distance, speed = self._distance(time, x), self._speed(time, u)
        force, pull = self._forces(distance, speed), g.stiffness * x + g.damping * u
        acting = self._acting(piece.course, pull, force)
        acceleration = (force - acting) / g.mass
        return {
            "time": time,
            "distance": distance,
            "relative_velocity": speed,
            "displacement": x,
            "displacement_velocity": u,
            "displacement_acceleration": acceleration,
            "virtual_force": force,
            "held": pull - acting,
            "travel": x - g.x0 + (g.r_v + g.r_a * time / 2) * time,
            "velocity": u + g.r_v + g.r_a * time,
            "acceleration": acceleration + g.r_a,
        }

    def columns(self) -> dict[str, float]:
        """Return all quantities at the end of the encounter, such as the contact time, by name."""
        g, last = self.encounter, self.pieces[-1]
        end = {
            name: float(values[0]) for name, values in self._quantities(last, last.steps[-1:]).items()
        } | self.exact_end
        pieces = [(piece, self._quantities(piece, _grid(piece.steps))) for piece in self.pieces]
        return {
            **end,
            "status": float(self.status),
            "gain": g.value,
            "position": end["travel"] + g.x0 + g.r,
            "closest_distance": min(end["distance"], *(float(values["distance"].min()) for _, values in pieces)),
            "settling_distance": self.settling,
            "impulse_residual": self._residual(end, pieces),
            **{name: self._largest(of, pieces) for name, of in _PEAK_OF.items()},
        }

    def _largest(self, name: str, pieces: list[tuple[_Piece, dict[str, FloatArray]]]) -> float:
        """Return the largest magnitude of a quantity, such as the virtual force, over the whole motion."""
        piece, values = max(pieces, key=lambda item: float(np.abs(item[1][name]).max()))
        largest = 0.0
        for _ in range(_ROUNDS):
            magnitude, time = np.abs(values[name]), values["time"]
            best = int(magnitude.argmax())
            largest = max(largest, float(magnitude[best]))
            near = time[max(best - 1, 0)], time[min(best + 1, len(time) - 1)]
            values = self._quantities(piece, np.linspace(*near, 33))
        return max(largest, float(np.abs(values[name]).max()))

    def _residual(self, end: dict[str, float], pieces: list[tuple[_Piece, dict[str, FloatArray]]]) -> float:
        """Return the relative residual of the impulse balance, which measures the error of the integration."""
        # The terms of the initial momentum are M |l'(0)| and D l(0).
        g, integrals = self.encounter, np.zeros(3)
        for piece, values in pieces:
            each = [
                values[name][:-1].reshape(-1, 1 + len(_NODES)) for name in ("displacement", "virtual_force", "held")
            ]
            integrals += [np.diff(piece.steps) / 2 @ (samples[:, 1:] @ _WEIGHTS) for samples in each]
        states = g.mass * (end["displacement_velocity"] - g.u0), g.damping * (end["displacement"] - g.x0)
        terms = [*states, *(integrals * (g.stiffness, -1.0, -1.0))]
        approach = g.mass * abs(g.v - g.u0), g.damping * (g.p - g.x0)
        largest = max(*map(abs, terms), *approach)
        return float(abs(math.fsum(terms)) / largest) if largest > 0 else 0.0

    def sample(self, samples: int) -> dict[str, FloatArray]:
        """Return the motion at equally spaced times from start to end."""
        stops = [float(piece.steps[-1]) for piece in self.pieces]
        times = np.linspace(0.0, stops[-1], samples)
        index = np.minimum(np.searchsorted(stops, times), len(stops) - 1)
        parts = [
            self._quantities(piece, times[index == i]) for i, piece in enumerate(self.pieces) if (index == i).any()
        ]
        course = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        for name, value in self.exact_end.items():
            course[name][-1] = value
        return course


def _grid(steps: FloatArray) -> FloatArray:
    """Return the start of each integration step, the quadrature nodes inside it, and the end of the last step."""
    nodes = np.append(-1.0, _NODES)
    inside = steps[:-1, None] + np.diff(steps)[:, None] * (nodes + 1) / 2
    return np.append(inside.ravel(), steps[-1])


def _event(function: Any, direction: int) -> Any:
    """Mark a function as an event: integration ends when the function crosses zero in one direction."""
    function.terminal, function.direction = True, direction
    return function
