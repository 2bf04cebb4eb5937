"""Integrate the motions of many encounters under a custom force.

Each encounter has its own step sizes. On a piece of a motion, l' has one sign, there is no knot of the curve, and the
obstacle has one acceleration. If the admittance's pull is switched off in approaches, l'' jumps between an approach and
a recession. If l'' points toward l' = 0 from both sides, the plant moves along with the object, x~'' = a_o, until the
object would recede. This is the third kind of piece.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray

from .custom_force import ForceLaw
from .integrated_path import Encounters
from .layout import RESOLUTION, ContactStatus
from .radau import POINTS, first_root, tables
from .radau_step import ALONG, APPROACH, RECEDE, Start, Trial, try_step

_RUNNING: Final = -1
_LANDED: Final = 1e-13  # a step ends at an event if it misses it by this share of its change at most
_MAX_ATTEMPTS: Final = 4_000  # attempted steps of one encounter; longer runs are unresolved
_STOPS: Final = 1e-3  # ratio of the speeds at the ends of a step in which an object stops
_FEW: Final = 300  # attempted steps in which a motion must get ahead by _LITTLE of its first step
_LITTLE: Final = 1e-3
_CERTAIN: Final = 1e-6  # largest rounding error of a step, relative to the largest speed so far
_FIRST: Final = 0.05  # the first step, relative to the time in which the distance would be passed
_LEAST: Final = 0.1  # smallest ratio of a step to the attempt before it
_MOST: Final = 5.0  # largest ratio
_UNSOLVED: Final = 0.25  # change of the length of a step if Newton's method fails
_MARGIN: Final = 0.9  # of the length of a step for which the estimated error is the allowed one
_SHORTEST: Final = 1e-16  # length of a step that is too short, relative to the first one
_JUST_PAST: Final = 1e-9  # relative change of the distance
_EPS: Final = float(np.finfo(np.float64).eps)
_ROUNDING: Final = 16 * _EPS  # of the terms whose sum or difference is l or l'
_PROBES: Final = 65  # distances at which the force is checked to exclude a later approach
_AHEAD: Final = 1e3  # the farthest probe, relative to the distance
_SOON: Final = 1e-7  # s; time after which l'' is evaluated if it is zero at the start


class Steps(NamedTuple):
    """Accepted integration steps of all encounters, ordered by encounter and time."""

    encounter: IntArray  # index of the encounter, shape (n,)
    time: FloatArray  # start of the step [s], shape (n,)
    duration: FloatArray  # [s], shape (n,)
    start: Start  # state at the start
    distance: FloatArray  # l at the nodes [m], shape (n, POINTS + 1)
    speed: FloatArray  # l' at the nodes [m/s], shape (n, POINTS + 1)
    force: FloatArray  # F at the nodes [N], shape (n, POINTS + 1)

    def some(self, which: IntArray) -> Steps:
        """Return the selected steps."""
        columns = (column.some(which) if isinstance(column, Start) else column[which] for column in self)
        return Steps._make(columns)


class Integration:
    """Motions of encounters under a custom force, integrated until each has ended.

    Args:
        encounters: the encounters.
        law: the force along the sensor curve.
        horizon: longest time that is integrated [s].

    Attributes:
        status: how each encounter ended.
        settling: settling distance of each encounter [m]; NaN if it is unknown.
        steps: all steps.
    """

    def __init__(self, encounters: Encounters, law: ForceLaw, horizon: float) -> None:
        n = len(encounters)
        self.encounters, self.law, self.horizon = encounters, law, horizon
        low, high = law.valid_range
        self.borders = np.array([low, *(k for k in law.sensor.knots if k > low), high])
        self.status, self.settling = np.full(n, _RUNNING), np.full(n, np.nan)
        self.time, self.section = np.zeros(n), np.zeros(n, dtype=np.int64)
        self.distance = encounters.position[0] - encounters.displacement
        self.speed = encounters.velocity[0] - encounters.displacement_velocity
        self.course, self.cell = np.sign(self.speed).astype(np.int64), np.zeros(n, dtype=np.int64)
        self.force, self.attempts = np.zeros(n), np.zeros(n, dtype=np.int64)
        self.first, self.size, self.limit = np.zeros(n), np.zeros(n), np.full(n, np.inf)
        self.fastest = np.zeros(n)
        self._records: list[Steps] = []
        with np.errstate(all="ignore"):
            self._start(np.arange(n))
            while len(running := np.flatnonzero(self.status == _RUNNING)):
                moving = self.course[running] != ALONG
                self._advance(running[moving])
                self._keep_distance(running[~moving])
        self.steps = self._joined()

    def _joined(self) -> Steps:
        records = self._records or [self._record(np.arange(0), np.zeros(0), None)]
        start = Start._make(map(np.concatenate, zip(*(record.start for record in records), strict=True)))
        others: list[Any] = [
            start if name == "start" else np.concatenate([getattr(record, name) for record in records])
            for name in Steps._fields
        ]
        joined = Steps._make(others)
        return joined.some(np.argsort(joined.encounter, kind="stable"))

    def _state(self, which: IntArray) -> Start:
        e = self.encounters
        obstacle = e.obstacle_at(self.section[which], which, self.time[which])
        parameters = (array[which] for array in (e.mass, e.damping, e.stiffness, e.value, self.course))
        return Start._make((*parameters, *obstacle, *(v[which] for v in (self.distance, self.speed, self.force))))

    def _start(self, which: IntArray) -> None:
        """Set the initial direction and first step size of each motion."""
        self._set_course(which[self.course == ALONG])
        cells = [np.searchsorted(self.borders, self.distance, side) for side in ("left", "right")]
        self.cell = np.where(self.course == APPROACH, *cells) - 1
        self._begin(which)
        acceleration = np.abs(self._state(which).acceleration(self.law))
        times = np.minimum(self.distance / np.abs(self.speed), np.sqrt(self.distance / acceleration))
        self.first = np.minimum(np.where(np.isfinite(times), _FIRST * times, np.inf), self.horizon)
        self.size = self.first.copy()

    def _begin(self, which: IntArray) -> None:
        """Prepare the integration of each motion after its start or an event.

        A motion ends if it leaves the sensor range or never approaches again.
        """
        self.force[which] = self.law.at(self.encounters.value[which], self.distance[which], self.speed[which])
        self.limit[which] = np.inf
        which = which[~self._end_receding(which)]
        outside = (self.cell[which] < 0) | (self.cell[which] >= len(self.borders) - 1)
        self._end(which[outside], ContactStatus.LEFT_RANGE)

    def _end(self, which: IntArray, status: ContactStatus) -> None:
        """End encounters in their current state, even before the first integration step."""
        self.status[which] = status
        still = which[self.time[which] == 0]
        self._record(still, np.zeros(len(still)), None)

    def _end_receding(self, which: IntArray) -> BoolArray:
        """End encounters in which the object can never approach again."""
        state = self._state(which)
        final = (self.section[which] == len(self.encounters.since) - 1) & (state.course != APPROACH)
        resting = final & (state.course == ALONG) & (state.velocity == 0) & (state.push == 0) & (state.speed == 0)
        self.settling[which[resting]] = state.distance[resting]
        leaving = final & ~resting & (state.push >= 0) & self.law.suspends_admittance
        if leaving.any():
            leaving[leaving] = self._keeps_receding(state.some(leaving))
        self.settling[which[leaving]] = np.inf
        self._end(which[resting | leaving], ContactStatus.NEVER)
        return np.asarray(resting | leaving)

    def _keeps_receding(self, state: Start) -> BoolArray:
        """Return True if the force cannot make the robot follow the object."""
        far = np.maximum(np.minimum(self.law.valid_range[1], _AHEAD * state.distance), state.distance)
        probes = state.distance[:, None] * (far / state.distance)[:, None] ** np.linspace(0.0, 1.0, _PROBES)
        force = self.law.at(state.value[:, None], probes, np.zeros(probes.shape))
        return np.asarray((force <= (state.mass * state.push)[:, None]).all(axis=1))

    def _set_course(self, which: IntArray) -> None:
        """Choose the next direction of each motion with zero relative velocity."""
        if not len(which):
            return
        self.course[which] = ALONG
        for delay in (0.0, _SOON):
            below, above = self._acceleration_limits(which, delay)
            self.course[which] = np.where(below < 0, APPROACH, np.where(above > 0, RECEDE, ALONG))
            which = which[(below == 0) & (above == 0)]

    def _acceleration_limits(self, which: IntArray, delay: float) -> tuple[FloatArray, FloatArray]:
        """Return the relative acceleration [m/s^2] before and after a turning point."""
        # These are the limits of l'' as l' tends to zero, from l' < 0 and from l' > 0.
        state = self._state(which)
        zero, later = np.zeros((len(which), 1)), np.full((len(which), 1), delay)
        force = self.law.at(state.value, state.distance, np.zeros(len(which)))
        pull = state.pull(later, state.distance[:, None], zero)
        free = state.push - force / state.mass
        approaching = state._replace(course=np.full(len(which), APPROACH)).acting(pull, zero, self.law)
        return free + approaching[:, 0] / state.mass, free + pull[:, 0] / state.mass

    def _end_of_section(self, which: IntArray) -> FloatArray:
        return np.minimum(self.encounters.until(self.section[which], which), self.horizon)

    def _record(self, which: IntArray, duration: FloatArray, trial: Trial | None) -> Steps:
        """Store integration steps of selected encounters."""
        # If `trial` is None, distance, velocity and force are constant during the step.
        state = self._state(which)
        nodes = trial[:3] if trial else (np.repeat(v[:, None], POINTS + 1, axis=1) for v in state[-3:])
        self._records.append(Steps(which, self.time[which], duration, state, *nodes))
        return self._records[-1]

    def _advance(self, which: IntArray) -> None:
        """Attempt one integration step of each selected encounter."""
        if not len(which):
            return
        state, left = self._state(which), self._end_of_section(which) - self.time[which]
        border = self.borders[self.cell[which] + (state.course == RECEDE)]
        h = np.minimum(np.minimum(self.size[which], self.limit[which]), left)
        h = np.minimum(h, _time_until(border, state, state.acceleration(self.law)))
        trial = try_step(self.law, state, h)
        events = self._events(which, state, trial, border, h)
        self.fastest[which] = np.maximum(self.fastest[which], np.abs(state.speed))
        certain = trial.rounding <= _CERTAIN * np.maximum(self.fastest[which], np.abs(trial.speed).max(axis=1))
        accurate = trial.solved & (trial.error <= 1) & certain
        taken = accurate & ~(events.share < 1)
        share = np.where(accurate, events.share, np.maximum(events.share, _LEAST))
        self._choose_size(which, h, trial, accurate=accurate, taken=taken, share=share)
        self._take(which[taken], h[taken], h[taken] >= left[taken], trial.some(taken), events.some(taken))
        self._turn_now(which[accurate & events.stopped & (events.share * h <= _ROUNDING * self.time[which])])
        self._give_up(which[self.status[which] == _RUNNING])

    def _choose_size(
        self,
        which: IntArray,
        h: FloatArray,
        trial: Trial,
        *,
        accurate: BoolArray,
        taken: BoolArray,
        share: FloatArray,
    ) -> None:
        """Choose the next step size from the error of this step.

        If this step passed an event, the next step ends there.
        """
        self.attempts[which] += 1
        change = np.clip(_MARGIN * trial.error ** (-1 / (POINTS - 1)), _LEAST, _MOST)
        change = np.where(trial.solved, change, _UNSOLVED)
        size = self.size[which]
        size = np.where(~accurate, np.minimum(change, _MARGIN) * h, size)
        self.size[which] = np.where(taken, np.where(h < size, np.maximum(size, change * h), change * h), size)
        self.limit[which] = np.where(taken | ~trial.solved, np.inf, share * h)

    def _give_up(self, which: IntArray) -> None:
        """End encounters as unresolved after too short or too many steps."""
        h = np.minimum(self.size[which], self.limit[which])
        short = ~(h > _SHORTEST * self.first[which] + 2 * _EPS * self.time[which])
        slow = (self.attempts[which] >= _FEW) & (self.time[which] < _LITTLE * self.first[which])
        which = which[short | slow | (self.attempts[which] >= _MAX_ATTEMPTS)]
        state = self._state(which)
        # A force that is not finite here raises an error, since the motion cannot pass it.
        self.law.at(state.value, state.distance + np.sign(state.speed) * _JUST_PAST * state.distance, state.speed)
        self._end(which, ContactStatus.UNRESOLVED)

    def _events(self, which: IntArray, state: Start, trial: Trial, border: FloatArray, h: FloatArray) -> _Events:
        """Find turning points and sensor curve borders within each integration step."""
        course = state.course[:, None]
        forward, beyond = trial.speed * course, (trial.distance - border[:, None]) * course
        time, initial = self.time[which], self.encounters.distance[which]
        lowest = (state.course == APPROACH) & (self.cell[which] == 0) & (self.borders[0] == 0)
        near = np.where(lowest, RESOLUTION * self.encounters.terms(self.section[which], which, time), 0.0)
        fastest, braking = np.abs(forward).max(axis=1), np.abs(state.acceleration(self.law))
        still = trial.rounding + _ROUNDING * (np.abs(state.velocity) + braking * time)
        stops = np.abs(forward[:, -1]) <= _STOPS * np.abs(forward[:, 0])  # not a slow motion that stays slow
        at_turn = np.abs(forward[:, -1]) <= _LANDED * fastest + np.where(stops, still, 0.0)
        grazes = lowest & (beyond.max(axis=1) <= near) & (at_turn | _turns_before(near, trial, h))
        rounding = _ROUNDING * (np.abs(border) + initial + fastest * time)
        at_border = np.isfinite(border) & ~grazes & (np.abs(beyond[:, -1]) <= _LANDED * np.abs(beyond[:, 0]) + rounding)
        beyond[grazes] = -1.0
        share = np.full(len(which), np.inf)
        for values, lands, least in ((-forward, at_turn, still), (beyond, at_border, np.zeros(len(which)))):
            passed = values > least[:, None]
            passed[:, 0] = False
            passed[lands, -1] = False
            some = passed.any(axis=1) & np.isfinite(values).all(axis=1)
            if some.any():
                share[some] = np.minimum(share[some], first_root(values[some], passed[some]))
        touches = at_turn & grazes & (trial.distance[:, -1] <= near)
        return _Events(
            share,
            at_turn,
            at_border | touches,
            np.where(touches, 0.0, border),
            (state.speed != 0) & (np.abs(state.speed) <= still),
        )

    def _take(self, which: IntArray, h: FloatArray, at_end: BoolArray, trial: Trial, events: _Events) -> None:
        """Apply accepted integration steps and their events.

        After an event such as a turn, a new piece of the motion starts, or the encounter ends.
        """
        if not len(which):
            return
        trial.distance[events.at_border, -1] = events.border[events.at_border]
        trial.speed[events.at_turn, -1] = 0.0
        self._record(which, h, trial)
        self.time[which] = np.where(at_end, self._end_of_section(which), self.time[which] + h)
        self.distance[which], self.speed[which], self.force[which] = (values[:, -1] for values in trial[:3])
        before = self.course[which]
        reached = events.at_border & (before == APPROACH) & (self.cell[which] == 0)
        self._end(which[reached], ContactStatus.CONTACT if self.borders[0] == 0 else ContactStatus.LEFT_RANGE)
        self._enter_section(which[~reached & at_end])
        turned = which[~reached & events.at_turn]
        self._set_course(turned)
        crossed = ~reached & events.at_border & (self.course[which] == before)
        self.cell[which[crossed]] += before[crossed]
        new = which[at_end | events.at_turn | events.at_border]
        self._begin(new[self.status[new] == _RUNNING])

    def _turn_now(self, which: IntArray) -> None:
        """Set the relative velocity to zero, and restart the integration."""
        if not len(which):
            return
        self.speed[which] = 0.0
        self._set_course(which)
        self._begin(which)

    def _enter_section(self, which: IntArray) -> None:
        """Continue with the next section of the obstacle's path.

        At the longest simulated time, the encounter ends.
        """
        late = self.time[which] >= self.horizon
        self._end(which[late], ContactStatus.HORIZON)
        self.section[which[~late]] += 1
        still = which[~late]
        self._set_course(still[self.speed[still] == 0])

    def _keep_distance(self, which: IntArray) -> None:
        """Advance encounters while robot and object keep a constant distance."""
        if not len(which):
            return
        state, left = self._state(which), self._end_of_section(which) - self.time[which]
        release = _time_until_release(state)
        h = np.minimum(release, left)
        self._record(which, h, None)
        at_end = h == left
        self.time[which] = np.where(at_end, self._end_of_section(which), self.time[which] + h)
        self.attempts[which] += 1
        self.course[which[~at_end]] = RECEDE
        self._enter_section(which[at_end])
        stuck = which[self.attempts[which] >= _MAX_ATTEMPTS]
        self._end(stuck[self.status[stuck] == _RUNNING], ContactStatus.UNRESOLVED)
        self._begin(which[self.status[which] == _RUNNING])


class _Events(NamedTuple):
    """Events within integration steps, such as turning points."""

    share: FloatArray  # share of the step before the first event inside it; infinite without one
    at_turn: BoolArray  # whether l' = 0 at the end of the step
    at_border: BoolArray  # whether the border of the piece is at the end of the step
    border: FloatArray  # the border [m]
    stopped: BoolArray  # whether l' is zero within rounding at the start of the step, but not exactly

    def some(self, which: BoolArray) -> _Events:
        """Return the events of the selected steps."""
        return _Events._make(column[which] for column in self)


def _turns_before(depth: FloatArray, trial: Trial, h: FloatArray) -> BoolArray:
    """Return True for approaches that turn back near contact.

    They turn during this step or soon after, at most `depth` [m] beyond contact.
    """
    nodes = tables().nodes
    slowing = (trial.speed[:, -1] - trial.speed[:, -2]) / (h * (nodes[-1] - nodes[-2]))
    ahead = np.where(slowing > 0, trial.speed[:, -1] ** 2 / (2 * slowing), np.inf)
    return np.asarray((trial.speed[:, 1:] > 0).any(axis=1) | (trial.distance[:, -1] - ahead >= -depth))


def _time_until(border: FloatArray, state: Start, acceleration: FloatArray) -> FloatArray:
    """Return the time [s] until a motion reaches a given distance.

    The acceleration is constant. The time is infinite if the motion does not reach the distance.
    """
    ahead = border - state.distance
    root = np.sqrt(state.speed**2 + 2 * acceleration * ahead)
    time = 2 * ahead / (state.speed + state.course * root)
    return np.where(time > 0, time, np.inf)


def _time_until_release(state: Start) -> FloatArray:
    """Return the time [s] until the admittance pulls the robot away."""
    # The pull minus F - M a_o is a quadratic of time, which rises through zero at this root. Without one: infinity.
    curvature = state.stiffness * state.push / 2
    slope = state.stiffness * state.velocity + state.damping * state.push
    pull = state.stiffness * (state.position - state.distance) + state.damping * state.velocity
    now = pull + state.mass * state.push - state.force
    root = np.sqrt(slope**2 - 4 * curvature * now)
    time = np.where(slope > 0, -2 * now / (slope + root), (root - slope) / (2 * curvature))
    return np.where(time >= 0, time, np.inf)
