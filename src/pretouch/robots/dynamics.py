"""Reduce robot dynamics in a posture to motion along a sensor axis.

The equations of motion are M v' + h = B f + J^T F, with the generalized velocity v = (v_b, q') of the base and of the
driven joints. Nothing pushes on a floating base but gravity, so that the momentum M_bb v_b + M_bq q' stays 0 in a frame
that falls with the robot. With G = M_bb^-1 M_bq this gives

- the base's motion -G q' for joint velocities q',
- the inertia that the drives feel, M_qq - M_qb G,
- the generalized Jacobian J_q - J_b G of the site in that frame (Y. Umetani, K. Yoshida, 1989).

Without a base, G is empty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray

from .model import Data, Model, joint_label, mujoco, names_of, tree_of

_FEASIBLE: Final = 1e-7  # residual of the motion along the axis, above which the joints cannot hold a direction
_RANK: Final = 1e-10  # relative singular values below it are zero up to rounding


@dataclass(frozen=True, slots=True)
class Drivetrain:
    """The driven and passive degrees of freedom of a sensor's robot.

    Args:
        site: index of the site.
        driven: degrees of freedom that an actuator moves, shape (n,).
        base: all others of the same kinematic tree: a floating base and passive joints, shape (m,).
        joints: the joint of each driven degree of freedom, shape (n,).
        rows: indices of the actuator outputs that act on the robot.
    """

    site: int
    driven: IntArray
    base: IntArray
    joints: IntArray
    rows: IntArray


@dataclass(frozen=True, slots=True)
class PostureDynamics:
    """Mass matrix and Jacobians of a robot in one posture.

    `inertia`, `own` and `seen` are reduced to the driven joints.

    Args:
        mass: mass matrix of base and joints, the base first, shape (m + n, m + n).
        inertia: inertia that the drives feel, shape (n, n).
        own: Jacobian of the site relative to the base by the joints, shape (6, n): three rows of the position, three of
            the orientation.
        relative: generalized Jacobian of the site relative to the common center of mass, shape (6, n).
        full: Jacobian by base and joints, the base first, shape (6, m + n).
        share: G, the base's motion for a motion of the joints with the opposite sign, shape (m, n).
        axis: direction toward objects in the world frame, shape (3,).
        position: position of the site in the world frame [m], shape (3,).
    """

    mass: FloatArray
    inertia: FloatArray
    own: FloatArray
    relative: FloatArray
    full: FloatArray
    share: FloatArray
    axis: FloatArray
    position: FloatArray

    @property
    def reflected_mass(self) -> float:
        """Effective mass [kg] in an impact along the sensor axis.

        It is 1 / (u^T J M^-1 J^T u) with the axis u, the Jacobian J and the mass matrix M.
        """
        row = self.axis @ self.full[:3]
        return float(1 / (row @ np.linalg.solve(self.mass, row)))

    @property
    def lightest_mass(self) -> float:
        """The smallest effective mass [kg] in any direction that the joints allow."""
        jacobian = self.own[:3]
        mobility = jacobian @ np.linalg.solve(self.inertia, jacobian.T)
        return float(1 / np.linalg.eigvalsh(mobility)[-1])


@dataclass(frozen=True, slots=True)
class AxisMotion:
    """The joint motion that moves a sensor site along its axis.

    Args:
        hold: what the joints hold meanwhile: pose, position or axis.
        joints: joint velocities per velocity of the site relative to the base, shape (n,).
        free: basis of the joint motions that move nothing that is held, shape (n, k).
        moved_mass: effective mass of this motion for the drives [kg].
        recoil_share: share of the motion that the recoil of the base takes back, kappa.
        conditioning: sqrt(lightest mass / moved mass): 1 in the best direction, 0 at a singularity.
        turning: angle by which the axis of the sensor turns per motion of the site [rad/m].
        sideways: motion across the axis per motion of the site relative to the base.
    """

    hold: str
    joints: FloatArray
    free: FloatArray
    moved_mass: float
    recoil_share: float
    conditioning: float
    turning: float
    sideways: float


def drivetrain_of(model: Model, data: Data, site: int) -> Drivetrain:
    """Find the driven and passive degrees of freedom of a sensor's robot.

    Args:
        model: the model.
        data: its state; the actuators must move the same joints in every posture.
        site: index of the site.

    Returns:
        The degrees of freedom.

    Raises:
        InvalidInputError: the site cannot move, or no actuator moves it.
    """
    tree, moment = tree_of(model, site), actuator_moment(model, data)
    moved = np.abs(moment[:, tree]).max(axis=0, initial=0.0) > 0
    if not moved.any():
        raise InvalidInputError(
            f"actuators: no actuator of the model moves the robot with the site {names_of(model, 'site')[site]!r}; "
            "add actuators, such as <motor joint=...>"
        )
    driven = tree[moved]
    joints = np.asarray(model.dof_jntid)[driven]
    kinds = mujoco().mjtJoint
    for joint in joints:
        if int(model.jnt_type[joint]) not in {int(kinds.mjJNT_HINGE), int(kinds.mjJNT_SLIDE)}:
            raise InvalidInputError(
                f"joint {joint_label(model, int(joint))!r}: an actuator moves this ball or free joint, but driven "
                "joints must be hinges or slides; use several hinges instead"
            )
    rows = np.flatnonzero(np.abs(moment[:, driven]).max(axis=1) > 0)
    if len(moment) != model.nu or np.any(np.asarray(model.actuator_ctrlnum) != 1):
        raise InvalidInputError(
            "actuators: found an actuator with several controls or forces, expected actuators with one of each"
        )
    return Drivetrain(site, driven, tree[~moved], joints, rows)


def joined(drivetrains: Sequence[Drivetrain]) -> tuple[Drivetrain, ...]:
    """Combine the degrees of freedom of several sensor sites.

    The fingers of a hand that is fixed to the world are separate kinematic trees in MuJoCo.

    Returns:
        One drivetrain for each site, with the degrees of freedom of all sites.
    """
    trees = list({int(d.driven[0]): d for d in drivetrains}.values())
    driven, base, joints = (np.concatenate([getattr(d, name) for d in trees]) for name in ("driven", "base", "joints"))
    rows = np.unique(np.concatenate([d.rows for d in trees]))
    return tuple(Drivetrain(d.site, driven, base, joints, rows) for d in drivetrains)


def actuator_moment(model: Model, data: Data) -> FloatArray:
    """Return the generalized forces per unit of actuator force.

    The dense matrix has one row for each actuator output.
    """
    moment = np.zeros((len(data.moment_rownnz), model.nv))
    if len(moment):
        sparse = data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
        mujoco().mju_sparse2dense(moment, *sparse)
    return moment


def update_posture(model: Model, data: Data) -> None:
    """Update a model's body positions and mass matrix for new joint positions."""
    library = mujoco()
    library.mj_kinematics(model, data)
    library.mj_comPos(model, data)
    library.mj_tendon(model, data)
    library.mj_makeM(model, data)


