"""Run encounters of the sampled loop: sensor chain, law at its own rate, plant, contact."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol, runtime_checkable

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray, nonnegative, positive
from pretouch.motion import Scenario
from pretouch.motion.parallel import for_stretches
from pretouch.sensors import SensorModel

from .chain import SensorChain
from .contact import ContactModel
from .curve_table import curve_table
from .kernels.layout import CONTACT_COLUMNS, RESULT_COLUMNS, TRACE_COLUMNS
from .plant import IdealPlant, PlantModel
from .result import LoopTrace, SimulationResult

__all__ = ["Loop", "SampledLaw", "run_loop", "simulate"]

_HORIZON: Final = 10.0
_FOLLOW: Final = 0.2
_TOUCHES: Final = 32  # contacts of one run that are told apart
_FINE: Final = 0.2  # of the shortest time scale of a plant: what Runge-Kutta's method takes at once
_BEYOND: Final = 4.0  # times the farthest start: from there on a curve without an end is taken to be flat
_LEAST_STRETCH: Final = 16
_MOST_STRETCH: Final = 512
_NO_CONTACT: Final = (0.0, 0.0, 1.0, False, 0.0)


@runtime_checkable
class SampledLaw(Protocol):
    """What the loop asks of a law: `pretouch.control.Controller` is one, and so is any value with these four.

    Attributes:
        period: time between two steps [s].
        step: a plain function `state, output = step(parameters, state, sample)` that Numba can compile.
    """

    @property
    def period(self) -> float:
        """The time between two steps [s]."""

    @property
    def step(self) -> Callable[[Any, Any, Any], Any]:
        """The step of the law."""

    def parameters(self) -> Any:
        """Return the numbers of the law."""

    def start(self, *, position: float, velocity: float) -> Any:
        """Return the state of the law for a plant at rest or in motion relative to its reference [m, m/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """All that one run of the loop is made of, so that any of its encounters can be run again."""

    scenario: Scenario
    sensor: SensorModel
    law: SampledLaw
    chain: SensorChain
    plant: PlantModel
    contact: ContactModel | None
    horizon: float
    follow: float
    seed: int
    shape: tuple[int, ...]


def simulate(
    scenario: Scenario,
    sensor: SensorModel,
    law: SampledLaw,
    *,
    chain: SensorChain | None = None,
    plant: PlantModel | None = None,
    contact: ContactModel | None = None,
    runs: int | None = None,
    seed: int = 0,
    horizon: float = _HORIZON,
    follow: float = _FOLLOW,
) -> SimulationResult:
    """Run encounters of the sampled loop: L(1) with L(2) as a controller computes them from readings.

    Obstacle, plant and reference start as the scenario says; its admittance is not read, for the law has its own.

    Args:
        scenario: the encounter, or an array of them.
        sensor: the sensor curve, by which xi follows from the distance.
        law: the controller; the loop does not know which one it is.
        chain: what lies between xi and the law's readings; without noise and delay, at the law's rate, by default.
        plant: the robot; ideal by default, which ends a run at contact.
        contact: the contact force, for a plant with a mass.
        runs: repeat every encounter so often, each with noise of its own: a first axis of the results.
        seed: of the noise. The i-th run of a seed draws the same numbers whatever else is changed: common random
            numbers.
        horizon: how long to wait for contact [s].
        follow: how long to go on after the first contact [s], over rebounds and further contacts.

    Returns:
        How each run ended, its contacts and its largest values; `trace` has the whole course of one of them.

    Raises:
        InvalidInputError: plant and contact do not go together, or a number makes no sense.

    Examples:
        >>> from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> law = Controller(
        ...     period=1e-3,
        ...     conditioning=Conditioning(floor=1e-3),
        ...     law=VirtualDamper(gain=-0.7),
        ...     admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        ... )
        >>> run = simulate(scenario, sensor, law)
        >>> round(run.relative_velocity, 3)  # -0.0815 in continuous time
        -0.082
    """
    plant = plant or IdealPlant()
    chain = chain or SensorChain(rate=1 / law.period)
    if contact is not None and isinstance(plant, IdealPlant):
        raise InvalidInputError(
            "contact: an ideal plant has no mass, so no force follows from its contact; choose an ImpedancePlant or a "
            "PositionPlant"
        )
    shape = scenario.shape if runs is None else (_whole(runs, "runs", 1, 2**31), *scenario.shape)
    loop = Loop(
        scenario=scenario,
        sensor=sensor,
        law=law,
        chain=chain,
        plant=plant,
        contact=contact,
        horizon=positive(horizon, "horizon", "s"),
        follow=nonnegative(follow, "follow", "s") if contact is not None else 0.0,
        seed=_whole(seed, "seed", 0, 2**64 - 1),
        shape=shape,
    )
    size = math.prod(shape)
    out, touches, _ = run_loop(loop, np.arange(size))
    columns = {name: out[:, i].reshape(shape) for i, name in enumerate(RESULT_COLUMNS)}
    return SimulationResult(columns, touches.reshape(*shape, _TOUCHES, len(CONTACT_COLUMNS)), lambda i: _trace(loop, i))


def run_loop(loop: Loop, which: IntArray, rows: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Run some encounters of a loop, on all cores.

    Args:
        loop: the loop.
        which: flat indices of its encounters.
        rows: of the trace that is asked for; only for a single encounter.

    Returns:
        Columns by RESULT_COLUMNS and contacts by CONTACT_COLUMNS of these encounters, and the trace by TRACE_COLUMNS.
    """
    from pretouch._core.machine_code import compiled  # noqa: PLC0415 - loads Numba

    from .kernels.loop import encounters  # noqa: PLC0415

    scenes = _scenes(loop)
    law, chain = loop.law, loop.chain
    reach = _BEYOND * float(np.max(loop.scenario.distance)) + loop.sensor.valid_range[0]
    table, low, spacing = curve_table(loop.sensor, reach)
    contact = loop.contact.numbers() if loop.contact else _NO_CONTACT
    clock = (law.period, _plant_step(loop.plant, law.period), loop.horizon, loop.follow)
    out = np.zeros((len(scenes), len(RESULT_COLUMNS)))
    touches = np.full((len(scenes), _TOUCHES, len(CONTACT_COLUMNS)), np.nan)
    trace = np.full((rows, len(TRACE_COLUMNS)), np.nan)
    run, parameters = compiled(encounters, step=law.step), law.parameters()
    curve = (table, low, spacing, loop.sensor.valid_range[1])
    numbers = chain.numbers(loop.sensor.valid_range[1])
    for state, group in _groups(scenes, which, law):

        def stretch(start: int, end: int, state: Any = state, group: IntArray = group) -> None:
            run(
                *(parameters, state, scenes, loop.plant.coefficients(), contact, numbers, curve, clock),
                *(np.uint64(loop.seed), group[start:end], out, touches, trace),
            )

        for_stretches(stretch, len(group), least=_LEAST_STRETCH, most=_MOST_STRETCH)
    return out[which], touches[which], trace


def _scenes(loop: Loop) -> FloatArray:
    s = loop.scenario
    columns = (
        *(s.plant.position, s.plant.velocity, s.obstacle.position, s.obstacle.velocity, s.obstacle.acceleration),
        *(s.reference.position, s.reference.velocity, s.reference.acceleration),
    )
    return np.stack([np.broadcast_to(c, loop.shape).ravel() for c in columns], axis=-1).astype(np.float64)


def _groups(scenes: FloatArray, which: IntArray, law: SampledLaw) -> list[tuple[Any, IntArray]]:
    """Gather encounters in which the law starts alike."""
    starts = scenes[which][:, (0, 1)] - scenes[which][:, (5, 6)]
    unique, place = np.unique(starts, axis=0, return_inverse=True)
    order = np.argsort(place.ravel(), kind="stable")
    borders = np.cumsum(np.bincount(place.ravel(), minlength=len(unique)))[:-1]
    groups = np.split(which[order], borders)
    return [
        (law.start(position=float(x), velocity=float(v)), group) for (x, v), group in zip(unique, groups, strict=True)
    ]


def _plant_step(plant: PlantModel, period: float) -> float:
    mass, stiffness, _, own, _, servo, coulomb, friction_speed = plant.coefficients()
    if mass == 0:
        return period
    # the slope of the friction at rest is the fastest of all, and needs no more than stability
    friction = coulomb / friction_speed / mass / 8
    fastest = max(math.sqrt(stiffness / mass), own / mass, servo, friction)
    return period / max(math.ceil(period * fastest / _FINE), 1)


def _whole(value: Any, name: str, least: int, most: int) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not least <= value <= most:
        raise InvalidInputError(f"{name}: found {value!r}, expected a whole number from {least} to {most}")
    return int(value)


def _trace(loop: Loop, index: int) -> LoopTrace:
    rows = math.ceil(loop.horizon / loop.law.period - 1e-9)
    _, touches, trace = run_loop(loop, np.array([index]), rows)
    trace = trace[~np.isnan(trace[:, 0])]
    columns = {name: np.ascontiguousarray(trace[:, i]) for i, name in enumerate(TRACE_COLUMNS)}
    return LoopTrace(**columns, contacts=touches[0][~np.isnan(touches[0][:, 0])])
