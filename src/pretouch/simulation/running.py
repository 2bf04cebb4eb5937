"""The loop on many encounters: what they are made of, and what is recorded of them."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray, nonnegative, positive
from pretouch.control.laws import as_step
from pretouch.motion.parallel import for_stretches

from .asked import Loop
from .curve_table import curve_table
from .layout import CONTACT_COLUMNS, FIRST_CONTACT, RESULT_COLUMNS, TRACE_COLUMNS
from .native_loop import Laws, Runs
from .plant import IdealPlant, PlantModel
from .result import LoopTrace, SimulationResult
from .size import TOUCHES, refuse_endless_runs, refuse_too_many_runs, rows_until

__all__ = ["FOLLOW", "HORIZON", "check_loop", "result_of", "run_loop", "runs_of", "whole"]

HORIZON: Final = 10.0
"""How long runs wait for contact where nothing else is said [s]."""

FOLLOW: Final = 0.2
"""How long runs go on after the first contact where nothing else is said [s]."""

_COURSE: Final = 8192  # steps in contact that a trace holds: some fifty rebounds
_FINE: Final = 0.2  # of the shortest time scale of a plant: what Runge-Kutta's method takes at once
_BEYOND: Final = 4.0  # times the farthest start: from there on a curve without an end is taken to be flat
_LEAST_STRETCH: Final = 16
_MOST_STRETCH: Final = 512
_NO_CONTACT: Final = (0.0, 0.0, 1.0, False, 0.0)


def check_loop(loop: Loop) -> Loop:
    """Refuse a loop that makes no sense.

    Args:
        loop: the loop as given.

    Returns:
        The loop, its numbers checked.

    Raises:
        InvalidInputError: plant and contact do not go together, or a number makes no sense, or a run may be endless.
    """
    if loop.contact is not None and isinstance(loop.plant, IdealPlant):
        raise InvalidInputError(
            "contact: an ideal plant has no mass, so no force follows from its contact; choose an ImpedancePlant or a "
            "PositionPlant"
        )
    checked = replace(
        loop,
        horizon=positive(loop.horizon, "horizon", "s"),
        follow=nonnegative(loop.follow, "follow", "s") if loop.contact is not None else 0.0,
        seed=whole(loop.seed, "seed", 0, 2**64 - 1),
    )
    refuse_endless_runs(checked, _plant_step(loop.plant, loop.laws[0].period))
    return checked


def result_of(loop: Loop) -> SimulationResult:
    """Run all encounters of a loop.

    Args:
        loop: the loop.

    Returns:
        What they came to.
    """
    shape = loop.shape
    refuse_too_many_runs(math.prod(shape))
    out, touches, _, _ = run_loop(loop, np.arange(math.prod(shape)))
    columns = {name: out[:, i].reshape(shape) for i, name in enumerate(RESULT_COLUMNS)}
    touched = columns["contacts"] > 0
    for name in FIRST_CONTACT:
        columns[name] = np.where(touched, columns[name], np.nan)
    touches = touches.reshape(*shape, TOUCHES, len(CONTACT_COLUMNS))
    return SimulationResult(columns, touches, partial(_trace, loop))


def run_loop(
    loop: Loop, which: IntArray, rows: int = 0, *, touches: int = TOUCHES, course_rows: int = 0
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Run some encounters of a loop, on all cores where the law is compiled.

    Args:
        loop: the loop.
        which: flat indices of its encounters.
        rows: of the trace that is asked for; only for a single encounter.
        touches: how many contacts of each are told apart.
        course_rows: of the course of its contacts that is asked for.

    Returns:
        Columns by RESULT_COLUMNS and contacts by CONTACT_COLUMNS of these encounters, the trace by TRACE_COLUMNS, and
        the course of the contacts by COURSE_COLUMNS.
    """
    scenes, law, contact = _scenes(loop), loop.laws[0], loop.contact
    met, curve_of = np.unique(loop.sensor_of.ravel()[which], return_inverse=True)
    runs = Runs(
        laws=_laws(loop, scenes, which),
        plant=loop.plant.coefficients(),
        contact=contact.numbers() if contact else _NO_CONTACT,
        chain=loop.chain.numbers(),
        curves=_curves(loop, met),
        curve_of=_of_all(curve_of, which, len(scenes)),
        clock=(law.period, _plant_step(loop.plant, law.period), loop.horizon, loop.follow),
        seed=loop.seed,
        scenes=scenes,
        draws=loop.noise_of.flatten(),
        touches=touches,
        rows=rows,
        course_rows=course_rows,
    )
    if runs.compiled:
        for_stretches(lambda a, b: runs.run(which[a:b]), len(which), least=_LEAST_STRETCH, most=_MOST_STRETCH)
    else:  # threads would wait for each other at every step
        runs.run(which)
    return runs.ends[which], runs.touches[which], runs.trace, runs.course


