"""What the tests share: the letter's sensors and encounter, and which tests are slow."""

from __future__ import annotations

import gc
from collections import Counter
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec

import pytest
import typer.main

from browser_checks import browser  # noqa: F401 - a fixture
from pretouch.motion import Admittance, Obstacle, Scenario
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower
from properties import register_profiles
from verification_samples import short_rest

register_profiles(times=20)

EXAMPLES = (("xarray", "sweep", "pretouch.sweeps.run.sweep"),)


@pytest.fixture(scope="session")
def letter_power() -> InversePower:
    return InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)


@pytest.fixture(scope="session")
def letter_first_order() -> ExponentialFirstOrder:
    return ExponentialFirstOrder(scale=0.458, rate=-61.0)


@pytest.fixture(scope="session")
def letter_second_order() -> ExponentialSecondOrder:
    return ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0)


@pytest.fixture(scope="session")
def letter_encounter() -> Scenario:
    """Section IV-B: an obstacle that approaches at -0.3 m/s from 42.2 mm."""
    return Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.0422, velocity=-0.3),
    )


@pytest.fixture(name="short_rest")
def _short_rest() -> Iterator[None]:
    """Verdicts with a short rest, for tests of which the rest is not the subject."""
    with short_rest():
        yield


@pytest.fixture(scope="session", autouse=True)
def _one_command_line() -> Iterator[None]:
    """Build the command line once per process, as users do: it takes 30 ms, and tests call it thousands of times."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typer.main, "get_command", cache(typer.main.get_command))
        yield


def pytest_collection_finish() -> None:
    """Exempt the collected tests from garbage collection, which would visit all of them again and again."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what `make test` leaves out, and skip examples of verbs whose libraries are an extra, if it is missing."""
    for library, extra, example in EXAMPLES:
        if find_spec(library) is None:
            for item in items:
                if item.name == example:
                    item.add_marker(pytest.mark.skip(reason=f"needs the extra '{extra}'"))
    cases: Counter[str] = Counter()
    for item in items:
        slow = item.get_closest_marker("slow")
        if slow is not None:
            function = item.nodeid.partition("[")[0]
            cases[function] += 1
            if cases[function] > slow.kwargs.get("keep", 0):
                item.add_marker(pytest.mark.thorough)
