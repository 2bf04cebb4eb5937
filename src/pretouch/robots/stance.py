"""Find the contacts on which a robot stands, and how hard an object may push until they give way.

With the base at rest and the driven joints held, the contact forces f are those of Gauss' principle: they minimize
|M_bb^(-1/2) (h_b - G f)| in the friction cones, with the weight h_b of the base and the generalized forces G f. Of all
such forces, the smallest ones count. A contact that carries a force holds its point: along the normal, and along the
directions of its friction unless it slides. Rows of A v = 0 say so, next to the equality constraints of the model.

This is right as long as no contact lifts or slides. During an impact, the drives keep their torques, so that the
accelerations and contact forces are affine in the force of the object. A linear program yields the largest force for
which all contact forces stay in their cones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value

from .model import Data, Model, mujoco, names_of

_AT_SURFACE: Final = 1e-6  # m: bodies that are this close touch
_NEAR: Final = 5e-3  # m: a robot that is this close to the ground is likely meant to stand on it
_SPREAD: Final = 1e-6  # weight of the size of the contact forces, so that contacts share their load
_CARRIES: Final = 1e-6  # share of the largest contact force, below which a contact carries nothing
_SLIDES: Final = 1e-6  # share of gravity: a contact point that accelerates more along the surface slides
_FALLS: Final = 0.01  # share of gravity: a base that accelerates more falls
_NOTHING: Final = 1e-9  # N: rounding of a robot without weight
_ENDLESS: Final = 1e6  # forces of the object, in units of the largest force at rest, that count as no limit
_EDGES: Final = 16  # of a pyramid inside an elliptic friction cone


@dataclass(frozen=True, slots=True)
class Foothold(Value):
    """A contact that carries a robot at rest.

    Args:
        bodies: the two bodies, shape (2,).
        points: the contact point in the frames of both bodies [m], shape (2, 3).
        frame: normal from the first body to the second, and two tangents, in the frame of the first body, shape (3, 3).
        turn: orientation of the second body in the frame of the first one, as a quaternion, shape (4,).
        held: the directions that it holds: 0 for the normal, 1 and 2 for the tangents, 3 for the turn about the normal,
            4 and 5 for rolling.
        edges: edges of the friction cone by the directions held, shape (k, len(held)).
        force: normal force at rest [N].
    """

    bodies: IntArray
    points: FloatArray
    frame: FloatArray
    turn: FloatArray
    held: IntArray
    edges: FloatArray
    force: float

    def rows(self, model: Model, data: Data) -> FloatArray:
        """Return the velocities in the directions held per generalized velocity, shape (len(held), nv)."""
        linear, angular = np.zeros((2, 3, model.nv)), np.zeros((2, 3, model.nv))
        for side, (body, point) in enumerate(zip(self.bodies.tolist(), self._places(data), strict=True)):
            mujoco().mj_jac(model, data, linear[side], angular[side], point, body)
        return self._along(data, np.vstack([linear[1] - linear[0], angular[1] - angular[0]]))

    def error(self, data: Data) -> FloatArray:
        """Return how far the second body has moved from the first in the directions held [m or rad]."""
        place, turn = self._places(data), np.array(data.xquat)[self.bodies]
        inverse, since, angle = np.zeros(4), np.zeros(4), np.zeros(3)
        mujoco().mju_mulQuat(since, turn[0], self.turn)
        mujoco().mju_negQuat(inverse, since)
        mujoco().mju_mulQuat(since, turn[1], inverse)
        mujoco().mju_quat2Vel(angle, since, 1.0)
        return self._along(data, np.concatenate([place[1] - place[0], angle])[:, None])[:, 0]

    def _places(self, data: Data) -> FloatArray:
        turns = np.array(data.xmat)[self.bodies].reshape(2, 3, 3)
        return np.asarray(np.array(data.xpos)[self.bodies] + np.einsum("sij,sj->si", turns, self.points))

    def _along(self, data: Data, twist: FloatArray) -> FloatArray:
        """Select the directions held from linear and angular parts, shape (6, k)."""
        frame = self.frame @ np.array(data.xmat)[self.bodies[0]].reshape(3, 3).T
        return np.asarray(np.vstack([frame @ twist[:3], frame @ twist[3:]])[self.held])


def footholds_of(
    model: Model, data: Data, degrees: tuple[IntArray, IntArray, IntArray], equality: FloatArray
) -> tuple[Foothold, ...]:
    """Find the contacts that carry a robot.

    Contacts with bodies that neither the world nor the robot holds do not count.

    Args:
        model: the model.
        data: its state after `mj_forward`.
        degrees: the degrees of freedom that no actuator moves, the others of the robot, and those of the first ones by
            which the whole robot moves.
        equality: rows of the equality constraints, shape (k, nv).

    Returns:
        The contacts that carry a force; none if the robot falls nevertheless.
    """
    base, driven, root = degrees
    touching = _contacts_of(model, data, np.concatenate([base, driven])) if len(base) else []
    if not touching:
        return ()
    pushes = forces_of(model, data, touching)
    sizes, acceleration = _balance(model, data, base, pushes, equality)
    ends = np.cumsum([len(contact.edges) for contact in touching])[:-1]
    normal = [
        float(part @ contact.edges[:, 0])
        for part, contact in zip(np.split(sizes[: len(pushes)], ends), touching, strict=True)
    ]
    gravity = max(float(np.linalg.norm(model.opt.gravity)), 1.0)
    if np.abs(acceleration[root]).max(initial=0.0) > _FALLS * gravity:
        return ()
    still = _SLIDES * gravity
    return tuple(
        _holding(contact, np.abs(contact.rows(model, data) @ acceleration) <= still, force)
        for contact, force in zip(touching, normal, strict=True)
        if force > max(_CARRIES * max(normal), _NOTHING)
    )


def _balance(
    model: Model, data: Data, base: IntArray, pushes: FloatArray, equality: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the contact forces that carry a base while the driven joints are held, and its acceleration.

    Args:
        model: the model.
        data: its state after `mj_forward`.
        base: the degrees of freedom of the base.
        pushes: generalized forces of the edges of the friction cones, shape (k, nv).
        equality: rows of the equality constraints, shape (r, nv).

    Returns:
        The sizes of the contact forces by edges, and of the forces of the constraints, positive and negative, and the
        acceleration, shape (nv,).
    """
    from scipy.optimize import nnls  # noqa: PLC0415 - slow to import

    mass = np.zeros((model.nv, model.nv))
    mujoco().mj_fullM(model, data, mass)
    root = np.linalg.cholesky(mass[np.ix_(base, base)])
    forces = np.linalg.solve(root, np.vstack([pushes, equality, -equality])[:, base].T)
    weight = np.linalg.solve(root, np.array(data.qfrc_bias - data.qfrc_passive)[base])
    small = _SPREAD * np.linalg.norm(forces, axis=0).max(initial=0.0) * np.eye(forces.shape[1])
    sizes = np.zeros(forces.shape[1])
    if len(sizes):  # nnls of SciPy crashes without unknowns
        target = np.concatenate([weight, np.zeros(len(small))])
        sizes, _ = nnls(np.vstack([forces, small]), target, maxiter=100 * len(small))
    acceleration = np.zeros(model.nv)
    acceleration[base] = np.linalg.solve(root.T, forces @ sizes - weight)
    return np.asarray(sizes), acceleration


