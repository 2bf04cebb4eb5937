"""Simulate in MuJoCo how objects meet a robot with proximity sensors."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, cast

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, nonnegative, positive
from pretouch._core.warning_codes import with_context
from pretouch.control.structures import Output, Status
from pretouch.simulation import SensorChain
from pretouch.simulation.result import whole
from pretouch.simulation.sensing import SensorRun

from .centering import Centering, HandMotion, pair_of
from .deviations import explain_deviations, report_deviations, report_rising_forces, report_touches
from .drives import Drives, drives_of
from .dynamics import (
    Drivetrain,
    constraint_rows,
    drivetrain_of,
    free_acceleration,
    joined,
    posture_dynamics,
    reduce_base,
)
from .model import Data, Model, check_model, mujoco, site_index
from .obstruction import beam_warnings, refuse_covered_sensor, refuse_overlap
from .projection import warnings_of_site
from .reference import JointPath
from .result import (
    BodyContact,
    DetectedEncounter,
    RobotSimulation,
    RobotTrace,
    SiteContact,
    prediction_of,
    touches_elsewhere,
)
from .sight import FARTHEST, Glance, Sight
from .site_law import SiteLaw
from .touches import ContactPoint, SiteSurface, Touches, approach_velocity, contact_points
from .tracking import ComputedTorque, JointState, Tracking

HORIZON: Final = 5.0
"""Default for the longest time that a run waits for the contact of all sites [s]."""

FOLLOW: Final = 0.02
"""Default for the time that a run continues at least after the last contact [s]."""

LONGEST: Final = 1.0
"""Longest time that a run continues after the last contact until the force has passed its peak [s]."""

_INSTANT: Final = 1e-12  # s
_FINEST: Final = 0.5  # largest product of the feedback's angular frequency and the time step
_OPPOSED: Final = -0.99  # cosine of the angle between the axes of two fingers that face each other
_DETECTING: Final = int(Status.DETECTING)


@check_arguments
def simulate_robot(
    model: Model,
    data: Data,
    laws: Sequence[SiteLaw],
    *,
    tracking: Tracking | None = None,
    centering: Centering | None = None,
    runs: int = 1,
    seed: int = 0,
    contact_stiffness: float | None = None,
    horizon: float = HORIZON,
    follow_time: float = FOLLOW,
    workers: int = 1,
) -> RobotSimulation:
    """Simulate how objects meet a robot with sampled control laws.

    The results are compared with the 1-D prediction. Each sensor sees the scene by rays, and has its own sensor chain
    and its own controller. The controllers move the references of their sites along axes that stay those of the start,
    relative to the base. The tracking makes the joints follow. The robot starts at rest, and the objects move as the
    state says.

    Laws on robots are one-sided by default, see `SiteLaw`: an object that leaves the beam looks like one that recedes.

    The drives apply the torques of the tracking within the force limits of the model. Actuators and their controls are
    not used otherwise.

    Args:
        model: a `mujoco.MjModel` with robot and objects. Its time step has to divide the period of the controllers.
        data: its state at the start, with the velocities of the objects.
        laws: the controllers, at most one per site, all with one period. The sites may be on several robots.
        tracking: how the joints follow; computed torque by default.
        centering: law that centers a hand between two opposed fingers; None for none. The prediction of a finger does
            not know it.
        runs: number of runs, each with its own noise and phase of the sensors.
        seed: seed of the noise.
        contact_stiffness: stiffness of the contact [N/m] for the predicted impact force; None for no prediction.
        horizon: longest time to wait for the contact of all sites [s].
        follow_time: time to continue at least after the last contact [s]. A run continues until the force on the robot
            has passed its peak, for at most 1 s.
        workers: number of processes that share the runs. A program that uses more than one has to start its work under
            `if __name__ == "__main__":`, because each process imports the program.

    Returns:
        Contacts and largest values of every site and run, next to their prediction.
    """
    options = {
        "horizon": positive(horizon, "horizon", "s"),
        "follow_time": nonnegative(follow_time, "follow_time", "s"),
    }
    check_model(model)
    scene = _Scene.of(model, data, laws, tracking=tracking or ComputedTorque(), centering=centering, **options)
    stiffness = None if contact_stiffness is None else positive(contact_stiffness, "contact_stiffness", "N/m")
    count, seed = whole(runs, "runs", 1, 10**7), whole(seed, "seed", 0, 2**64 - 1)
    results = _simulate(scene, seed, count, whole(workers, "workers", 1, 1024))
    contacts = tuple(zip(*(result.contacts for result in results), strict=True))
    touches = tuple(result.touches for result in results)
    predictions = tuple(
        tuple(None if c.detection is None else prediction_of(law, c.detection, stiffness) for c in row)
        for law, row in zip(laws, contacts, strict=True)
    )
    return RobotSimulation(
        sites=tuple(law.site.name for law in laws),
        contacts=contacts,
        predictions=predictions,
        touches=touches,
        robot_forces=tuple(result.robot_force for result in results),
        warnings=(
            *report_touches(touches_elsewhere(touches)),
            *report_rising_forces([result.passed_peak for result in results]),
            *_warnings(scene, contacts, predictions),
        ),
        laws=tuple(laws),
        model=scene.model,
        trace_of=_Tracer(scene, seed),
    )


def _warnings(
    scene: _Scene,
    contacts: Sequence[Sequence[SiteContact]],
    predictions: Sequence[Sequence[SiteContact | None]],
) -> Iterator[str]:
    """Yield all warnings of a robot simulation, on postures, model and deviations from the prediction."""
    names = [law.site.name for law in scene.laws]
    explanations = list(explain_deviations(names, contacts))
    if scene.centering is None:  # the prediction does not know the law of the hand
        explanations += report_deviations(names, contacts, predictions)
    for law in scene.laws:
        index, curve = site_index(scene.model, law.site.name), law.site.sensor
        sight = Sight(scene.model, law.site, index, cast("Any", curve), FARTHEST)
        for warning in (
            *warnings_of_site(scene.model, scene.data, law.site),
            *beam_warnings(scene.model, scene.data, index, sight),
        ):
            yield with_context(law.site.name, warning)
    yield from explanations


@dataclass(frozen=True, slots=True)
class _RunResult:
    """Contacts of one run: of the sites, of all bodies, the largest force on the robot [N], and if it was passed."""

    contacts: tuple[SiteContact, ...]
    touches: tuple[BodyContact, ...]
    robot_force: float
    passed_peak: bool


def _simulate(scene: _Scene, seed: int, runs: int, workers: int) -> list[_RunResult]:
    """Simulate all runs, in several processes if there are several workers."""
    if workers == 1:
        return _simulate_part(scene, seed, range(runs))
    from concurrent.futures import ProcessPoolExecutor  # noqa: PLC0415 - only for several workers
    from multiprocessing import get_context  # noqa: PLC0415

    parts = [range(first, runs, workers) for first in range(min(workers, runs))]
    with ProcessPoolExecutor(len(parts), mp_context=get_context("spawn")) as pool:
        finished = list(pool.map(_simulate_part, [scene] * len(parts), [seed] * len(parts), parts))
    return [finished[run % len(parts)][run // len(parts)] for run in range(runs)]


def _simulate_part(scene: _Scene, seed: int, runs: range) -> list[_RunResult]:
    return [_Run(scene, seed, run).finish() for run in runs]


@dataclass(frozen=True, slots=True)
class _Tracer:
    """Callable that repeats a simulated run and records its time series."""

    scene: Any
    seed: int

    def __call__(self, run: int) -> RobotTrace:
        rows: list[tuple[Any, ...]] = []
        _Run(self.scene, self.seed, run, rows).finish()
        columns = [np.array(column) for column in zip(*rows, strict=True)]
        return RobotTrace(*columns)


@dataclass(frozen=True, slots=True)
class _Scene:
    """Inputs and prepared model that all runs of a simulation share."""

    model: Model
    data: Data
    laws: tuple[SiteLaw, ...]
    tracking: Tracking
    centering: Centering | None
    drivetrains: tuple[Drivetrain, ...]
    drives: Drives
    highest: FloatArray
    path: JointPath
    steps: int
    period: float
    horizon: float
    follow_time: float

    @classmethod
    def of(
        cls,
        model: Model,
        data: Data,
        laws: Sequence[SiteLaw],
        *,
        tracking: Tracking,
        centering: Centering | None,
        horizon: float,
        follow_time: float,
    ) -> _Scene:
        """Check the inputs of a simulation, and copy the robot model.

        Returns:
            The scene of the simulation, with a copy in which joint torques replace the actuators.

        Raises:
            InvalidInputError: an input is invalid, or the time step does not fit the controller period.
        """
        library = mujoco()
        laws = tuple(laws)
        names = [law.site.name for law in laws]
        if not laws or len(set(names)) < len(names):
            raise InvalidInputError(
                f"laws: found control laws for the sites {names}, expected at least one law, and at most one law per "
                "site",
                value=names,
            )
        periods = {law.controller.period for law in laws}
        if len(periods) > 1:
            listed = ", ".join(f"{p:g} s" for p in sorted(periods))
            raise InvalidInputError(
                f"laws: found controllers with different periods ({listed}), expected the same period for all"
            )
        (period,) = periods
        steps = round(period / model.opt.timestep)
        if steps < 1 or abs(period / model.opt.timestep - steps) > 1e-6 * steps:
            raise InvalidInputError(
                f"model: the time step of {model.opt.timestep:g} s does not divide the controller period of "
                f"{period:g} s. Set <option timestep=.../> to the period divided by a whole number"
            )
        _check_bandwidth(tracking, model.opt.timestep)
        copied = copy.copy(model)
        copied.opt.disableflags |= int(library.mjtDisableBit.mjDSBL_ACTUATION)
        start = library.MjData(model)
        start.qpos[:], start.qvel[:] = data.qpos, data.qvel
        library.mj_forward(model, start)
        indices = [site_index(model, name) for name in names]
        drivetrains = joined([drivetrain_of(model, start, index) for index in indices])
        tree = np.concatenate([drivetrains[0].driven, drivetrains[0].base])
        start.qvel[tree[: len(drivetrains[0].driven)]] = 0.0
        library.mj_forward(model, start)
        for law, index in zip(laws, indices, strict=True):
            curve: Any = law.site.sensor
            glance = Sight(model, law.site, index, curve, FARTHEST).glance(start)
            refuse_overlap(model, start, law.site, index, glance.distance)
            refuse_covered_sensor(model, start, law.site, index)
        if centering is not None:
            _check_opposed(start, centering, laws, indices)
        still = library.MjData(model)
        still.qpos[:] = data.qpos
        library.mj_forward(model, still)
        drives = drives_of(model, still, drivetrains[0], np.full(len(drivetrains[0].driven), math.inf))
        return cls(
            model=copied,
            data=start,
            laws=laws,
            tracking=tracking,
            centering=centering,
            drivetrains=drivetrains,
            drives=drives,
            highest=_largest_torques(drives),
            path=JointPath(copied, start, drivetrains, [law.site for law in laws]),
            steps=steps,
            period=period,
            horizon=horizon,
            follow_time=follow_time,
        )


def _check_opposed(data: Data, centering: Centering, laws: Sequence[SiteLaw], indices: Sequence[int]) -> None:
    """Raise an error if two fingers do not face each other."""
    first, second = (
        np.array(data.site_xmat[indices[i]]).reshape(3, 3) @ laws[i].site.direction for i in pair_of(centering, laws)
    )
    if float(first @ second) > _OPPOSED:
        angle = math.degrees(math.acos(max(-1.0, min(1.0, float(first @ second)))))
        raise InvalidInputError(
            f"centering: found an angle of {angle:.3g} deg between the axes of the sites "
            f"{' and '.join(centering.sites)}, expected opposed axes (180 deg)",
            value=angle,
        )


def _check_bandwidth(tracking: Tracking, step: float) -> None:
    """Raise an error if the joint controller's bandwidth is too high."""
    bandwidth = getattr(tracking, "bandwidth", 0.0)
    if 2 * math.pi * bandwidth * step > _FINEST:
        raise InvalidInputError(
            f"bandwidth: found {bandwidth:g} Hz, expected at most {_FINEST / (2 * math.pi * step):.3g} Hz for the "
            f"model's time step of {step:g} s. Reduce the bandwidth of the joint controller, or reduce the time step",
            value=bandwidth,
        )


