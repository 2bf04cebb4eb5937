"""Define simulation results, and limit the number and duration of runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray, nonnegative, positive
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.motion import ContactStatus

from .native_loop import (
    CONTACT_COLUMNS,
    CONTACT_NUMBERS,
    FIRST_CONTACT,
    RESULT_COLUMNS,
    TOUCHES,
    TRACE_COLUMNS,
    Loop,
    contact_step,
    run_loop,
)
from .robot import COEFFICIENTS, checked_numbers, plant_step

HORIZON: Final = 10.0
"""Default for the longest time that runs wait for contact [s]."""

FOLLOW: Final = 0.2
"""Default for the time that runs continue after the first contact [s]."""

MOST_RUNS: Final = 1_000_000
"""The largest number of runs of a simulation: their results take about 2 GB."""

_MOST_STEPS: Final = 20_000_000  # most steps of any kind in one run, which take some seconds
_MOST_BUFFERED: Final = 1_000_000  # most undelivered readings


def check_loop(loop: Loop) -> Loop:
    """Check the inputs of a simulation and return them.

    Returns:
        The checked inputs.

    Raises:
        InvalidInputError: an input is invalid, or a run would have too many steps.
    """
    checked_numbers(loop.plant, loop.plant.coefficients(), COEFFICIENTS)
    if loop.contact is not None:
        checked_numbers(loop.contact, loop.contact.numbers(), CONTACT_NUMBERS)
        if loop.plant.coefficients()[0] == 0:
            raise InvalidInputError(
                "contact: an ideal plant has no mass, so its contact has no force; choose an ImpedancePlant "
                "or a PositionPlant"
            )
    checked = replace(
        loop,
        horizon=positive(loop.horizon, "horizon", "s"),
        follow_time=nonnegative(loop.follow_time, "follow_time", "s") if loop.contact is not None else 0.0,
        seed=whole(loop.seed, "seed", 0, 2**64 - 1),
    )
    _refuse_endless_runs(checked)
    return checked


def refuse_too_many_runs(count: int) -> None:
    """Raise an error if a simulation has too many runs.

    The check comes before memory is allocated for the runs.

    Raises:
        InvalidInputError: there are too many runs.
    """
    if count > MOST_RUNS:
        size = 8 * count * (len(RESULT_COLUMNS) + TOUCHES * len(CONTACT_COLUMNS))
        raise InvalidInputError(
            f"runs: found {count:,} runs, which would need {size / 1e9:,.0f} GB of memory. Expected at most "
            f"{MOST_RUNS:,} runs. For more runs, call the function again with another seed",
            value=count,
        )


def _refuse_endless_runs(loop: Loop) -> None:
    """Raise an error if a single run would be too long."""
    period, chain = loop.laws[0].period, loop.chain
    _refuse(loop.horizon, period, "loop horizon", f"a controller with a period of {_time(period)}")
    _refuse(loop.horizon, 1 / chain.rate, "loop horizon", f"a sensor with {chain.rate:g} readings per second")
    step = plant_step(loop.plant, period)
    _refuse(loop.horizon, step, "loop horizon", f"a robot integrated in steps of {_time(step)}")
    if loop.contact is not None:
        numbers, mass = loop.contact.numbers(), loop.plant.coefficients()[0]
        fastest = max(1.0, float(np.max(np.abs(loop.scenario.relative_velocity))))
        step = contact_step(numbers, 1 / mass + numbers[4], fastest)
        _refuse(loop.follow_time, period, "loop follow_time", f"a controller with a period of {_time(period)}")
        _refuse(loop.follow_time, step, "loop follow_time", f"a contact integrated in steps of {_time(step)}")
    waiting = chain.exposure + chain.delay + 16 * chain.jitter + period
    if waiting * chain.rate > _MOST_BUFFERED:
        raise InvalidInputError(
            f"chain delay: up to {waiting * chain.rate:.3g} sensor readings would wait for delivery, expected at "
            f"most {_MOST_BUFFERED:,} readings. Reduce the delay, the exposure, the jitter or the rate of the sensor. "
            f"The sensor rate is {chain.rate:g} readings per second",
            limit=_MOST_BUFFERED,
        )


def _refuse(span: float, step: float, name: str, what: str) -> None:
    if not span / step <= _MOST_STEPS:
        raise InvalidInputError(
            f"{name}: found a simulated time of {_time(span)}, expected at most {_time(_MOST_STEPS * step)}. "
            f"This time takes {span / step:.3g} steps of {what}. At most {_MOST_STEPS:,} steps are allowed. "
            "Reduce the simulated time to the longest possible duration of an encounter",
            value=span,
            limit=_MOST_STEPS * step,
        )


def _time(seconds: float) -> str:
    return format_quantity(seconds, "s") if seconds >= 1e-9 else f"{seconds:g} s"


def whole(value: Any, name: str, least: int, most: int) -> int:
    """Return an integer after checking its range."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not least <= value <= most:
        raise InvalidInputError(
            f"{name}: found {value!r}, expected a whole number from {least:,} to {most:,}",
            value=value,
            limit=(least, most),
        )
    return int(value)


