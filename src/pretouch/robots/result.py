"""Define results of robot simulations, compared with predictions along one axis."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Final

import numpy as np

from pretouch._core.display import Described
from pretouch._core.errors import InvalidInputError
from pretouch._core.messages import not_one_of
from pretouch._core.numbers import FloatArray, finite_or_none
from pretouch._core.values import Value
from pretouch.designs.impact import SpringImpact
from pretouch.motion import Admittance, ContactStatus, Obstacle, Plant, Reference, Scenario, find_contact, solve_motion

from .site_law import SiteLaw


@dataclass(frozen=True, slots=True)
class DetectedEncounter(Value):
    """The encounter of a sensor site at its first detection.

    It is described along the sensor axis, when the controller first detects the object.

    Args:
        time: t [s].
        distance: l [m].
        relative_velocity: l' [m/s].
        acceleration: acceleration of the object along the axis [m/s^2].
        reflected_mass: of the robot along the axis [kg].
        obstacle_mass: of the object [kg]; infinite if it belongs to the world.
        recoil_share: kappa of a floating base.
        position: position of the site's reference [m], relative to the start.
        velocity: velocity of the site's reference [m/s].
    """

    time: float
    distance: float
    relative_velocity: float
    acceleration: float
    reflected_mass: float
    obstacle_mass: float
    recoil_share: float
    position: float
    velocity: float


@dataclass(frozen=True, slots=True)
class BodyContact(Value):
    """The contact of one body of a robot with another body in one run.

    Args:
        body: the body of the robot.
        object: the other body.
        site: the site at whose surface they touch; empty if they touch elsewhere.
        time: time of the first contact [s].
        relative_velocity: normal relative velocity at the contact point before the contact [m/s], negative if both
            approach.
        peak_force: largest magnitude of the contact force between both bodies [N].
    """

    body: str
    object: str
    site: str
    time: float
    relative_velocity: float
    peak_force: float


@dataclass(frozen=True, slots=True)
class SiteContact(Value):
    """Contact speed, peak force and other results of one sensor site.

    They belong to one run. NaN stands for what does not happen.

    Args:
        time: time of the first contact of the surface at the site [s], on the axis or next to it.
        relative_velocity: l' at this contact [m/s]; next to the axis, the normal relative velocity at the contact
            point.
        peak_force: largest contact force on this surface along the axis [N].
        impulse: impulse of all contact forces [N s].
        excursion: largest excursion of the reference until contact [m], relative to the base.
        energy: energy of the impact, 1/2 mu l'^2 with the reduced mass mu of robot and object [J].
        detection: the encounter at the first detection; None without one.
        axis_turn: angle by which the axis of the sensor has turned until contact [rad].
        sideways: motion of the site across its axis until contact [m]; uniform motion and free fall do not
            count.
        saturated: time until contact in which a drive is at its limit [s].
        obstacle: what keeps the robot from following its reference until contact, such as "joint range" or
            "singularity"; empty if nothing does.
    """

    time: float
    relative_velocity: float
    peak_force: float
    impulse: float
    excursion: float
    energy: float
    detection: DetectedEncounter | None = None
    axis_turn: float = math.nan
    sideways: float = math.nan
    saturated: float = math.nan
    obstacle: str = ""


def touches_elsewhere(touches: Sequence[Sequence[BodyContact]]) -> tuple[BodyContact, ...]:
    """Return the contacts of a robot that are not at the surface of a site.

    Each pair of bodies appears once, with its first contact over all runs and its largest force.
    """
    pairs: dict[tuple[str, str], BodyContact] = {}
    for touch in (touch for run in touches for touch in run if not touch.site):
        key = touch.body, touch.object
        known = pairs.get(key, touch)
        first = min(known, touch, key=lambda contact: contact.time)
        pairs[key] = replace(first, peak_force=max(known.peak_force, touch.peak_force))
    return tuple(sorted(pairs.values(), key=lambda contact: contact.time))


_NAN: Final = math.nan
_NOTHING: Final = SiteContact(_NAN, _NAN, _NAN, _NAN, _NAN, _NAN)
_HORIZON: Final = 60.0  # s, longest predicted encounter


@dataclass(frozen=True, slots=True)
class RobotTrace(Value):
    """Time series of one simulated robot run.

    There is one row for each time step of MuJoCo.

    Args:
        time: t [s], shape (n,).
        distance: l of each site [m], shape (n, sites).
        reference: position of the reference of each site along its axis at the end of the period [m], shape (n, sites).
        force: contact force on each site [N], shape (n, sites).
        torque: torques of the driven joints [N m or N], shape (n, joints).
        configuration: positions of all joints of the model, shape (n, nq).
    """

    time: FloatArray
    distance: FloatArray
    reference: FloatArray
    force: FloatArray
    torque: FloatArray
    configuration: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotSimulation(Described, Value):
    """Simulated encounters of a robot with their 1-D predictions.

    Args:
        sites: names of the sites.
        contacts: what happened, for each site and run.
        predictions: what the 1-D model predicts from the first detection on, for each site and run; None without a
            detection.
        touches: every body of the robot that touched something else, for each run, in the order of the contacts.
        robot_forces: largest magnitude of the sum of all contact forces on the robot [N], for each run.
        warnings: sentences on properties of the model that matter for the results.
        notes: sentences that describe the scene, such as where the object comes from.
        laws: the laws of the sites.
        model: the `mujoco.MjModel` of the simulation.
        trace_of: function that repeats a run and records its time series.
    """

    sites: tuple[str, ...]
    contacts: tuple[tuple[SiteContact, ...], ...]
    predictions: tuple[tuple[SiteContact | None, ...], ...]
    touches: tuple[tuple[BodyContact, ...], ...] = ()
    robot_forces: tuple[float, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    laws: tuple[SiteLaw, ...] = ()
    model: Any = field(default=None, compare=False, metadata={"checked": False})
    trace_of: Callable[[int], RobotTrace] = field(compare=False)

    @property
    def runs(self) -> int:
        """The number of simulated runs."""
        return len(self.contacts[0])

    def simulated(self, site: str, quantity: str) -> FloatArray:
        """Return a simulated quantity of a site for each run.

        The quantity is a field of `SiteContact`, such as "peak_force".
        """
        return np.array([getattr(c, quantity) for c in self.contacts[self._index(site)]])

    def predicted(self, site: str, quantity: str) -> FloatArray:
        """Return a predicted quantity of a site for each run.

        The quantity is a field of `SiteContact`, such as "peak_force".
        """
        rows = self.predictions[self._index(site)]
        return np.array([math.nan if c is None else getattr(c, quantity) for c in rows])

    def unmitigated_speeds(self, site: str) -> FloatArray:
        """Return the contact speed of a site in each run if the robot did not react to its sensor [m/s].

        It follows from distance, velocity and acceleration at the first detection. It is NaN without a detection before
        contact, and 0 if the object would not reach the robot.
        """
        detections = [None if math.isnan(c.time) else c.detection for c in self.contacts[self._index(site)]]
        squares = [
            math.nan if d is None else max(d.relative_velocity**2 - 2 * d.acceleration * d.distance, 0.0)
            for d in detections
        ]
        return np.sqrt(squares)

    def order(self, run: int = 0) -> tuple[str, ...]:
        """Return the sites that touched an object, in order of contact."""
        times = [(contacts[run].time, name) for name, contacts in zip(self.sites, self.contacts, strict=True)]
        return tuple(name for time, name in sorted(times) if not math.isnan(time))

    def predicted_courses(self, run: int = 0) -> tuple[PredictedCourse | None, ...]:
        """Return the predicted motion of each site in a run.

        It begins at the first detection of the site. It is None without a prediction.
        """
        detections = [contacts[run].detection for contacts in self.contacts]
        return tuple(
            None if detection is None else course_of(law, detection)
            for law, detection in zip(self.laws, detections, strict=True)
        )

    def trace(self, run: int = 0) -> RobotTrace:
        """Repeat one simulated run, and return its time series."""
        if not 0 <= run < self.runs:
            raise InvalidInputError(f"run: found {run}, expected a run from 0 to {self.runs - 1}", value=run)
        return self.trace_of(run)

    def to_dict(self) -> dict[str, Any]:
        """Return all contacts and predictions as a dictionary for JSON.

        All values are in SI units. NaN becomes None.
        """
        return {
            "sites": {
                name: {
                    "simulated": list(map(_as_dict, self.contacts[i])),
                    "predicted": list(map(_as_dict, self.predictions[i])),
                }
                for i, name in enumerate(self.sites)
            },
            "order": [list(self.order(run)) for run in range(self.runs)],
            "robot_peak_force": list(self.robot_forces),
            "touches": [[asdict(touch) for touch in run] for run in self.touches],
            "warnings": list(self.warnings),
            "notes": list(self.notes),
        }

    def _index(self, site: str) -> int:
        if site not in self.sites:
            raise InvalidInputError(**not_one_of("site", site, self.sites))
        return self.sites.index(site)


QUANTITIES: Final = ("time", "relative_velocity", "peak_force", "impulse", "excursion", "energy")
"""The quantities that are simulated and predicted."""


def _as_dict(contact: SiteContact | None) -> dict[str, Any] | None:
    if contact is None:
        return None
    return {name: finite_or_none(getattr(contact, name)) for name in QUANTITIES}


@dataclass(frozen=True, slots=True)
class PredictedCourse(Value):
    """The predicted motion of one sensor site over time.

    Args:
        time: t [s], from the first detection to contact.
        distance: l [m].
        position: position of the reference of the site relative to the base [m].
    """

    time: FloatArray
    distance: FloatArray
    position: FloatArray


def course_of(law: SiteLaw, detection: DetectedEncounter) -> PredictedCourse | None:
    """Return the predicted motion of a sensor site after detection.

    It begins at the first detection. It is None if it cannot be predicted.
    """
    if not detection.distance > 0 or not math.isfinite(detection.distance):
        return None
    continuous: Any = law.controller.law.continuous
    scenario, curve = _scenario_of(law, detection), law.site.sensor
    assert curve is not None  # noqa: S101 - checked by SiteLaw
    motion = solve_motion(scenario, curve, law.controller.law.value, law=continuous, horizon=_HORIZON)
    return PredictedCourse(
        detection.time + np.asarray(motion.time),
        np.asarray(motion.distance),
        np.asarray(motion.position) / (1 - detection.recoil_share),
    )


def prediction_of(law: SiteLaw, detection: DetectedEncounter, stiffness: float | None) -> SiteContact:
    """Predict the contact of a sensor site after its first detection.

    The prediction is in continuous time. The admittance is that of the controller, divided by 1 - kappa on a floating
    base. The robot follows its reference exactly.

    Args:
        law: the law of the site.
        detection: the encounter at the first detection.
        stiffness: stiffness of the contact [N/m] for the peak force of the reflected mass without drives; None for no
            prediction.

    Returns:
        The prediction; NaN for what does not happen or cannot be predicted.
    """
    d, share, curve = detection, 1 - detection.recoil_share, law.site.sensor
    if curve is None or not d.distance > 0:
        return replace(_NOTHING, detection=d)
    scenario = _scenario_of(law, d)
    continuous: Any = law.controller.law.continuous
    number = law.controller.law.value
    solved = find_contact(scenario, curve, number, law=continuous, horizon=_HORIZON)
    if solved.status != ContactStatus.CONTACT:
        return replace(_NOTHING, detection=d)
    contact = solved.contact
    speed = float(contact.relative_velocity)
    reduced = 1 / (1 / d.reflected_mass + 1 / d.obstacle_mass)
    force = math.nan
    if stiffness is not None:
        impact = SpringImpact(robot_mass=d.reflected_mass, obstacle_mass=d.obstacle_mass, stiffness=stiffness)
        force = float(impact.peak_force(speed))
    return SiteContact(
        time=d.time + float(contact.time),
        relative_velocity=speed,
        peak_force=force,
        impulse=2 * reduced * abs(speed) if stiffness is not None else math.nan,
        excursion=float(contact.largest_excursion) / share,
        energy=0.5 * reduced * speed**2,
        detection=d,
    )


def _scenario_of(law: SiteLaw, d: DetectedEncounter) -> Scenario:
    """Return the 1-D encounter that starts at a site's first detection."""
    share, own = 1 - d.recoil_share, law.controller.admittance
    return Scenario(
        admittance=Admittance(mass=own.mass / share, damping=own.damping / share, stiffness=own.stiffness / share),
        obstacle=Obstacle(
            position=share * d.position + d.distance,
            velocity=share * d.velocity + d.relative_velocity,
            acceleration=d.acceleration,
        ),
        plant=Plant(position=share * d.position, velocity=share * d.velocity),
        reference=Reference(position=share * law.approach * d.time, velocity=share * law.approach),
    )
