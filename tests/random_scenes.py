"""Random robots that meet an object, made of the parts that other people's models have, and checks of their results."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pretouch.control import VirtualAdmittance
from pretouch.robots import (
    ComputedTorque,
    OperationalSpace,
    PositionControl,
    RobotSimulation,
    SensorSite,
    SiteLaw,
    simulate_robot,
)
from pretouch.robots.dynamics import (
    AxisMotion,
    Drivetrain,
    PostureDynamics,
    axis_motion,
    constraint_rows,
    drivetrain_of,
    posture_dynamics,
)
from pretouch.robots.stance import holding_torques
from pretouch.simulation import SensorChain
from robot_scenes import CURVE, controller

BASES = "fixed", "welded", "rail", "floating", "falling", "standing"
LARGE = 0.1  # relative difference from which a result has to say it
PUSH = 0.1  # N or N m
SOFT = 1e-6  # factor of the softness of constraints in the checks of masses
HEIGHT = 0.45  # m, of a base on the ground

_BASES = {
    "fixed": '<body name="base" pos="0 0 1">{inertia}',
    "welded": '<body name="base" pos="0 0 1"><freejoint/>{inertia}',
    "rail": '<body name="base" pos="0 0 1"><joint name="rail" type="slide" axis="1 0 0"/>{inertia}',
    "floating": '<body name="base" pos="0 0 1"><freejoint/>{inertia}',
    "falling": '<body name="base" pos="0 0 1"><freejoint/>{inertia}',
    "standing": f'<body name="base" pos="0 0 {HEIGHT - 1e-6}"><freejoint/>{{inertia}}<geom name="foot" type="box" '
    f'size="0.3 0.3 0.05" pos="0 0 {-HEIGHT + 0.05}" mass="8" contype="4" conaffinity="4"/>',
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomScene:
    """A random robot with an object ahead of its site.

    Args:
        text: the model in MuJoCo's XML format.
        positions: positions of its joints by name.
        speed: approach speed of the object along the axis [m/s].
        lateral: speed of the object across the axis [m/s].
        law: the law of the site.
        tracking: how the joints follow.
        stiffness: stiffness of the contact for the prediction [N/m].
        parts: what this robot has, in words.
    """

    text: str
    positions: Any
    speed: float
    lateral: float
    law: SiteLaw
    tracking: Any
    stiffness: float
    parts: tuple[str, ...]

    def start(self) -> tuple[Any, Any]:
        """Return model and state at the start."""
        model, data = _posed(self.text, self.positions)
        import mujoco

        if "object" in [model.body(i).name for i in range(model.nbody)] and model.body("object").dofnum[0]:
            first = int(model.body("object").dofadr[0])
            data.qvel[first : first + 3] = -self.speed, 0.0, self.lateral
        mujoco.mj_forward(model, data)
        return model, data


def _posed(text: str, positions: Any) -> tuple[Any, Any]:
    import mujoco

    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    for name, value in positions.items():
        data.joint(name).qpos = value
    mujoco.mj_forward(model, data)
    return model, data


def random_scene(seed: int) -> RandomScene:
    """Return the random scene of a seed."""
    rng = np.random.default_rng(seed)
    base = str(rng.choice(BASES))
    parts, extra = [f"{base} base"], {"tendon": "", "equality": "", "actuator": ""}
    gravity = base in {"falling", "standing"} or (base in {"fixed", "welded"} and rng.random() < 0.4)

    def chance(share: float, words: str) -> bool:
        happens = bool(rng.random() < share)
        if happens:
            parts.append(words)
        return happens

    joints = int(rng.choice([1, 2, 3], p=[0.4, 0.3, 0.3]))
    positions = {"a": 0.0} if joints == 1 else dict(zip("abc", (0.7, -1.4, 0.5)[:joints], strict=False))
    loss = rng.uniform(0.05, 2.0) if chance(0.15, "dry friction") else 0.0
    limits = f'frictionloss="{loss:.4g}" damping="{rng.uniform(0, 1) * (rng.random() < 0.3):.4g}"'
    tip = ""
    if chance(0.15, "prongs"):
        ahead = rng.uniform(0.003, 0.03)
        tip += "".join(
            f'<body><geom type="capsule" fromto="0 {y} 0 {ahead} {y} 0" size="0.003" mass="0.004"/></body>'
            for y in (0.015, -0.015)
        )
    if chance(0.15, "flush flange"):
        tip += (
            f'<body><geom type="box" size="0.001 0.02 0.02" pos="{rng.uniform(-2e-3, -1e-3)} 0 0" mass="0.01"/></body>'
        )
    if chance(0.2, "passive hinge"):
        tip += (
            f'<body pos="-0.04 0 -0.02"><joint name="dangling" axis="0 1 0" damping="{rng.uniform(0, 0.002):.4g}"/>'
            f'<geom type="capsule" fromto="0 0 0 0 0 -0.06" size="0.004" mass="{rng.uniform(0.005, 0.05):.4g}"/></body>'
        )
    text = _arm(rng, joints, limits, tip)
    text = _BASES[base].format(inertia=_inertia(rng, base)) + text
    if chance(0.3, "coupled finger"):
        text, extra = _coupled(rng, text, extra, positions, chance)
    names = "abc"[:joints]
    if joints == 2 and base != "standing" and not gravity and chance(0.2, "tendon that drives both joints"):
        extra["tendon"] += '<fixed name="drive"><joint joint="a" coef="1"/><joint joint="b" coef="-0.7"/></fixed>'
        extra["actuator"] += '<motor tendon="drive" ctrlrange="-80 80"/>'
    else:
        extra["actuator"] += "".join(_actuator(rng, name, positions[name], chance) for name in names)
    if base == "welded":
        extra["equality"] += '<weld body1="base" solimp="0.999 0.9999 0.0001"/>'
    text += "</body>"
    spring = float((2 * math.pi * rng.uniform(40, 100)) ** 2) if chance(0.6, "contact like a spring") else 0.0
    ball, lateral = _object(rng, chance, floats=base in {"falling"} or not gravity, spring=spring)
    ground = '<geom name="ground" type="plane" size="3 3 1" contype="4" conaffinity="4"/>' * (base == "standing")
    sections = "".join(f"<{name}>{body}</{name}>" for name, body in extra.items() if body)
    default = '<default><geom solref="{} 1"/></default>'.format(f"{rng.uniform(0.003, 0.02):.4g}")
    text = (
        f'<mujoco><compiler angle="radian" autolimits="true"/><option timestep="0.0005" '
        f'gravity="0 0 {-9.81 if gravity else 0}"/>{default}<worldbody>{ground}{text}{{object}}'
        f"</worldbody>{sections}</mujoco>"
    )
    text = _facing(text, positions)
    text = text.replace("{object}", _object_at(text, positions, ball))
    view = 8.0 if chance(0.4, "beam of 8 deg") else 0.0
    chain = SensorChain(rate=250.0, random_phase=True, delay=120e-6) if chance(0.15, "sensor at 250 Hz") else None
    site = SensorSite("tip", CURVE, field_of_view=math.radians(view))
    own = replace(
        controller(-float(rng.uniform(0.3, 1.0)), rate=None if chain is None else 250.0),
        admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )
    tracking = rng.choice([0, 1, 2], p=[0.7, 0.15, 0.15])
    return RandomScene(
        text=text,
        positions=positions,
        speed=float(rng.uniform(0.15, 0.6)),
        lateral=lateral,
        law=SiteLaw(site=site, controller=own, chain=chain),
        tracking=(ComputedTorque(), OperationalSpace(), PositionControl(bandwidth=15.0))[int(tracking)],
        stiffness=spring * _reduced_mass(text, positions) if spring else float(10 ** rng.uniform(2.8, 4.5)),
        parts=tuple(parts),
    )


def _inertia(rng: Any, base: str) -> str:
    mass = rng.uniform(0.5, 8.0)
    turn = mass * rng.uniform(0.005, 0.1)
    height = rng.uniform(-0.05, 0.05) if base != "standing" else -0.2
    return f'<inertial pos="0 0 {height:.4g}" mass="{mass:.4g}" diaginertia="{turn:.4g} {turn:.4g} {turn:.4g}"/>'


def _arm(rng: Any, joints: int, limits: str, tip: str) -> str:
    """Return the arm; the frame of its site is set by `_place`."""
    end = (
        f'<geom name="tip" type="sphere" size="0.015" mass="{rng.uniform(0.02, 0.3):.4g}"/>'
        f'<body name="hand" quat="{{turn}}" pos="{{place}}">{tip}<site name="tip"/></body>'
    )
    if joints == 1:
        low, high = rng.uniform(-0.25, -0.03), rng.uniform(0.03, 0.2)
        return (
            f'<body pos="0.1 0 {rng.uniform(-0.03, 0.03):.4g}"><joint name="a" type="slide" axis="1 0 0" '
            f'range="{low:.4g} {high:.4g}" {limits}/><geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.01" '
            f'mass="{rng.uniform(0.1, 1):.4g}"/><body pos="0.12 0 0">{end}</body></body>'
        )
    for name in reversed("abc"[:joints]):
        length = 0.25 if name != "c" else 0.1
        end = (
            f'<body pos="{0.0 if name == "a" else 0.25} 0 0"><joint name="{name}" axis="0 -1 0" range="-2.6 2.6" '
            f'{limits}/><geom type="capsule" fromto="0 0 0 {length - 0.02} 0 0" size="0.01" '
            f'mass="{rng.uniform(0.1, 1):.4g}"/>'
            + (f'<body pos="{length} 0 0">{end}</body>' if name == "abc"[joints - 1] else end)
            + "</body>"
        )
    return end


def _coupled(rng: Any, text: str, extra: Any, positions: Any, chance: Any) -> tuple[str, Any]:
    """Return the arm with a second finger that follows the first joint by an equality or a tendon."""
    ratio = float(rng.choice([-1, 1]) * rng.uniform(0.5, 2.0))
    bound = 'range="-0.05 0.05"' if "slide" in text and chance(0.3, "range of the follower") else ""
    kind = "slide" if 'name="a" type="slide"' in text else "hinge"
    text += (
        f'<body pos="0 0.6 0"><joint name="follower" type="{kind}" axis="0 0 1" {bound if kind == "slide" else ""}/>'
        f'<geom type="sphere" size="0.02" mass="{rng.uniform(0.05, 1):.4g}" pos="0.05 0 0"/></body>'
    )
    positions["follower"], start = 0.0, positions["a"]
    if rng.random() < 0.5:
        row = f'<joint joint1="follower" joint2="a" polycoef="{-ratio * start!r} {ratio!r} 0 0 0" {_RIGID}/>'
        return text, {**extra, "equality": extra["equality"] + row}
    tendon = f'<fixed name="t"><joint joint="a" coef="{ratio!r}"/><joint joint="follower" coef="-1"/></fixed>'
    row = f'<tendon tendon1="t" polycoef="0 1 0 0 0" {_RIGID}/>'
    return text, {**extra, "equality": extra["equality"] + row, "tendon": extra["tendon"] + tendon}


_RIGID = 'solimp="0.9999 0.9999"'


def _actuator(rng: Any, name: str, position: float, chance: Any) -> str:
    """Return an actuator of one joint."""
    if chance(0.2, f"servo at {name} without a force range"):
        return f'<position joint="{name}" kp="{rng.uniform(100, 2000):.4g}" kv="5" ctrlrange="-2.6 2.6"/>'
    if chance(0.15, f"servo at {name}"):
        return f'<position joint="{name}" kp="2000" kv="5" ctrlrange="-2.6 2.6" forcerange="-60 60"/>'
    if chance(0.1, f"filter at {name}"):
        return f'<general joint="{name}" dyntype="filter" dynprm="{rng.uniform(0.01, 0.1):.4g}" ctrlrange="-80 80"/>'
    weak = 8.0 if position == 0.0 and chance(0.15, f"weak motor at {name}") else 80.0
    return f'<motor joint="{name}" ctrlrange="{-weak} {weak}"/>'


def _object(rng: Any, chance: Any, *, floats: bool, spring: float) -> tuple[Any, float]:
    """Return radius or half thickness, offset, and the text of a free object, and its speed across the axis [m/s]."""
    size = float(rng.uniform(0.02, 0.06))
    offset = float(rng.uniform(0.005, 0.04)) if chance(0.35, "object beside the axis") else 0.0
    alpha = 0.0 if chance(0.1, "transparent object") else 1.0
    margin = float(rng.uniform(0.001, 0.01)) if chance(0.15, "margin") else 0.0
    gap = margin * float(rng.choice([0.0, 0.5])) if margin else 0.0
    soft = f'solref="{-spring!r} -1" solimp="0.9999 0.9999" priority="1" ' if spring else ""
    common = f'{soft}mass="{rng.uniform(0.2, 2):.4g}" rgba="1 0 0 {alpha}" margin="{margin:.4g}" gap="{gap:.4g}"'
    if chance(0.3, "plate"):
        tilt = float(rng.uniform(0.1, 0.5)) if chance(0.4, "tilted plate") else 0.0
        size = 0.01
        shape = f'<geom name="object" type="box" size="0.01 0.15 0.15" euler="0 {tilt:.4g} 0" {common}/>'
        reach = 0.01 / math.cos(tilt)
    else:
        shape, reach = f'<geom name="object" type="sphere" size="{size:.4g}" {common}/>', size
    lateral = float(rng.uniform(-0.1, 0.1)) if chance(0.15, "lateral motion") else 0.0
    body = f'<body name="object" pos="{{0}}" gravcomp="{0 if floats else 1}"><freejoint/>{shape}</body>'
    return (body, reach, offset, float(rng.uniform(0.03, 0.06))), lateral


def _facing(text: str, positions: Any) -> str:
    """Return a model whose site is on the surface of its tip and faces along x; the place of the object stays open."""
    import mujoco

    plain = text.replace("{turn}", "1 0 0 0").replace("{place}", "0 0 0").replace("{object}", "")
    turn, inverse = _posed(plain, positions)[1].site("tip").xmat.reshape(3, 3), np.zeros(4)
    mujoco.mju_mat2Quat(inverse, np.ascontiguousarray(turn.T).ravel())
    place = turn.T @ np.array([0.015, 0.0, 0.0])
    rows = (" ".join(map(repr, row.tolist())) for row in (inverse, place))
    return text.replace("{turn}", next(rows)).replace("{place}", next(rows))


def _object_at(text: str, positions: Any, made: Any) -> str:
    """Return the text of the object, ahead of the site."""
    body, reach, offset, distance = made
    data = _posed(text.replace("{object}", ""), positions)[1]
    point = data.site("tip").xpos + np.array([distance + reach, 0.0, offset])
    return str(body.format(" ".join(repr(float(v)) for v in point)))


def _reduced_mass(text: str, positions: Any) -> float:
    """Return the reduced mass of robot and object [kg], by which MuJoCo scales the stiffness of a contact."""
    model, data = _posed(text, positions)
    drivetrain = drivetrain_of(model, data, 0)
    dynamics = posture_dynamics(model, data, drivetrain, np.array([1.0, 0.0, 0.0]))
    return float(1 / (1 / dynamics.reflected_mass + 1 / model.body("object").mass[0]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a random robot did, compared with its prediction.

    Args:
        scene: the scene.
        result: the simulation.
        differences: relative differences from the prediction by quantity; infinite if only one of both happens.
        unsaid: what differs by more than 10 % or is wrong without a warning.
    """

    scene: RandomScene
    result: RobotSimulation
    differences: dict[str, float]
    unsaid: tuple[str, ...]


