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
from functools import lru_cache
from itertools import accumulate
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.native import INTEGER, POINTER, address, kernel
from pretouch._core.numbers import FloatArray, IntArray

from .model import Data, Model, joint_label, mujoco, names_of, tree_of
from .stance import Foothold, footholds_of, rows_of

_RANK: Final = 1e-10  # relative singular values below it are zero up to rounding
_DEPENDENT: Final = 1e-8  # of constraint rows of length 1: rounding of loops that are closed up to it
_HELD: Final = 1e-12  # share of the mobility of a site, below which the constraints hold it up to rounding
_FALLING: Final = 0.01  # share of gravity by which the acceleration of a falling robot may differ from it
_CLOSED: Final = 1e-10  # m or rad: error of a closed loop
_CLOSING: Final = 20  # steps of Newton's method
_BYTE: Final = np.dtype(np.uint8)
_INDEX: Final = np.dtype(np.int64)
_NOT_DEFINITE: Final = -2  # status of compiled functions

_reduce: Final = kernel("robot_posture_reduce", *(POINTER,) * 4, *(INTEGER,) * 4, POINTER, POINTER, result=INTEGER)
_least_energy: Final = kernel(
    "robot_least_energy", POINTER, INTEGER, POINTER, INTEGER, POINTER, INTEGER, POINTER, POINTER, result=INTEGER
)
_axis_motion: Final = kernel(
    *("robot_axis_motion", POINTER, INTEGER, INTEGER, POINTER, POINTER, INTEGER, INTEGER, POINTER, POINTER),
    result=INTEGER,
)


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
        memory: the result of the compiled function, of which the arrays are parts.
    """

    mass: FloatArray
    inertia: FloatArray
    own: FloatArray
    relative: FloatArray
    full: FloatArray
    reduction: Reduction
    axis: FloatArray
    position: FloatArray
    memory: FloatArray

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


@dataclass(frozen=True, slots=True)
class AxisMotion:
    """The joint motion that moves a sensor site along its axis.

    Args:
        hold: what the joints hold meanwhile: pose, position or axis.
        joints: joint velocities per velocity of the site relative to the base, shape (n,).
        moved_mass: effective mass of this motion for the drives [kg].
        recoil_share: share of the motion that the recoil of the base takes back, kappa.
        conditioning: sqrt(lightest mass / moved mass): 1 in the best direction, 0 at a singularity.
        turning: angle by which the axis of the sensor turns per motion of the site [rad/m].
        sideways: motion across the axis per motion of the site relative to the base.
    """

    hold: str
    joints: FloatArray
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
    return RobotReducer(model, data, (base, driven)).reduce(constraint_rows(model, data, footholds)).reduction.coupling


def _linked(model: Model, data: Data, tree: IntArray) -> IntArray:
    """Return the degrees of freedom of a robot: of its kinematic tree, and of the trees that constraints join to it."""
    trees = np.asarray(model.dof_treeid)
    touched = [set(trees[row != 0].tolist()) for row in constraint_rows(model, data)]
    linked = set(trees[tree].tolist())
    while added := set().union(*(group for group in touched if group & linked)) - linked:
        linked |= added
    return np.flatnonzero(np.isin(trees, list(linked)))


def robot_trees(model: Model, data: Data, drivetrain: Drivetrain) -> frozenset[int]:
    """Return the kinematic trees of a robot: those that constraints join to its site, and all that actuators drive."""
    driven = np.asarray(actuator_moment(model, data).any(axis=0))
    driven[np.concatenate([drivetrain.driven, drivetrain.base])] = True
    return frozenset(np.asarray(model.dof_treeid)[driven].tolist())


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
        constraints: A, the rows of the constraints by base and joints, the base first, shape (k, m + n).
    """

    motion: FloatArray
    forced: FloatArray
    loose: FloatArray
    coupling: FloatArray
    constraints: FloatArray

    @property
    def allowed(self) -> FloatArray:
        """N, a basis of all velocities that the constraints allow, the base first, shape (m + n, l)."""
        return null_space(self.constraints)


