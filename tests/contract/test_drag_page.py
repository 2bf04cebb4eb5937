"""What the design of a drag says, row by row, beside closed forms and an integrator; and what a gain's says of it."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import expi

import pretouch as pt
from figure_checks import assert_legible
from page_checks import assert_sound
from page_rows import line, row, table
from pretouch._core.errors import ResultUnavailableError
from pretouch._core.vocabulary import words_for
from pretouch.cli import main
from pretouch.designs.drag import drag_by, drag_trade_off
from pretouch.designs.drag.page import drag_page
from pretouch.report import plots, report_html
from refusals import refused
from verification_samples import BOUNDS, NOISY, OBJECTIVE, SCENARIO, SENSOR

L_0, N, L_D, V = 0.0419, 3.32, 0.0422, 0.3
U_OF = 1 / (L_0 + L_D)
DIGITS = 5e-4  # relative: half a unit of the last of the four digits that a page shows, at most
FACTORS = {"m": 1.0, "mm": 1e-3, "s": 1.0, "ms": 1e-3, "m/s": 1.0, "mm/s": 1e-3, "m/s\u00b2": 1.0, "N": 1.0, "%": 0.01}
TASK = pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, drag_effect=pt.DragEffect(ratio=0.15))


def excursion(phi: float, distance: float = L_D) -> float:
    """E of docs/explanation/drag.md, by exponential integrals; M = 1 kg."""
    c = phi * N**2
    near, far = c / L_0, c / (L_0 + distance)
    return c * np.exp(-far) * (expi(near) - expi(far)) - L_0 * (np.exp(near - far) - 1)


def share(phi: float, distance: float = L_D) -> float:
    return float(np.exp(-phi * N**2 * (1 / L_0 - 1 / (L_0 + distance))))


def peak(phi: float, distance: float = L_D) -> float:
    """The largest acceleration over v^2 of a strong drag: at u = 1, or at the nearer end."""
    c = phi * N**2
    far = c / (L_0 + distance)
    u = float(np.clip(1.0, far, c / L_0))
    return u**2 / c * np.exp(-2 * (u - far))


def followed(phi: float, push: float, speed: float = V) -> tuple[float, float]:
    """Integrate l'' = -A + phi g^2 l'^2 in time: contact speed and time."""

    def change(_: float, state: Any) -> tuple[float, float]:
        return state[1], -push + phi * (N / (state[0] + L_0)) ** 2 * state[1] ** 2

    def contact(_: float, state: Any) -> float:
        return float(state[0])

    contact.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(change, (0.0, 60.0), (L_D, -speed), "DOP853", rtol=1e-11, atol=1e-13, events=contact)
    return -float(run.y_events[0][0][1]), float(run.t_events[0][0])


def si(cell: str) -> float:
    number, _, unit = cell.partition(" ")
    return float(number) * FACTORS[unit]


def shown(cells: list[str]) -> list[float]:
    return [si(cell) for cell in cells]


def near(*values: float) -> Any:
    return pytest.approx(list(values), rel=DIGITS)


PHI = np.log(1 / 0.15) / (N**2 * (1 / L_0 - U_OF))


@pytest.fixture(scope="module")
def design() -> Any:
    return pt.design(TASK)


@pytest.fixture(scope="module")
def page(design: Any) -> str:
    return report_html(design)