QUANTITIES = {
    "relative_velocity": "contact speed",
    "time": "time to contact",
    "excursion": "excursion",
    "peak_force": "peak force",
}


def simulate_scene(scene: RandomScene, **options: Any) -> Outcome:
    """Simulate a random robot, and compare what its result says with what it contains."""
    model, data = scene.start()
    result = simulate_robot(
        *(model, data, [scene.law]),
        **{"tracking": scene.tracking, "contact_stiffness": scene.stiffness, "horizon": 1.0, **options},
    )
    differences = dict(_differences(result))
    return Outcome(
        scene=scene, result=result, differences=differences, unsaid=tuple(_unsaid(scene, result, differences))
    )


def _differences(result: RobotSimulation) -> Iterator[tuple[str, float]]:
    contact, predicted = result.contacts[0][0], result.predictions[0][0]
    for quantity in QUANTITIES:
        value = abs(getattr(contact, quantity))
        if quantity == "peak_force":
            value = max(value, result.robot_forces[0])
        expected = math.nan if predicted is None else abs(getattr(predicted, quantity))
        if math.isnan(contact.time) or math.isnan(expected):
            both = math.isnan(contact.time) and math.isnan(expected)
            yield quantity, 0.0 if both else math.inf
        elif abs(value - expected) < 1e-9:
            yield quantity, 0.0
        else:
            yield quantity, abs(value / expected - 1) if expected else math.inf


