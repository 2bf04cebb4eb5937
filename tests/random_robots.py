"""Random robots, once as text for MuJoCo and once built in Pinocchio from the same numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """A body with one joint: its parent's index (-1 for the world or the base), placement, joint and inertia."""

    parent: int
    position: Any
    quaternion: Any
    slides: bool
    axis: Any
    mass: float
    center: Any
    turn: Any
    moments: Any
    armature: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomRobot:
    links: tuple[Link, ...]
    floats: bool
    base: Link
    site: Any
    configuration: Any

    @property
    def text(self) -> str:
        """The robot in MuJoCo's XML format; the site is on the last link."""
        children: dict[int, list[int]] = {}
        for i, link in enumerate(self.links):
            children.setdefault(link.parent, []).append(i)

        def bodies(parent: int) -> str:
            return "".join(body(i) for i in children.get(parent, ()))

        def body(i: int) -> str:
            link, last = self.links[i], i == len(self.links) - 1
            kind = "slide" if link.slides else "hinge"
            site = f'<site name="tip" pos="{_row(self.site)}"/>' if last else ""
            return (
                f'<body pos="{_row(link.position)}" quat="{_row(link.quaternion)}">'
                f'<joint name="joint {i}" type="{kind}" axis="{_row(link.axis)}" armature="{link.armature!r}" '
                f'range="-20 20"/>{_inertial(link)}{site}{bodies(i)}</body>'
            )

        inside = bodies(-1)
        if self.floats:
            inside = f"<body><freejoint/>{_inertial(self.base)}{inside}</body>"
        motors = "".join(f'<motor joint="joint {i}" ctrlrange="-9 9"/>' for i in range(len(self.links)))
        return (
            '<mujoco><compiler angle="radian" autolimits="true"/><option gravity="0 0 0"/>'
            f"<worldbody>{inside}</worldbody><actuator>{motors}</actuator></mujoco>"
        )

    def pinocchio(self, pin: Any) -> tuple[Any, Any, int]:
        """Return the model, the configuration and the frame of the site in Pinocchio."""
        model = pin.Model()
        parents = {-1: 0}
        if self.floats:
            parents[-1] = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
            model.appendBodyToJoint(parents[-1], _inertia(pin, self.base), pin.SE3.Identity())
        armature = [0.0] * (6 if self.floats else 0)
        for i in self._depth_first():
            link = self.links[i]
            kind = pin.JointModelPrismaticUnaligned if link.slides else pin.JointModelRevoluteUnaligned
            place = pin.SE3(_rotation(link.quaternion), link.position)
            parents[i] = model.addJoint(parents[link.parent], kind(link.axis), place, f"joint {i}")
            model.appendBodyToJoint(parents[i], _inertia(pin, link), pin.SE3.Identity())
            armature.append(link.armature)
        last = len(self.links) - 1
        site = pin.Frame("tip", parents[last], pin.SE3(np.eye(3), self.site), pin.FrameType.OP_FRAME)
        frame = model.addFrame(site)
        model.armature = np.array(armature)
        q = pin.neutral(model)
        order = list(self._depth_first())
        if self.floats:
            q[:7] = np.concatenate([self.configuration[:3], np.roll(self.configuration[3:7], -1)])
        q[7 * self.floats :] = self.configuration[7 * self.floats :][order]
        return model, q, frame

    def _depth_first(self) -> Any:
        """Yield the links in the order of MuJoCo's text, depth first."""
        stack = [i for i in reversed(range(len(self.links))) if self.links[i].parent == -1]
        while stack:
            i = stack.pop()
            yield i
            stack += [j for j in reversed(range(len(self.links))) if self.links[j].parent == i]

    def mujoco_configuration(self) -> Any:
        """Return the joint positions in MuJoCo's order."""
        first = 7 * self.floats
        return np.concatenate([self.configuration[:first], self.configuration[first:][list(self._depth_first())]])


def random_robot(seed: int) -> RandomRobot:
    rng = np.random.default_rng(seed)
    count, floats = int(rng.integers(1, 9)), bool(rng.integers(2))
    links = tuple(_link(rng, i) for i in range(count))
    base = _link(rng, 0)
    pose = np.concatenate([rng.normal(size=3), _unit(rng.normal(size=4))]) if floats else np.zeros(0)
    configuration = np.concatenate([pose, rng.uniform(-2, 2, count)])
    return RandomRobot(links=links, floats=floats, base=base, site=rng.normal(size=3), configuration=configuration)


