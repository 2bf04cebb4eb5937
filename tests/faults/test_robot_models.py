"""Robot models with mistakes: each is refused with one sentence that names what is wrong."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import pretouch as pt
from pretouch.errors import MissingExtraError
from pretouch.robots import (
    SensorSite,
    load_model,
    make_data,
    project,
    project_site,
    project_workspace,
    random_postures,
    simulate_robot,
)
from refusals import refused

ARM = Path(__file__).parents[2] / "examples/robots/arm.xml"
SITE = SensorSite("fingertip", axis=(0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("arguments", "fields"),
    [
        ({"axis": "x"}, {"argument": "axis", "value": "x"}),
        ({"axis": (1.0, 1.0, 0.0)}, {"argument": "axis"}),
        ({"axis": (0.0, 0.0, 0.0)}, {"argument": "axis"}),
        ({"axis": (1.0, 0.0)}, {"argument": "axis", "value": (1.0, 0.0)}),
        ({"axis": (1.0, float("nan"), 0.0)}, {"argument": "axis"}),
        ({"field_of_view": "200 deg"}, {"argument": "field_of_view"}),
        ({"field_of_view": "8 mm"}, {"argument": "field_of_view", "value": "8 mm"}),
        ({"hold": "nothing"}, {"argument": "hold", "value": "nothing"}),
    ],
)
def test_a_site_with_a_mistake_is_refused(arguments, fields: dict[str, Any]) -> None:
    with refused(**fields) as caught:
        SensorSite("fingertip", **arguments)
    assert "\n" not in str(caught.value)


def test_a_site_takes_a_unit_vector_and_an_angle_with_its_unit() -> None:
    site = SensorSite("fingertip", axis=(0.6, 0.0, -0.8), field_of_view="8 deg")
    assert site.direction.tolist() == [0.6, 0.0, -0.8]
    assert site.field_of_view == pytest.approx(0.13962634)


def test_without_mujoco_the_message_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with refused("mujoco", error=MissingExtraError, remedy="pip install 'pretouch[mujoco]'"):
        load_model(ARM)


mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

ONE_JOINT = """
<mujoco><worldbody><geom name="wall" type="box" size="0.1 0.1 0.1" pos="9 0 0"/><site name="fixed"/>
<body><joint name="a" type="{kind}" axis="1 0 0" range="{range}" limited="{limited}"/>
<geom name="finger" type="capsule" fromto="0 0 0 0.1 0 0" size="0.02"/><site name="tip" pos="{place} 0 0"/></body>
</worldbody><actuator>{motor}</actuator></mujoco>"""
GOOD = {
    "kind": "slide",
    "range": "-0.1 0.1",
    "limited": "true",
    "place": "0.12",
    "motor": '<motor joint="a" ctrlrange="-5 5"/>',
}


def model_of(**changes: str):
    return mujoco.MjModel.from_xml_string(ONE_JOINT.format(**{**GOOD, **changes}))


def test_the_model_without_changes_is_accepted() -> None:
    model = model_of()
    assert project_site(model, make_data(model), SensorSite("tip")).retreat == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("changes", "site", "fields"),
    [
        ({}, SensorSite("toe"), {"argument": "site", "value": "toe"}),
        ({}, SensorSite("fixed"), {"argument": "site", "value": "fixed"}),
        ({}, SensorSite("tip", axis="+y"), {"argument": "site 'tip'"}),
        ({"motor": ""}, SensorSite("tip"), {"argument": "actuators"}),
        (
            {"kind": "ball", "limited": "false", "motor": '<motor joint="a" gear="1 0 0"/>'},
            SensorSite("tip"),
            {"argument": "joint 'a'"},
        ),
        ({"range": "0.05 0.1"}, SensorSite("tip"), {"argument": "posture a", "value": 0.0, "limit": (0.05, 0.1)}),
    ],
    ids=["unknown site", "fixed site", "other direction", "no actuator", "ball", "out of range"],
)
def test_a_model_that_cannot_be_projected_is_refused(
    changes: dict[str, str], site: SensorSite, fields: dict[str, Any]
) -> None:
    model = model_of(**changes)
    with refused(**fields) as caught:
        project_site(model, make_data(model), site)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("shape", "place", "covered"),
    [
        ('type="sphere" size="0.1"', 0.0999, True),
        ('type="sphere" size="0.1"', 0.1, False),
        ('type="sphere" size="0.1"', 0.12, False),
        ('type="box" size="0.1 0.1 0.1"', 0.05, True),
        ('type="cylinder" size="0.1 0.1"', 0.05, True),
        ('type="cylinder" size="0.1 0.1"', 0.1, False),
        ('type="ellipsoid" size="0.1 0.2 0.3"', 0.09, True),
        ('type="ellipsoid" size="0.1 0.2 0.3"', 0.11, False),
        ('type="mesh" mesh="cube"', 0.05, True),
        ('type="mesh" mesh="cube"', 0.11, False),
        ('type="box" size="0.1 0.1 0.1" contype="0" conaffinity="0"', 0.05, False),
    ],
)
def test_a_site_inside_a_shape_is_taken_to_its_surface(shape: str, place: float, covered: bool) -> None:
    corners = " ".join(f"{x} {y} {z}" for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1))
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><asset><mesh name="cube" vertex="{corners}"/></asset><worldbody><body>
        <joint name="a" type="slide" axis="1 0 0" range="-1 1" limited="true"/><geom name="shell" {shape}/>
        <geom size="0.01" mass="1" pos="-1 0 0"/><site name="tip" pos="{place} 0 0"/></body></worldbody>
        <actuator><motor joint="a" ctrlrange="-5 5"/></actuator></mujoco>"""
    )
    projection = project_site(model, make_data(model), SensorSite("tip"))
    assert projection.retreat == pytest.approx(1.0)
    assert projection.position[0] == pytest.approx(
        0.1 if covered else place, abs=1e-8
    )  # meshes are stored in single precision
    assert [text[:5] for text in projection.warnings if "PT544" in text] == ["PT544"] * covered
    assert "'shell'" in "".join(projection.warnings) or not covered


