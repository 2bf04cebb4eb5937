"""Run simulated encounters of a robot in compiled code.

The compiled loop runs MuJoCo, sensors, laws, references, tracking and contacts. It returns to Python for what happens
rarely: the first detection and the first contact of a site, a new anchor of the joint path, and the torques of a
tracking that Python computes.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from ctypes import byref
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.native import INTEGER, POINTER, Structure, address, copy_of, kernel, location, numbers
from pretouch._core.numbers import FloatArray
from pretouch.control import CompiledStep
from pretouch.control.laws import as_step
from pretouch.control.structures import RawOutput
from pretouch.simulation import SensorChain
from pretouch.simulation.native_loop import PythonStep
from pretouch.simulation.sensing import SensorRun

from .centering import hand_law
from .dynamics import RobotReducer, actuator_moment, constraint_rows, free_acceleration, posture_dynamics
from .engine import address_of, contact_list, count_address, engine
from .model import mujoco, names_of
from .reference import SPACING
from .result import BodyContact, DetectedEncounter, SiteContact
from .run_scene import RunScene
from .sight import FARTHEST, NativeGlance, Sight
from .touches import PATIENCE, RESTING, RobotBodies, body_contact, surface_geoms
from .tracking import JointFeedback, JointState

LONGEST: Final = 1.0
"""Longest time that a run continues after the last contact until the force has passed its peak [s]."""

OBSTACLES: Final = "", "joint range", "singularity"
"""What keeps a reference from following the sites, by the number that the compiled loop uses."""

_ENDED, _DETECTED, _ANCHOR, _TORQUES, _TOUCHED, _ROWS, _FAILED = range(7)
_MOST_TOUCHES: Final = 1024  # pairs of bodies that touch in one run
_MOST_CONSTRAINTS: Final = 100_000  # scalar constraints of MuJoCo in one step
_MOST_ROWS: Final = 4096  # of a time series, after which Python stores them
_BYTE: Final = np.dtype(np.uint8)
_INDEX: Final = np.dtype(np.int64)

_run: Final = kernel("run_robot", POINTER, result=INTEGER)


class _Site(Structure):
    _fields_ = (
        *numbers("sight", "surface", "step", "parameters", "law", "sensor", kind=POINTER),
        ("index", INTEGER),
        *numbers("approach", "hand"),
        ("glance", NativeGlance),
        ("target", ctypes.c_double * 4),
        *numbers("force", "peak", "impulse", "excursion", "time", "speed", "saturated"),
        *numbers("obstacle", "detected", kind=INTEGER),
        ("output", RawOutput),
    )


class _Touch(Structure):
    _fields_ = (
        *numbers("body", "other", "site", "current", kind=ctypes.c_int32),
        *numbers("time", "speed", "peak"),
        ("total", ctypes.c_double * 3),
    )


class _Path(Structure):
    _fields_ = (
        *numbers("joints", "motions", "turn", "direction", "points", "inside", "ranges", kind=POINTER),
        *numbers("spacing", "blocked"),
        ("table", POINTER),
        *numbers("rows", "first", "ends", kind=INTEGER),
    )


class _Feedback(Structure):
    _fields_ = numbers("acceleration", "velocity", "damping", "stiffness", "scale", "interval", "delay")


class _NativeRun(Structure):
    _fields_ = (
        *numbers("engine", "model", "data", "qpos", "qvel", "applied", "bias", "passive", kind=POINTER),
        *numbers("site_points", "site_frames", "subtree_velocity", kind=POINTER),
        *numbers("contact_count", "equality_count", "constraint_count", "contacts", kind=POINTER),
        *(("contact_size", INTEGER), ("contact_fields", INTEGER * 4)),
        *numbers("nq", "nv", "bodies", kind=INTEGER),
        *numbers("geom_body", "flex_body", "body_root", "body_tree", "own", "moving", "still", kind=POINTER),
        *(("support", POINTER), ("support_count", INTEGER), ("sites", POINTER), ("site_count", INTEGER)),
        *(("path", _Path), ("feedback", _Feedback)),
        *numbers("driven", "base", "places", kind=POINTER),
        *numbers("driven_count", "base_count", kind=INTEGER),
        *numbers("highest", "motion", "reference", "wanted", "torques", "scratch", kind=POINTER),
        *(
            *numbers("equality", "selected", kind=POINTER),
            *numbers("most_equalities", "most_constraints", kind=INTEGER),
        ),
        *(("setpoints", POINTER), *numbers("most_setpoints", "setpoint_head", "setpoint_tail", kind=INTEGER)),
        *(("touches", POINTER), *numbers("most_touches", "touch_count", kind=INTEGER)),
        *(("rows", POINTER), ("most_rows", INTEGER), ("row_count", INTEGER)),
        *numbers("period", "time_step", "follow_time", "longest", "patience", "resting", "unseen"),
        *numbers("steps", "periods", "floats", "returns", "ask_torques", kind=INTEGER),
        *numbers("hand_first", "hand_second", kind=INTEGER),
        *numbers("hand_floors", "hand_gain", "hand_share", "hand_position", "hand_velocity"),
        ("hand_target", ctypes.c_double * 4),
        *numbers("phase", "number", "sub_step", "anchored", "touched", "passed", kind=INTEGER),
        *numbers("now", "last_contact", "first", "last", "summit", "force", "peak"),
        ("pair_direction", ctypes.c_double * 3),
        *numbers("pair_body", "pair_other", kind=INTEGER),
        ("message", ctypes.c_char * 256),
    )


@dataclass(frozen=True, slots=True)
class RunResult:
    """Contacts of one run: of the sites, of all bodies, the largest force on the robot [N], and if it was passed.

    `problems` has the names of MuJoCo's warnings in this run, such as "BADQACC".
    """

    contacts: tuple[SiteContact, ...]
    touches: tuple[BodyContact, ...]
    robot_force: float
    passed_peak: bool
    problems: tuple[str, ...]


class _SiteResult:
    """What Python records of a site during a run: its detection, and where it has been at its contact."""

    __slots__ = ("detection", "mass", "sideways", "turn")

    def __init__(self) -> None:
        self.detection: DetectedEncounter | None = None
        self.mass, self.turn, self.sideways = math.nan, 0.0, 0.0


class Runner:
    """Simulates the runs of a scene one after another, in one thread.

    Args:
        scene: the scene.
        seed: seed of the noise.
    """

    def __init__(self, scene: RunScene, seed: int) -> None:
        library, model = mujoco(), scene.model
        self._scene, self._seed = scene, seed
        self._data = data = library.MjData(model)
        self._path, drivetrain = scene.path.fork(), scene.drivetrains[0]
        self._start = self._start_velocity()
        self._reset()
        self._sights = [Sight(model, law.site, d.site, _curve(law), FARTHEST) for law, d in self._pairs]
        self._distances = [sight.equivalent_distance(data) for sight in self._sights]
        self._glances = [sight.glance(data) for sight in self._sights]
        self._places = [
            (sight.axis(data), *self._motion_of(d.site))
            for sight, (_, d) in zip(self._sights, self._pairs, strict=True)
        ]
        self._falls = [free_acceleration(model, data, d) for d in scene.drivetrains]
        self._laws = [_Law(law.running) for law in scene.laws]
        self._held: list[Any] = []
        self._joint_places = np.asarray(model.jnt_qposadr)[drivetrain.joints].astype(np.int64)
        count, sites = len(drivetrain.driven), len(scene.laws)
        self._motion, self._reference = np.zeros((3, sites)), np.zeros((3, count))
        self._wanted, self._torques = np.zeros(count), np.zeros(count)
        self._touches = (_Touch * _MOST_TOUCHES)()
        self._rows = np.empty((_MOST_ROWS, 1 + 3 * sites + count + model.nq))
        self._sites = (_Site * sites)()
        self._native = self._to_native()
        for i, (law, d) in enumerate(self._pairs):
            surface = self._hold(surface_geoms(model, data, law.site, d.site))
            own, along = self._sites[i], 0.0 if scene.centering is None else self._hand.along(i)
            own.sight, own.surface = ctypes.addressof(self._sights[i].native), address(surface, _BYTE)
            own.step, own.parameters, own.law = self._laws[i].places
            own.index, own.approach, own.hand = d.site, law.approach, along

    @property
    def path(self) -> Any:
        """The joint path with the anchors of all runs so far."""
        return self._path

    @property
    def _pairs(self) -> list[tuple[Any, Any]]:
        return list(zip(self._scene.laws, self._scene.drivetrains, strict=True))

    def _hold(self, array: Any) -> Any:
        """Keep an array alive to which the compiled loop points."""
        self._held.append(array)
        return array

    def _start_velocity(self) -> FloatArray:
        """Return the velocities of all joints at the start: those of the objects, and those of the approach."""
        scene, drivetrain = self._scene, self._scene.drivetrains[0]
        velocity = self._path.velocity_of(np.array([law.approach for law in scene.laws]))
        parts = posture_dynamics(scene.model, scene.data, drivetrain, scene.laws[0].site.direction)
        start = np.array(scene.data.qvel)
        start[drivetrain.driven] = velocity
        start[drivetrain.base] += parts.reduction.forced @ velocity
        return start

    def _reset(self) -> None:
        """Set the state of the start."""
        library, data = mujoco(), self._data
        library.mj_resetData(self._scene.model, data)
        data.qpos[:], data.qvel[:] = self._scene.data.qpos, self._start
        library.mj_forward(self._scene.model, data)

    def _motion_of(self, site: int) -> tuple[FloatArray, FloatArray]:
        """Return position and velocity of a site."""
        velocity, kind = np.zeros(6), mujoco().mjtObj.mjOBJ_SITE
        mujoco().mj_objectVelocity(self._scene.model, self._data, kind, site, velocity, 0)
        return np.array(self._data.site_xpos[site]), velocity[3:].copy()

    def _to_native(self) -> _NativeRun:
        """Return the structure of the compiled loop, with all that does not change from run to run."""
        scene, model, data, path = self._scene, self._scene.model, self._data, self._path
        drivetrain, bodies = scene.drivetrains[0], RobotBodies.of(model, data, scene.drivetrains)
        contacts, base = contact_list(data), len(drivetrain.base)
        flexes = np.array([model.flex_vertbodyid[first] for first in model.flex_vertadr], dtype=np.int32)
        feedback = scene.tracking.feedback()
        native = _NativeRun()
        native.engine, native.model, native.data = ctypes.addressof(engine()), model._address, data._address
        for name, view in (
            *(("qpos", data.qpos), ("qvel", data.qvel), ("applied", data.qfrc_applied), ("bias", data.qfrc_bias)),
            *(("passive", data.qfrc_passive), ("site_points", data.site_xpos), ("site_frames", data.site_xmat)),
            *(("subtree_velocity", data.subtree_linvel), ("geom_body", model.geom_bodyid), ("flex_body", flexes)),
            *(("body_root", model.body_rootid), ("body_tree", model.body_treeid)),
        ):
            setattr(native, name, address_of(self._hold(view)))
        native.contact_count, native.contacts, native.contact_size = contacts.count, contacts.start, contacts.size
        native.contact_fields = contacts.fields
        native.nq, native.nv, native.bodies = model.nq, model.nv, model.nbody
        for name in ("own", "moving", "still"):
            setattr(native, name, address(self._hold(getattr(bodies, name)), _BYTE))
        native.support, native.support_count = address(self._hold(bodies.support), _INDEX), len(bodies.support)
        native.sites, native.site_count = ctypes.addressof(self._sites), len(self._sites)
        native.path = _Path(
            *(address(a) for a in (path.joints, path.motions, path.turn, path.direction, path.points, path.inside)),
            *(address(path.ranges), SPACING, 0.0, address(path.table), len(path.table), -(len(path.table) // 2), 0),
        )
        used = feedback or JointFeedback(0.0, 0.0, 0.0, 0.0)
        native.feedback = _Feedback(
            *(used.acceleration, used.velocity, used.damping, used.stiffness, used.scale, used.interval, used.delay)
        )
        if used.interval or used.delay:
            count = math.ceil(used.delay / max(used.interval, model.opt.timestep)) + 3
            setpoints = self._hold(np.zeros((count, 1 + 3 * len(drivetrain.driven))))
            native.setpoints, native.most_setpoints = address(setpoints), count
        for name, indices in (("driven", drivetrain.driven), ("base", drivetrain.base), ("places", self._joint_places)):
            setattr(native, name, address(self._hold(np.ascontiguousarray(indices, dtype=np.int64)), _INDEX))
        native.driven_count, native.base_count = len(drivetrain.driven), base
        scratch = self._hold(np.zeros(4 * model.nv + (base + 1) * base))
        highest = self._hold(np.ascontiguousarray(scene.highest))
        for name, array in (
            *(("highest", highest), ("motion", self._motion), ("reference", self._reference)),
            *(("wanted", self._wanted), ("torques", self._torques), ("scratch", scratch)),
        ):
            setattr(native, name, address(array))
        native.touches, native.most_touches = ctypes.addressof(self._touches), _MOST_TOUCHES
        native.most_rows = _MOST_ROWS
        native.period, native.time_step, native.follow_time = scene.period, model.opt.timestep, scene.follow_time
        native.longest, native.patience, native.resting, native.unseen = LONGEST, PATIENCE, RESTING, 2 * FARTHEST
        native.steps, native.periods = scene.steps, math.ceil(scene.horizon / scene.period - 1e-9)
        native.floats, native.returns = bodies.floats, bodies.returns
        native.ask_torques = feedback is None or bool(drivetrain.footholds) or scene.forces is not None
        native.equality_count, native.constraint_count = count_address(data, "ne"), count_address(data, "nefc")
        if model.neq:
            most = max(int(data.ne), 1)
            equality = self._hold(np.zeros(most * (model.nv + base) + 2 * base * base + 3 * base))
            selected = self._hold(np.zeros(_MOST_CONSTRAINTS))
            native.equality, native.most_equalities = address(equality), most
            native.selected, native.most_constraints = address(selected), len(selected)
        native.hand_first = native.hand_second = -1
        if scene.centering is not None:
            self._hand = hand = hand_law(scene.centering, scene.laws, scene.period)
            native.hand_first, native.hand_second, native.hand_floors = hand.first, hand.second, hand.floors
            native.hand_gain, native.hand_share = hand.gain, hand.share
        return native

    def run(self, number: int, rows: list[FloatArray] | None = None) -> RunResult:
        """Simulate one run to its end.

        Args:
            number: index of the run; every run has its own noise.
            rows: list to which blocks of the time series are appended; None for no time series.

        Returns:
            The contacts of all sites and bodies. The run ends some time after the last contact, or after the longest
            time.

        Raises:
            InvalidInputError: MuJoCo has stopped the simulation.
        """
        native, results = self._native, [_SiteResult() for _ in self._sites]
        held = self._restart(number, record=rows is not None)
        handlers: dict[int, Callable[[], None]] = {
            _DETECTED: lambda: self._detect(results),
            _ANCHOR: self._extend,
            _TORQUES: self._set_torques,
            _TOUCHED: lambda: self._record_contact(results),
            _ROWS: lambda: self._store(rows),
        }
        while (reason := _run(byref(native))) in handlers:
            handlers[reason]()
        for law in self._laws:
            law.check()
        if reason == _FAILED:
            raise InvalidInputError(
                f"model: MuJoCo has stopped the simulation: {native.message.decode(errors='replace')}"
            )
        if rows is not None:
            self._store(rows)
        del held
        for i, own in enumerate(self._sites):
            if math.isnan(own.time):
                self._leave_axis(i, results[i], native.now)
        contacts = tuple(
            SiteContact(
                time=own.time,
                relative_velocity=own.speed,
                peak_force=own.peak,
                impulse=own.impulse,
                excursion=own.excursion,
                energy=0.5 * result.mass * own.speed**2,
                detection=result.detection,
                axis_turn=result.turn,
                sideways=result.sideways,
                saturated=own.saturated,
                obstacle=OBSTACLES[own.obstacle],
            )
            for own, result in zip(self._sites, results, strict=True)
        )
        return RunResult(contacts, self._body_contacts(), native.peak, bool(native.passed), self._problems())

    def _problems(self) -> tuple[str, ...]:
        """Return the names of MuJoCo's warnings since the start of the run."""
        kinds, counts = mujoco().mjtWarning, self._data.warning
        return tuple(
            name.removeprefix("mjWARN_")
            for name, kind in kinds.__members__.items()
            if name.startswith("mjWARN_") and counts[int(kind)].number
        )

    def _restart(self, number: int, *, record: bool) -> Any:
        """Set state, sensors, laws and results to those of the start of a run; return what has to be kept alive."""
        scene, native = self._scene, self._native
        self._reset()
        self._path.restart()
        sensors = []
        for i, (own, law) in enumerate(zip(self._sites, scene.laws, strict=True)):
            sensor = SensorRun(
                *(law.chain or SensorChain(rate=1 / scene.period), _curve(law)),
                distance=self._distances[i],
                farthest=FARTHEST,
                period=scene.period,
                seed=self._seed,
                run=number * len(scene.laws) + i,
            )
            sensors.append(sensor)
            self._laws[i].restart()
            glance = self._glances[i]
            own.sensor, own.time, own.speed = sensor.place, math.nan, math.nan
            own.glance.distance, own.glance.geom = glance.distance, glance.geom
            own.glance.normal[:] = glance.normal.tolist()
            own.target[:] = (0.0, law.approach, 0.0, law.approach)
            own.force = own.peak = own.impulse = own.excursion = own.saturated = 0.0
            own.obstacle = own.detected = 0
        native.touch_count = native.row_count = native.setpoint_head = native.setpoint_tail = 0
        native.rows = address(self._rows) if record else None
        native.hand_position = native.hand_velocity = 0.0
        native.hand_target[:] = (0.0,) * 4
        native.phase = native.number = native.sub_step = native.anchored = native.touched = native.passed = 0
        native.now = native.force = native.peak = native.path.blocked = 0.0
        native.path.ends = 0
        native.last_contact = native.first = native.last = native.summit = math.nan
        return sensors

    def _store(self, rows: list[FloatArray] | None) -> None:
        """Move the time series to a list of its blocks."""
        assert rows is not None  # noqa: S101 - only a run with rows records them
        rows.append(self._rows[: self._native.row_count].copy())
        self._native.row_count = 0

    def _extend(self) -> None:
        """Extend the joint path to the present reference of the sites."""
        path, native, points = self._path, self._native.path, self._motion[0].copy()
        whole = path.extend(points)
        native.ends = path.ends
        if len(points) == 1 and not whole:
            native.blocked = math.copysign(1.0, points[0] - path.points[0])

    def _detect(self, results: list[_SiteResult]) -> None:
        for i, own in enumerate(self._sites):
            if own.detected == 1:
                own.detected = 2
                results[i].detection = self._detection(i)

    def _detection(self, i: int) -> DetectedEncounter:
        """Return the encounter of a site at its first detection, with distance, velocities and masses."""
        scene, data, own = self._scene, self._data, self._sites[i]
        model, drivetrain = scene.model, scene.drivetrains[i]
        dynamics = posture_dynamics(model, data, drivetrain, scene.laws[i].site.direction)
        body = int(model.geom_bodyid[own.glance.geom])
        tree = int(model.body_treeid[body])
        free = tree >= 0 and tree != int(model.body_treeid[model.site_bodyid[drivetrain.site]])
        motion = self._path.motion_of(i)
        share = float(1 - dynamics.axis @ dynamics.relative[:3] @ motion) if len(drivetrain.base) else 0.0
        return DetectedEncounter(
            time=self._native.number * scene.period,
            distance=own.glance.distance,
            relative_velocity=self._approach(i),
            acceleration=self._object_acceleration(i),
            reflected_mass=dynamics.reflected_mass,
            obstacle_mass=float(model.body_subtreemass[int(model.body_rootid[body])]) if free else math.inf,
            recoil_share=share,
            position=own.target[0],
            velocity=own.target[1],
        )

    def _object_acceleration(self, i: int) -> float:
        """Return the object's acceleration along the sensor axis [m/s^2].

        It is relative to the site, such as it would move if no driven joint accelerated.
        """
        library, model, data = mujoco(), self._scene.model, self._data
        body = int(model.geom_bodyid[self._sites[i].glance.geom])
        library.mj_rnePostConstraint(model, data)
        accelerations = np.zeros(6)
        library.mj_objectAcceleration(model, data, library.mjtObj.mjOBJ_BODY, body, accelerations, 0)
        moving = int(model.body_treeid[body]) >= 0
        own = accelerations[3:] + model.opt.gravity if moving else np.zeros(3)
        site = free_acceleration(model, data, self._scene.drivetrains[i])
        return float(self._sights[i].axis(data) @ (own - site))

    def _approach(self, i: int) -> float:
        """Return the rate of change [m/s] of the distance to the object."""
        library, model, data, glance = mujoco(), self._scene.model, self._data, self._sites[i].glance
        u, index = self._sights[i].axis(data), self._sites[i].index
        jacobian, turn, normal = np.zeros((3, model.nv)), np.zeros((3, model.nv)), np.array(glance.normal)
        point = np.array(data.site_xpos[index]) + glance.distance * u
        library.mj_jac(model, data, jacobian, None, point, int(model.geom_bodyid[glance.geom]))
        hit = jacobian @ data.qvel
        library.mj_jacSite(model, data, jacobian, turn, index)
        here = jacobian @ data.qvel + np.cross(turn @ data.qvel, glance.distance * u)
        facing = float(normal @ u)
        return float(normal @ (hit - here)) / facing if facing else math.nan

    def _record_contact(self, results: list[_SiteResult]) -> None:
        """Record the sites that were touched for the first time in the last step."""
        scene = self._scene
        for i, own in enumerate(self._sites):
            if not self._native.touched >> i & 1:
                continue
            self._leave_axis(i, results[i], own.time)
            drivetrain, detection = scene.drivetrains[i], results[i].detection
            dynamics = posture_dynamics(scene.model, self._data, drivetrain, scene.laws[i].site.direction)
            obstacle = math.inf if detection is None else detection.obstacle_mass
            results[i].mass = 1 / (1 / dynamics.reflected_mass + 1 / obstacle)

    def _leave_axis(self, i: int, result: _SiteResult, now: float) -> None:
        """Record how far a site has moved and turned off its initial axis, which moves with the robot."""
        axis, position, velocity = self._places[i]
        fall = self._falls[i] * (now * now / 2)
        moved = np.array(self._data.site_xpos[self._sites[i].index]) - position - velocity * now - fall
        turn = float(np.linalg.norm(np.cross(axis, self._sights[i].axis(self._data))))
        result.turn, result.sideways = math.asin(min(turn, 1.0)), float(np.linalg.norm(np.cross(axis, moved)))

    def _set_torques(self) -> None:
        """Compute torques in Python: of a custom tracking, a standing robot, or actuators that drive several joints."""
        scene, data, model = self._scene, self._data, self._scene.model
        drivetrain = scene.drivetrains[0]
        driven, base = drivetrain.driven, drivetrain.base
        load, rows = np.array(data.qfrc_bias - data.qfrc_passive), constraint_rows(model, data, drivetrain.footholds)
        robot = RobotReducer(model, data, (base, driven)).reduce(rows)
        force = load[driven] + robot.reduction.motion.T @ load[base]
        state = JointState(
            np.array(data.qpos)[self._joint_places],
            np.array(data.qvel)[driven],
            *(self._reference[0].copy(), self._reference[1].copy(), self._reference[2].copy()),
            robot.inertia,
            force,
            lambda: self._path.held(data),
        )
        wanted = scene.tracking.torques(state)
        if scene.forces is not None:  # actuators that drive several joints apply what comes closest to these torques
            moment = actuator_moment(model, data)[np.ix_(scene.drivetrains[0].rows, driven)]
            wanted = moment.T @ np.clip(np.linalg.lstsq(moment.T, wanted, rcond=None)[0], *scene.forces.T)
        self._wanted[:] = wanted

    def _body_contacts(self) -> tuple[BodyContact, ...]:
        """Return the contacts of all bodies in their order."""
        names, sites = names_of(self._scene.model, "body"), [law.site.name for law in self._scene.laws]
        touches = sorted(self._touches[: self._native.touch_count], key=lambda touch: touch.time)
        return tuple(
            body_contact(
                *(names, (t.body, t.other), sites[t.site] if t.site >= 0 else ""),
                time=t.time,
                speed=t.speed,
                peak=t.peak,
            )
            for t in touches
        )


class _Law:
    """A law that the compiled loop runs: its step, its parameters and the memory of its state.

    Args:
        controller: the controller with the law.
    """

    __slots__ = ("_held", "_initial", "_python", "_state", "places")

    def __init__(self, controller: Any) -> None:
        step: Any = as_step(controller.step)
        parameters, self._initial = controller.parameters(), controller.start()
        self._python = None
        if not isinstance(step, CompiledStep):
            self._python = PythonStep(step, [parameters], [self._initial])
            parameters, self._initial = np.zeros(1), np.zeros(1)  # indices of parameters and state
        self._state = copy_of(self._initial)
        self._held = step, parameters
        place = self._python.address if self._python else step.located()
        self.places = place, location(parameters, "parameters")[0], location(self._state, "state")[0]

    def restart(self) -> None:
        """Set the state to that of the start."""
        place, size = location(self._initial, "state")
        ctypes.memmove(self.places[2], place, size)

    def check(self) -> None:
        """Raise the exception of a law in Python."""
        if self._python is not None and self._python.raised is not None:
            raise self._python.raised


def _curve(law: Any) -> Any:
    """Return the sensor curve of a site, which SiteLaw has checked."""
    return law.site.sensor
