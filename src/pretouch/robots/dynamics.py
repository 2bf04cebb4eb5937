"""Reduce robot dynamics in a posture to motion along a sensor axis.

The equations of motion are M v' + h = B f + J^T F + A^T c, with the generalized velocity v = (v_b, q') of the base and
of the driven joints, and constraint forces c that keep A v = A_b v_b + A_q q' = 0. The rows of A are the active
equality constraints of the model: joints and tendons that are coupled, loops, and welds. The contacts on which the
robot stands are further rows.

The constraints determine a part of the base, v_b = P q' with P = -A_b^+ A_q. The rest, with a basis B of the null space
of A_b, moves so that nothing but gravity changes its momentum: B^T (M_bb v_b + M_bq q') stays 0 in a frame that falls
with the robot. Together, v_b = -G q' with

    -G = P - B (B^T M_bb B)^-1 B^T (M_bb P + M_bq),

which is -M_bb^-1 M_bq without constraints. With T = (-G, 1) this gives

- the inertia that the drives feel, T^T M T, and their load T^T h,
- the generalized Jacobian J T of the site in the falling frame (Y. Umetani, K. Yoshida, 1989),
- the Jacobian of the site relative to the base, J_q + J_b P,
- rows C = (1 - A_b A_b^+) A_q with C q' = 0, if the constraints couple driven joints.

The reflected mass along u is 1 / (u^T J N (N^T M N)^-1 N^T J^T u) with a basis N of the null space of A.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray

from .model import Data, Model, joint_label, mujoco, names_of, tree_of
from .stance import Foothold, footholds_of, rows_of

_FEASIBLE: Final = 1e-7  # residual of the motion along the axis, above which the joints cannot hold a direction
_RANK: Final = 1e-10  # relative singular values below it are zero up to rounding
_DEPENDENT: Final = 1e-8  # of constraint rows of length 1: rounding of loops that are closed up to it
_HELD: Final = 1e-12  # share of the mobility of a site, below which the constraints hold it up to rounding
_FALLING: Final = 0.01  # share of gravity by which the acceleration of a falling robot may differ from it
_CLOSED: Final = 1e-10  # m or rad: error of a closed loop
_CLOSING: Final = 20  # steps of Newton's method


@dataclass(frozen=True, slots=True)
class Drivetrain:
    """The driven and passive degrees of freedom of a sensor's robot.

    Args:
        site: index of the site.
        driven: degrees of freedom that an actuator moves, shape (n,).
        base: all others of the robot: a floating base and passive joints, shape (m,).
        root: those of the base by which the whole robot moves: no driven joint is between them and the world.
        joints: the joint of each driven degree of freedom, shape (n,).
        rows: indices of the actuator outputs that act on the robot.
        footholds: the contacts on which the robot stands. They hold their points along all motions.
        shared: whether actuators drive several joints together, such as by a tendon, so that some joint motions are
            driven by none.
    """

    site: int
    driven: IntArray
    base: IntArray
    root: IntArray
    joints: IntArray
    rows: IntArray
    footholds: tuple[Foothold, ...] = ()
    shared: bool = False


@dataclass(frozen=True, slots=True)
class PostureDynamics:
    """Mass matrix and Jacobians of a robot in one posture.

    `inertia`, `own` and `seen` are reduced to the driven joints.

    Args:
        mass: mass matrix of base and joints, the base first, shape (m + n, m + n).
        inertia: inertia that the drives feel, shape (n, n).
        own: Jacobian of the site relative to the base by the joints, shape (6, n): three rows of the position, three of
            the orientation. What the constraints make follow the joints counts.
        relative: generalized Jacobian of the site relative to the common center of mass, shape (6, n).
        full: Jacobian by base and joints, the base first, shape (6, m + n).
        reduction: the base and its constraints.
        axis: direction toward objects in the world frame, shape (3,).
        position: position of the site in the world frame [m], shape (3,).
    """

    mass: FloatArray
    inertia: FloatArray
    own: FloatArray
    relative: FloatArray
    full: FloatArray
    reduction: Reduction
    axis: FloatArray
    position: FloatArray

    @property
    def reflected_mass(self) -> float:
        """Effective mass [kg] in an impact along the sensor axis.

        It is 1 / (u^T J M^-1 J^T u) with the axis u, the Jacobian J and the mass matrix M. Constraints of the model
        and contacts on which the robot stands count: the site moves as they allow. It is infinite if they hold the
        site.
        """
        return self.mass_with(self.reduction.allowed)

    def mass_with(self, free: FloatArray) -> float:
        """Return the effective mass [kg] along the axis if only some velocities are possible.

        Args:
            free: a basis of these velocities, the base first, shape (m + n, k).
        """
        row, whole = self.axis @ self.full[:3] @ free, self.axis @ self.full[:3]
        if not len(row):
            return math.inf
        mobility = float(row @ np.linalg.solve(free.T @ self.mass @ free, row))
        unconstrained = float(whole @ np.linalg.solve(self.mass, whole))
        return 1 / mobility if mobility > _HELD * unconstrained else math.inf

    @property
    def lightest_mass(self) -> float:
        """The smallest effective mass [kg] in any direction that the joints allow."""
        jacobian, inertia = self.own[:3], self.inertia
        if len(self.reduction.coupling):
            free = null_space(self.reduction.coupling)
            jacobian, inertia = jacobian @ free, free.T @ inertia @ free
        mobility = jacobian @ np.linalg.solve(inertia, jacobian.T)
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
    tree, moment = _linked(model, data, tree_of(model, site)), actuator_moment(model, data)
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
    base = tree[~moved]
    chain = np.intersect1d(_root_of(model, site, driven), base)
    # a robot on a fixed base does not stand on contacts, such as those between its own links
    footholds = footholds_of(model, data, (base, driven, chain), constraint_rows(model, data)) if len(chain) else ()
    held = constraint_rows(model, data, footholds)
    free = np.abs(null_space(held[:, base])).max(axis=1, initial=0.0) > _RANK
    root = np.intersect1d(chain, base[free])
    torques = np.vstack([moment[np.ix_(rows, driven)], _couplings(model, data, base, driven, footholds)])
    shared = np.linalg.matrix_rank(torques) < len(driven)
    return Drivetrain(site, driven, base, root, joints, rows, footholds, bool(shared))


def _couplings(model: Model, data: Data, base: IntArray, driven: IntArray, footholds: Sequence[Foothold]) -> FloatArray:
    """Return the rows of the constraints that couple driven joints, shape (r, n)."""
    every, mass = np.concatenate([base, driven]), np.zeros((model.nv, model.nv))
    mujoco().mj_fullM(model, data, mass)
    rows = constraint_rows(model, data, footholds)[:, every]
    return reduce_base(mass[np.ix_(every, every)], rows, len(base)).coupling


def _linked(model: Model, data: Data, tree: IntArray) -> IntArray:
    """Return the degrees of freedom of a robot: of its kinematic tree, and of the trees that constraints join to it."""
    trees = np.asarray(model.dof_treeid)
    touched = [set(trees[row != 0].tolist()) for row in constraint_rows(model, data)]
    linked = set(trees[tree].tolist())
    while added := set().union(*(group for group in touched if group & linked)) - linked:
        linked |= added
    return np.flatnonzero(np.isin(trees, list(linked)))


def _root_of(model: Model, site: int, driven: IntArray) -> IntArray:
    """Return the degrees of freedom between the world and the first driven joint on the way to a site."""
    chain: list[int] = []
    body = int(model.site_bodyid[site])
    while body > 0:
        first = int(model.body_dofadr[body])
        chain = [*range(first, first + int(model.body_dofnum[body])), *chain]
        body = int(model.body_parentid[body])
    stop = next((i for i, degree in enumerate(chain) if degree in set(driven.tolist())), len(chain))
    return np.array(chain[:stop], dtype=np.int64)


def joined(drivetrains: Sequence[Drivetrain]) -> tuple[Drivetrain, ...]:
    """Combine the degrees of freedom of several sensor sites.

    The fingers of a hand that is fixed to the world are separate kinematic trees in MuJoCo.

    Returns:
        One drivetrain for each site, with the degrees of freedom of all sites.
    """
    trees = list({int(d.driven[0]): d for d in drivetrains}.values())
    names = "driven", "base", "root", "joints"
    driven, base, root, joints = (np.concatenate([getattr(d, name) for d in trees]) for name in names)
    rows = np.unique(np.concatenate([d.rows for d in trees]))
    footholds = tuple(foothold for d in trees for foothold in d.footholds)
    shared = any(d.shared for d in trees)
    return tuple(Drivetrain(d.site, driven, base, root, joints, rows, footholds, shared) for d in drivetrains)


def constraint_rows(model: Model, data: Data, footholds: Sequence[Foothold] = ()) -> FloatArray:
    """Return the Jacobian of the active equality constraints and of the given contacts, shape (k, nv).

    The state has to be that after `mj_forward` or `update_posture`. The rows have unit length.
    """
    if not model.neq and not footholds:
        return np.zeros((0, model.nv))
    equal = np.asarray(data.efc_type) == int(mujoco().mjtConstraint.mjCNSTR_EQUALITY)
    rows = rows_of(model, data, footholds)
    if model.neq and equal.any():
        rows = np.vstack([_all_rows(model, data)[equal], rows])
    sizes = np.linalg.norm(rows, axis=1)
    real = sizes > _RANK * sizes.max(initial=0.0)  # directions in which the joints cannot move a contact are rounding
    return np.asarray(rows[real] / sizes[real, None])


def _all_rows(model: Model, data: Data) -> FloatArray:
    """Return the dense Jacobian of all constraints of MuJoCo, shape (nefc, nv)."""
    if not mujoco().mj_isSparse(model):
        return np.array(data.efc_J).reshape(-1, model.nv)
    dense = np.zeros((len(data.efc_J_rownnz), model.nv))
    mujoco().mju_sparse2dense(dense, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    return dense


def null_space(rows: FloatArray) -> FloatArray:
    """Return a basis of the vectors that all rows map to 0; the identity without rows."""
    count = rows.shape[1]
    if not len(rows) or not count:
        return np.eye(count)
    _, values, right = np.linalg.svd(rows)
    return np.asarray(right[int((values > _DEPENDENT * max(1.0, values[0])).sum()) :].T)


@dataclass(frozen=True, slots=True)
class Reduction:
    """How the base of a robot moves with its driven joints.

    Args:
        motion: -G, the velocities of the base per velocity of the joints, shape (m, n).
        forced: P, the part of it that constraints cause, shape (m, n).
        loose: B, a basis of the base motions that no constraint holds, shape (m, k).
        coupling: C, rows that are 0 for all joint velocities that the constraints allow, and that actuators cause which
            drive several joints together, shape (r, n).
        allowed: N, a basis of all velocities that the constraints allow, the base first, shape (m + n, l).
    """

    motion: FloatArray
    forced: FloatArray
    loose: FloatArray
    coupling: FloatArray
    allowed: FloatArray


def reduce_base(mass: FloatArray, constraints: FloatArray, count: int) -> Reduction:
    """Return how the base of a robot moves with its driven joints.

    Args:
        mass: mass matrix of base and joints, the base first.
        constraints: rows of the constraints, in the same order.
        count: number of degrees of freedom of the base.

    Returns:
        The motion of the base.
    """
    if not len(constraints):
        motion = np.asarray(-np.linalg.solve(mass[:count, :count], mass[:count, count:]), dtype=np.float64)
        nothing = np.zeros((0, len(mass) - count))
        return Reduction(motion, np.zeros_like(motion), np.eye(count), nothing, np.eye(len(mass)))
    of_base, of_joints = constraints[:, :count], constraints[:, count:]
    inverse = np.linalg.pinv(of_base, rcond=_DEPENDENT) if count else np.zeros((0, len(constraints)))
    forced, loose = -inverse @ of_joints, null_space(of_base)
    rest = np.linalg.solve(loose.T @ mass[:count, :count] @ loose, loose.T @ (mass[:count] @ _stack(forced)))
    coupling = of_joints - of_base @ inverse @ of_joints
    sizes = np.linalg.norm(coupling, axis=1)
    return Reduction(forced - loose @ rest, forced, loose, coupling[sizes > _DEPENDENT], null_space(constraints))


def _stack(motion: FloatArray) -> FloatArray:
    """Return T, the velocities of base and joints per velocity of the joints."""
    return np.vstack([motion, np.eye(motion.shape[1])])


def free_acceleration(model: Model, data: Data, drivetrain: Drivetrain) -> FloatArray:
    """Return the acceleration of a site [m/s^2] while no driven joint accelerates, shape (3,).

    It is that of gravity for a robot that falls, and 0 for one that stands on a fixed base.

    Args:
        model: the model.
        data: its state after `mj_forward` or `mj_step1`.
        drivetrain: the degrees of freedom.
    """
    base = drivetrain.base
    if not len(base):
        return np.zeros(3)
    mass, jacobian = np.zeros((model.nv, model.nv)), np.zeros((3, model.nv))
    mujoco().mj_fullM(model, data, mass)
    mujoco().mj_jacSite(model, data, jacobian, None, drivetrain.site)
    loose = null_space(constraint_rows(model, data, drivetrain.footholds)[:, base])
    force = np.array(data.qfrc_passive - data.qfrc_bias)[base]
    acceleration = loose @ np.linalg.solve(loose.T @ mass[np.ix_(base, base)] @ loose, loose.T @ force)
    return np.asarray(jacobian[:, base] @ acceleration)


def falls(model: Model, data: Data, drivetrain: Drivetrain) -> bool:
    """Return True if a robot falls freely, so that gravity accelerates its site."""
    gravity = np.array(model.opt.gravity)
    missing = float(np.linalg.norm(free_acceleration(model, data, drivetrain) - gravity))
    return bool(len(drivetrain.root)) and missing <= _FALLING * float(np.linalg.norm(gravity))


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
    library.mj_transmission(model, data)
    library.mj_makeM(model, data)
    if model.neq:
        library.mj_makeConstraint(model, data)


def close_loops(model: Model, data: Data, drivetrain: Drivetrain) -> None:
    """Move the base of a robot so that it meets its constraints for the positions of the driven joints.

    The state is that after `update_posture`. Newton's method moves what the constraints determine; without constraints,
    nothing changes. The points of contacts on which the robot stands stay where they are: feet do not roll.
    """
    footholds = drivetrain.footholds
    if not model.neq and not footholds:
        return
    library, base = mujoco(), drivetrain.base
    before = math.inf
    for _ in range(_CLOSING):
        equal = np.asarray(data.efc_type) == int(library.mjtConstraint.mjCNSTR_EQUALITY)
        parts = [np.array(data.efc_pos)[equal] if model.neq else np.zeros(0), *(f.error(data) for f in footholds)]
        error = np.concatenate(parts)
        size = float(np.abs(error).max(initial=0.0))
        if size < _CLOSED or size >= before:
            return
        equalities = _all_rows(model, data)[equal] if model.neq else np.zeros((0, model.nv))
        before, rows = size, np.vstack([equalities, rows_of(model, data, footholds)])[:, base]
        step = np.zeros(model.nv)
        step[base] = -np.linalg.pinv(rows, rcond=_DEPENDENT) @ error
        library.mj_integratePos(model, data.qpos, step, 1.0)
        update_posture(model, data)


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
    reduction = reduce_base(mass, constraint_rows(model, data, drivetrain.footholds)[:, every], count)
    together = _stack(reduction.motion)
    inertia = together.T @ mass @ together
    if drivetrain.shared:  # what no actuator drives keeps its momentum, as a passive joint does
        torques = np.vstack([actuator_moment(model, data)[np.ix_(drivetrain.rows, driven)], reduction.coupling])
        undriven = null_space(torques).T @ inertia
        reduction = replace(reduction, coupling=np.vstack([reduction.coupling, undriven]))
    return PostureDynamics(
        mass=mass,
        inertia=inertia,
        own=jacobian @ _stack(reduction.forced),
        relative=jacobian @ together,
        full=jacobian,
        reduction=reduction,
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
    kept = np.delete(np.arange(len(dynamics.inertia)), np.asarray(locked, dtype=np.int64))
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
    moves = dynamics.relative @ joints
    shift, turn = (part - (part @ dynamics.axis) * dynamics.axis for part in (moves[:3], moves[3:]))
    return AxisMotion(
        hold=hold,
        joints=joints,
        free=free,
        moved_mass=moved,
        recoil_share=float(1 - dynamics.axis @ moves[:3]),
        conditioning=float(np.sqrt(dynamics.lightest_mass / moved)),
        turning=float(np.linalg.norm(turn)),  # without the turn about the axis, which changes nothing
        sideways=float(np.linalg.norm(shift)),
    )


def held_rows(dynamics: PostureDynamics, hold: str) -> FloatArray:
    """Return the Jacobian of the sensor axis, the fixed directions and the couplings of driven joints.

    The first row is that of the axis. The shape is (k, n).
    """
    u = dynamics.axis
    lines = np.zeros(({"axis": 1, "position": 3, "pose": 6}[hold], 6))
    lines[0, :3] = u
    if hold != "axis":
        lines[1:3, :3] = _across(u)
    if hold == "pose":
        lines[3:, 3:] = np.eye(3)
    return np.vstack([lines @ dynamics.own, dynamics.reduction.coupling])


def _across(u: FloatArray) -> FloatArray:
    """Return two unit vectors at right angles to a unit vector and to each other, as rows."""
    x, y, z = u.tolist()
    side = math.copysign(1.0, z)  # T. Duff and others, 2017
    a = -1 / (side + z)
    b = x * y * a
    return np.array([[1 + side * x * x * a, side * b, -side * x], [b, side + y * y * a, -y]])


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
    inverse = np.linalg.inv(np.linalg.cholesky(inertia))
    whitened = rows @ inverse.T
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
    motions = inverse.T @ (right[:rank].T @ (part / values[:rank, None]))
    return motions, inverse.T @ right[rank:].T