HEAVY = '<option gravity="-9.81 0 0"/><worldbody>'


def test_the_joint_that_the_drives_cannot_hold_is_named() -> None:
    text = ONE_JOINT.format(**{**GOOD, "motor": '<motor name="weak" joint="a" ctrlrange="-0.1 0.1"/>'})
    model = mujoco.MjModel.from_xml_string(text.replace("<worldbody>", HEAVY, 1))
    projection = project_site(model, make_data(model), SensorSite("tip"))
    weight = 9.81 * float(model.body_mass.sum())
    (said,) = (text for text in projection.warnings if "PT546" in text)
    assert f"joint a lacks {weight - 0.1:.3g} of {weight:.3g} N" in said
    assert "weak" in said
    for limits in (projection.acceleration, projection.speed, projection.force):
        assert (limits.ahead, limits.back) == (0.0, 0.0)
    assert projection.reflected_mass == pytest.approx(float(model.body_mass.sum()))
    with refused("speed"):
        projection.constraints()


def test_a_weak_joint_that_does_not_move_the_site_does_not_matter() -> None:
    slide = '<joint name="{}" type="slide" axis="{}" range="-1 1" limited="true"/><geom size="0.1"/>'
    other = f'<body pos="0 1 0">{slide.format("b", "1 0 0")}</body>'
    bodies = f'<body pos="0 0 1">{slide.format("c", "0 0 1")}'
    text = ONE_JOINT.format(**GOOD).replace('ctrlrange="-5 5"', 'ctrlrange="-50 50"').replace("<worldbody>", HEAVY, 1)
    both = text.replace("<body>", bodies + other + "<body>", 1).replace("</worldbody>", "</body></worldbody>")
    motors = '<motor joint="b" ctrlrange="-0.1 0.1"/><motor joint="c" ctrlrange="-9 9"/></actuator>'
    model = mujoco.MjModel.from_xml_string(both.replace("</actuator>", motors))
    projection = project_site(model, make_data(model), SensorSite("tip"))
    assert not any("PT546" in text for text in projection.warnings)
    assert projection.acceleration.least > 0


def test_a_slide_without_a_range_is_said() -> None:
    model = model_of(limited="false")
    projection = project_site(model, make_data(model), SensorSite("tip"))
    assert [text[:5] for text in projection.warnings] == ["PT508"]
    with refused("joint 'a'"):
        random_postures(model, SensorSite("tip"), 3)


@pytest.mark.parametrize(
    ("options", "fields"),
    [
        ({"posture": {"knee": 1.0}}, {"argument": "posture", "value": "knee"}),
        ({"posture": {"elbow": "1 mm"}}, {"argument": "posture elbow", "value": "1 mm"}),
        ({"keyframe": "folded"}, {"argument": "keyframe", "value": "folded"}),
        ({"keyframe": 7}, {"argument": "keyframe", "value": 7}),
    ],
)
def test_an_unknown_posture_is_refused(options, fields: dict[str, Any]) -> None:
    with refused(**fields):
        make_data(load_model(ARM), **options)