def _scenes(loop: Loop) -> FloatArray:
    s = loop.scenario
    columns = (
        *(s.plant.position, s.plant.velocity, s.obstacle.position, s.obstacle.velocity, s.obstacle.acceleration),
        *(s.reference.position, s.reference.velocity, s.reference.acceleration),
    )
    return np.stack([np.broadcast_to(c, loop.shape).ravel() for c in columns], axis=-1).astype(np.float64)


def _of_all(index: IntArray, which: IntArray, count: int) -> IntArray:
    """Spread the indices of some encounters over all."""
    every = np.zeros(count, dtype=np.int64)
    every[which] = index.ravel()
    return every


def _curves(loop: Loop, met: IntArray) -> list[tuple[FloatArray, float, float, float]]:
    """Return the table of each curve that some encounters meet, as far as their distances may come to."""
    sensor_of, distance = loop.sensor_of.ravel(), np.broadcast_to(loop.scenario.distance, loop.shape).ravel()
    curves = []
    for index in met:
        sensor = loop.sensors[index]
        low, high = sensor.valid_range
        farthest = float(distance.max() if len(loop.sensors) == 1 else distance[sensor_of == index].max())
        curves.append((*curve_table(sensor, _BEYOND * farthest + low), high))
    return curves


def _laws(loop: Loop, scenes: FloatArray, which: IntArray) -> Laws:
    """Gather the parameters of the laws of some encounters, and the states that they start in."""
    met, law_of = np.unique(loop.law_of.ravel()[which], return_inverse=True)
    starts = np.column_stack([met[law_of.ravel()], scenes[which][:, (0, 1)] - scenes[which][:, (5, 6)]])
    alike, start_of = np.unique(starts, axis=0, return_inverse=True)
    return Laws(
        step=as_step(loop.laws[0].step),
        parameters=[loop.laws[int(i)].parameters() for i in met],
        states=[loop.laws[int(i)].start(position=float(x), velocity=float(v)) for i, x, v in alike],
        law_of=_of_all(law_of, which, len(scenes)),
        start_of=_of_all(start_of, which, len(scenes)),
    )


def _plant_step(plant: PlantModel, period: float) -> float:
    mass, stiffness, _, own, _, servo, coulomb, friction_speed = plant.coefficients()
    if mass == 0:
        return period
    # the slope of the friction at rest is the fastest of all, and needs no more than stability
    friction = coulomb / friction_speed / mass / 8
    fastest = max(math.sqrt(stiffness / mass), own / mass, servo, friction)
    return period / max(math.ceil(period * fastest / _FINE), 1)


def whole(value: Any, name: str, least: int, most: int) -> int:
    """Return a whole number, or refuse what is none or out of range."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not least <= value <= most:
        raise InvalidInputError(f"{name}: found {value!r}, expected a whole number from {least} to {most}")
    return int(value)


def runs_of(value: Any) -> int:
    """Return a number of runs, or refuse what is none or too large."""
    refuse_too_many_runs(runs := whole(value, "runs", 1, 2**63))
    return runs


def _trace(loop: Loop, index: int) -> LoopTrace:
    ended, *_ = run_loop(loop, np.array([index]))
    rows = rows_until(float(ended[0, RESULT_COLUMNS.index("end_time")]), loop.laws[0].period)
    course_rows = _COURSE if loop.contact else 0
    _, touches, trace, course = run_loop(loop, np.array([index]), rows, course_rows=course_rows)
    trace, course = (part[~np.isnan(part[:, 0])] for part in (trace, course))
    columns = {name: np.ascontiguousarray(trace[:, i]) for i, name in enumerate(TRACE_COLUMNS)}
    return LoopTrace(**columns, contacts=touches[0][~np.isnan(touches[0][:, 0])], contact_course=course)