def _unsaid(scene: RandomScene, result: RobotSimulation, differences: dict[str, float]) -> Iterator[str]:
    """Yield what a result contains but does not say."""
    contact = result.contacts[0][0]
    said = " ".join(text for text in result.warnings if text.startswith("PT507: At the site"))
    elsewhere = [touch for touch in result.touches[0] if not touch.site]
    codes = {text[:5] for text in result.warnings}
    if contact.detection is None and not math.isnan(contact.time) and "PT559" not in codes:
        yield "a contact without a detection"
    for quantity, words in QUANTITIES.items():
        if not differences[quantity] > LARGE:
            continue
        if math.isinf(differences[quantity]) and {"PT559", "PT560"} & codes:
            continue
        named = re.search(rf"{words} ([\d.e+]+|inf) %", said)
        if not named or "reason" not in said or said.rstrip().endswith(": ."):
            yield f"{words} differs by {100 * differences[quantity]:.3g} %"
    if "nan" in str(result):
        yield "nan in the report"
    if "The reason is: ." in said:
        yield "no cause"
    if not (result.order() or elsewhere) and (result.robot_forces[0] > 0 or _pushed(scene, result)):
        yield "the object was touched, but no contact is reported"
    if elsewhere and "hit" not in str(result).splitlines()[0]:
        yield "a contact elsewhere is not in the first line"