def posture_dynamics(model: Model, data: Data, drivetrain: Drivetrain, direction: FloatArray) -> PostureDynamics:
    """Compute the mass matrix and Jacobians of a robot in a posture.

    They are reduced to the driven joints.

    Args:
        model: the model.
        data: its state after `update_posture` or `mj_forward`.
        drivetrain: its degrees of freedom.
        direction: axis of the sensor in the frame of the site.

    Returns:
        The reduced dynamics.
    """
    library = mujoco()
    base, driven, site = drivetrain.base, drivetrain.driven, drivetrain.site
    every = np.concatenate([base, driven])
    mass, jacobian = np.zeros((model.nv, model.nv)), np.zeros((6, model.nv))
    library.mj_fullM(model, data, mass)
    library.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
    mass, jacobian, count = mass[np.ix_(every, every)], jacobian[:, every], len(base)
    share = np.linalg.solve(mass[:count, :count], mass[:count, count:])
    return PostureDynamics(
        mass=mass,
        inertia=mass[count:, count:] - mass[count:, :count] @ share,
        own=jacobian[:, count:],
        relative=jacobian[:, count:] - jacobian[:, :count] @ share,
        full=jacobian,
        share=share,
        axis=np.array(data.site_xmat[site]).reshape(3, 3) @ direction,
        position=np.array(data.site_xpos[site]),
    )