@dataclass(frozen=True, slots=True)
class ReducedRobot:
    """Mass matrix and Jacobians of a robot in a posture, reduced to the driven joints; see `PostureDynamics`."""

    mass: FloatArray
    full: FloatArray
    inertia: FloatArray
    own: FloatArray
    relative: FloatArray
    reduction: Reduction
    memory: FloatArray


class RobotReducer:
    """Reduces the dynamics of a robot to its driven joints, in memory that the next posture uses again.

    Args:
        model: the model.
        data: its state, which may change between two postures.
        degrees: the degrees of freedom of the base, and the driven ones.
        site: index of the site to which the Jacobians belong; None for none, which makes them 0.
    """

    __slots__ = (
        *("_arguments", "_constraints", "_counts", "_data", "_every", "_jacobian", "_mass", "_memory"),
        *("_model", "_parts", "_robot", "_site", "_sizes"),
    )

    def __init__(self, model: Model, data: Data, degrees: tuple[IntArray, IntArray], site: int | None = None) -> None:
        self._model, self._data, self._site = model, data, site
        self._every, self._sizes = np.concatenate(degrees), (len(degrees[0]), len(degrees[1]))
        self._mass, self._jacobian = np.empty((model.nv, model.nv)), np.zeros((6, model.nv))
        self._counts, self._constraints = np.zeros(2, dtype=np.int64), np.zeros((0, model.nv))
        self._allocate()

    def _allocate(self) -> None:
        """Reserve memory for the present number of constraints."""
        (m, n), k = self._sizes, len(self._constraints)
        shapes = (m + n, m + n), (6, m + n), (n, n), (6, n), (6, n), (m, n), (m, n), (m, m), (k, n)
        ends = list(accumulate(rows * columns for rows, columns in shapes))
        memory: FloatArray = np.empty(ends[-1])
        self._parts: list[FloatArray] = [
            memory[end - a * b : end].reshape(a, b) for end, (a, b) in zip(ends, shapes, strict=True)
        ]
        self._memory = memory
        self._robot: ReducedRobot | None = None
        self._arguments = (
            *(address(self._mass), address(self._jacobian), address(self._constraints), address(self._every, _INDEX)),
            *(self._model.nv, m, n, k, address(memory), address(self._counts, _INDEX)),
        )

    def reduce(self, constraints: FloatArray) -> ReducedRobot:
        """Reduce the dynamics of the present posture.

        Args:
            constraints: rows of the constraints by all degrees of freedom, shape (k, nv).

        Returns:
            The reduced dynamics. Its arrays change with the next call.
        """
        mujoco().mj_fullM(self._model, self._data, self._mass)
        if self._site is not None:
            mujoco().mj_jacSite(self._model, self._data, self._jacobian[:3], self._jacobian[3:], self._site)
        if constraints.shape != self._constraints.shape:
            self._constraints = np.array(constraints)
            self._allocate()
        self._constraints[:] = constraints
        _check(_reduce(*self._arguments))
        if self._robot is None or len(constraints):
            whole, full, inertia, own, relative, motion, forced, loose, coupling = self._parts
            free, coupled = self._counts.tolist()
            reduction = Reduction(motion, forced, loose[:free].T, coupling[:coupled], constraints[:, self._every])
            self._robot = ReducedRobot(whole, full, inertia, own, relative, reduction, self._memory)
        return self._robot


def _check(status: int) -> None:
    """Raise the exception of a compiled function."""
    if status == _NOT_DEFINITE:
        raise np.linalg.LinAlgError("the mass matrix of the robot is not positive definite")
    if status < _NOT_DEFINITE:
        raise MemoryError


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
    reducer = RobotReducer(model, data, (drivetrain.base, drivetrain.driven), drivetrain.site)
    axis = np.array(data.site_xmat[drivetrain.site]).reshape(3, 3) @ direction
    return dynamics_along(model, data, drivetrain, axis, reducer)