def _largest_torques(drives: Drives) -> FloatArray:
    """Return the smallest and largest actuator torques per joint, shape (n, 2)."""
    by_control = np.sort(drives.gain[:, None] * drives.controls + drives.constant[:, None], axis=1)
    by_control = np.where(drives.gain[:, None] == 0, (-math.inf, math.inf), by_control)
    low = np.maximum(drives.lowest, by_control[:, 0])
    high = np.minimum(drives.highest, by_control[:, 1])
    torques = np.zeros((drives.moment.shape[1], 2))
    for row, least, most in zip(drives.moment, low, high, strict=True):
        for joint in np.flatnonzero(row):
            ends = sorted((row[joint] * least, row[joint] * most))
            torques[joint] += ends
    return np.clip(torques, drives.torques[:, :1], drives.torques[:, 1:])


class _Site:
    """One sensor site in a simulated run. It has a sensor, a controller and the results recorded so far."""

    __slots__ = (
        *("body", "controller", "detection", "distance", "excursion", "force", "glance", "index", "impulse", "law"),
        *("mass", "obstacle", "peak", "saturated", "sensor", "sight", "surface", "target", "time", "speed"),
        *("drivetrain", "fall", "sideways", "start", "turn"),
    )

    def __init__(self, scene: _Scene, i: int, data: Data, seed: int, run: int) -> None:
        law = scene.laws[i]
        self.law, self.drivetrain = law, scene.drivetrains[i]
        self.index = self.drivetrain.site
        curve: Any = law.site.sensor
        self.sight = Sight(scene.model, law.site, self.index, curve, FARTHEST)
        chain = law.chain or SensorChain(rate=1 / scene.period)
        distance = self.sight.equivalent_distance(data)
        self.sensor = SensorRun(
            *(chain, curve),
            distance=distance,
            farthest=FARTHEST,
            period=scene.period,
            seed=seed,
            run=run * len(scene.laws) + i,
        )
        self.controller = law.running.begin()
        self.body = int(scene.model.site_bodyid[self.index])
        self.glance = self.sight.glance(data)
        self.distance = self.glance.distance
        self.surface = SiteSurface(scene.model, data, law.site, self.index)
        self.detection: DetectedEncounter | None = None
        # position and velocity of the reference, at the start and at the end of the period
        self.target = (0.0, law.approach, 0.0, law.approach)
        self.time = self.speed = math.nan
        self.excursion = self.force = self.peak = self.impulse = 0.0
        self.mass = math.nan
        velocity = np.zeros(6)
        kind = mujoco().mjtObj.mjOBJ_SITE
        mujoco().mj_objectVelocity(scene.model, data, kind, self.index, velocity, 0)
        self.start = self.sight.axis(data), np.array(data.site_xpos[self.index]), velocity[3:].copy()
        self.fall = free_acceleration(scene.model, data, self.drivetrain)
        self.turn = self.sideways = self.saturated = 0.0
        self.obstacle = ""