def test_a_file_that_is_no_model_is_refused(tmp_path: Path) -> None:
    with refused("model", value=str(tmp_path / "no.xml")):
        load_model(tmp_path / "no.xml")
    (tmp_path / "text.xml").write_text("<mujoco><worldbody><nonsense/></worldbody></mujoco>")
    with refused("model", value=str(tmp_path / "text.xml")) as caught:
        load_model(tmp_path / "text.xml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "verb",
    [
        project,
        make_data,
        lambda model: project_site(model, None, SITE),
        lambda model: project_workspace(model, SITE, [{}]),
        lambda model: random_postures(model, SITE, 2),
        lambda model: simulate_robot(model, None, []),
    ],
)
@pytest.mark.parametrize("model", ["arm.xml", None, 1.0])
def test_what_is_no_model_is_named(verb: Callable[[Any], Any], model: Any) -> None:
    with refused("model", value=model):
        verb(model)


def test_an_overview_needs_a_site_that_can_be_projected() -> None:
    with refused("site"):
        project(model_of(motor=""))
    with refused("site"):
        project(mujoco.MjModel.from_xml_string("<mujoco><worldbody/></mujoco>"))


def test_a_joint_without_speed_is_refused() -> None:
    model = load_model(ARM)
    with refused("joint_speeds", value="knee"):
        project_site(model, make_data(model, keyframe="bent"), SensorSite("fingertip"), joint_speeds={"knee": 1.0})


def slide_by(motor: str) -> Any:
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="base" type="slide" axis="1 0 0"/>
        <geom size="0.05" mass="2"/><body pos="0.1 0 0"><joint name="s" type="slide" axis="1 0 0" range="-1 1"/>
        <geom size="0.02" mass="1"/><site name="tip"/></body></body></worldbody>
        <actuator>"""
        + motor
        + "</actuator></mujoco>"
    )
    return project_site(model, make_data(model), SensorSite("tip"))


def test_a_site_that_a_held_direction_stops_names_the_option_hold() -> None:
    model = load_model(ARM)
    stretched = project_site(model, make_data(model), SensorSite("fingertip", axis="+z", hold="pose"))
    ahead, back = stretched.excursion
    with refused("excursion") as error:
        replace(stretched, excursion=(ahead, replace(back, length=0.0))).constraints()
    assert 'hold = "axis"' in str(error.value)
    (limit,) = (limit for limit in stretched.constraints() if limit.name == "excursion")
    assert limit.source == 'the posture becomes singular with hold = "pose"; try hold = "axis"'


def test_drives_that_push_in_one_direction_only_are_named() -> None:
    one = slide_by('<motor name="m" joint="s" ctrlrange="0 40"/>')
    assert (one.acceleration.least, one.force.least) == pytest.approx((0.0, 0.0))
    (warning,) = (text for text in one.warnings if text.startswith("PT627"))
    assert "away from objects (control range of m)" in warning
    assert not any("PT627" in text for text in slide_by('<motor joint="s" ctrlrange="-1 40"/>').warnings)


def test_a_joint_whose_actuator_has_gear_zero_is_named_as_passive() -> None:
    motors = '<motor joint="s" ctrlrange="-9 9"/><motor name="idle" joint="base" {}/>'
    (warning,) = (text for text in slide_by(motors.format('gear="0"')).warnings if "PT503" in text)
    assert "base with gear 0 of idle" in warning
    assert not any("PT503" in text for text in slide_by(motors.format("")).warnings)


def test_a_site_without_a_sensor_makes_no_task() -> None:
    model = load_model(ARM)
    projection = project_site(model, make_data(model, keyframe="bent"), SensorSite("fingertip"))
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0), obstacle=pt.Obstacle(position=0.04)
    )
    with refused("site 'fingertip'"):
        projection.task(scenario)


def test_a_hinge_without_range_turns_as_far_as_one_with_a_wide_range() -> None:
    model = load_model(ARM)
    site, posture = SensorSite("fingertip"), {"shoulder": 0.4, "elbow": -0.9, "wrist": 0.5}
    model.jnt_range[1:] = (-1000.0, 1000.0)
    wide = project_site(model, make_data(model, posture), site)
    model.jnt_limited[1:] = False
    free = project_site(model, make_data(model, posture), site)
    assert (free.retreat, free.reflected_mass) == (wide.retreat, wide.reflected_mass)
    (said,) = (text for text in free.warnings if "PT508" in text)
    assert "lets them move without limit (elbow, wrist): add the range" in said
    assert not any("PT508" in text for text in wide.warnings)
    assert free.retreat > project_site(load_model(ARM), make_data(load_model(ARM), posture), site).retreat


def test_a_problem_of_mujoco_writes_no_file(tmp_path: Path) -> None:
    """In a process of its own: the file would be in the working directory."""
    import subprocess

    program = (
        "from pretouch.robots import load_model, make_data\nimport mujoco\n"
        f"model = load_model({str(ARM)!r})\ndata = make_data(model)\ndata.qvel[0] = 1e20\nmujoco.mj_step(model, data)\n"
        "assert data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number\n"
    )
    subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=True, capture_output=True)
    assert list(tmp_path.iterdir()) == []
