"""If a simulated robot deviates from its prediction by more than 5 %, a warning says so, and why if it is known."""

from __future__ import annotations

import math
import re

import pytest

from pretouch.robots import (
    ComputedTorque,
    OperationalSpace,
    RobotSimulation,
    SensorSite,
    SiteLaw,
    load_model,
    make_data,
    project_site,
    simulate_robot,
)
from refusals import refused
from robot_scenes import ARM, CURVE, SLIDE, controller, share, slide_with_ball, with_object

mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

TIP, FINGERTIP = SensorSite("tip", CURVE), SensorSite("fingertip", CURVE)


def turning_base(inertia: float, height: float):
    """The floating slide, whose line of force passes its center of mass at a height: its recoil turns the base."""
    text = SLIDE.format(base="<freejoint/>", mass=1.0, gravity="0 0 0")
    text = text.replace('diaginertia="1 1 1"', f'diaginertia="{inertia} {inertia} {inertia}"')
    text = text.replace('pos="0.1 0 0"', f'pos="0.1 0 {height}"')
    return text, make_data(mujoco.MjModel.from_xml_string(text))


def deviation(result: RobotSimulation) -> float:
    (site,) = result.sites
    return share(result.simulated(site, "relative_velocity"), result.predicted(site, "relative_velocity"))


@pytest.mark.parametrize(("inertia", "height", "warns"), [(0.01, 0.0, False), (0.1, 0.1, False), (0.01, 0.1, True)])
def test_a_base_that_turns_is_reported(inertia: float, height: float, warns: bool) -> None:
    text, start = turning_base(inertia, height)
    projection = project_site(mujoco.MjModel.from_xml_string(text), start, TIP)
    scene = with_object(text, start, "tip", 0.6)
    result = simulate_robot(*scene, [SiteLaw(site=TIP, controller=controller())])
    contact = result.contacts[0][0]
    assert (deviation(result) > 0.05) == warns
    codes = [text[:5] for text in result.warnings]
    assert codes == ["PT504", "PT504", "PT507"] * warns  # of the projection, of the simulation, and of the comparison
    assert any("its axis" in text for text in projection.warnings) == warns
    # with the projection's rate at the start; it grows while the slide moves off the base
    assert contact.axis_turn == pytest.approx(projection.turning * contact.excursion, rel=0.3, abs=1e-6)
    if height:  # the lever of the sideways motion, 220 mm, shrinks by the excursion of 80 mm
        assert 0.5 < contact.sideways / (projection.sideways * contact.excursion) < 1.0


def arm_text(strength: float) -> str:
    def weaker(match: re.Match[str]) -> str:
        limit = strength * float(match[1])
        return f'ctrlrange="{-limit} {limit}"'

    text = ARM.read_text().replace('timestep="0.0005"', 'timestep="0.001"')
    return re.sub(r'ctrlrange="-(\d+) \1"', weaker, text)


def stretched_arm(elbow: float, *, speed: float = 0.3, strength: float = 1.0, shoulder: float = 0.0):
    model = load_model(ARM)
    posture = {"shoulder": shoulder - elbow / 2, "elbow": elbow, "wrist": -elbow / 2}
    return with_object(arm_text(strength), make_data(model, posture), "fingertip", speed)


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("elbow", [-0.3, -0.2, -0.1])
@pytest.mark.parametrize("error", [0.0, 0.3, -0.3])
def test_a_posture_near_a_singularity_costs_nothing_with_strong_drives(elbow: float, error: float) -> None:
    """The reflected mass is 21, 47 and 185 kg."""
    scene = stretched_arm(elbow)
    assert project_site(*scene, FINGERTIP).reflected_mass > 20
    tracking = OperationalSpace(model_error=error)
    result = simulate_robot(*scene, [SiteLaw(site=FINGERTIP, controller=controller())], tracking=tracking)
    assert deviation(result) < 0.005
    # nothing but the projection's own warning; it says that drives decide
    assert [text[:5] for text in result.warnings] == ["PT501"]


