"""Results are values: pickled, copied and sent to another process they are the same, before and after printing."""

from __future__ import annotations

import copy
import enum
import importlib
import inspect
import multiprocessing
import pickle
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch._core.errors import PretouchError
from pretouch.motion import ContactGradients
from result_samples import BOUNDS, OBJECTIVE, REQUESTS, RESULTS, SCENARIO, SENSOR, SEVERAL, half

ROOMS = (
    *("pretouch", "pretouch.sensors", "pretouch.calibration", "pretouch.motion", "pretouch.control"),
    *(
        "pretouch.uncertainty",
        "pretouch.sweeps",
        "pretouch.designs",
        "pretouch.designs.robust",
        "pretouch.designs.drag",
    ),
    *("pretouch.simulation", "pretouch.verification", "pretouch.config", "pretouch.report", "pretouch.letter"),
)
BEHIND = {"columns", "solution", "trace_of", "figure"}
"""Attributes that lead to what results are computed from, and to what is no number."""


CLASSES: dict[str, set[type]] = {}
"""The classes in each sample that a test of this process has read, by its name."""


def classes_in(name: str) -> set[type]:
    """Return the classes in a sample; make the sample only if no test has read it before."""
    if name not in CLASSES:
        note_classes(name, numbers({**RESULTS, **REQUESTS}[name]()))
    return CLASSES[name]


def note_classes(name: str, read: dict[str, Any]) -> None:
    CLASSES[name] = {value for value in read.values() if isinstance(value, type)}


def numbers(thing: Any) -> dict[str, Any]:
    """Everything public that can be read of a thing, by its path, numbers as their bits."""
    found: dict[str, Any] = {}
    _read(thing, "", found, {})
    return found


def _read(thing: Any, path: str, found: dict[str, Any], seen: dict[int, Any]) -> None:
    own = type(thing).__module__.startswith("pretouch")
    if own:
        found[f"{path}:"] = type(thing)
    if isinstance(thing, np.ndarray):
        found[path] = (thing.dtype.str, thing.shape, thing.flags.writeable, thing.tobytes())
    elif isinstance(thing, float):
        found[path] = thing.hex()
    elif thing is None or isinstance(thing, str | int | enum.Enum):
        found[path] = thing
    elif not own or id(thing) not in seen:
        seen |= {id(thing): thing} if own else {}  # kept, so that no other takes its number
        for step, value in _parts(thing, own=own):
            _read(value, f"{path}{step}", found, seen)


def _parts(thing: Any, *, own: bool) -> Iterator[tuple[str, Any]]:
    if isinstance(thing, Mapping):
        yield from ((f"[{key}]", value) for key, value in thing.items())
    elif isinstance(thing, tuple | list):
        yield from ((f"[{i}]", value) for i, value in enumerate(thing))
    elif own:
        for name in dir(thing):
            if not name.startswith("_") and name not in BEHIND:
                try:
                    yield f".{name}", getattr(thing, name)
                except PretouchError as error:
                    yield f".{name}", str(error)
        if isinstance(thing, ContactGradients):
            yield from ((f"/{by}", [thing.of(q, by) for q in thing.quantities]) for by in thing.inputs)


def sent(thing: Any, protocol: int = pickle.HIGHEST_PROTOCOL) -> Any:
    return pickle.loads(pickle.dumps(thing, protocol))  # noqa: S301 - our own


def printed(thing: Any) -> tuple[str, ...]:
    plain = getattr(thing, "to_dict", None)
    return (repr(thing), str(thing), *(str(f()) for f in (plain,) if f is not None))


def shown(thing: Any) -> str:
    """What a notebook shows, with its figures."""
    html = getattr(thing, "_repr_html_", None)
    return "" if html is None else str(html())


def check(thing: Any, *, protocols: tuple[int, ...] = (2, 3, 4, 5)) -> None:
    copies = [sent(thing, protocol) for protocol in protocols]
    for other in (*copies, copy.copy(thing), copy.deepcopy(thing)):
        assert type(other) is type(thing)
        assert (other == thing) is True
        assert hash(other) == hash(thing)
        assert repr(other) == repr(thing)


@pytest.mark.slow(keep=13)
@pytest.mark.parametrize("name", [*RESULTS, *REQUESTS])
def test_a_result_travels_before_and_after_it_was_printed(name: str) -> None:
    thing = {**RESULTS, **REQUESTS}[name]()
    early = sent(thing)
    check(thing)
    text, page = printed(thing), shown(thing)
    check(thing, protocols=(2, pickle.HIGHEST_PROTOCOL))
    known = numbers(thing)
    note_classes(name, known)
    late = sent(thing)
    assert shown(early) == page  # the late one shows the same, because its numbers and texts are the same
    for other in (early, late):  # one computes everything itself, the other brings along what was computed
        assert printed(other) == text
        assert numbers(other) == known