def runs_of(value: Any) -> int:
    """Return a number of runs after checking its range.

    It must be a positive integer and not too large.
    """
    least = 1
    if not isinstance(value, bool) and isinstance(value, (int, np.integer)) and value >= least:
        refuse_too_many_runs(int(value))
    return whole(value, "runs", least, MOST_RUNS)


_COURSE: Final = 8192  # steps in contact that a trace records: about fifty rebounds


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LoopTrace(Value):
    """Time series of one simulated run, with one value per controller step.

    Each array has the shape (n,).

    Args:
        time: t_k [s].
        distance: l [m]; below 0 where the bodies press into each other.
        position: x of the plant [m].
        velocity: x' of the plant [m/s].
        obstacle_position: x_o [m].
        virtual_position: x_v [m], the position that the plant follows.
        virtual_velocity: x_v' [m/s].
        virtual_force: F_p [N] from this step to the next.
        contact_force: force between the bodies [N], 0 without contact.
        reading: the newest reading of the law, in the sensor's output unit.
        log_level: ln xi above the law's floor, as reported by the law.
        flags: status flags reported by the law.
        contacts: a row per contact: time [s], l' [m/s], peak force [N], impulse [N s], l' at its end [m/s],
            duration [s]; NaN if the run ended before.
        contact_course: time series in contact, shape (m, 4), with a row at each touch and after each integration step,
            finer than the steps of the law: time [s], distance l [m], l' [m/s] and contact force [N]. Only the first
            8192 rows are kept.
    """

    time: FloatArray
    distance: FloatArray
    position: FloatArray
    velocity: FloatArray
    obstacle_position: FloatArray
    virtual_position: FloatArray
    virtual_velocity: FloatArray
    virtual_force: FloatArray
    contact_force: FloatArray
    reading: FloatArray
    log_level: FloatArray
    flags: FloatArray
    contacts: FloatArray
    contact_course: FloatArray

    def __repr__(self) -> str:
        return f"<LoopTrace: {len(self.time)} steps to {self.time[-1]:.4g} s, {len(self.contacts)} contacts>"