def holding_torques(
    model: Model, data: Data, base: IntArray, footholds: Sequence[Foothold], equality: FloatArray
) -> FloatArray:
    """Return the generalized forces by which the drives hold the joints of a robot that stands, shape (nv,).

    Of all possible ones, they are those with the smallest contact forces.
    """
    pushes = forces_of(model, data, footholds)
    sizes, acceleration = _balance(model, data, base, pushes, equality)
    mass = np.zeros((model.nv, model.nv))
    mujoco().mj_fullM(model, data, mass)
    force = np.array(data.qfrc_bias - data.qfrc_passive) + mass @ acceleration
    force -= np.vstack([pushes, equality, -equality]).T @ sizes
    force[base] = 0.0
    return np.asarray(force)


def largest_push(
    inertia: tuple[FloatArray, FloatArray], forces: tuple[FloatArray, FloatArray, FloatArray], push: FloatArray
) -> float:
    """Return the force [N] on a site from which a contact lifts or slides while the drives keep their torques.

    Args:
        inertia: the mass matrix, and a basis of the velocities that constraints and contacts allow.
        forces: the generalized force on the robot at rest without constraints and contacts, those of the edges of the
            friction cones, and those of the equality constraints, in the rows.
        push: the generalized force per force of the object, in the same order.

    Returns:
        The force; infinite if the contacts hold in any case.
    """
    from scipy.optimize import linprog  # noqa: PLC0415 - slow to import

    (mass, free), (rest, edges, equality) = inertia, forces
    mobility = free @ np.linalg.solve(free.T @ mass @ free, free.T)
    # the constraints apply mass @ acceleration - force, with force = rest + size * push
    constant, slope = (mass @ mobility @ part - part for part in (rest, push))
    scale = max(float(np.abs(constant).max()), 1e-9)
    result = linprog(
        np.concatenate([[-1.0], np.zeros(len(edges) + len(equality))]),
        A_eq=np.hstack([-slope[:, None], edges.T, equality.T]),
        b_eq=constant / scale,
        bounds=[(0, _ENDLESS), *[(0, None)] * len(edges), *[(None, None)] * len(equality)],
        method="highs",
    )
    if result.x is None:
        return 0.0
    return float(result.x[0]) * scale if result.x[0] < _ENDLESS * (1 - 1e-6) else math.inf


def _holding(contact: Foothold, holds: Any, force: float) -> Foothold:
    """Return a contact that holds its normal and those of its other directions that do not slide."""
    keep = np.flatnonzero(np.asarray(holds) | (contact.held == 0))
    edges = np.unique(contact.edges[:, keep], axis=0) if len(keep) < len(contact.held) else contact.edges
    return Foothold(contact.bodies, contact.points, contact.frame, contact.turn, contact.held[keep], edges, force)


