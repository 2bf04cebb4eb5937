"""A custom law, in Python or compiled, runs in the loop as the controller does, for every way of passing it."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from scipy import LowLevelCallable

import pretouch as pt
from control_samples import LETTER_FILTERS, controller
from loop_samples import BareLaw
from native_code import compile_c
from plain_law import plain, start, step
from pretouch._core.native import entry
from pretouch.control import CompiledStep, Controller, Output, Sample
from pretouch.control.laws import as_step
from refusals import refused

SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
SCENARIO = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.0422, velocity=np.linspace(-0.4, -0.2, 6)),
)
CHAIN = pt.SensorChain(rate=1000.0, exposure=2e-4, delay=1e-4, noise=1e-3, jitter=1e-5)
ROBOT = {
    "plant": pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0),
    "contact": pt.simulation.SpringDamper(stiffness=3e4, damping=60.0, obstacle_mass=1.0),
}
QUANTITIES = ("time", "position", "velocity", "relative_velocity", "peak_force", "impulse", "flags", "end_time")


@dataclass(frozen=True)
class Own:
    """The letter's law as a user may hand it over."""

    step: Any
    parameters_as: Callable[[Any], Any] = lambda numbers: numbers
    made: Controller = field(default_factory=lambda: controller(**LETTER_FILTERS | {"cutoff": 400.0}))

    @property
    def period(self) -> float:
        return self.made.period

    def parameters(self) -> Any:
        return self.parameters_as(self.made.parameters())

    def start(self, *, position: float, velocity: float) -> Any:
        return self.parameters_as(self.made.start(position, velocity))


class PlainLaw(Own):
    """The same law in Python, of the tests' own reference."""

    def start(self, *, position: float, velocity: float) -> Any:
        return start(self.parameters(), position, velocity)


def results(law: Any, scenario: pt.Scenario = SCENARIO, **robot: Any) -> list[np.ndarray]:
    run = pt.simulation.simulate_loop(scenario, SENSOR, law, chain=CHAIN, seed=3, **robot)
    return [np.asarray(getattr(run, name)) for name in QUANTITIES]


def as_octets(numbers: ctypes.Structure) -> np.ndarray:
    return np.frombuffer(bytes(numbers), dtype=np.uint8)


ADDRESS = entry("step_damper")
FUNCTION = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)(ADDRESS)
HANDED = {
    "an address": ADDRESS,
    "a function of ctypes": FUNCTION,
    "scipy.LowLevelCallable": LowLevelCallable(FUNCTION),
    "a capsule": tuple.__getitem__(LowLevelCallable(FUNCTION), 0),
    "something with an address": type("Compiled", (), {"address": ADDRESS})(),
}


@pytest.mark.parametrize("robot", [{}, ROBOT], ids=["ideal", "robot"])
@pytest.mark.parametrize("handed", HANDED)
def test_a_compiled_step_is_the_controllers_bit_for_bit(handed: str, robot: Any) -> None:
    own = Own(HANDED[handed])
    for found, expected in zip(results(own, **robot), results(own.made, **robot), strict=True):
        np.testing.assert_array_equal(found, expected)
    for found, expected in zip(results(replace(own, parameters_as=as_octets)), results(own.made), strict=True):
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("robot", [{}, ROBOT], ids=["ideal", "robot"])
def test_a_step_in_python_is_the_controllers_bit_for_bit(robot: Any) -> None:
    own = PlainLaw(step, parameters_as=plain)
    for found, expected in zip(results(own, **robot), results(own.made, **robot), strict=True):
        np.testing.assert_array_equal(found, expected)


class OddError(Exception):
    """What no loop knows."""


@pytest.mark.parametrize("raised", [OddError, KeyboardInterrupt])
@pytest.mark.parametrize("count", [1, 400])
def test_what_a_step_in_python_raises_comes_out(raised: type[BaseException], count: int) -> None:
    calls = 0

    def failing(parameters: Any, state: Any, sample: Sample) -> Any:
        nonlocal calls
        calls += 1
        if sample.reading > 0.1:
            raise raised("too near")
        return step(parameters, state, sample)

    own = PlainLaw(failing, parameters_as=plain)
    with pytest.raises(raised, match="too near"):
        results(own, replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=np.full(count, -0.3))))
    assert 0 < calls < 500 * count