def _link(rng: Any, i: int) -> Link:
    first, second, third = rng.uniform(0.05, 1.0, 3)
    moments = np.array([second + third, first + third, first + second])  # any body meets the triangle inequality
    return Link(
        parent=int(rng.integers(-1, i)) if i else -1,
        position=rng.normal(size=3) * 0.3,
        quaternion=_unit(rng.normal(size=4)),
        slides=bool(rng.random() < 0.3),
        axis=_unit(rng.normal(size=3)),
        mass=float(rng.uniform(0.2, 5)),
        center=rng.normal(size=3) * 0.2,
        turn=_unit(rng.normal(size=4)),
        moments=moments * rng.uniform(0.01, 0.2),
        armature=float(rng.uniform(0, 0.1)),
    )


def _unit(vector: Any) -> Any:
    return vector / np.linalg.norm(vector)


def _row(values: Any) -> str:
    return " ".join(repr(float(v)) for v in values)


def _inertial(link: Link) -> str:
    return (
        f'<inertial pos="{_row(link.center)}" quat="{_row(link.turn)}" mass="{link.mass!r}" '
        f'diaginertia="{_row(link.moments)}"/>'
    )


def _rotation(q: Any) -> Any:
    w, (x, y, z) = q[0], q[1:]
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * skew + 2 * skew @ skew


def _inertia(pin: Any, link: Link) -> Any:
    turn = _rotation(link.turn)
    return pin.Inertia(link.mass, link.center, turn @ np.diag(link.moments) @ turn.T)


def standing_robot(seed: int) -> tuple[str, Any]:
    """Return a random robot with legs and an arm with a site, on a pad under each foot, and its configuration.

    The contacts do not correct their penetration, so that the accelerations at rest are those of rigid contacts.
    """
    import mujoco

    rng = np.random.default_rng(seed)
    legs, joints, motors = int(rng.integers(3, 6)), int(rng.integers(1, 4)), []

    def limb(name: str, count: int, first: str, step: str, rod: str, end: str) -> str:
        for j in reversed(range(count)):
            motors.append(f'<motor joint="{name} {j}" ctrlrange="-200 200"/>')
            end = (
                f'<body pos="{step if j else first}"><joint name="{name} {j}" axis="{_row(_unit(rng.normal(size=3)))}" '
                f'range="-3 3"/><geom type="capsule" fromto="0 0 0 {rod}" size="0.015" mass="{rng.uniform(0.2, 1)}"/>'
                f"{end}</body>"
            )
        return end

    angles = 2 * np.pi * (np.arange(legs) + rng.uniform(-0.2, 0.2, legs)) / legs
    kinds = rng.choice(["sphere", "box"], legs)
    feet = "".join(
        limb(
            f"leg {i}",
            joints,
            _row((0.3 * np.cos(angle), 0.3 * np.sin(angle), -0.05)),
            "0 0 -0.15",
            "0 0 -0.15",
            f'<geom name="foot {i}" type="{kind}" size="0.03 0.03 0.03" pos="0 0 -0.2" mass="0.1" contype="1" '
            'conaffinity="1"/>',
        )
        for i, (angle, kind) in enumerate(zip(angles, kinds, strict=True))
    )
    arm = limb("arm", int(rng.integers(1, 4)), "0.1 0 0.1", "0.1 0 0.1", "0.2 0 0", '<site name="tip" pos="0.2 0 0"/>')
    text = (
        '<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81" tolerance="1e-16" iterations="200" '
        f'timestep="0.001" cone="{rng.choice(["pyramidal", "elliptic"])}"/><default><geom contype="0" conaffinity="0" '
        f'friction="{rng.uniform(0.6, 1.5)} 0.05 0.01" condim="{rng.choice([3, 4, 6])}" solimp="0.9999 0.9999" '
        'solref="-1e-6 -1"/></default><worldbody>{pads}<body name="trunk" pos="0 0 1"><freejoint/><geom type="box" '
        f'size=".2 .2 .05" mass="{rng.uniform(2, 20)}"/>{feet}{arm}</body></worldbody>'
        f"<actuator>{''.join(motors)}</actuator></mujoco>"
    )
    model = mujoco.MjModel.from_xml_string(text.replace("{pads}", ""))
    data = mujoco.MjData(model)
    data.qpos[7:] = rng.uniform(-0.4, 0.4, model.nq - 7)
    mujoco.mj_forward(model, data)
    pads = ""
    for i, kind in enumerate(kinds):
        foot = data.geom(f"foot {i}")
        x, y, z = foot.xpos
        height = 0.03 * (1.0 if kind == "sphere" else float(np.abs(foot.xmat.reshape(3, 3)[2]).sum()))
        place = _row((x, y, z - height - 0.1 + 1e-5))
        pads += f'<geom type="box" size="0.2 0.2 0.1" pos="{place}" contype="1" conaffinity="1"/>'
    return text.replace("{pads}", pads), data.qpos.copy()