def _contacts_of(model: Model, data: Data, degrees: IntArray) -> list[Foothold]:
    """Return the contacts of a robot with the world and with itself."""
    trees, robot = np.asarray(model.body_treeid), set(np.asarray(model.dof_treeid)[degrees].tolist())
    inside, result = np.asarray(model.geom_bodyid), []
    for contact in data.contact:
        if min(contact.geom) < 0 or contact.exclude > 1 or contact.dist > contact.includemargin + _AT_SURFACE:
            continue
        bodies = inside[np.asarray(contact.geom)].astype(np.int64)
        own = [int(trees[body]) in robot for body in bodies]
        if not any(own) or not all(mine or trees[body] < 0 for mine, body in zip(own, bodies, strict=True)):
            continue
        turns = np.array(data.xmat)[bodies].reshape(2, 3, 3)
        offsets = np.array(contact.pos) - np.array(data.xpos)[bodies]
        inverse, turn = np.zeros(4), np.zeros(4)
        mujoco().mju_negQuat(inverse, data.xquat[bodies[0]])
        mujoco().mju_mulQuat(turn, inverse, data.xquat[bodies[1]])
        friction = np.array(contact.friction)[: int(contact.dim) - 1]
        held = np.concatenate([[0], 1 + np.flatnonzero(friction > 0)])
        result.append(
            Foothold(
                bodies,
                np.einsum("sji,sj->si", turns, offsets),
                np.array(contact.frame).reshape(3, 3) @ turns[0],
                turn,
                held,
                _cone(friction[friction > 0], elliptic=int(model.opt.cone) == int(mujoco().mjtCone.mjCONE_ELLIPTIC)),
                0.0,
            )
        )
    return result


def _cone(friction: FloatArray, *, elliptic: bool) -> FloatArray:
    """Return the edges of a friction cone with normal force 1: those of MuJoCo's pyramid, or some of an ellipse."""
    sides = np.vstack([np.diag(friction), -np.diag(friction)])
    if elliptic and len(friction) > 1:
        angles = 2 * math.pi * np.arange(_EDGES) / _EDGES
        around = np.zeros((_EDGES, len(friction)))
        around[:, 0], around[:, 1] = friction[0] * np.cos(angles), friction[1] * np.sin(angles)
        sides = np.vstack([around, sides])
    return np.hstack([np.ones((len(sides), 1)), sides]) if len(friction) else np.ones((1, 1))


def rows_of(model: Model, data: Data, footholds: Sequence[Foothold]) -> FloatArray:
    """Return the velocities that the contacts hold at 0 per generalized velocity, shape (k, nv)."""
    return np.vstack([np.zeros((0, model.nv)), *(foothold.rows(model, data) for foothold in footholds)])


def forces_of(model: Model, data: Data, footholds: Sequence[Foothold]) -> FloatArray:
    """Return the generalized forces of the edges of all friction cones, shape (k, nv)."""
    rows = (foothold.edges @ foothold.rows(model, data) for foothold in footholds)
    return np.vstack([np.zeros((0, model.nv)), *rows])


def supporting_bodies(model: Model, data: Data, degrees: IntArray) -> tuple[str, ...]:
    """Name the pairs of bodies by which a robot touches the world or itself, whether or not they carry it."""
    return describe_footholds(model, _contacts_of(model, data, degrees))


def gap_below(model: Model, data: Data, degrees: IntArray) -> tuple[str, float]:
    """Return which body of a robot is nearest to the world, and how near [m]; infinite if nothing is within 5 mm.

    Args:
        model: the model.
        data: its state after `mj_forward`.
        degrees: the degrees of freedom of the robot.
    """
    trees = np.asarray(model.body_treeid)[np.asarray(model.geom_bodyid)]
    robot = np.isin(trees, np.asarray(model.dof_treeid)[degrees])
    kinds, groups = np.asarray(model.geom_contype), np.asarray(model.geom_conaffinity)
    nearest, pair = math.inf, (0, 0)
    for own in np.flatnonzero(robot):
        meets = ((kinds[own] & groups) | (kinds & groups[own])) != 0
        for other in np.flatnonzero((trees < 0) & meets):
            distance = float(mujoco().mj_geomDistance(model, data, int(own), int(other), _NEAR, None))
            if distance < min(nearest, _NEAR):
                nearest, pair = distance, (int(own), int(other))
    if not math.isfinite(nearest):
        return "", nearest
    names, bodies = names_of(model, "body"), np.asarray(model.geom_bodyid)
    labels = [names[body] or f"number {body}" for body in bodies[list(pair)]]
    return f"{labels[0]} above {labels[1]}", nearest


def describe_footholds(model: Model, footholds: Sequence[Foothold]) -> tuple[str, ...]:
    """Name the pairs of bodies by whose contacts a robot stands."""
    names = names_of(model, "body")
    labels = [[names[body] or f"number {body}" for body in foothold.bodies] for foothold in footholds]
    pairs = ((a, b) if foothold.bodies[0] else (b, a) for (a, b), foothold in zip(labels, footholds, strict=True))
    return tuple(dict.fromkeys(f"{first} on {second}" for first, second in pairs))
