"""Integrate the motion of one encounter under a custom force by SciPy's LSODA.

The state is (l, l'). A motion is split where l' changes its sign and where the obstacle's acceleration changes. In each
part, l' has one sign, so that the equation of motion is smooth apart from corners of force and curve. If the
admittance's pull is switched off in approaches, l'' jumps between an approach and a recession. If l'' points toward
l' = 0 from both sides, the plant moves along with the object, x~'' = a_o, until the object would recede. This is the
third kind of part.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.integrate import OdeSolution, solve_ivp

from pretouch._core.numbers import BoolArray, FloatArray

from .custom_force import ForceLaw
from .layout import RESOLUTION, ContactStatus
from .obstacle_path import Encounters

APPROACH, ALONG, RECEDE = -1, 0, 1
"""Whether the object approaches, keeps its distance or recedes in a part of a motion."""

_RELATIVE: Final = 1e-12  # error of a step of LSODA, relative to l and l'; contacts then have errors of about 1e-10
_ABSOLUTE: Final = 1e-14  # error of a step, relative to the initial l and to the largest expected l'
_MOST_CALLS: Final = 25_000  # evaluations of the force in one encounter; longer runs are unresolved
_MOST_TURNS: Final = 2_000  # turning points of one encounter
_STUCK: Final = 8  # turning points without progress in time
_PROBES: Final = 65  # distances at which the force is checked to exclude a later approach
_AHEAD: Final = 1e3  # the farthest probe, relative to the distance
_SOON: Final = 1e-7  # s; time after which l'' is evaluated if it is zero at a turning point
_ROUNDING: Final = 16 * float(np.finfo(np.float64).eps)


class MotionPart(NamedTuple):
    """A part of a motion, in which l' keeps its sign or is zero."""

    section: int  # of the obstacle's path
    course: int  # APPROACH, ALONG or RECEDE
    times: FloatArray  # t at the ends of the integration steps [s], shape (k,)
    states: FloatArray  # l [m] and l' [m/s] at these times, shape (2, k)
    solution: OdeSolution | None  # l and l' at any time of the part; None if they are constant or unknown

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return l [m] and l' [m/s] at given times of the part."""
        if self.solution is None or not times.size:
            distance, speed = (np.interp(times, self.times, state) for state in self.states)
            return distance, speed
        distance, speed = self.solution(times)
        return distance, speed


class _TooLongError(Exception):
    """The motion needs more evaluations of the force than allowed."""