@pytest.mark.parametrize("far", [1e160, 1e300, math.inf, math.nan])
@pytest.mark.parametrize(
    "contact", [pt.simulation.HuntCrossley(stiffness=2e6, dissipation=1.0), ROBOT["contact"], None]
)
def test_a_law_that_answers_beyond_all_bounds_ends_its_run(far: float, contact: Any) -> None:
    """Also where the robot strikes so hard that no step could follow the contact."""

    def wild(parameters: Any, state: Any, sample: Sample) -> Any:
        return state, Output(far, far, far, 0.0, 0.0, 0)

    own = PlainLaw(wild, parameters_as=plain)
    run = pt.simulation.simulate_loop(
        SCENARIO, SENSOR, own, chain=CHAIN, plant=ROBOT["plant"], contact=contact, horizon=0.02
    )
    assert np.isin(run.status, [pt.motion.ContactStatus.UNRESOLVED, pt.motion.ContactStatus.CONTACT]).all()
    assert contact is None or (run.end_time <= 0.02).all()


def test_an_answer_without_all_numbers_is_said() -> None:
    own = PlainLaw(lambda *given: given[1:], parameters_as=plain)  # state and sample
    with pytest.raises(AttributeError, match="position"):
        results(own)


def test_memory_that_a_compiled_step_cannot_read_is_refused() -> None:
    with refused("parameters"):
        results(replace(BareLawCompiled(-0.7, 1e-3)))
    with refused("step", value="step"):
        results(Own("step"))
    with refused("step"):
        results(Own(0))


class BareLawCompiled(BareLaw):
    """Numbers in a tuple beside a compiled step."""

    @property
    def step(self) -> Any:
        return ADDRESS


@pytest.fixture(scope="module")
def compiled_law(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """The bare law of the tests in C, by the compiler that the core is built with."""
    return compile_c(tmp_path_factory.mktemp("law"), BARE)


BARE = """
#include <math.h>
#include "pretouch_law.h"

pretouch_law_step bare_step;
typedef struct { double gain, period, hold, a, b, c, d, e, f; } numbers;
typedef struct { double x, v, last, force, left, seen; } memory;

void bare_step(const void *parameters, void *state, const pretouch_sample *s, pretouch_output *out) {
    const numbers *p = parameters;
    memory *m = state;
    if (s->fresh && s->reading > 0) {
        const double level = log(s->reading);
        if (m->seen > 0) {
            m->force = p->gain * (level - m->last) / p->hold;
            m->left = p->hold;
        }
        m->last = level;
        m->seen = 1;
    }
    const double acting = m->left > 0.5 * p->period ? m->force : 0, period = p->period;
    m->left -= period;
    const double x = p->a * m->x + p->b * m->v + p->e * acting, v = p->c * m->x + p->d * m->v + p->f * acting;
    out->position = x + (s->reference_position +
                         period * (s->reference_velocity + 0.5 * period * s->reference_acceleration));
    out->velocity = v + (s->reference_velocity + period * s->reference_acceleration);
    out->acceleration = (v - m->v) / period + s->reference_acceleration;
    out->virtual_force = acting;
    out->log_level = m->last;
    out->status = 1;
    m->x = x;
    m->v = v;
}
"""


def test_a_law_in_c_is_the_same_law_in_python(compiled_law: ctypes.CDLL) -> None:
    bare = BareLaw(-0.7, 1e-3)

    class InC(BareLaw):
        step = compiled_law.bare_step

        def parameters(self) -> Any:
            return np.array(bare.parameters())

        def start(self, *, position: float, velocity: float) -> Any:
            return np.array(bare.start(position=position, velocity=velocity))

    own = InC(-0.7, 1e-3)
    for found, expected in zip(results(own, **ROBOT), results(bare, **ROBOT), strict=True):
        np.testing.assert_array_equal(found, expected)
    called = as_step(own.step)
    assert isinstance(called, CompiledStep)
    state = own.start(position=0.0, velocity=0.1)
    after, output = called(own.parameters(), state, Sample(0.1))
    assert state[1] == 0.1
    assert output == bare.step(bare.parameters(), tuple(state), Sample(0.1))[1]
    assert after[0] == output.position
