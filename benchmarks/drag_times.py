"""Time the virtual drag next to the same method in NumPy: contacts, designs, peaks, and the page of a robust design.

Run with `python -m benchmarks.drag_times`; `--quick` runs fewer encounters, once. Both methods alternate in one
process. Each figure is the smallest processor time of several runs, so that other programs on the machine hardly
change it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import pretouch as pt
from pretouch.designs.drag import drag_by
from pretouch.motion.drag import solve_drag
from pretouch.motion.layout import PEAKS

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import drag_in_numpy

POWER = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
GRID = np.linspace(0.0, 0.08, 12)
CURVES = {
    "inverse power": POWER,
    "exponential": pt.ExponentialFirstOrder(scale=0.458, rate=-61.0),
    "Mittag-Leffler": pt.MittagLeffler(scale=1.0, rate=-40.0, order=0.8),
    "table": pt.Table(distances=tuple(GRID), outputs=tuple(POWER.output(GRID))),
}
SPRING = pt.SpringImpact(robot_mass=2.0, stiffness=4e3)
EFFECTS = {
    "ratio": (0.99, 0.01),
    "excursion": (0.005, 0.1),
    "contact_speed": (0.02, 0.2),
    "impact_force": (2.0, 15.0),
    "acceleration": (2.0, 6.0),
}
DRAG, PEAK_WALKS = 0.0144, 4  # walks of the path for all peaks, one each of force, acceleration, speed and travel
ASKED_CONTACTS, ASKED_DESIGN, ASKED_PEAKS, ASKED_PAGE = 0.1, 5e-6, 0.01, 2.0  # s, s each, s, s beyond the design
COUNT, REPEATS = 100_000, 3
QUICK_COUNT, QUICK_REPEATS = 100, 1


class Lines(NamedTuple):
    """Printed lines, and missed requirements."""

    text: list[str]
    missed: list[str]


def encounters(count: int, acceleration: float) -> pt.Scenario:
    """Draw approaches, with accelerations up to a limit in both directions [m/s^2]."""
    rng = np.random.default_rng(1)
    obstacle = pt.Obstacle(
        position=rng.uniform(0.02, 0.06, count),
        velocity=-rng.uniform(0.1, 1.0, count),
        acceleration=rng.uniform(-acceleration, acceleration, count),
    )
    return pt.Scenario(admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0), obstacle=obstacle)


def alternating(ours: Callable[[], Any], peer: Callable[[], Any], repeats: int) -> tuple[float, float]:
    """Return the smallest processor time of both functions [s], which run in turn."""
    taken: list[list[float]] = [[], []]
    for _ in range(repeats):
        for function, times in zip((ours, peer), taken, strict=True):
            start = time.process_time()
            function()
            times.append(time.process_time() - start)
    return min(taken[0]), min(taken[1])


def in_numpy(scenario: pt.Scenario, sensor: Any, drag: Any, peaks: int = 0) -> None:
    """Solve encounters by the reference, and walk the path once more for each of so many peaks."""
    path = drag_in_numpy.solved(solve_drag(scenario, sensor, drag).columns)  # type: ignore[arg-type]
    for _ in range(peaks):
        drag_in_numpy.largest_rates(path)


def with_peaks(scenario: pt.Scenario, sensor: Any, drag: Any) -> None:
    """Solve encounters, and read all peaks."""
    end = solve_drag(scenario, sensor, drag).end
    for name in PEAKS:
        getattr(end, name)


def measure(count: int, repeats: int) -> Iterator[tuple[str, float, float, float, float]]:
    """Yield for each case: name, compiled time and NumPy time [s], required time [s], and number of items per time."""
    for name, sensor in CURVES.items():
        for acceleration in (0.0, 1.0):
            one = encounters(count, acceleration)
            ours, peer = alternating(
                lambda one=one, s=sensor: solve_drag(one, s, DRAG).end.time,  # type: ignore[misc]
                lambda one=one, s=sensor: in_numpy(one, s, DRAG),  # type: ignore[misc]
                repeats,
            )
            kind = "accelerated" if acceleration else "uniform"
            yield f"{count:,} contacts, {name}, {kind}", ours, peer, ASKED_CONTACTS * count / COUNT, 1
    still = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=0.0, stiffness=0.0),
        obstacle=pt.Obstacle(position=0.0422, velocity=-1.0),
    )
    for effect, (least, most) in EFFECTS.items():
        limits = np.linspace(least, most, count // 10)
        options = {} if effect in {"ratio", "excursion"} else {"largest_speed": 0.5}
        design = partial(drag_by, POWER, 0.0422, 1.0, impact=SPRING, **{effect: limits}, **options)
        drags = design().drag
        ours, peer = alternating(design, lambda drags=drags: in_numpy(still, POWER, drags, 1), repeats)  # type: ignore[misc]
        yield f"a design, of {len(limits):,} by their {effect}", ours, peer, ASKED_DESIGN * len(limits), len(limits)
    for name, sensor in CURVES.items():
        few = encounters(40, 1.0)
        ours, peer = alternating(
            lambda few=few, s=sensor: with_peaks(few, s, DRAG),  # type: ignore[misc]
            lambda few=few, s=sensor: in_numpy(few, s, DRAG, PEAK_WALKS),  # type: ignore[misc]
            3 * repeats,
        )
        yield f"40 encounters with all peaks, {name}", ours, peer, ASKED_PEAKS, 1


def robust_page(samples: int) -> tuple[float, float]:
    """Return the processor time of a robust drag design of this many samples, and of its page [s]."""
    uniform = pt.uncertainty.Uniform
    task = pt.Task(
        pt.Scenario(
            admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
            obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
        ),
        POWER,
        pt.excursion_objective(position_scale=0.5, velocity_scale=0.3),
        bounds=(1e-3, 0.05),
        law="virtual-drag",
        uncertainty={
            "obstacle.velocity": uniform(low=-0.4, high=-0.2),
            "obstacle.acceleration": uniform(low=-0.2, high=0.1),
            "sensor.exponent": uniform(low=3.2, high=3.4),
        },
        robust=pt.designs.RobustOptions(samples=samples),
    )
    start = time.process_time()
    design = pt.robust(task)
    between = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        pt.write_report(design, Path(folder) / "robust.html")
    return between - start, time.process_time() - between


def lines(quick: bool) -> Lines:
    """Return the figures as text, and those that take longer than asked."""
    found = Lines([f"{'':52s}{'ours':>10s}{'NumPy':>12s}{'ratio':>9s}   asked"], [])
    for name, ours, peer, asked, parts in measure(*((QUICK_COUNT, QUICK_REPEATS) if quick else (COUNT, REPEATS))):
        unit, factor = ("us", 1e6 / parts) if parts > 1 else ("ms", 1e3)
        text = f"{factor * ours:7.3g} {unit}{factor * peer:9.4g} {unit}{peer / ours:9.3g}"
        found.text.append(f"{name:52s}{text}   <= {factor * asked:g} {unit}")
        if ours > asked:
            found.missed.append(f"{name}: {factor * ours:.3g} {unit}, required <= {factor * asked:g} {unit}")
    samples = 4 if quick else 16
    design, page = robust_page(samples)
    found.text.append(
        f"robust drag, {samples} samples: design {design:.2f} s, page {page:.2f} s, asked <= design + 2 s"
    )
    if page > design + ASKED_PAGE:
        found.missed.append(f"page of a robust drag: {page:.2f} s, required <= {design + ASKED_PAGE:.2f} s")
    return found


def main() -> None:
    """Print the figures, then the missed requirements."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.drag_times", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few encounters, once")
    text, missed = lines(parser.parse_args().quick)
    print(*text, "\nmissed requirements:", *(missed or ["none"]), sep="\n")


if __name__ == "__main__":
    main()