def test_the_contact_stands_beside_none_and_the_letters_optimum(design: Any, page: str) -> None:
    gain = pt.designs.design_gain(TASK).result.contact
    assert design.drag == pytest.approx(PHI, rel=1e-12)
    assert design.gain == design.drag
    assert table(page, "The contact")[0][1:] == [
        "without mitigation",
        f"\u03c6 = {PHI:.4g} N s\u00b2",
        "the letter's optimum, D_p = -0.7463 N s",
    ]
    assert shown(row(page, "contact speed", "The contact")) == near(V, 0.15 * V, -gain.relative_velocity)
    assert shown(row(page, "share of the approach speed", "The contact")) == pytest.approx(
        [1.0, 0.15, -gain.relative_velocity / V], rel=2e-3
    )  # three digits
    assert shown(row(page, "excursion", "The contact")) == near(0.0, excursion(PHI), -gain.displacement)
    peaks = (0.0, peak(PHI) * V**2, gain.largest_acceleration)
    assert shown(row(page, "largest acceleration", "The contact")) == near(*peaks)
    assert row(page, "distance of the largest acceleration") == ["", "42.2 mm", ""]
    assert shown(row(page, "time", "The contact")) == near(L_D / V, followed(PHI, 0.0)[1], gain.time)
    ratios = row(page, "relative to the smallest possible excursion")
    runs = ((0.15 * V, excursion(PHI), peaks[1]), (-gain.relative_velocity, -gain.displacement, peaks[2]))
    least = [e / ((V - w) ** 2 / (2 * a)) for w, e, a in runs]  # (|v| - w)^2 / 2A: docs/how-to/trade-offs.md
    assert ratios[0] == "\u2013"
    assert [float(cell) for cell in ratios[1:]] == pytest.approx(least, rel=5e-3)  # three digits


def test_every_speed_has_its_row(page: str) -> None:
    head, *rows = table(page, "Effect at every approach speed")
    assert head[1:5] == ["contact speed", "excursion", "largest acceleration", "time"]
    assert [si(cells[0]) for cells in rows] == [0.05, 0.1, 0.3, 1.0]
    for cells in rows:
        v, *found = shown(cells)
        assert found[:4] == near(0.15 * v, excursion(PHI), peak(PHI) * v**2, followed(PHI, 0.0, v)[1])
        encounter = replace(SCENARIO, obstacle=pt.Obstacle(position=L_D, velocity=-v))
        letter = pt.find_contact(encounter, SENSOR, pt.designs.design_gain(TASK).gain).contact
        assert found[4:] == near(-letter.relative_velocity, -letter.displacement, letter.largest_acceleration)


def test_the_guarantee_is_met_with_equality_by_the_worst_object(page: str) -> None:
    _, *rows = table(page, "Guaranteed contact speed")
    assert [si(cells[0]) for cells in rows] == [0.0, 0.5, 1.0, 2.0, 5.0]
    for cells in rows:
        push, bound, free = shown(cells)
        assert [bound, free] == near(followed(PHI, push)[0], np.sqrt(V**2 + 2 * push * L_D))
    assert "The plant follows the virtual object of mass M exactly" in page


def test_what_is_seen_nearer_is_touched_faster(page: str) -> None:
    _, *rows = table(page, "Other detection distances")
    assert [si(cells[0]) / L_D for cells in rows] == near(0.5, 0.75, 1.0, 1.25, 1.5, 2.0)
    for cells, part in zip(rows, (0.5, 0.75, 1.0, 1.25, 1.5, 2.0), strict=True):
        far = part * L_D
        assert shown(cells)[1:4] == near(V * share(PHI, far), excursion(PHI, far), peak(PHI, far) * V**2)
        encounter = replace(SCENARIO, obstacle=pt.Obstacle(position=far, velocity=-V))
        letter = pt.find_contact(encounter, SENSOR, pt.designs.design_gain(TASK).gain).contact
        assert shown(cells)[4:] == near(-letter.relative_velocity, -letter.displacement, letter.largest_acceleration)


def test_text_and_notebook_say_the_same(design: Any) -> None:
    text = str(design)
    assert text.splitlines()[0] == (
        f"With the virtual drag \u03c6 = {PHI:.4g} N s\u00b2, the contact speed is 15 % of every approach speed, after "
        f"an excursion of {1e3 * excursion(PHI):.4g} mm. For 0.3 m/s: contact at 0.045 m/s."
    )
    assert line(text, "excursion").split("mm")[1].strip() == f"{1e3 * excursion(PHI):.4g}"
    assert f"{1e3 * excursion(PHI):.4g} mm" in design._repr_html_()
    assert repr(design) == f"<DragDesign: {design.headline}>"
    told = design.to_dict()
    assert (told["drag"], told["holds"], told["contact"]["status"]) == (design.drag, True, "contact")


