"""Run the control law with recorded readings.

Simulations run the same compiled code.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.native import INTEGER, POINTER, kernel
from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch._core.values import Value
from pretouch.control import Arrival, CompiledStep, Controller
from pretouch.control.structures import RawOutput, RawSample
from pretouch.sensors import SensorModel

from .recording import Recording

_INSTANT: Final = 1e-12  # s: times that are closer are the same instant, as in a simulation
_MOST_STEPS: Final = 10_000_000
_run_law: Final = kernel("run_law", *[POINTER] * 4, INTEGER, POINTER)
_SAMPLE: Final = np.dtype(RawSample)
_OUTPUT: Final = np.dtype(RawOutput)
_KINDS: Final = (Arrival.NO_OBJECT, Arrival.READING)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LawSteps(Value):
    """Inputs and outputs of the law in each control period.

    Each array has one value per period, that is, the shape (n,).

    Args:
        time: time of the step after the first reading [s].
        reading: newest reading, in the unit of the sensor output.
        fresh: whether it arrived since the last step, also if it says that there is no object.
        position: x_v at the end of the period, relative to a reference at rest [m].
        velocity: x_v' at the end of the period [m/s].
        virtual_force: F_p [N].
        log_level: ln(xi / floor).
        status: status flags.
    """

    time: FloatArray
    reading: FloatArray
    fresh: BoolArray
    position: FloatArray
    velocity: FloatArray
    virtual_force: FloatArray
    log_level: FloatArray
    status: IntArray

    def __repr__(self) -> str:
        return f"<LawSteps: {len(self.time):,} steps>"


def readings_of(recording: Recording, sensor: SensorModel, offset: float) -> FloatArray:
    """Return the sensor readings for the control law.

    The sensor curve converts distances to sensor outputs, as on the robot.

    Args:
        recording: the recording.
        sensor: the sensor curve.
        offset: offset that the controller subtracts; it is added to converted distances.

    Returns:
        The readings. An infinite distance, or one beyond the curve, means no object, and results in the offset. A
        distance before the start of the curve results in the output there. Minus infinity means an object that is too
        near to be measured; like NaN, it results in NaN, which the law refuses.
    """
    if recording.kind == "reading":
        return recording.values
    low, high = sensor.valid_range
    distance = np.where(np.isneginf(recording.values), np.nan, recording.values)
    inside = np.clip(np.where(np.isnan(distance), high, distance), low, high if np.isfinite(high) else np.inf)
    reached = np.where(np.isfinite(inside), inside, low)
    output = np.where(distance > high, 0.0, np.exp(sensor.log_output(reached)))
    output = np.where(np.isposinf(distance), 0.0, output)
    return np.asarray(np.where(np.isnan(distance), np.nan, output + offset))


def are_without_object(recording: Recording, sensor: SensorModel) -> BoolArray:
    """Return the readings by which a sensor of distances says that it sees no object, as on the robot.

    Args:
        recording: the recording.
        sensor: the sensor curve; beyond its end, there is no object either.
    """
    if recording.kind == "reading":
        return np.zeros(len(recording.values), dtype=bool)
    return np.asarray((recording.values > sensor.valid_range[1]) | np.isposinf(recording.values))


def run_steps(
    controller: Controller, time: FloatArray, readings: FloatArray, no_object: BoolArray | None = None
) -> LawSteps:
    """Run the control law with recorded readings in open loop.

    The readings do not respond to the commanded motion. The first step is at the first reading. A reading is used in
    the first step after its arrival, with its age; if several arrive between two steps, only the newest is used. A
    reading whose time is earlier than that of an earlier one arrives with the earlier one.

    Args:
        controller: the controller with its gain.
        time: time of each reading after the first one [s], in the order of arrival.
        readings: the readings, in the unit of the sensor output.
        no_object: the readings that say that there is no object; None if there are none.

    Returns:
        Inputs and outputs of each step.

    Raises:
        InvalidInputError: the recording has too many control periods.
    """
    arrival = np.maximum.accumulate(time)
    count = int(np.floor((arrival[-1] + _INSTANT) / controller.period)) + 2  # the last reading is used, too
    if count > _MOST_STEPS:
        raise InvalidInputError(
            f"recording: found {count:,} control periods, expected at most {_MOST_STEPS:,} control periods. The "
            f"duration of the recording is {arrival[-1]:,.0f} s. Replay only a part of it with --from and --to"
        )
    clock: FloatArray = controller.period * np.arange(count, dtype=np.float64)
    newest = np.searchsorted(arrival, clock + _INSTANT, side="right") - 1
    samples = np.zeros(count, dtype=_SAMPLE)
    samples["reading"] = readings[newest]
    samples["age"] = np.maximum(clock - time[newest], 0.0)
    kinds = np.full(len(readings), Arrival.READING) if no_object is None else np.where(no_object, *_KINDS)
    samples["fresh"] = np.where(np.diff(newest, prepend=-1) > 0, kinds[newest], Arrival.NOTHING)
    outputs = run_samples(controller, samples)
    columns = {name: outputs[name].copy() for name in ("position", "velocity", "virtual_force", "log_level")}
    return LawSteps(
        time=clock,
        reading=samples["reading"].copy(),
        fresh=samples["fresh"].astype(bool),
        status=outputs["status"].astype(np.int64),
        **columns,
    )


def run_samples(controller: Controller, samples: Any) -> Any:
    """Run a controller with input samples, and return its outputs.

    Args:
        controller: the controller.
        samples: array of the C structure of samples.

    Returns:
        Array of the C structure of outputs.
    """
    step = controller.step
    outputs = np.zeros(len(samples), dtype=_OUTPUT)
    if isinstance(step, CompiledStep):
        parameters, state = controller.parameters(), controller.start()
        places = [step.located(), ctypes.addressof(parameters), ctypes.addressof(state), samples.ctypes.data]
        _run_law(*places, len(samples), outputs.ctypes.data)
        return outputs
    run = controller.begin()
    for i, sample in enumerate(samples):
        output = run.step(float(sample["reading"]), Arrival(sample["fresh"]), float(sample["age"]))
        outputs[i] = tuple(output)
    return outputs
