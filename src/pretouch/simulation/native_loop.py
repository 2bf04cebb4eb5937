"""Run the compiled C++ simulation of the control loop, and collect its results.

A compiled law is called by its address. A law in Python is called back, which costs some microseconds per step. An
exception in such a law ends its runs and is raised again here.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from ctypes import byref
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.native import DOUBLE, INTEGER, POINTER, Structure, address, kernel, location, numbers
from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value
from pretouch.control import Arrival, CompiledStep, Output, Sample
from pretouch.control.laws import as_step
from pretouch.control.structures import RawOutput, RawSample
from pretouch.motion import Scenario
from pretouch.motion.curve import check_curve
from pretouch.motion.parallel import run_in_chunks
from pretouch.sensors import SensorModel
from pretouch.sensors.model import cache_by_curve

from .chain import SensorChain
from .detection import begun_before
from .disturbance import MOST_DISTURBANCES
from .law import SampledLaw
from .robot import COEFFICIENTS, ContactModel, PlantModel, plant_step
from .state_space import native_rows

RESULT_COLUMNS: Final = (
    *("status", "time", "position", "velocity", "displacement", "relative_velocity", "closest_distance"),
    *("largest_excursion", "largest_travel", "largest_speed", "largest_virtual_force", "peak_force", "impulse"),
    *("rebound_velocity", "contacts", "detection_time", "flags", "end_time", "impact_force", "distance"),
    *("acceleration", "virtual_force", "largest_acceleration", "largest_advance"),
)
FIRST_CONTACT: Final = (
    *("time", "position", "velocity", "displacement", "relative_velocity", "acceleration", "virtual_force"),
)
"""The columns that hold the state at the first contact or, without one, at the end of the run."""

CONTACT_COLUMNS: Final = ("time", "relative_velocity", "peak_force", "impulse", "rebound_velocity", "duration")
COURSE_COLUMNS: Final = ("time", "distance", "relative_velocity", "contact_force")
TRACE_COLUMNS: Final = (
    *("time", "distance", "position", "velocity", "obstacle_position", "virtual_position", "virtual_velocity"),
    *("virtual_force", "contact_force", "reading", "log_level", "flags"),
)

TOUCHES: Final = 32
"""The largest number of contacts of one run that are recorded separately."""

CONTACT_NUMBERS: Final = "stiffness", "damping", "exponent", "grows", "inverse_mass"
"""The coefficients of a contact model in the compiled loop."""

_TIMES: Final = "time", "detection_time", "end_time"
_Step = ctypes.CFUNCTYPE(None, POINTER, POINTER, ctypes.POINTER(RawSample), ctypes.POINTER(RawOutput))
_INDEX: Final = np.dtype(np.int64)
_READING: Final = 4  # numbers stored for each undelivered reading
_AT_ONCE: Final = 64  # encounters per call, after which Ctrl-C is handled
_LANES: Final = 8  # largest number of encounters that the compiled loop runs side by side
_JITTERS: Final = 16  # largest shift of an exposure in standard deviations; none of 2^53 draws exceeds 9
_BEYOND: Final = 4.0  # times the farthest start: from there on, a curve is taken as flat
_LEAST_STRETCH: Final = 64  # encounters per thread
_LONG: Final = 10_000  # controller steps: so long encounters are worth a thread in smaller numbers
_LEAST_LONG: Final = 24  # long encounters per thread: three groups of lanes
_MOST_STRETCH: Final = 512
_FEWEST: Final = 257  # rows of a table of a curve
_MOST: Final = 1 << 16
_ERROR: Final = 1e-12  # tolerance of ln xi in the middle between two rows
_NO_CONTACT: Final = (0.0, 0.0, 1.0, False, 0.0)

_run: Final = kernel("run_encounters", POINTER, POINTER, INTEGER, POINTER, POINTER, INTEGER)
_contact_step: Final = kernel("contact_step", POINTER, DOUBLE, DOUBLE, result=DOUBLE)


class _Plant(Structure):
    _fields_ = numbers(*COEFFICIENTS)


class _Contact(Structure):
    _fields_ = numbers(*CONTACT_NUMBERS)


class _Chain(Structure):
    _fields_ = (
        *numbers("rate", "phase", "exposure", "delay", "jitter", "noise", "relative_noise", "offset", "drift"),
        *numbers("lowest", "highest", "resolution", "dropout", "measures_distance", "distance_noise"),
        *numbers("distance_resolution", "random_phase", "misfit", "misfit_length"),
        ("disturbances", ctypes.c_double * (5 * MOST_DISTURBANCES)),
    )


_OWN: Final = len(_Chain._fields_) - 1  # numbers of a chain before its disturbances


class _Curve(Structure):
    _fields_ = (("table", POINTER), ("rows", INTEGER), *numbers("low", "step", "high"))


class _Laws(Structure):
    _fields_ = (
        *numbers("step", "parameters", "states", kind=POINTER),
        *numbers("parameters_size", "state_size", kind=INTEGER),
        *numbers("law_of", "start_of", kind=POINTER),
    )


class _Linear(Structure):
    _fields_ = (*numbers("rows", "starts", kind=POINTER), ("hidden", INTEGER))


class _Loop(Structure):
    _fields_ = (
        *(("laws", _Laws), ("plant", _Plant), ("contact", _Contact), ("chain", _Chain)),
        *numbers("curves", "curve_of", kind=POINTER),
        *numbers("period", "plant_step", "horizon", "follow_time"),
        *(("seed", ctypes.c_uint64), *numbers("scenes", "draws", "ends", "touches", kind=POINTER)),
        ("most_touches", INTEGER),
        *(("trace", POINTER), ("trace_rows", INTEGER), ("course", POINTER), ("course_rows", INTEGER)),
        *(("stretches", POINTER), ("stretches_each", INTEGER), ("linear", _Linear)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop(Value):
    """All inputs of a set of simulated runs.

    Each run can be repeated exactly from these inputs. `shape` is the shape of the array of runs.

    Each run has one of the `sensors`, one of the `laws` (which share a period and a step), and the noise of the run
    with the index in `noise_of`. A run begins `lead` seconds before the start of its encounter; None for all at 0.
    """

    scenario: Scenario
    sensors: tuple[SensorModel, ...]
    sensor_of: IntArray
    laws: tuple[SampledLaw, ...]
    law_of: IntArray
    noise_of: IntArray
    chain: SensorChain
    plant: PlantModel
    contact: ContactModel | None
    horizon: float
    follow_time: float
    seed: int
    shape: tuple[int, ...]
    lead: FloatArray | None = None

    @property
    def begun(self) -> Scenario:
        """The encounters from the beginning of the runs."""
        return self.scenario if self.lead is None else begun_before(self.scenario, self.lead)


def run_loop(
    loop: Loop, which: IntArray, rows: int = 0, *, touches: int = TOUCHES, course_rows: int = 0
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Simulate selected encounters in compiled code.

    If the control law is compiled, the simulation uses all processor cores.

    Args:
        loop: the loop.
        which: flat indices of its encounters.
        rows: number of rows of the trace; only for a single encounter.
        touches: largest number of contacts of each encounter that are recorded separately.
        course_rows: number of rows of the time series in contact.

    Returns:
        Results (RESULT_COLUMNS) and contacts (CONTACT_COLUMNS) of these encounters, the trace (TRACE_COLUMNS, a row per
        period), and the time series in contact (COURSE_COLUMNS, a row per touch and per step in contact).
    """
    outputs = (
        np.zeros((len(which), len(RESULT_COLUMNS))),
        np.full((len(which), touches, len(CONTACT_COLUMNS)), np.nan),
        np.full((rows, len(TRACE_COLUMNS)), np.nan),
        np.full((course_rows, len(COURSE_COLUMNS)), np.nan),
    )
    native, python_step = _to_native(loop, which, outputs)

    def run(first: int, last: int) -> None:
        states = np.zeros(_LANES * native.laws.state_size // 8)
        one = waiting_readings(loop.chain, native.period)
        readings = np.empty((_LANES * len(one), one.shape[1]))
        for start in range(first, last, _AT_ONCE):
            indices = np.arange(start, min(start + _AT_ONCE, last))
            _run(byref(native), address(indices, _INDEX), len(indices), address(states), address(readings), len(one))
            if python_step is not None and python_step.raised is not None:
                raise python_step.raised

    if python_step is None:
        least = _LEAST_LONG if loop.horizon > _LONG * native.period else _LEAST_STRETCH
        run_in_chunks(run, len(which), least=least, most=_MOST_STRETCH)
    else:  # with a law in Python, threads would wait for each other at every step
        run(0, len(which))
    if loop.lead is not None:
        _count_from_start(np.broadcast_to(loop.lead, loop.shape).ravel()[which], outputs)
    return outputs


def _count_from_start(lead: FloatArray, outputs: tuple[FloatArray, ...]) -> None:
    """Shift the times of runs, so that they count from the start of the encounters."""
    ends, touches, trace, course = outputs
    for name in _TIMES:
        ends[:, RESULT_COLUMNS.index(name)] -= lead
    touches[:, :, 0] -= lead[:, None]
    if len(trace) or len(course):  # of a single run
        trace[:, 0] -= lead[0]
        course[:, 0] -= lead[0]


def waiting_readings(chain: SensorChain, period: float) -> FloatArray:
    """Allocate memory for the sensor readings that wait for delivery.

    The number of rows is a power of two.

    Returns:
        Memory for all readings that may wait at the same time.
    """
    waiting = int((chain.delay + _JITTERS * chain.jitter + chain.exposure + period) * chain.rate) + 8
    return np.empty((1 << (waiting - 1).bit_length(), _READING))


def chain_structure(chain: SensorChain) -> ctypes.Structure:
    """Return the parameters of a sensor as a C structure."""
    own = chain.numbers()
    return _Chain(*own[:_OWN], (ctypes.c_double * (5 * MOST_DISTURBANCES))(*own[_OWN:]))


def curve_structure(sensor: SensorModel, farthest: float) -> tuple[ctypes.Structure, FloatArray]:
    """Return a sensor curve as a C structure with a table.

    The table must stay in memory as long as the structure. Beyond `farthest` [m], the output is 0.
    """
    low, high = sensor.valid_range
    table, start, step = _curve_table(sensor, farthest + low)
    return _Curve(address(table), len(table), start, step, min(high, farthest)), table


def _to_native(loop: Loop, which: IntArray, outputs: tuple[FloatArray, ...]) -> tuple[_Loop, PythonStep | None]:
    """Copy inputs of encounters, and the output arrays of `run_loop`, for the compiled simulation."""
    begun, period = loop.begun, loop.laws[0].period
    scenes, course = _columns(loop, _scene_of(begun))[which], begun.obstacle.course
    stretches = _columns(loop, [number for s in course for number in (s.until, s.acceleration)])[which]
    laws, python_step = _laws(loop, which, scenes)
    used_sensors, curve_of = np.unique(loop.sensor_of.ravel()[which], return_inverse=True)
    tables, indices = _curves(loop, used_sensors), (curve_of.ravel(), loop.noise_of.ravel()[which])
    curves = (_Curve * len(tables))(*[_Curve(address(table), len(table), *rest) for table, *rest in tables])
    ends, touches, trace, moments = outputs
    by_curve, draws = (address(i, _INDEX) for i in indices)
    system = loop.plant.system()
    blocks = () if system is None else native_rows(system)
    linear = _Linear(*map(address, blocks), len(blocks[1])) if blocks else _Linear(None, None, 0)
    native = _Loop(
        *(laws, _Plant(*loop.plant.coefficients())),
        *(_Contact(*(loop.contact.numbers() if loop.contact else _NO_CONTACT)), chain_structure(loop.chain)),
        *(ctypes.addressof(curves), by_curve, period, plant_step(loop.plant, period), loop.horizon, loop.follow_time),
        *(loop.seed, address(scenes), draws, address(ends), address(touches), touches.shape[1]),
        *(address(trace), len(trace), address(moments), len(moments), address(stretches), len(course), linear),
    )
    native.held = (
        laws.blocks,
        blocks,
        scenes,
        stretches,
        tables,
        indices,
        curves,
        python_step,
        outputs,
    )  # keep alive what the structure points to
    return native, python_step


def _laws(loop: Loop, which: IntArray, scenes: FloatArray) -> tuple[_Laws, PythonStep | None]:
    """Copy the control laws for the compiled simulation."""
    used_laws, law_of = np.unique(loop.law_of.ravel()[which], return_inverse=True)
    starts = np.column_stack([used_laws[law_of.ravel()], scenes[:, (0, 1)] - scenes[:, (5, 6)]])
    distinct, start_of = np.unique(starts, axis=0, return_inverse=True)
    step: Any = as_step(loop.laws[0].step)
    parameters = [loop.laws[int(i)].parameters() for i in used_laws]
    states = [loop.laws[int(i)].start(position=float(x), velocity=float(v)) for i, x, v in distinct]
    python_step = None if isinstance(step, CompiledStep) else PythonStep(step, parameters, states)
    blocks = _to_rows(parameters, "parameters", python_step), _to_rows(states, "state", python_step)
    indices = law_of.ravel(), start_of.ravel()
    laws = _Laws(
        *(
            python_step.address if python_step else step.located(),
            *map(address, blocks),
            *(8 * part.shape[1] for part in blocks),
        ),
        *(address(i, _INDEX) for i in indices),
    )
    laws.blocks = blocks, indices
    return laws, python_step


def _scene_of(s: Scenario) -> tuple[Any, ...]:
    return (
        *(s.plant.position, s.plant.velocity, s.obstacle.position, s.obstacle.velocity, s.obstacle.acceleration),
        *(s.reference.position, s.reference.velocity, s.reference.acceleration),
    )


def _columns(loop: Loop, columns: Sequence[Any]) -> FloatArray:
    """Combine inputs into one matrix with a row for each run."""
    rows = np.empty((*loop.shape, len(columns)))
    for i, column in enumerate(columns):
        rows[..., i] = column
    return rows.reshape(math.prod(loop.shape), len(columns))


def _curves(loop: Loop, indices: IntArray) -> list[tuple[FloatArray, float, float, float]]:
    """Tabulate each sensor curve of the simulated runs."""
    sensor_of, distance = loop.sensor_of.ravel(), np.broadcast_to(loop.scenario.distance, loop.shape).ravel()
    begun = distance if loop.lead is None else np.broadcast_to(loop.begun.distance, loop.shape).ravel()
    curves = []
    for index in indices:
        sensor = loop.sensors[index]
        low, high = sensor.valid_range
        check_curve(sensor, distance if len(loop.sensors) == 1 else distance[sensor_of == index])
        farthest = float(begun.max() if len(loop.sensors) == 1 else begun[sensor_of == index].max())
        curves.append((*_curve_table(sensor, _BEYOND * farthest + low), high))
    return curves


@cache_by_curve(1024)  # the number of sensor samples of a robust design on a loop, or of a verdict
def _curve_table(sensor: SensorModel, high: float) -> tuple[FloatArray, float, float]:
    """Tabulate the log sensor output for cubic interpolation.

    The table is so dense that the interpolation error is 1e-12.

    Returns:
        Values of ln xi and its slopes times the step, shape (n, 2); the first distance and the step [m].
    """
    low, end = sensor.valid_range[0], min(high, sensor.valid_range[1])
    count = _FEWEST
    while True:
        distance = np.linspace(low, end, count)
        spacing = (end - low) / (count - 1)
        table = np.stack([sensor.log_output(distance), np.asarray(sensor.log_slope(distance)) * spacing], axis=1)
        middle = np.asarray(sensor.log_output(distance[:-1] + spacing / 2))
        between = (table[:-1, 0] + table[1:, 0]) / 2 + (table[:-1, 1] - table[1:, 1]) / 8
        if count > _MOST or np.all(np.abs(between - middle) <= _ERROR * (1 + np.abs(middle))):
            table.setflags(write=False)
            return table, low, spacing
        count = 2 * count - 1


class PythonStep:
    """Adapter of a Python law: it holds parameters and states, of which the compiled loop has the indices.

    Args:
        step: the step of the law.
        parameters: the parameters of each law.
        states: the initial states.
    """

    def __init__(self, step: Any, parameters: list[Any], states: list[Any]) -> None:
        self._law, self._parameters, self._states, self._state = step, parameters, states, None
        self.raised: BaseException | None = None
        self._function = _Step(self._step)  # must live as long as the structure that calls it
        self.address = ctypes.cast(self._function, POINTER).value or 0

    def _step(self, parameters: int, state: int, sample: Any, out: Any) -> None:
        # an exception must not leave a function called from C: it would be printed and lost
        raw = out.contents
        try:
            if self.raised is None:
                place = DOUBLE.from_address(state)
                if place.value >= 0:  # the first step of a run: the number is the index of its initial state
                    self._state = self._states[int(place.value)]
                    place.value = -1
                given_sample = _to_sample(sample.contents)
                current = self._parameters[int(DOUBLE.from_address(parameters).value)]
                self._state, output = self._law(current, self._state, given_sample)
                for name in Output._fields:
                    setattr(raw, name, getattr(output, name))
                return
        except BaseException as error:  # raised again by run_loop, also for Ctrl-C
            self.raised = error
        raw.position = raw.velocity = math.nan  # a status that ends the run


def _to_sample(raw: RawSample) -> Sample:
    return Sample(
        *(raw.reading, Arrival(raw.fresh), raw.age, raw.contact_force),
        *(raw.reference_position, raw.reference_velocity, raw.reference_acceleration),
    )


def _to_rows(parts: Sequence[Any], name: str, python_step: PythonStep | None) -> FloatArray:
    """Copy parameters or states of laws to rows aligned to 8 bytes; for a Python step, their indices."""
    if python_step is not None:
        return np.arange(len(parts), dtype=np.float64)[:, None]
    places = [location(part, name) for part in parts]
    sizes = {size for _, size in places}
    if len(sizes) != 1:
        raise InvalidInputError(
            f"{name}: found memory blocks of {sorted(sizes)} bytes, expected blocks of one size. Compiled control laws "
            "with the same step function need memory blocks of the same size"
        )
    size = sizes.pop()
    rows = np.zeros((len(parts), max(-(-size // 8), 1)))
    for row, (place, _) in zip(rows, places, strict=True):
        ctypes.memmove(address(row), place, size)
    return rows


def contact_step(contact: tuple[float, ...], inverse_mass: float, speed: float) -> float:
    """Return the integration step during contact [s].

    It is 1/50 of the time scale of the contact. `inverse_mass` is 1 / reduced mass [1/kg], and `speed` the initial
    speed.
    """
    return float(_contact_step(byref(_Contact(*contact)), inverse_mass, speed))