OTHERS = {
    "no objective": TASK.replace(objective=None),
    "bounds of a drag": TASK.replace(law="virtual-drag", bounds=(1e-4, 1.0)),
    "by acceleration": TASK.replace(drag_effect=pt.DragEffect(acceleration=20.0, largest_speed=2.0)),
    "by force": TASK.replace(
        drag_effect=pt.DragEffect(impact_force=5.0), impact=pt.SpringImpact(robot_mass=2.0, stiffness=1e4)
    ),
    "nothing to do": TASK.replace(drag_effect=pt.DragEffect(contact_speed=0.4)),
    "a limit": TASK.replace(constraints=[pt.Constraint(name="acceleration", limit=1.0)]),
    "a table": TASK.replace(sensor=pt.Table(distances=(0.0, 0.01, 0.02, 0.045), outputs=(8.0, 4.0, 2.0, 1.0))),
    "pushed": TASK.replace(
        scenario=replace(SCENARIO, obstacle=pt.Obstacle(position=L_D, velocity=-V, acceleration=-0.5))
    ),
    "braking": TASK.replace(
        scenario=replace(SCENARIO, obstacle=pt.Obstacle(position=L_D, velocity=-V, acceleration=3.0))
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_pages_and_figures_are_sound_whatever_was_asked(name: str) -> None:
    found = pt.design(OTHERS[name])
    assert_sound(report_html(found))
    assert_legible(plots.drag(found))
    assert str(found).startswith("With the virtual drag φ = ")


def test_the_weakest_by_force_shows_its_force() -> None:
    task = OTHERS["by force"]
    found = pt.design(task)
    assert found.largest_speed == V  # that of the encounter, where none was said
    assert row(report_html(found), "impact force", "The contact")[1] == "5 N"
    w = 5.0 / np.sqrt(2.0 * 1e4)  # v sqrt(m k) for a spring
    assert found.ratio == pytest.approx(w / V, rel=1e-9)
    assert row(report_html(found), "the drag is chosen by its impact force") == ["5 N, up to 0.3 m/s"]


def test_what_does_not_hold_is_said() -> None:
    broken = pt.design(OTHERS["a limit"])
    assert row(report_html(broken), "largest plant acceleration", "Constraints") == [
        "2.016 m/s\u00b2",
        "1 m/s\u00b2",
        "exceeded",
    ]
    assert not broken.holds
    pushed = pt.design(OTHERS["pushed"])
    assert "accelerates toward the robot at 0.5 m/s\u00b2" in str(pushed)
    assert shown(row(report_html(pushed), "contact speed", "The contact")[1:2]) == near(followed(PHI, 0.5)[0])
    assert "no contact" in pt.design(OTHERS["braking"]).headline
    slow = pt.design(TASK.replace(drag_effect=pt.DragEffect(acceleration=2.0, largest_speed=0.1)))
    assert "for approach speeds up to 0.1 m/s, but this object approaches at 0.3 m/s" in str(slow)


def test_what_accelerates_is_the_object_relative_to_the_reference() -> None:
    for own, theirs, said in (
        (0.5, 0.5, ()),
        (0.5, 0.0, ("toward the robot at 0.5 m/s\u00b2",)),
        (0.0, 0.05, ("away from the robot",)),
    ):
        bodies = {
            "obstacle": replace(SCENARIO.obstacle, acceleration=theirs),
            "reference": pt.Reference(acceleration=own),
        }
        warnings = drag_page(pt.design(TASK.replace(scenario=replace(SCENARIO, **bodies)))).warnings
        assert len(warnings) == len(said)
        assert all(words in text for words, text in zip(said, warnings, strict=True))


@pytest.mark.parametrize(
    ("limit", "acceleration", "largest_speed", "good", "said"),
    [
        (4.0, 0.0, None, True, ()),
        (2.02, 0.0, 0.3, True, ()),
        (2.01, 0.0, 0.31, False, ()),
        (4.0, -0.5, None, True, ("accelerates toward the robot at 0.5 m/s\u00b2",)),
        (4.0, 0.05, None, True, ("accelerates away from the robot at 0.05 m/s\u00b2",)),
        (4.0, 0.0, 0.29, True, ("up to 0.29 m/s, but this object approaches at 0.3 m/s",)),
    ],
)
def test_a_drag_is_warned_of_where_it_must_be_and_nowhere_else(
    limit: float, acceleration: float, largest_speed: float | None, good: bool, said: tuple[str, ...]
) -> None:
    """Its largest acceleration is 2.016 m/s^2 for the object in uniform motion."""
    scenario = replace(SCENARIO, obstacle=replace(SCENARIO.obstacle, acceleration=acceleration))
    limits = (pt.Constraint(name="acceleration", limit=limit),)
    effect = pt.DragEffect(ratio=0.15)
    if largest_speed is not None:  # the same drag at the speed of the encounter
        effect = pt.DragEffect(contact_speed=0.15 * largest_speed, largest_speed=largest_speed)
    found = pt.design(TASK.replace(scenario=scenario, constraints=limits, drag_effect=effect))
    page = drag_page(found)
    assert (page.good, page.status) == (good, "drag found" if good else "a limit is exceeded")
    assert len(page.warnings) == len(said)
    assert all(words in text for words, text in zip(said, page.warnings, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "name", "limit"),
    [
        ("excursion", "excursion", 0.05),
        ("contact_speed", "relative_velocity", 0.07),
        ("acceleration", "acceleration", 1.9),
        ("impact_force", "impact_force", 7.0),
    ],
)
def test_a_drag_keeps_the_limit_that_it_is_made_for(effect: str, name: str, limit: float) -> None:
    task = TASK.replace(
        drag_effect=pt.DragEffect(**{effect: limit}),
        constraints=[pt.Constraint(name=name, limit=limit), pt.Constraint(name="gain", limit=0.1)],
        impact=pt.SpringImpact(robot_mass=2.0, stiffness=1e4),
    )
    found = pt.design(task)
    assert found.holds
    cells = row(report_html(found), words_for(task.limits[0].quantity), "Constraints")
    assert shown(cells[:2]) == near(limit, limit)
    assert cells[2] == "met"
    assert row(report_html(found), "gain", "Constraints") == ["", "0.1 N s", "does not apply: a limit of D_p"]


@pytest.mark.parametrize(
    ("task", "fields"),
    [
        (TASK.replace(drag_effect=None), {"argument": "drag_effect"}),
        (TASK.replace(scenario=replace(SCENARIO, plant=pt.Plant(velocity=-0.1))), {"argument": "scenario"}),
        (
            TASK.replace(
                scenario=replace(SCENARIO, obstacle=replace(SCENARIO.obstacle, course=(pt.motion.Stretch(until=0.1),)))
            ),
            {"argument": "scenario"},
        ),
        (
            TASK.replace(scenario=replace(SCENARIO, obstacle=pt.Obstacle(position=L_D, velocity=0.1))),
            {"argument": "scenario"},
        ),
        (
            TASK.replace(
                scenario=replace(SCENARIO, obstacle=pt.Obstacle(position=L_D, velocity=np.array([-0.1, -0.2])))
            ),
            {"argument": "scenario"},
        ),
    ],
)
def test_a_task_without_a_drag_is_refused(task: Any, fields: dict[str, Any]) -> None:
    with refused(**fields):
        pt.designs.design_drag(task)


def test_a_drag_without_an_encounter_has_no_page() -> None:
    plain, many = drag_by(SENSOR, L_D, 1.0, ratio=0.15), drag_trade_off(SENSOR, L_D, 1.0)
    assert (str(many), many._repr_html_()) == ("<DragDesign: 99 drags>", None)
    assert str(plain) == repr(plain)
    with refused("drag", error=ResultUnavailableError):
        report_html(plain)


def test_a_gain_says_what_a_drag_would_do() -> None:
    design = pt.designs.design_gain(TASK)
    own = design.result.contact
    phi = brentq(lambda phi: excursion(phi) + own.displacement, 1e-4, 0.1, xtol=1e-16, rtol=1e-14)
    found = report_html(design)
    title = "Comparison with the virtual drag"
    weak = np.log(-V / own.relative_velocity) / (N**2 * (1 / L_0 - U_OF))
    speeds, ways = (-own.relative_velocity, V * share(phi)), (-own.displacement, excursion(weak))
    assert shown(row(found, "contact speed", title)) == near(speeds[0], speeds[1], speeds[0])
    assert shown(row(found, "excursion", title)) == near(ways[0], ways[0], ways[1])
    peaks = near(own.largest_acceleration, peak(phi) * V**2, peak(weak) * V**2)
    assert shown(row(found, "largest acceleration", title)) == peaks
    (said,) = re.findall("^With a virtual drag.*$", str(design), re.MULTILINE)
    assert said == (
        f"With a virtual drag of \u03c6 = {phi:.4g} N s\u00b2, the excursion would be the same. The contact speed "
        f"would be {speeds[1]:.4g} m/s instead of {speeds[0]:.4g} m/s. The largest acceleration would be "
        f"{peak(phi) * V**2:.4g} m/s\u00b2 instead of {own.largest_acceleration:.4g} m/s\u00b2. With this virtual "
        f"drag, the contact speed is {100 * share(phi):.3g} % of every approach speed."
    )


def test_an_object_that_accelerates_is_compared_as_it_does() -> None:
    design = pt.designs.design_gain(OTHERS["pushed"])
    own = design.result.contact

    def gone(phi: float) -> float:
        time = followed(phi, 0.5)[1]
        return V * time + 0.25 * time**2 - L_D + own.displacement  # where the object is, behind the start

    phi = brentq(gone, 1e-3, 0.1, xtol=1e-12)
    speed = shown(row(report_html(design), "contact speed", "Comparison with the virtual drag"))
    assert speed == near(-own.relative_velocity, followed(phi, 0.5)[0])
    assert "every other approach speed" not in str(design)


SILENT = {
    "an object that brakes": OTHERS["braking"],
    "a plant that moves": TASK.replace(scenario=replace(SCENARIO, plant=pt.Plant(velocity=-0.05))),
    "a plant away from its reference": TASK.replace(
        scenario=replace(SCENARIO, plant=pt.Plant(position=-0.01), reference=pt.Reference(position=0.0))
    ),
    "a loop": TASK.replace(loop=NOISY),
    "on a loop": TASK.replace(evaluate=NOISY, bounds=(-1.0, -0.5)),
    "a drag itself": TASK.replace(law="virtual-drag", bounds=(1e-3, 0.1)),
    "a limit that it breaks": TASK.replace(constraints=[pt.Constraint(name="speed", limit=0.23)]),
    "no gain at all": TASK.replace(constraints=[pt.Constraint(name="relative_velocity", limit=1e-5)]),
    "a curve that ends": TASK.replace(sensor=replace(SENSOR, minimum_distance=1e-4)),
}


@pytest.mark.slow(keep=4)
@pytest.mark.parametrize("name", SILENT)
def test_nothing_is_said_of_a_drag_where_it_is_not_known_or_no_better(name: str) -> None:
    assert "virtual drag" not in str(pt.designs.design_gain(SILENT[name]))


def test_a_custom_curve_that_turns_before_the_start_has_neither_gain_nor_drag() -> None:
    """Beyond 28.6 mm the virtual force would have the wrong sign. A gain was designed all the same."""
    turning = pt.CustomSensor(
        log_output_function=lambda distance: (700 * distance - 40) * distance,
        log_slope_function=lambda distance: 1400 * distance - 40,
    )
    with refused("sensor"):
        pt.designs.design_gain(TASK.replace(sensor=turning))
    nearer = replace(SCENARIO, obstacle=pt.Obstacle(position=0.028, velocity=-0.3))
    assert "Optimal gain" in str(pt.designs.design_gain(TASK.replace(sensor=turning, scenario=nearer)))


@pytest.mark.slow
def test_the_command_shows_the_drag_of_a_file_with_an_effect(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, code in (("pushed", 0), ("a limit", 1), ("braking", 1)):
        monkeypatch.setattr("pretouch.config.load_scenario", lambda _, name=name: OTHERS[name])
        monkeypatch.setattr(sys, "argv", ["pretouch", "design", "drag.toml"])
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code == code
        told = capsys.readouterr().out
        assert told.startswith("With the virtual drag φ = ")
        assert "Optimal gain" not in told
        assert Path("drag-design.html").exists()