def axis_motion(dynamics: PostureDynamics, hold: str, locked: Any = ()) -> AxisMotion | None:
    """Find the least-energy joint motion that moves a sensor along its axis.

    Of all such joint motions, it has the least kinetic energy. It is the motion that a force along the axis would cause
    if constraints held the other directions. Computed torque and operational-space control with the dynamically
    consistent inverse both command it (O. Khatib, 1987).

    Args:
        dynamics: the posture.
        hold: "pose", "position", "axis", or "auto" for the first of these that is possible.
        locked: indices of driven joints that must not move.

    Returns:
        The motion; None if the joints cannot move the site in this way.
    """
    kept = np.setdiff1d(np.arange(len(dynamics.inertia)), locked)
    for choice in ("pose", "position", "axis") if hold == "auto" else (hold,):
        motion = _axis_motion(dynamics, choice, kept) if len(kept) else None
        if motion is not None:
            return motion
    return None


def _axis_motion(dynamics: PostureDynamics, hold: str, kept: IntArray) -> AxisMotion | None:
    """Return the joint motion along the axis, with other directions fixed; None if that is impossible."""
    inertia = dynamics.inertia[np.ix_(kept, kept)]
    solution = least_energy(held_rows(dynamics, hold)[:, kept], (0,), inertia)
    if solution is None:
        return None
    motion, others = solution
    joints, free = np.zeros(len(dynamics.inertia)), np.zeros((len(dynamics.inertia), others.shape[1]))
    joints[kept], free[kept] = motion[:, 0], others
    moved = float(joints @ dynamics.inertia @ joints)
    shift, turn = (np.cross(part @ joints, dynamics.axis) for part in (dynamics.relative[:3], dynamics.relative[3:]))
    return AxisMotion(
        hold=hold,
        joints=joints,
        free=free,
        moved_mass=moved,
        recoil_share=float(1 - dynamics.axis @ dynamics.relative[:3] @ joints),
        conditioning=float(np.sqrt(dynamics.lightest_mass / moved)),
        turning=float(np.linalg.norm(turn)),  # without the turn about the axis, which changes nothing
        sideways=float(np.linalg.norm(shift)),
    )


def held_rows(dynamics: PostureDynamics, hold: str) -> FloatArray:
    """Return the Jacobian of the sensor axis and the fixed directions.

    The first row is that of the axis. The shape is (k, n).
    """
    u = dynamics.axis
    lines = np.zeros(({"axis": 1, "position": 3, "pose": 6}[hold], 6))
    lines[0, :3] = u
    if hold != "axis":
        lines[1:3, :3] = np.linalg.svd(u[None])[2][1:]
    if hold == "pose":
        lines[3:, 3:] = np.eye(3)
    held: FloatArray = lines @ dynamics.own
    return held


def least_energy(
    rows: FloatArray, driven: tuple[int, ...], inertia: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Find the least-energy joint motion along each of several directions.

    The directions are rows of a Jacobian. Each motion moves along its own row only. Rows in meters and in radians are
    made comparable by the mobility of each, and rows of zeros are left out.

    Args:
        rows: the Jacobian of all directions that move or are held, shape (k, n).
        driven: indices of the rows that move, one motion for each.
        inertia: the inertia of the joints, shape (n, n).

    Returns:
        The motions, shape (n, m), and a basis of the motions that move no row; None if the rows are in conflict.
    """
    root = np.linalg.cholesky(inertia)
    whitened = np.linalg.solve(root, rows.T).T
    sizes = np.linalg.norm(whitened, axis=1)
    useful = sizes > _RANK * sizes.max()
    if not useful[list(driven)].all():
        return None
    scaled = whitened[useful] / sizes[useful, None]
    left, values, right = np.linalg.svd(scaled, full_matrices=True)
    rank = int((values > _RANK * values[0]).sum())
    targets = np.zeros((len(rows), len(driven)))
    targets[list(driven), range(len(driven))] = 1 / sizes[list(driven)]
    part = left[:, :rank].T @ targets[useful]
    missed = np.linalg.norm(left[:, :rank] @ part - targets[useful], axis=0)
    if np.any(missed > _FEASIBLE * targets.max(axis=0)):
        return None
    motions = np.linalg.solve(root.T, right[:rank].T @ (part / values[:rank, None]))
    return motions, np.linalg.solve(root.T, right[rank:].T)
