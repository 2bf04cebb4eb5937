"""Create test vectors for an exported control law.

The inputs come from a simulated approach with added faults.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from pretouch._core.values import Value
from pretouch.control import Arrival, Controller, Output, Sample
from pretouch.control.laws import as_step
from pretouch.simulation import ClosedLoop, simulate_loop

MOST_STEPS: Final = 4000
"""The largest number of steps of one case; of a longer simulation, the last steps are taken."""

_SEED: Final = 20_26
_DROPPED: Final = 0.3  # share of readings that the dropout case removes
_SEEN: Final = 0.1  # share of readings of an object that vanishes and returns
_SPIKE: Final = 100.0  # factor of a single wrong reading
_BRIGHTER: Final = 2.0  # step of the reflectance
_PRESSURE: Final = (1.0, 100.0)  # smallest and largest force of the pressing object [N]
_PRESSED_STEPS: Final = 200
_ANY_READING: Final = 2e12  # above the highest saturation level that a controller can have

SAMPLE_COLUMNS: Final = (
    *("reading", "age", "contact_force", "reference_position", "reference_velocity", "reference_acceleration"),
    "fresh",
)
"""The inputs of a step, in the order of the C structure `pretouch_sample`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case(Value):
    """Input samples and expected outputs of a controller test.

    The controller is newly started.

    Args:
        name: short name, such as "dropouts".
        about: what happens in this case, in words.
        samples: the samples.
        outputs: the output of the law for each sample, computed in double precision.
    """

    name: str
    about: str
    samples: tuple[Sample, ...]
    outputs: tuple[Output, ...]


def make_cases(loop: ClosedLoop, controller: Controller, encounter: tuple[Any, Any]) -> tuple[Case, ...]:
    """Create test vectors from a simulated approach with faults.

    Args:
        loop: the loop, whose sensor chain, robot and contact deliver the samples.
        controller: the controller with the gain that is exported.
        encounter: scenario and sensor curve.

    Returns:
        A case without faults, and one for each kind of fault.
    """
    plain = _approach(loop, controller, encounter)
    return tuple(
        Case(name=name, about=about, samples=samples, outputs=_outputs(controller, samples))
        for name, about, edit in _CASES
        for samples in [tuple(edit(plain, controller, np.random.default_rng(_SEED)))]
    )


@dataclass(frozen=True)
class _Recorder:
    """Wrapper that records the input samples of a running controller."""

    controller: Controller
    samples: list[Sample] = field(default_factory=list)

    @property
    def period(self) -> float:
        return self.controller.period

    @property
    def admittance(self) -> Any:
        return self.controller.admittance

    def parameters(self) -> Any:
        return self.controller.parameters()

    def start(self, *, position: float, velocity: float) -> Any:
        return self.controller.start(position, velocity)

    @property
    def step(self) -> Callable[[Any, Any, Sample], Any]:
        original = as_step(self.controller.step)

        def recorded(parameters: Any, state: Any, sample: Sample) -> Any:
            self.samples.append(sample)
            return original(parameters, state, sample)

        return recorded


def _approach(loop: ClosedLoop, controller: Controller, encounter: tuple[Any, Any]) -> tuple[Sample, ...]:
    """Return the input samples that a controller receives in one simulated encounter."""
    recorder = _Recorder(controller)
    options = {name: getattr(loop, name) for name in ("chain", "plant", "contact", "seed", "horizon", "follow_time")}
    simulate_loop(*encounter, recorder, **options)
    return tuple(recorder.samples[-MOST_STEPS:])


def _outputs(controller: Controller, samples: tuple[Sample, ...]) -> tuple[Output, ...]:
    """Return the controller output for each input sample."""
    run = controller.begin()
    return tuple(run.step(s.reading, s.fresh, s.age, **_inputs(s)) for s in samples)


def _inputs(sample: Sample) -> dict[str, float]:
    return {name: getattr(sample, name) for name in SAMPLE_COLUMNS[2:6]}


Edited = Iterator[Sample]


def _same(samples: tuple[Sample, ...], controller: Controller, rng: np.random.Generator) -> Edited:  # noqa: ARG001
    yield from samples


def _dropouts(samples: tuple[Sample, ...], controller: Controller, rng: np.random.Generator) -> Edited:  # noqa: ARG001
    for sample, chance in zip(samples, rng.random(len(samples)), strict=True):
        yield sample._replace(fresh=False) if chance < _DROPPED else sample


def _gap(samples: tuple[Sample, ...], controller: Controller, rng: np.random.Generator) -> Edited:  # noqa: ARG001
    """Remove sensor readings for a period longer than the sensor timeout."""
    first = 2 * len(samples) // 3
    steps = int(1.5 * controller.conditioning.numbers(controller.period).timeout / controller.period) + 1
    for i, sample in enumerate(samples):
        yield sample._replace(fresh=False) if first <= i < first + steps else sample


def _saturation(samples: tuple[Sample, ...], controller: Controller, rng: np.random.Generator) -> Edited:  # noqa: ARG001
    """Set some readings to the saturation level of the sensor."""
    level = controller.conditioning.saturation or _ANY_READING
    for i, sample in enumerate(samples):
        yield sample._replace(reading=level) if 2 * len(samples) <= 3 * i < 5 * len(samples) // 2 else sample