@pytest.mark.parametrize("tracking", [ComputedTorque(), OperationalSpace()], ids=["torque", "impedance"])
def test_weak_drives_are_reported(tracking) -> None:
    """The shoulder leaves 1.8 m/s^2 along the axis, a tenth of what the law asks for."""
    scene = stretched_arm(-0.3, speed=0.6, strength=0.05, shoulder=-math.pi / 2)
    result = simulate_robot(*scene, [SiteLaw(site=FINGERTIP, controller=controller())], tracking=tracking, horizon=2.0)
    assert not deviation(result) < 0.05  # it may also be without contact
    assert "drive" in " ".join(text for text in result.warnings if text.startswith("PT505"))


def test_a_reference_that_reaches_a_joint_range_is_reported() -> None:
    model, data = slide_with_ball(1.0, 0.3, floats=False)
    model.jnt_range[0] = -0.03, 0.03
    result = simulate_robot(model, data, [SiteLaw(site=TIP, controller=controller())])
    assert deviation(result) > 0.05
    assert "joint range" in " ".join(result.warnings)
    assert result.warnings[-1].startswith("PT507")


def overlapping(geom: str, distance: float, offset: float = 0.0):
    text = arm_text(1.0)
    data = make_data(load_model(ARM), keyframe="bent")
    return with_object(text, data, "fingertip", 0.3, geom=geom, radius=0.035, distance=distance, offset=offset)


TOUCHING = '<geom name="ball" type="sphere" size="0.035" mass="0.5" contype="2" conaffinity="1"/>'


@pytest.mark.parametrize(
    ("distance", "offset", "overlap"),
    [(-0.002, 0.0, 2.0), (-0.067, 0.05, 5.0), (0.001, 0.0, None), (-0.067, 0.056, None)],
    ids=["on the axis", "beside the axis", "near", "near and beside"],
)
def test_an_object_that_overlaps_the_robot_is_refused(distance: float, offset: float, overlap: float | None) -> None:
    """Beside the axis, the centers of ball and finger are 50 mm apart, and their radii are 35 and 20 mm."""
    scene = overlapping(TOUCHING, distance, offset)
    laws = [SiteLaw(site=FINGERTIP, controller=controller())]
    if overlap is None:
        assert simulate_robot(*scene, laws, horizon=0.1).sites == ("fingertip",)
        return
    with refused("data") as error:
        simulate_robot(*scene, laws)
    assert float(re.search(r"by ([\d.]+) mm", str(error.value))[1]) == pytest.approx(overlap, rel=1e-3)


def test_ground_may_overlap_a_body_without_a_sensor_only() -> None:
    text, start = arm_text(1.0), make_data(load_model(ARM), keyframe="bent")

    def scene(place) -> tuple[object, object]:
        row = " ".join(map(str, place))
        ground = f'<geom name="ground" type="sphere" size="0.05" pos="{row}" contype="2" conaffinity="1"/>'
        return with_object(text.replace("<body", f"{ground}<body", 1), start, "fingertip", 0.3)

    laws = [SiteLaw(site=FINGERTIP, controller=controller())]
    assert simulate_robot(*scene(start.geom("upper link").xpos), laws, horizon=0.05).sites == ("fingertip",)
    with refused("data", value="ground"):
        simulate_robot(*scene(start.geom("finger").xpos), laws)


def test_the_warnings_of_the_projection_are_repeated_with_the_name_of_the_site() -> None:
    scene = stretched_arm(-0.2)
    result = simulate_robot(*scene, [SiteLaw(site=FINGERTIP, controller=controller())])
    (expected,) = project_site(*scene, FINGERTIP).warnings
    code, _, text = expected.partition(": ")
    assert result.warnings == (f"{code}: fingertip: {text}",)