class CustomMotion:
    """Motion of one encounter under a custom force.

    Args:
        encounters: the encounter, one element.
        law: the force along the sensor curve.
        horizon: longest time that is integrated [s].
        dense: whether l and l' are needed between the integration steps.

    Attributes:
        status: how the encounter ended.
        settling: settling distance [m]; NaN if it is unknown.
        closest: smallest distance [m].
        parts: the parts of the motion, at least one.
    """

    def __init__(self, encounters: Encounters, law: ForceLaw, horizon: float, *, dense: bool = False) -> None:
        self.encounters, self.law, self.horizon, self.dense = encounters, law, horizon, dense
        e = encounters
        self.mass, self.damping, self.stiffness = (float(v[0]) for v in (e.mass, e.damping, e.stiffness))
        path = zip(e.since[:, 0], e.position[:, 0], e.velocity[:, 0], e.acceleration[:, 0], strict=True)
        self.sections = [tuple(map(float, row)) for row in path]
        self.low, self.high = law.valid_range
        self.distance = self.start = float(e.position[0, 0] - e.displacement[0])
        self.speed = float(e.velocity[0, 0] - e.displacement_velocity[0])
        self.time, self.section, self.calls, self.turns, self.stuck = 0.0, 0, 0, 0, 0
        self.force = law.of_one(float(e.value[0]), self.start)
        self.status, self.settling, self.closest = ContactStatus.UNRESOLVED, math.nan, self.distance
        self.parts: list[MotionPart] = []
        self.course = int(np.sign(self.speed)) or self._next_course()
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", UserWarning)  # LSODA reports a failure twice
            try:
                self._follow()
            except _TooLongError:
                self.status = ContactStatus.UNRESOLVED
        if not self.parts:
            self._record(np.array([self.time]), np.array([[self.distance], [self.speed]]))

    def obstacle(self, time: float, section: int | None = None) -> tuple[float, float, float]:
        """Return position [m], velocity [m/s] and acceleration [m/s^2] of the obstacle relative to the reference."""
        since, position, velocity, acceleration = self.sections[self.section if section is None else section]
        after = time - since
        return position + (velocity + acceleration * after / 2) * after, velocity + acceleration * after, acceleration

    def pull(self, time: float, distance: float, speed: float) -> float:
        """Return the force [N] of the admittance's spring and damper."""
        position, velocity, _ = self.obstacle(time)
        return self.stiffness * (position - distance) + self.damping * (velocity - speed)

    def _follow(self) -> None:
        """Integrate part by part until the encounter ends."""
        while not (self._recedes_forever() or self._is_outside()):
            if self.time >= self.horizon:
                self.status = ContactStatus.HORIZON
                return
            until = min(self._section_end(), self.horizon)
            if self.course == ALONG:
                self._keep_distance(until)
            elif self._integrate(until):
                return
            if self.time >= self._section_end() and self.time < self.horizon:
                self.section += 1
                if self.speed == 0:
                    self.course = self._next_course()

    def _section_end(self) -> float:
        return self.sections[self.section + 1][0] if self.section + 1 < len(self.sections) else math.inf

    def _record(self, times: FloatArray, states: FloatArray, solution: OdeSolution | None = None) -> None:
        self.parts.append(MotionPart(self.section, self.course, times, states, solution))
        self.closest = min(self.closest, float(states[0].min()))

    def _is_outside(self) -> bool:
        """Return True if the motion leaves the sensor range at once."""
        outside = (self.course == APPROACH and self.distance <= self.low) or (
            self.course == RECEDE and self.distance >= self.high
        )
        if outside:
            self.status = ContactStatus.LEFT_RANGE
        return outside

    def _recedes_forever(self) -> bool:
        """Return True if the object can never approach again."""
        if self.section + 1 < len(self.sections) or self.course == APPROACH:
            return False
        _, velocity, push = self.obstacle(self.time)
        if self.course == ALONG and velocity == push == self.speed == 0:
            self.settling, self.status = self.distance, ContactStatus.NEVER
        elif push >= 0 and self.law.suspends_admittance and self._cannot_follow(push):
            self.settling, self.status = math.inf, ContactStatus.NEVER
        return self.status is ContactStatus.NEVER

    def _cannot_follow(self, push: float) -> bool:
        """Return True if the force cannot make the robot follow the object."""
        far = max(min(self.high, _AHEAD * self.distance), self.distance)
        probes = self.distance * (far / self.distance) ** np.linspace(0.0, 1.0, _PROBES)
        return all(self.force(float(probe), 0.0) <= self.mass * push for probe in probes)

    def _next_course(self) -> int:
        """Choose the direction of the motion after a turning point."""
        for delay in (0.0, _SOON):
            below, above = self._acceleration_limits(delay)
            if below < 0 or above > 0:
                return APPROACH if below < 0 else RECEDE
            if below != 0 or above != 0:
                return ALONG
        return ALONG

    def _acceleration_limits(self, delay: float) -> tuple[float, float]:
        """Return the limits of l'' [m/s^2] as l' tends to zero, from l' < 0 and from l' > 0."""
        pull = self.pull(self.time + delay, self.distance, 0.0)
        free = self.obstacle(self.time)[2] - self.force(self.distance, 0.0) / self.mass
        held = max(pull, 0.0) if self.law.suspends_admittance else pull
        return free + held / self.mass, free + pull / self.mass

    def _keep_distance(self, until: float) -> None:
        """Keep the distance constant until the admittance pulls the robot away, or until the given time [s]."""
        _, velocity, push = self.obstacle(self.time)
        curvature, slope = self.stiffness * push / 2, self.stiffness * velocity + self.damping * push
        now = self.pull(self.time, self.distance, 0.0) + self.mass * push - self.force(self.distance, 0.0)
        release = math.inf
        square = slope * slope - 4 * curvature * now
        if square >= 0:
            root = math.sqrt(square)
            above, below = (-2 * now, slope + root) if slope > 0 else (root - slope, 2 * curvature)
            release = above / below if below != 0 and above / below >= 0 else math.inf
        end = min(self.time + release, until)
        self._record(np.array([self.time, end]), np.array([[self.distance] * 2, [0.0] * 2]))
        if end < until:
            self.course = RECEDE
            self._count_turn(end > self.time)
        self.time = end

    def _count_turn(self, moved: bool) -> None:
        """Raise an error if the motion turns too often."""
        self.turns += 1
        self.stuck = 0 if moved else self.stuck + 1
        if self.turns > _MOST_TURNS or self.stuck > _STUCK:
            raise _TooLongError

    def _rates(self) -> Callable[[float, FloatArray], tuple[float, float]]:
        """Return the function that computes l' and l'' in the present part."""
        since, position, velocity, push = self.sections[self.section]
        mass, damping, stiffness, force = self.mass, self.damping, self.stiffness, self.force
        suspended = self.course == APPROACH and self.law.suspends_admittance

        def rates(time: float, state: FloatArray) -> tuple[float, float]:
            self.calls += 1
            if self.calls > _MOST_CALLS:
                raise _TooLongError
            distance, speed = state.tolist()
            after = time - since
            pull = stiffness * (position + (velocity + push * after / 2) * after - distance)
            pull += damping * (velocity + push * after - speed)
            if suspended and pull < 0.0:
                pull = 0.0
            return speed, push - (force(distance, speed) - pull) / mass

        return rates

    def _solve(self, start: float, state: tuple[float, float], until: float, events: list[Any]) -> Any:
        rates = self._rates()
        bend = abs(rates(start, np.array(state))[1])
        fastest = max(abs(state[1]), math.sqrt(bend * self.start), abs(self.obstacle(start)[1]))
        tolerance = _ABSOLUTE * np.array([self.start, fastest if 0 < fastest < math.inf else 1.0])
        return solve_ivp(
            rates,
            (start, until),
            state,
            method="LSODA",
            events=events,
            dense_output=self.dense,
            rtol=_RELATIVE,
            atol=tolerance,
        )

    def _integrate(self, until: float) -> bool:
        """Integrate until the next event or a given time [s]; return True if the encounter ends."""
        reaches, leaves, turns = _passes(self.low, -1), _passes(self.high, 1), _turns(-self.course)
        events = [reaches, turns, *([leaves] if math.isfinite(self.high) else [])]
        run = self._solve(self.time, (self.distance, self.speed), until, events)
        if run.status < 0 or not np.isfinite(run.y).all() or (np.diff(run.t) <= 0).any():
            self._record(run.t[:1], run.y[:, :1])
            return True
        before = self.time
        turned = run.status == 1 and len(run.t_events[1]) > 0
        if turned and self.course == APPROACH and run.y[0, -1] < self.low - self._resolution(run.t[-1]):
            # l passed the border twice within the last step
            last = self._solve(run.t[-2], tuple(run.y[:, -2]), run.t[-1], [reaches])
            self._record(run.t[:-1], run.y[:, :-1], run.sol)
            run, turned = last, False
        times, states = run.t, run.y
        self.time, self.distance, self.speed = float(times[-1]), float(states[0, -1]), float(states[1, -1])
        reached = len(run.t_events[0]) > 0
        near = self.low == 0 and self.course == APPROACH
        touched = near and turned and abs(self.distance) <= self._resolution(self.time)
        if near and reached and self._grazes(run):
            touched = True
        if turned or touched:
            states[1, -1] = self.speed = 0.0
        if reached or touched:
            states[0, -1] = self.distance = self.low
            self._record(times, states, run.sol)
            self.status = ContactStatus.CONTACT if self.low == 0 else ContactStatus.LEFT_RANGE
            return True
        left = len(run.t_events) > 2 and len(run.t_events[2]) > 0
        if left:
            states[0, -1] = self.distance = self.high
        self._record(times, states, run.sol)
        if left:
            self.status = ContactStatus.LEFT_RANGE
            return True
        if turned:
            self.course = self._next_course()
            self._count_turn(self.time > before)
        return False

    def _grazes(self, run: Any) -> bool:
        """Return True if the distance passes zero only within rounding, and turns there."""
        bend = self._rates()(self.time, run.y[:, -1])[1]
        return bend > 0 and self.speed**2 / (2 * bend) <= self._resolution(self.time)

    def _resolution(self, time: float) -> float:
        """Return the distance [m] that counts as zero."""
        which, at = np.zeros(1, dtype=np.int64), np.array([time])
        return RESOLUTION * float(self.encounters.terms(np.array([self.section]), which, at)[0])


def _passes(border: float, direction: int) -> Any:
    """Return the event that the distance passes a border [m]."""

    def event(_: float, state: FloatArray) -> float:
        return float(state[0]) - border

    event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
    return event


def _turns(direction: int) -> Any:
    """Return the event that l' changes its sign."""

    def event(_: float, state: FloatArray) -> float:
        return float(state[1])

    event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
    return event


def follow_all(
    encounters: Encounters, law: ForceLaw, horizon: float, dense: BoolArray | None = None
) -> Iterator[CustomMotion]:
    """Yield the motions of encounters, integrated one after the other.

    `dense` selects the encounters whose motion between the integration steps is needed; None for none.
    """
    for i in range(len(encounters)):
        needed = dense is not None and bool(dense[i])
        yield CustomMotion(encounters.part(slice(i, i + 1)), law, horizon, dense=needed)