class _Run:
    """One simulated run of a robot and the objects around it."""

    def __init__(self, scene: _Scene, seed: int, run: int, rows: list[tuple[Any, ...]] | None = None) -> None:
        library = mujoco()
        self.scene, self.rows = scene, rows
        self.data = library.MjData(scene.model)
        self.data.qpos[:], self.data.qvel[:] = scene.data.qpos, scene.data.qvel
        self.path = scene.path.restart()
        approach = np.array([law.approach for law in scene.laws])
        drivetrain, velocity = scene.drivetrains[0], self.path.at(0 * approach, approach, 0 * approach).velocity
        parts = posture_dynamics(scene.model, scene.data, drivetrain, scene.laws[0].site.direction)
        self.data.qvel[drivetrain.driven] = velocity
        self.data.qvel[drivetrain.base] += parts.reduction.forced @ velocity
        library.mj_forward(scene.model, self.data)
        self.sites = [_Site(scene, i, self.data, seed, run) for i in range(len(scene.laws))]
        self.places = np.asarray(scene.model.jnt_qposadr)[scene.drivetrains[0].joints]
        self.last_contact = math.nan
        surfaces, names = [site.surface for site in self.sites], [law.site.name for law in scene.laws]
        self.touches = Touches(scene.model, self.data, scene.drivetrains, surfaces, names)
        centering = scene.centering
        self.hand = None if centering is None else HandMotion(centering, scene.laws, scene.period)
        self.hand_target = (0.0, 0.0, 0.0, 0.0)

    def finish(self) -> _RunResult:
        """Simulate the run to its end, and return all contacts.

        Returns:
            The contacts of all sites and bodies. The run ends some time after the last contact, or after the longest
            time.
        """
        scene, now = self.scene, 0.0
        for j in range(math.ceil(scene.horizon / scene.period - 1e-9)):
            t = j * scene.period
            self._move_hand([self._ask(site, t) for site in self.sites])
            for i in range(scene.steps):
                self._step(t, i)
            now = t + scene.period
            if self._is_over(now):
                break
            if not np.isfinite(self.data.qpos).all():
                break
        for site in self.sites:
            if math.isnan(site.time):
                self._leave_axis(site, now)
        passed = self.touches.has_passed_peak(self.data, now, scene.follow_time)
        contacts = tuple(
            SiteContact(
                time=site.time,
                relative_velocity=site.speed,
                peak_force=site.peak,
                impulse=site.impulse,
                excursion=site.excursion,
                energy=0.5 * site.mass * site.speed**2,
                detection=site.detection,
                axis_turn=site.turn,
                sideways=site.sideways,
                saturated=site.saturated,
                obstacle=site.obstacle,
            )
            for site in self.sites
        )
        return _RunResult(contacts, self.touches.contacts(), self.touches.peak, passed)

    def _is_over(self, now: float) -> bool:
        """Return True if all sites have touched and the force on the robot has passed its peak."""
        if any(math.isnan(site.time) for site in self.sites):
            return False
        after, follow = now - self.last_contact, self.scene.follow_time
        passed = self.touches.has_passed_peak(self.data, now, follow)
        return after >= follow and (passed or after >= max(follow, LONGEST))

    def _move_hand(self, outputs: Sequence[Output]) -> None:
        """Move the hand of a centering law for one control period. Without such a law, do nothing."""
        if self.hand is not None:
            before = self.hand.position, self.hand.velocity
            self.hand.advance(outputs, touched=any(not math.isnan(site.time) for site in self.sites))
            self.hand_target = (*before, self.hand.position, self.hand.velocity)

    def _ask(self, site: _Site, t: float) -> Output:
        """Run one controller step for a site with its latest reading."""
        fresh = site.sensor.deliver(t)
        output = site.controller.step(
            *(site.sensor.reading, fresh, max(t - site.sensor.measured, 0.0)),
            contact_force=-site.force,
            reference_position=site.law.approach * t,
            reference_velocity=site.law.approach,
        )
        if output.status & _DETECTING and site.detection is None and math.isfinite(site.distance):
            site.detection = self._detect(site, t)
        _, _, x, v = site.target
        site.target = (x, v, output.position, output.velocity)
        return output

    def _detect(self, site: _Site, t: float) -> DetectedEncounter:
        """Return the encounter of a site at its first detection, with distance, velocities and masses."""
        scene, data = self.scene, self.data
        model = scene.model
        dynamics = posture_dynamics(model, data, site.drivetrain, site.law.site.direction)
        glance = site.glance
        motions = self.path.motion_of(self.sites.index(site))
        body = int(model.geom_bodyid[glance.geom])
        tree = int(model.body_treeid[body])
        along = self._approach(site)
        free = tree >= 0 and tree != int(model.body_treeid[site.body])
        share = float(1 - dynamics.axis @ dynamics.relative[:3] @ motions) if len(site.drivetrain.base) else 0.0
        return DetectedEncounter(
            time=t,
            distance=glance.distance,
            relative_velocity=along,
            acceleration=self._object_acceleration(glance, site),
            reflected_mass=dynamics.reflected_mass,
            obstacle_mass=float(model.body_subtreemass[int(model.body_rootid[body])]) if free else math.inf,
            recoil_share=share,
            position=site.target[2],
            velocity=site.target[3],
        )

    def _object_acceleration(self, glance: Glance, site: _Site) -> float:
        """Return the object's acceleration along the sensor axis [m/s^2].

        It is relative to the site, such as it would move if no driven joint accelerated.
        """
        library, model, data = mujoco(), self.scene.model, self.data
        body = int(model.geom_bodyid[glance.geom])
        library.mj_rnePostConstraint(model, data)
        accelerations = np.zeros(6)
        library.mj_objectAcceleration(model, data, library.mjtObj.mjOBJ_BODY, body, accelerations, 0)
        proper = accelerations[3:].copy()
        moving = int(model.body_treeid[body]) >= 0
        own = proper + model.opt.gravity if moving else np.zeros(3)
        return float(site.sight.axis(data) @ (own - free_acceleration(model, data, site.drivetrain)))

    def _approach(self, site: _Site) -> float:
        """Return the rate of change [m/s] of the distance to the object."""
        library, model, data, glance = mujoco(), self.scene.model, self.data, site.glance
        u = site.sight.axis(data)
        jacobian, turn = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        point = np.array(data.site_xpos[site.index]) + glance.distance * u
        library.mj_jac(model, data, jacobian, None, point, int(model.geom_bodyid[glance.geom]))
        hit = jacobian @ data.qvel
        library.mj_jacSite(model, data, jacobian, turn, site.index)
        here = jacobian @ data.qvel + np.cross(turn @ data.qvel, glance.distance * u)
        facing = float(glance.normal @ u)
        return float(glance.normal @ (hit - here)) / facing if facing else math.nan

    def _step(self, t: float, i: int) -> None:
        """Advance the simulation by one step of MuJoCo."""
        scene, data, library = self.scene, self.data, mujoco()
        model, h = scene.model, scene.model.opt.timestep
        library.mj_step1(model, data)
        torque = self._torques(i * h)
        data.qfrc_applied[scene.drivetrains[0].driven] = torque
        if self.rows is not None:
            self._record(t + i * h, torque)
        velocity = np.array(data.qvel)
        library.mj_step2(model, data)
        library.mj_kinematics(model, data)
        library.mj_comPos(model, data)
        now = t + (i + 1) * h
        points = contact_points(model, data) if data.ncon else []
        self.touches.watch(data, points, velocity, now - h)
        for site in self.sites:
            self._watch(site, now, h, points, velocity)

    def _torques(self, at: float) -> FloatArray:
        """Return the torques, within those of the drives, that make the joints follow their reference."""
        scene, data, model = self.scene, self.data, self.scene.model
        drivetrain = scene.drivetrains[0]
        driven, base = drivetrain.driven, drivetrain.base
        motion = np.array([_cubic(site.target, scene.period, at) for site in self.sites])
        if self.hand is not None:
            shares = np.array([self.hand.along(i) for i in range(len(self.sites))])
            motion = motion + shares[:, None] * np.array(_cubic(self.hand_target, scene.period, at))
        reference = self.path.at(*motion.T)
        mass, load = np.zeros((model.nv, model.nv)), np.array(data.qfrc_bias - data.qfrc_passive)
        mujoco().mj_fullM(model, data, mass)
        inertia, force = mass[driven[:, None], driven], load[driven]
        if len(base) or model.neq:
            every = np.concatenate([base, driven])
            own = mass[every[:, None], every]
            motion = reduce_base(own, constraint_rows(model, data, drivetrain.footholds)[:, every], len(base)).motion
            together = np.vstack([motion, np.eye(len(driven))])
            inertia, force = together.T @ own @ together, together.T @ load[every]
        state = JointState(
            np.array(data.qpos)[self.places],
            np.array(data.qvel)[driven],
            *(reference.position, reference.velocity, reference.acceleration, inertia, force),
            lambda: self.path.held(data),
        )
        wanted = scene.tracking.torques(state)
        torques = np.clip(wanted, *scene.highest.T)
        for site in self.sites:
            if math.isnan(site.time):
                site.saturated += model.opt.timestep * bool(np.any(torques != wanted))
                site.obstacle = site.obstacle or reference.obstacle
        return torques

    def _watch(self, site: _Site, now: float, h: float, points: Sequence[ContactPoint], velocity: FloatArray) -> None:
        """Update the reading of a sensor site, and record its contact."""
        model, data = self.scene.model, self.data
        before, site.glance = site.distance, site.sight.glance(data)
        site.distance = site.glance.distance
        while site.sensor.next <= now + _INSTANT:
            distance = site.sight.equivalent_distance(data)
            ahead = (now - site.sensor.next) / h
            moved = site.distance - before
            shift = -moved * ahead if math.isfinite(distance) and math.isfinite(moved) else 0.0
            site.sensor.look(max(distance + shift, 0.0) if math.isfinite(distance) else 2 * FARTHEST)
        if math.isnan(site.time):
            site.excursion = max(site.excursion, abs(site.target[2] - site.law.approach * now))
        own = [(push, side) for push in points if (side := site.surface.side(data, push)) is not None]
        site.force = self._force(site, own)
        site.peak = max(site.peak, site.force)
        site.impulse += site.force * h
        if math.isnan(site.time) and (site.distance <= 0 < before or site.force > 0):
            on_axis = site.distance <= 0 < before < math.inf
            part = before / (before - site.distance) if on_axis else 0.0
            site.time = self.last_contact = now - (1 - part) * h
            self._leave_axis(site, site.time)
            if on_axis:
                site.speed = (site.distance - before) / h
            else:  # no ray has met the object at the contact point
                strongest = max(own, key=lambda pair: float(np.linalg.norm(pair[0].force)))[0]
                site.speed = approach_velocity(model, data, strongest, velocity)
            dynamics = posture_dynamics(model, data, site.drivetrain, site.law.site.direction)
            obstacle = math.inf if site.detection is None else site.detection.obstacle_mass
            site.mass = 1 / (1 / dynamics.reflected_mass + 1 / obstacle)

    def _leave_axis(self, site: _Site, now: float) -> None:
        """Record how far a site has moved and turned off its initial axis, which moves with the robot."""
        axis, position, velocity = site.start
        moved = np.array(self.data.site_xpos[site.index]) - position - velocity * now - site.fall * (now * now / 2)
        turn = float(np.linalg.norm(np.cross(axis, site.sight.axis(self.data))))
        site.turn, site.sideways = math.asin(min(turn, 1.0)), float(np.linalg.norm(np.cross(axis, moved)))

    def _force(self, site: _Site, points: Sequence[tuple[ContactPoint, int]]) -> float:
        """Return the contact force [N] on the surface of a site along its axis, positive if it pushes back."""
        u = site.sight.axis(self.data)
        return math.fsum(float(push.force @ u) * (1.0 if side == 0 else -1.0) for push, side in points)

    def _record(self, t: float, torque: FloatArray) -> None:
        """Append the present state of the simulation to the recorded time series."""
        assert self.rows is not None  # noqa: S101 - the caller checks it
        self.rows.append(
            (
                t,
                np.array([site.distance for site in self.sites]),
                np.array([site.target[2] for site in self.sites]),
                np.array([site.force for site in self.sites]),
                torque.copy(),
                np.array(self.data.qpos),
            )
        )


def _cubic(target: tuple[float, float, float, float], period: float, at: float) -> tuple[float, float, float]:
    """Interpolate position, velocity and acceleration within one controller period."""
    x0, v0, x1, v1 = target
    s = at / period
    a, b = v0 * period, v1 * period
    second, third = 3 * (x1 - x0) - 2 * a - b, a + b - 2 * (x1 - x0)
    return (
        x0 + s * (a + s * (second + s * third)),
        (a + s * (2 * second + 3 * s * third)) / period,
        (2 * second + 6 * s * third) / period**2,
    )
