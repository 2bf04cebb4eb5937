"""The animation in a report shows the motion that was computed, and stands still if the reader asks for it."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

import pretouch as pt
from pretouch.report import report_html
from pretouch.report.encounter_animation import encounter_animation, lane
from pretouch.report.motion_figures import lanes_of

CURVE = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
SCENARIO = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
)
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
LAST = 0.8  # of the period, when the last frame begins: it stays for a quarter of the shown time
PIXEL = 0.1  # positions are written with one decimal


@pytest.fixture(scope="module")
def design() -> pt.designs.GainDesign:
    objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
    return pt.design(pt.Task(SCENARIO, CURVE, objective, bounds=(-10.0, -0.01)))


def frames(page: str, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the keyframes of a shape: shares of the period, and the last number of each transform."""
    rule = re.search(rf"@keyframes encounter-{name} {{ (.*) }}\n", page)
    assert rule is not None
    rows = re.findall(r"([\d.e-]+)% { transform: .*?\((-?[\d.]+)(?:px)?\); }", rule[1])
    return np.array([float(at) for at, _ in rows]) / 100, np.array([float(value) for _, value in rows])


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1])
def test_frames_show_the_distance_and_speed_of_the_motion(design: pt.designs.GainDesign, number: int) -> None:
    lanes, _ = lanes_of(design)
    page, shown = report_html(design), lanes[number]
    end = max(lane.time[-1] for lane in lanes)
    at, robot = frames(page, f"robot-{number}")
    _, obstacle = frames(page, f"object-{number}")
    _, speed = frames(page, f"speed-{number}")
    assert at[-2] == pytest.approx(LAST, abs=1e-4)
    times = at[:-1] / LAST * end
    motion = pt.solve_motion(SCENARIO, CURVE, design.gain if number else 0.0, samples=2000)
    gap = (obstacle - robot)[:-1]
    distance = np.interp(times, motion.time, motion.distance)
    assert gap == pytest.approx(distance * gap[0] / SCENARIO.distance, abs=3 * PIXEL)
    assert speed[:-1] == pytest.approx(np.interp(times, motion.time, -motion.relative_velocity) / 0.3, abs=5e-3)
    assert times[-1] >= shown.time[-1]


def test_runs_have_the_colors_and_the_contacts_of_the_figure(design: pt.designs.GainDesign) -> None:
    lanes, _ = lanes_of(design)
    assert [lane.style for lane in lanes] == [1, 0]
    page = report_html(design)
    assert "no mitigation: contact at 0.3 m/s after 141 ms" in page
    assert "contact at 0.0791 m/s after 464 ms" in page


@pytest.mark.parametrize(("duration", "choices"), [(0.46, 3), (4.0, 2), (0.0, 3), (1e6, 2)])
def test_slow_motion_is_offered_only_for_short_encounters(duration: float, choices: int) -> None:
    time, distance = np.array([0.0, duration]), np.array([0.02, 0.02])
    shown = lane(
        "a <run>",
        0,
        pt.Obstacle(position=0.02),
        time=time,
        distance=distance,
        relative_velocity=0 * time,
        ends_with_contact=False,
    )
    page = encounter_animation([shown], CURVE)
    assert page.count("<input") == choices
    assert "a &lt;run&gt;: no contact" in page
    assert "nan" not in page
    assert "inf " not in page


def test_the_field_of_a_curve_that_is_valid_on_a_short_range_only_is_drawn() -> None:
    """The shapes show distances from 0, and beyond the range of the curve where the object retreats."""
    short = replace(CURVE, minimum_distance=0.01, maximum_distance=0.03)
    time, distance = np.array([0.0, 0.2]), np.array([0.0, 0.1])
    shown = lane(
        "a",
        0,
        pt.Obstacle(position=0.02),
        time=time,
        distance=distance,
        relative_velocity=0 * time,
        ends_with_contact=False,
    )
    page = encounter_animation([shown], short)
    stops = [float(value) for value in re.findall(r'stop-opacity="([^"]+)"', page)]
    assert stops[0] > stops[-1] > 0
    assert stops == sorted(stops, reverse=True)


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_the_animation_moves_unless_the_reader_prefers_no_motion(design: pt.designs.GainDesign) -> None:
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        for preference, running in (("no-preference", {"running"}), ("reduce", set())):
            page = browser.new_page(reduced_motion=preference, viewport={"width": 390, "height": 900})
            page.set_content(report_html(design))
            states = "[...new Set(document.getAnimations().map((one) => one.playState))]"
            assert set(page.evaluate(states)) == running
            assert page.evaluate("document.documentElement.scrollWidth") <= 390
        page = browser.new_page(reduced_motion="no-preference")
        page.set_content(report_html(design))
        period = "document.getAnimations()[0].effect.getTiming().duration"
        slow = page.evaluate(period)
        page.check("#encounter-real")
        assert slow == pytest.approx(10 * page.evaluate(period), rel=1e-3)
        page.check("#encounter-still")
        assert set(page.evaluate(states)) == {"paused"}
        browser.close()