def dynamics_along(
    model: Model, data: Data, drivetrain: Drivetrain, axis: FloatArray, reducer: RobotReducer
) -> PostureDynamics:
    """Compute the mass matrix and Jacobians of a robot in a posture, with memory that the next posture uses again.

    Args:
        model: the model.
        data: its state after `update_posture` or `mj_forward`.
        drivetrain: its degrees of freedom.
        axis: axis of the sensor in the world frame.
        reducer: the memory for these degrees of freedom.

    Returns:
        The reduced dynamics, whose arrays change with the next posture.
    """
    site, robot = drivetrain.site, reducer.reduce(constraint_rows(model, data, drivetrain.footholds))
    reduction = robot.reduction
    if drivetrain.shared:  # what no actuator drives keeps its momentum, as a passive joint does
        moment = actuator_moment(model, data)[np.ix_(drivetrain.rows, drivetrain.driven)]
        undriven = null_space(np.vstack([moment, reduction.coupling])).T @ robot.inertia
        reduction = replace(reduction, coupling=np.vstack([reduction.coupling, undriven]))
    return PostureDynamics(
        mass=robot.mass,
        inertia=robot.inertia,
        own=robot.own,
        relative=robot.relative,
        full=robot.full,
        reduction=reduction,
        axis=axis,
        position=np.array(data.site_xpos[site]),
        memory=robot.memory,
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
    for choice in ("pose", "position", "axis") if hold == "auto" else (hold,):
        motion = _motion_along(dynamics, choice, locked)
        if motion is not None:
            return motion
    return None


def _motion_along(dynamics: PostureDynamics, hold: str, locked: Any) -> AxisMotion | None:
    """Return the joint motion along the axis, with other directions fixed; None if that is impossible."""
    (m, n), rows = dynamics.reduction.forced.shape, held_rows(dynamics, hold)
    still, found = np.zeros(n, dtype=np.uint8), np.empty(n + 5)
    if len(locked):
        still[list(locked)] = 1
    status = _axis_motion(
        *(address(dynamics.memory), m, n, address(dynamics.axis)),
        *(address(rows), len(rows), len(dynamics.reduction.coupling), address(still, _BYTE), address(found)),
    )
    _check(status)
    if status < 0:
        return None
    moved_mass, recoil_share, conditioning, turning, sideways = found[n:].tolist()
    return AxisMotion(
        hold=hold,
        joints=found[:n],
        moved_mass=moved_mass,
        recoil_share=recoil_share,
        conditioning=conditioning,
        turning=turning,  # without the turn about the axis, which changes nothing
        sideways=sideways,
    )


def held_rows(dynamics: PostureDynamics, hold: str) -> FloatArray:
    """Return the Jacobian of the sensor axis, the fixed directions and the couplings of driven joints.

    The first row is that of the axis. The shape is (k, n).
    """
    lines = _lines(*dynamics.axis.tolist(), hold)
    return np.concatenate([lines @ dynamics.own, dynamics.reduction.coupling])


@lru_cache(maxsize=64)
def _lines(x: float, y: float, z: float, hold: str) -> FloatArray:
    """Return the directions of the position and the orientation that move or are held, shape (k, 6)."""
    u = np.array([x, y, z])
    lines = np.zeros(({"axis": 1, "position": 3, "pose": 6}[hold], 6))
    lines[0, :3] = u
    if hold != "axis":
        lines[1:3, :3] = _across(u)
    if hold == "pose":
        lines[3:, 3:] = np.eye(3)
    return lines


def free_motions(dynamics: PostureDynamics, motion: AxisMotion) -> FloatArray:
    """Return a basis of the joint motions that move nothing that is held, shape (n, k)."""
    solution = least_energy(held_rows(dynamics, motion.hold), (0,), dynamics.inertia)
    return np.zeros((len(motion.joints), 0)) if solution is None else solution[1]


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
    count, moved = len(inertia), np.asarray(driven, dtype=np.int64)
    rows, motions, others = np.ascontiguousarray(rows), np.empty((count, len(moved))), np.empty(count * count)
    loose = _least_energy(
        *(address(rows), len(rows), address(moved, _INDEX), len(moved)),
        *(address(np.ascontiguousarray(inertia)), count, address(motions), address(others)),
    )
    _check(loose)
    return None if loose < 0 else (motions, others[: count * loose].reshape(count, loose))