def _pushed(scene: RandomScene, result: RobotSimulation) -> bool:
    """Return whether the object has changed its velocity by more than gravity does, by its recorded positions."""
    import mujoco

    model, trace = result.model, result.trace()
    first, h = int(model.body("object").jntadr[0]), float(model.opt.timestep)
    place = int(model.jnt_qposadr[first])
    velocity = np.diff(trace.configuration[:, place : place + 3], axis=0) / h
    change = np.diff(velocity, axis=0) - h * model.opt.gravity * (
        1 - float(model.body_gravcomp[model.body("object").id])
    )
    assert model.jnt_type[first] == mujoco.mjtJoint.mjJNT_FREE
    return bool(np.abs(change).max(initial=0.0) > 1e-6)


def mass_errors(scene: RandomScene) -> dict[str, float]:
    """Return the relative errors of masses and recoil share compared with MuJoCo's response to small pushes.

    The softness of constraints and contacts is extrapolated to 0. Errors of the recoil share are absolute.
    """
    pairs = [_responses(scene, softness) for softness in (SOFT, 2 * SOFT)]
    if any(pair is None for pair in pairs):
        return {}
    (ours, first), (_, second) = (pair for pair in pairs if pair is not None)
    return {
        name: abs(2 * first[name] - second[name] - value) / (1.0 if name == "recoil share" else abs(value))
        for name, value in ours.items()
        if math.isfinite(value)
    }