def _contact(samples: tuple[Sample, ...], controller: Controller, rng: np.random.Generator) -> Edited:
    """Set random contact forces in the second half of the approach."""
    forces = 3 * controller.contact_threshold * rng.standard_normal(len(samples))
    for i, (sample, force) in enumerate(zip(samples, forces, strict=True)):
        pressed = 2 * i >= len(samples)
        value = np.nan if pressed and i % 97 == 0 else float(force)
        yield sample._replace(contact_force=value) if pressed else sample


def _pressed(samples: tuple[Sample, ...], controller: Controller, rng: np.random.Generator) -> Edited:  # noqa: ARG001
    """Press against the robot at rest for a while, without a reading."""
    pressed = float(np.clip(3 * controller.contact_threshold, *_PRESSURE))
    for i in range(min(len(samples), _PRESSED_STEPS)):
        force = -pressed if 4 * i >= _PRESSED_STEPS and 4 * i < 3 * _PRESSED_STEPS else 0.0
        yield Sample(reading=controller.conditioning.offset, contact_force=force)


def _garbage(samples: tuple[Sample, ...], controller: Controller, rng: np.random.Generator) -> Edited:
    """Replace some inputs by invalid or extreme values."""
    timeout = controller.conditioning.numbers(controller.period).timeout
    wrong = (
        *(("reading", value) for value in (np.nan, np.inf, -np.inf, -1e30, 0.0)),
        *(("age", value) for value in (np.nan, -1.0, 2 * timeout)),
        *((name, value) for name in SAMPLE_COLUMNS[3:6] for value in (np.nan, 1e30)),
    )
    for i, sample in enumerate(samples):
        name, value = wrong[int(rng.integers(len(wrong)))]
        fields: dict[str, Any] = {name: value}
        yield sample._replace(**fields) if i % 7 == 6 else sample


def _cable(samples: tuple[Sample, ...], controller: Controller, rng: np.random.Generator) -> Edited:  # noqa: ARG001
    """Set all readings to 0 from some step on."""
    for i, sample in enumerate(samples):
        yield sample._replace(reading=0.0) if 3 * i >= 2 * len(samples) else sample


def _reflectance(samples: tuple[Sample, ...], controller: Controller, rng: np.random.Generator) -> Edited:  # noqa: ARG001
    """Double the signal for a while."""
    offset = controller.conditioning.offset
    for i, sample in enumerate(samples):
        brighter = offset + _BRIGHTER * (sample.reading - offset)
        yield sample._replace(reading=brighter) if len(samples) <= 2 * i < 3 * len(samples) // 2 else sample


def _vanishing(samples: tuple[Sample, ...], controller: Controller, rng: np.random.Generator) -> Edited:
    """Report no object for a while, twice, with single readings between, and with messages that are late."""
    for i, (sample, chance) in enumerate(zip(samples, rng.random(len(samples)), strict=True)):
        place, kind = 8 * i / len(samples), Arrival.NO_OBJECT
        if 2 <= place < 3 or 5 <= place < 6:
            late = place >= 5.5 and chance < _DROPPED
            seen = place < 2.5 and chance < _SEEN
            age = 2 * controller.conditioning.numbers(controller.period).timeout if i % 53 == 0 else sample.age
            kind = Arrival.NOTHING if late or not sample.fresh else Arrival.READING if seen else kind
            yield sample._replace(fresh=kind, age=age)
        else:
            yield sample


def _spikes(samples: tuple[Sample, ...], controller: Controller, rng: np.random.Generator) -> Edited:  # noqa: ARG001
    for i, sample in enumerate(samples):
        yield sample._replace(reading=_SPIKE * sample.reading) if i % 41 == 40 else sample


_CASES: Final = (
    ("approach", "a simulated approach, with its contact if the robot has a contact model", _same),
    ("dropouts", "the approach, in which 30 % of the readings are missing at random", _dropouts),
    ("gap", "the approach, without readings for longer than the timeout", _gap),
    ("saturation", "the approach with a saturated sensor for a while", _saturation),
    ("contact", "the approach with contact forces, some of which are not a number", _contact),
    (
        "pressed",
        "an object that presses against the robot at rest for a while, so that the reference retreats",
        _pressed,
    ),
    ("garbage", "the approach with readings, ages and references that are impossible", _garbage),
    ("cable", "the approach, in which the cable breaks, so that all later readings are 0", _cable),
    ("reflectance", "the approach with a signal that is twice as large for a while", _reflectance),
    (
        "vanishing",
        "the approach, in which the sensor reports no object for a while, twice, with single readings between",
        _vanishing,
    ),
    ("spikes", "the approach with single readings that are 100 times too large", _spikes),
)


def cases_as_csv(cases: tuple[Case, ...]) -> str:
    """Return test vectors as a CSV table.

    Each row has the case number, inputs and expected outputs of a step. Numbers have as many digits as needed to
    restore them exactly. A comment line names each case.
    """
    lines = [f"# case {i}, {case.name}: {case.about}" for i, case in enumerate(cases)]
    lines.append(",".join(("case", *SAMPLE_COLUMNS, *Output._fields)))
    for i, case in enumerate(cases):
        for sample, output in zip(case.samples, case.outputs, strict=True):
            inputs = [repr(float(getattr(sample, name))) for name in SAMPLE_COLUMNS[:-1]]
            outputs = [repr(float(value)) for value in output[:-1]]
            lines.append(",".join((str(i), *inputs, str(int(sample.fresh)), *outputs, str(int(output.status)))))
    return "\n".join(lines) + "\n"