@dataclass(frozen=True, repr=False)
class SimulationResult(Value):
    """Result of `simulate` for one run or an array of runs.

    For an array of runs, all quantities are arrays of its shape.

    Args:
        columns: the quantities by name, each of the shape of the runs.
        contact_list: the contacts of each run, as in LoopTrace, shape (..., 32, 6), with rows of NaN after the last.
        trace_of: function that runs the i-th encounter again and records its time series; it can be pickled.

    Attributes:
        status: how each run ended: a ContactStatus, or an array of their numbers (contact, horizon, unresolved).
        time: time of the first contact [s]; NaN without a contact, like the next four.
        position: x at contact [m].
        velocity: x' at contact [m/s].
        displacement: x - x_d at contact [m].
        relative_velocity: l' at contact [m/s].
        closest_distance: smallest distance [m]; in contact, minus the depth.
        largest_excursion: max |x - x_d| until the first contact [m].
        largest_travel: max |x - x(0)| until the first contact [m].
        largest_speed: max |x'| until the first contact [m/s].
        largest_advance: largest x' - x_d', the speed toward the object beyond that of the reference, until the first
            contact [m/s].
        largest_virtual_force: max |F_p| until the first contact [N].
        peak_force: largest contact force [N]; 0 for an ideal plant, which has no mass.
        impact_force: largest contact force from the first touch on, within the duration of an impact without loss and
            drive [N]: pi sqrt(m / k) for a contact whose force is proportional to its depth. A later push, such as by
            a driven obstacle, can be stronger; `peak_force` includes it.
        impulse: impulse of all contact forces [N s].
        rebound_velocity: l' at the end of the first contact [m/s]; NaN if it does not end.
        contacts: number of contacts.
        detection_time: time at which the law first reported an object (status flag 1) [s]; NaN if it did not.
        flags: all flags that the law reported in a run, combined by or.
        end_time: time at which the run ended [s].
        shape: shape of the runs.
    """

    columns: Mapping[str, FloatArray]
    contact_list: FloatArray
    trace_of: Callable[[int], LoopTrace] = field(compare=False)
    shape: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "shape", self.columns["status"].shape)
        for column in (*self.columns.values(), self.contact_list):
            column.setflags(write=False)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name in type(self).__dataclass_fields__ or name not in self.columns:
            raise AttributeError(f"a simulation result has no {name!r}")
        column = self.columns[name]
        if name in {"status", "contacts", "flags"}:
            whole = column.astype(np.int64)
            return whole if self.shape else (ContactStatus(int(whole)) if name == "status" else int(whole))
        return column if self.shape else float(column)

    def __dir__(self) -> list[str]:
        return [*object.__dir__(self), *self.columns]

    @property
    def touched(self) -> BoolArray:
        """Return for each simulated run whether it reached contact."""
        return np.asarray(self.columns["status"] == ContactStatus.CONTACT)

    def trace(self, index: int | tuple[int, ...] = ()) -> LoopTrace:
        """Simulate one run again, and record its time series.

        The run has the same noise as before.

        Args:
            index: index of the run in the array.

        Returns:
            Its time series.

        Raises:
            InvalidInputError: there is no such run.
        """
        try:
            flat = np.arange(int(np.prod(self.shape))).reshape(self.shape)[index]
        except IndexError:
            raise InvalidInputError(
                f"index: found {index}, expected the index of a run in an array of runs of the shape {self.shape}",
                value=index,
            ) from None
        if np.ndim(flat):
            raise InvalidInputError(
                f"index: the index {index} selects several runs, expected a single run; give the index of a single run "
                f"in an array of runs of the shape {self.shape}"
            )
        return self.trace_of(int(flat))

    def __repr__(self) -> str:
        count = int(np.prod(self.shape))
        return f"<SimulationResult: {int(self.touched.sum())} of {count} runs reached contact>"


def result_of(loop: Loop) -> SimulationResult:
    """Simulate all runs that the inputs describe, and return their results."""
    shape = loop.shape
    refuse_too_many_runs(math.prod(shape))
    out, touches, _, _ = run_loop(loop, np.arange(math.prod(shape)))
    columns = {name: out[:, i].reshape(shape) for i, name in enumerate(RESULT_COLUMNS)}
    touched = columns["contacts"] > 0
    for name in FIRST_CONTACT:
        columns[name] = np.where(touched, columns[name], np.nan)
    touches = touches.reshape(*shape, TOUCHES, len(CONTACT_COLUMNS))
    return SimulationResult(columns, touches, partial(_trace, loop))


def _trace(loop: Loop, index: int) -> LoopTrace:
    ended, *_ = run_loop(loop, np.array([index]))
    lead = 0.0 if loop.lead is None else float(np.broadcast_to(loop.lead, loop.shape).ravel()[index])
    rows = math.ceil((float(ended[0, RESULT_COLUMNS.index("end_time")]) + lead) / loop.laws[0].period) + 1
    course_rows = _COURSE if loop.contact else 0
    _, touches, trace, course = run_loop(loop, np.array([index]), rows, course_rows=course_rows)
    trace, course = (part[~np.isnan(part[:, 0])] for part in (trace, course))
    columns = {name: np.ascontiguousarray(trace[:, i]) for i, name in enumerate(TRACE_COLUMNS)}
    return LoopTrace(**columns, contacts=touches[0][~np.isnan(touches[0][:, 0])], contact_course=course)
