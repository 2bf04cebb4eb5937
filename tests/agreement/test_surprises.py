"""The numbers of the page on surprises, computed by SciPy from the equation of motion, without pretouch."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, curve_fit

DOCS = Path(__file__).parents[2] / "docs"
TEXT = (DOCS / "explanation/surprises.md").read_text(encoding="utf-8")
N, L0, SPEED, GAIN = 3.32, 0.0419, 0.3, -0.7463


def shown(pattern: str) -> tuple[float, ...]:
    """The numbers of the first line of the page that matches a pattern with groups."""
    found = re.search(pattern, TEXT)
    assert found is not None, pattern
    return tuple(map(float, found.groups()))


def meet(start=0.0422, velocity=-SPEED, gain=GAIN, mass=1.0, damping=10.0, stiffness=25.0, **more):
    """Time, retreat and relative velocity at contact for L(1) with the force of L(2) on the power curve."""
    acceleration, stop = more.get("acceleration", 0.0), more.get("stop")
    force = more.get("force", lambda rate: gain * rate)

    def object_at(t):
        if stop is None or t < stop:
            return start + velocity * t + acceleration * t * t / 2, velocity + acceleration * t
        late = min(t - stop, 0.01)  # it stops within 10 ms
        return start + velocity * (stop + late - late**2 / 0.02), velocity * (1 - late / 0.01)

    def rates(t, state):
        position, speed = object_at(t)
        rate = -N / (position - state[0] + L0) * (speed - state[1])
        return [state[1], (force(rate) - damping * state[1] - stiffness * state[0]) / mass]

    def touch(t, state):
        return object_at(t)[0] - state[0]

    touch.terminal, touch.direction = True, -1
    motion = solve_ivp(rates, (0, 10), [0, 0], events=touch, rtol=1e-8, atol=1e-11, max_step=0.05)
    if motion.status == 0:  # a free mass that is never touched
        return np.inf, 1.0, 0.0
    (end,) = motion.t_events[0]
    retreat, own = motion.y_events[0][0]
    return end, -retreat, own - object_at(end)[1]


def test_ranges_and_bright_surfaces() -> None:
    for line in re.findall(r"^detected at +([\d.]+) mm: contact at ([\d.]+) m/s", TEXT, re.MULTILINE):
        start, speed = map(float, line)
        assert meet(start / 1e3)[2] == pytest.approx(speed, abs=6e-4)
    for bright, dark, late in re.findall(r"detected at (\d+) mm instead of (\d+) mm, touched (\d+) ms later", TEXT):
        start = {"165": 0.165, "42": 0.0422}[dark]
        seen = brentq(lambda x, start=start: 2 * (x + L0) ** -N - (start + L0) ** -N, 0.01, 1)
        assert 1e3 * seen == pytest.approx(float(bright), abs=0.6)
        later = meet(seen)[0] - (seen - start) / SPEED - meet(start)[0]
        assert 1e3 * later == pytest.approx(float(late), abs=0.6)


def test_spring_damper_and_mass() -> None:
    _, excursion, speed = meet()
    for name, changes in (
        ("no spring", {"stiffness": 0}),
        ("no damper", {"damping": 0}),
        ("twice the mass", {"mass": 2}),
    ):
        by_speed, by_excursion = shown(rf"{name} +contact speed ([-+]\d+)%, excursion ([-+]\d+)%")
        changed = meet(**changes)
        assert 100 * (changed[2] / speed - 1) == pytest.approx(by_speed, abs=0.6)
        assert 100 * (changed[1] / excursion - 1) == pytest.approx(by_excursion, abs=0.6)


def test_equal_retreat() -> None:
    cases = {
        "neither, a free mass": {"stiffness": 0, "damping": 0},
        "no damper": {"damping": 0},
        "no spring": {"stiffness": 0},
        "spring, damping ratio 0.5": {"damping": 5},
        "spring, damping ratio 2.0": {"damping": 20},
    }
    for name, changes in cases.items():
        gain = brentq(lambda g, changes=changes: meet(gain=g, **changes)[1] - 0.06, -1.0, -0.05, xtol=1e-6)
        (speed,) = shown(rf"{name}: contact at ([\d.]+) m/s")
        assert meet(gain=gain, **changes)[2] == pytest.approx(speed, abs=6e-4)


def test_the_drag_with_and_without_hold_off() -> None:
    for speed in (0.1, 0.3, 1.0):
        free, pulled = shown(rf"{speed} m/s: (\d+)% with hold-off, (\d+)% without")
        law = {"velocity": -speed, "force": lambda rate: -0.0105 * max(rate, 0) ** 2}
        assert 100 * meet(**law, damping=0, stiffness=0)[2] / speed == pytest.approx(free, abs=0.6)
        assert 100 * meet(**law)[2] / speed == pytest.approx(pulled, abs=0.6)
    _, excursion, remaining = meet(force=lambda rate: -0.130 * max(rate, 0) ** 2)
    assert (100 * remaining / SPEED, 1e3 * excursion) == pytest.approx(
        shown(r"without hold-off, (\d+)% at 0.3 m/s needs phi = 0.130 N s² and an excursion of (\d+) mm"), abs=0.6
    )


def test_an_object_that_stops_and_an_edge() -> None:
    time, _, speed = meet(stop=0.35)
    assert (1e3 * speed, time - 0.36) == pytest.approx(shown(r"contact at (\d+) mm/s, ([\d.]+) s after"), abs=0.6)
    assert time - 0.36 == pytest.approx(shown(r"mm/s, ([\d.]+) s after")[0], abs=6e-3)
    # the output doubles smoothly within a millisecond; the free virtual mass keeps the speed that it gets
    rise = solve_ivp(
        lambda t, _: [GAIN * np.log(2) * np.pi / 2e-3 * np.sin(np.pi * t / 1e-3)], (0, 1e-3), [0], rtol=1e-9
    )
    assert rise.y[0, -1] == pytest.approx(shown(r"change of the robot's speed: (-[\d.]+) m/s")[0], abs=6e-3)


def test_a_fall() -> None:
    speed = np.sqrt(2 * 9.81 * 0.05)
    steady, fall = shown(r"for constant speed (-[\d.]+) N s, for a fall (-[\d.]+) N s")
    for gain, acceleration in ((steady, 0.0), (fall, -9.81)):
        touched = meet(0.05, -speed, gain, acceleration=acceleration)
        assert touched[2] == pytest.approx(0.3, abs=6e-3)  # gains are shown to 0.005 N s


def radius(gain: float, period: float, latency: float) -> float:
    """Spectral radius of the loop of virtual mass, admittance and delayed force from one reading to the next."""
    slope, waits = N / L0, int(latency // period)
    late = latency - waits * period
    motion = np.array([[0, 1, 0], [-25, -10, 1], [0, 0, 0]], dtype=float)
    first, second = expm(motion * late), expm(motion * (period - late))
    # state: position, speed, and the readings of the last waits + 2 periods
    count = waits + 2
    step = np.zeros((2 + count, 2 + count))
    unit = np.eye(2 + count)
    newest = slope * unit[0]
    readings = [newest, *unit[2:]]  # of now, of one period ago, ...
    body = unit[:2]
    for matrix, k in ((first, waits + 1), (second, waits)):
        force = gain * (readings[k] - readings[k + 1]) / period
        body = matrix[:2, :2] @ body + np.outer(matrix[:2, 2], force)
    step[:2] = body
    step[2] = newest
    step[3:, 2:-1] = np.eye(count - 1)
    return float(np.abs(np.linalg.eigvals(step)).max())


def test_the_limits_of_two_rates() -> None:
    for latency in (0, 4):
        pattern = rf"latency {latency} ms: (-[\d.]+) N s at 30 Hz, (-[\d.]+) N s at 250 Hz, ([\d.]+) times"
        limits = [brentq(lambda g, r=r, late=latency / 1e3: radius(g, 1 / r, late) - 1, -9.0, -0.3) for r in (30, 250)]
        assert [*limits, limits[1] / limits[0]] == pytest.approx(shown(pattern), abs=0.06)


def test_fits_of_readings_with_errors() -> None:
    generator, distances = np.random.default_rng(1), np.linspace(0.002, 0.06, 12)
    found = []
    for _ in range(400):
        readings = np.log((distances + L0) ** -N) + 0.01 * generator.standard_normal(12)
        (_, n, l0), _ = curve_fit(lambda x, a, n, l0: a - n * np.log(x + l0), distances, readings, p0=(0.0, N, L0))
        found.append((n, l0, n / (0.02 + l0)))
    n, l0, g = np.transpose(found)
    correlation, of_n, of_g = shown(r"correlation of n and l0 ([\d.]+); n known to ([\d.]+)%, g at 20 mm to ([\d.]+)%")
    assert np.corrcoef(n, l0)[0, 1] == pytest.approx(correlation, abs=0.004)
    assert 100 * n.std() / N == pytest.approx(of_n, rel=0.15)  # 3.5 % of 400 samples, four times
    assert 100 * g.std() / g.mean() == pytest.approx(of_g, rel=0.15)


def test_the_best_of_many_gains() -> None:
    misses = np.random.default_rng(1).binomial(200, 0.01, (40_000, 20)).min(axis=1)
    (best,) = shown(r"the best gain misses in ([\d.]+)% of its runs")
    assert 100 * misses.mean() / 200 == pytest.approx(best, abs=0.006)


def test_every_figure_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(DOCS / "_ext")
    drawing = sys.modules.get("page_drawing") or __import__("page_drawing")
    names, figures = drawing.run_examples(TEXT), drawing.figures_of(TEXT)
    assert len(figures) == len(re.findall(r"^## ", TEXT, re.MULTILINE)) == 12
    for code in figures.values():
        assert drawing.draw(code, names).axes