@pytest.mark.slow
def test_every_public_class_is_among_the_samples() -> None:
    """A class that a room offers, and that no sample holds, is one whose journey nobody has tried."""
    offered = set()
    for room in ROOMS:
        module = importlib.import_module(room)
        names = getattr(module, "__all__", [n for n in vars(module) if not n.startswith("_")])
        classes = (value for value in map(partial(getattr, module), names) if inspect.isclass(value))
        offered |= {value for value in classes if value.__module__.startswith(room)}
    abstract = {c for c in offered if inspect.isabstract(c) or getattr(c, "_is_protocol", False)}
    concrete = {c for c in offered - abstract if not issubclass(c, Exception | enum.Enum)}
    met = {value for name in (*RESULTS, *REQUESTS) for value in classes_in(name)}
    assert concrete - met == {pt.control.Run}  # a controller at work stays where it works; its state travels


def both(thing: Any) -> tuple[Any, str, dict[str, Any]]:
    """What another process makes of a thing that it was sent, and the thing sent back."""
    return thing, repr(thing), numbers(thing)


@pytest.fixture(scope="module")
def other_process() -> Any:
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield pool


@pytest.mark.slow(keep=6)
@pytest.mark.parametrize("name", ["contacts", "motion", "design", "designs", "robust", "simulations", "verdict"])
def test_another_process_reads_the_same_of_a_result(other_process: Any, name: str) -> None:
    thing = RESULTS[name]()
    back, text, known = other_process.submit(both, thing).result()
    assert back == thing
    assert text == repr(thing) == repr(back)
    assert known == numbers(thing) == numbers(back)


def test_what_was_not_computed_yet_is_computed_after_the_journey() -> None:
    found = sent(pt.find_contact(SEVERAL, SENSOR, -0.7))
    again = pt.find_contact(SEVERAL, SENSOR, -0.7)
    assert (found.end.largest_speed == again.end.largest_speed).all()
    assert (found.gradients.of("time", "gain") == again.gradients.of("time", "gain")).all()
    with pytest.raises(ValueError, match="read-only"):
        found.end.time[0] = 0.0
    designs = sent(RESULTS["designs"]())
    assert designs.at(3).gain == pytest.approx(designs.gain[3], rel=1e-6)  # as two ways of search agree
    assert designs.at(3).certificate is not None
    runs = sent(RESULTS["simulations"]())
    assert runs.trace(3) == RESULTS["simulations"]().trace(3)


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnSensor(pt.sensors.SensorModel):
    """A sensor of a user's own."""

    rate: float = -50.0
    name = "own"

    def _log_output(self, distance: Any) -> Any:
        return self.rate * distance

    def _log_slope(self, distance: Any) -> Any:
        return np.full_like(distance, self.rate)


@dataclass(frozen=True, slots=True, kw_only=True)
class CustomObjective(pt.Objective):
    """An objective of a user's own."""

    extra: float = 1.0

    def value(self, state: Any, obstacle_speed: Any, impact: Any = None) -> Any:
        return pt.Objective.value(self, state, obstacle_speed, impact) + self.extra


def test_what_a_user_has_made_travels_along() -> None:
    objective = CustomObjective(terms=OBJECTIVE.terms)
    design = pt.design(pt.Task(SCENARIO, OwnSensor(), objective, bounds=BOUNDS))
    check(design)
    printed(design)
    check(design)
    check(pt.design(pt.Task(SCENARIO, OwnSensor(), OBJECTIVE, bounds=BOUNDS, evaluate=half)))


def test_what_cannot_be_pickled_is_named_by_pickle() -> None:
    sensor = pt.CustomSensor(
        log_output_function=lambda distance: -40 * distance,
        log_slope_function=lambda distance: np.full_like(distance, -40.0),
    )
    found = pt.find_contact(SCENARIO, sensor, -0.7)
    with pytest.raises((pickle.PicklingError, AttributeError), match="lambda"):
        pickle.dumps(found)
    assert copy.deepcopy(found) == found  # within a process a function is its own copy


def test_results_of_the_same_numbers_are_equal_and_others_are_not() -> None:
    one, same = pt.find_contact(SEVERAL, SENSOR, -0.7), pt.find_contact(SEVERAL, SENSOR, np.full(12, -0.7))
    assert one == same
    assert hash(one) == hash(same)
    assert one != pt.find_contact(SEVERAL, SENSOR, -0.6)
    assert one != pt.find_contact(SCENARIO, SENSOR, -0.7)
    assert replace(SEVERAL, obstacle=pt.Obstacle(position=0.0422, velocity=-0.3)) != SEVERAL
    assert (one == 1) is False
    assert len({RESULTS["design"](), RESULTS["design"](), RESULTS["designs"]()}) == 2