def _responses(scene: RandomScene, softness: float) -> tuple[dict[str, float], dict[str, float]] | None:
    """Return mobility and masses of our projection, and of MuJoCo's response with soft constraints."""
    import mujoco

    model, _ = _posed(re.sub('<body name="object".*?</body>', "", scene.text), scene.positions)
    model.eq_solimp[:] = model.geom_solimp[:] = 0.9999, 0.9999, 0.001, 0.5, 2
    model.eq_solref[:] = model.geom_solref[:] = -1e-6, -1.0
    model.dof_frictionloss[:] = 0.0
    model.opt.tolerance, model.opt.iterations = 1e-16, 200
    for weights in (model.dof_invweight0, model.body_invweight0, model.tendon_invweight0):
        weights[:] = softness * weights
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    data = mujoco.MjData(model)
    for name, value in scene.positions.items():
        data.joint(name).qpos = value
    mujoco.mj_forward(model, data)
    index = model.site("tip").id
    drivetrain = drivetrain_of(model, data, index)
    dynamics = posture_dynamics(model, data, drivetrain, scene.law.site.direction)
    motion = axis_motion(dynamics, "auto")
    if motion is None or math.isinf(dynamics.reflected_mass):
        return None
    ours = {
        "reflected mass": dynamics.reflected_mass,
        "moved mass": motion.moved_mass,
        "recoil share": motion.recoil_share,
    }
    return ours, _masses(model, data, drivetrain, dynamics, motion)


def _masses(
    model: Any, data: Any, drivetrain: Drivetrain, dynamics: PostureDynamics, motion: AxisMotion
) -> dict[str, float]:
    """Return reflected mass, moved mass and recoil share by MuJoCo's accelerations.

    The torques that cause the joint motion q^ as accelerations have the power q^ . torques, which is the moved mass.
    """
    import mujoco

    driven, jacobian = drivetrain.driven, np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, drivetrain.site)
    rest = holding_torques(model, data, drivetrain.base, drivetrain.footholds, constraint_rows(model, data))

    def accelerations(push: Any) -> Any:
        data.qfrc_applied[:] = rest + push
        mujoco.mj_forward(model, data)
        return data.qacc.copy()

    start = accelerations(0.0)
    row = dynamics.axis @ jacobian
    mobility = float(row @ (accelerations(-PUSH * row) - start)) / -PUSH
    columns = []
    for degree in driven:
        push = np.zeros(model.nv)
        push[degree] = PUSH
        columns.append((accelerations(push) - start) / PUSH)
    response = np.column_stack(columns)
    torques = np.linalg.pinv(response[driven], rcond=1e-6) @ motion.joints
    along = float(row @ response @ torques)
    return {"reflected mass": 1 / mobility, "moved mass": float(motion.joints @ torques), "recoil share": 1 - along}
