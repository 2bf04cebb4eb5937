"""The robots in examples/robots: each is projected, and its law runs."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pretouch.control import VirtualAdmittance
from pretouch.report import write_report
from pretouch.robots import (
    ComputedTorque,
    SensorSite,
    SiteLaw,
    load_model,
    make_data,
    project,
    project_site,
    simulate_robot,
)
from refusals import refused
from robot_scenes import CURVE, DISTANCE, arm_with_ball, controller, share

mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

EXAMPLES = Path(__file__).parents[2] / "examples/robots"


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.xml")), ids=lambda path: path.stem)
def test_an_example_is_projected(path: Path) -> None:
    table = project(load_model(path))
    assert table.projections
    assert all(p.reflected_mass > 0 for _, p in table.projections)


@pytest.mark.slow
def test_the_programs_of_the_page_run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(EXAMPLES.parents[1])
    blocks = re.findall(r"```python\n(.*?)```", Path("docs/how-to/robots.md").read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 6
    for block in blocks:
        exec(block, {})  # noqa: S102 - the page is ours
    printed = capsys.readouterr().out
    assert "D_p = -0.7463 N s" in printed
    assert "sole" in printed
    assert "contacts within 1 % of their prediction" in printed


def fallen_leg(speed: float):
    model = load_model(EXAMPLES / "leg.xml")
    data = make_data(model, keyframe="crouched")
    data.qpos[0] -= data.site("sole").xpos[2] - DISTANCE
    data.qvel[0] = -speed
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.slow
def test_a_hopping_leg_lands_with_its_designed_gain(monkeypatch: pytest.MonkeyPatch, capsys, tmp_path: Path) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    landing = __import__("landing").main()
    assert "limit of the constraint speed" in capsys.readouterr().out  # the drives and the workspace limit the design
    speeds = landing.simulated("sole", "relative_velocity"), landing.predicted("sole", "relative_velocity")
    assert share(*speeds) < 0.01
    assert abs(speeds[0][0]) < 0.25 * np.sqrt(0.7**2 + 2 * 9.81 * DISTANCE)
    projection = project_site(landing.model, make_data(landing.model, keyframe="crouched"), SensorSite("sole", CURVE))
    assert (1 - projection.recoil_share) * landing.simulated("sole", "excursion")[0] < projection.retreat
    # after the foot, the bent leg sits down on its shank and thigh; nothing else is warned of
    elsewhere = [touch.body for touch in landing.touches[0] if not touch.site]
    assert elsewhere == ["shank", "thigh"]
    assert [text[:5] for text in landing.warnings] == ["PT548"] * len(elsewhere)
    course = landing.predicted_courses()[0]
    trace = landing.trace()
    distances = np.interp(course.time, trace.time, trace.distance[:, 0])
    assert np.abs(distances - course.distance).max() < 1e-3  # one period at 1 m/s
    page = write_report(landing, tmp_path / "landing.html").read_text(encoding="utf-8")
    assert "torque of the drives" in page or "<svg" in page


def test_an_arm_meets_a_thrown_ball(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    example = __import__("thrown_ball")
    result = example.main()
    (site,) = result.sites
    detection = result.contacts[0][0].detection
    # The ball is thrown along x and falls freely, so that it is detected within one period after the flight.
    assert example.FLIGHT <= detection.time <= example.FLIGHT + 2e-3
    assert abs(detection.distance - example.DISTANCE) < 2 * 1e-3 * example.SPEED
    assert abs(result.simulated(site, "relative_velocity")[0]) < 0.2 * example.SPEED
    # The warning appears exactly if the deviation exceeds 5 %.
    deviation = share(result.simulated(site, "relative_velocity"), result.predicted(site, "relative_velocity"))
    assert any("PT507" in warning for warning in result.warnings) == (deviation > 0.05)
    # The trace follows the parabola of the throw until contact.
    trace = result.trace()
    before = trace.time < result.simulated(site, "time")[0]
    place = result.model.jnt_qposadr[result.model.body("ball").jntadr[0]]
    height = trace.configuration[before, place + 2]
    assert np.diff(height, 2) / np.diff(trace.time[before])[0] ** 2 == pytest.approx(-example.GRAVITY, rel=1e-3)


@pytest.mark.slow
def test_a_gripper_centers_itself_on_an_object(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    plain, centered = __import__("grasp").main()
    apart = [abs(float(np.diff([r.simulated(s, "time")[0] for s in r.sites])[0])) for r in (plain, centered)]
    assert apart[1] < 5e-3 < apart[0]
    place = centered.model.jnt_qposadr[centered.model.body("object").jntadr[0]]
    trace = centered.trace()
    until = trace.time <= max(centered.simulated(s, "time")[0] for s in centered.sites)
    pushed = trace.configuration[until, place]
    assert np.abs(pushed - pushed[0]).max() < 1e-3


def test_a_leg_lands_as_predicted() -> None:
    """The ground accelerates toward the falling leg by g; kappa is that of the start, while the leg bends by 30 deg."""
    model, data = fallen_leg(0.5)
    result = simulate_robot(model, data, [SiteLaw(site=SensorSite("sole", CURVE), controller=controller())])
    detection = result.contacts[0][0].detection
    assert detection.acceleration == pytest.approx(-9.81)
    assert detection.relative_velocity == pytest.approx(-0.5)
    assert detection.obstacle_mass == np.inf
    speeds = (result.simulated("sole", "relative_velocity"), result.predicted("sole", "relative_velocity"))
    assert share(*speeds) < 0.01
    # without the law, it would land at sqrt(v^2 + 2 g h)
    assert abs(speeds[0][0]) < 0.5 * np.sqrt(0.5**2 + 2 * 9.81 * DISTANCE)


def test_fingers_close_and_the_nearer_one_touches_first() -> None:
    model = load_model(EXAMPLES / "gripper.xml")
    law = replace(controller(-0.05), admittance=VirtualAdmittance(mass=0.2, damping=4.0, stiffness=25.0))
    laws = [SiteLaw(site=SensorSite(name, CURVE), controller=law, approach=0.05) for name in ("left", "right")]
    result = simulate_robot(model, make_data(model), laws)
    assert result.order() == ("right", "left")  # the object is 10 mm to the right
    detections = [contacts[0].detection for contacts in result.contacts]
    assert [d.distance for d in detections] == pytest.approx([0.059, 0.039])
    assert [d.relative_velocity for d in detections] == pytest.approx([-0.05, -0.05])
    # the first touch is that of the prediction; after it the object moves toward the other finger
    assert share(result.simulated("right", "relative_velocity"), result.predicted("right", "relative_velocity")) < 0.005
    assert share(result.simulated("right", "time"), result.predicted("right", "time")) < 0.005


@pytest.mark.slow
def test_several_processes_give_the_same_runs() -> None:
    model, data = arm_with_ball("bent", 0.6)
    law = SiteLaw(site=SensorSite("fingertip", CURVE), controller=controller())
    one = simulate_robot(model, data, [law], runs=3)
    assert simulate_robot(model, data, [law], runs=3, workers=2).contacts == one.contacts


@pytest.mark.parametrize(
    ("change", "fields"),
    [
        (lambda _: [], {"argument": "laws"}),
        (lambda law: [law, law], {"argument": "laws"}),
        (lambda law: [replace(law, controller=replace(law.controller, period=1.5e-3))], {"argument": "model"}),
        (lambda law: [replace(law, site=SensorSite("thumb", CURVE))], {"argument": "site", "value": "thumb"}),
        (lambda law: [replace(law, site=SensorSite("fingertip", CURVE, axis="+y"))], {"argument": "site 'fingertip'"}),
    ],
    ids=["no law", "twice", "period", "site", "axis"],
)
def test_laws_that_do_not_fit_the_model_are_refused(change, fields: dict[str, Any]) -> None:
    model, data = arm_with_ball("bent", 0.3)
    law = SiteLaw(site=SensorSite("fingertip", CURVE), controller=controller())
    with refused(**fields):
        simulate_robot(model, data, change(law))


def test_other_mistakes_are_refused() -> None:
    with refused("site 'fingertip'"):
        SiteLaw(site=SensorSite("fingertip"), controller=controller())
    with refused("model_error", value=-1.0):
        ComputedTorque(model_error=-1.0)
    model, data = arm_with_ball("bent", 0.6)
    result = simulate_robot(model, data, [SiteLaw(site=SensorSite("fingertip", CURVE), controller=controller())])
    with refused("site", value="thumb", limit=("fingertip",)):
        result.simulated("thumb", "time")
    with refused("run", value=1):
        result.trace(1)
