"""Combine sensor, controller, robot and contact into a simulated control loop."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.blocks import Cell, Measured, PageSection, PageTable, cell_as_text
from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_types, quantity
from pretouch._core.numbers import FloatArray, IntArray, finite, positive
from pretouch.control import Controller
from pretouch.motion import ContactResult, ContactStatus, ContinuousLaw, Scenario
from pretouch.motion.contact import KnownColumns
from pretouch.motion.laws import continuous_law
from pretouch.sensors import SensorModel

from .chain import SensorChain, timing_of
from .detection import (
    DetectionRange,
    detection_distance,
    detection_range,
    detects_beyond_curve,
    start_in_words,
)
from .law import SampledLaw, TunableLaw
from .native_loop import RESULT_COLUMNS, Loop, run_loop
from .result import FOLLOW, HORIZON, SimulationResult, check_loop, result_of, runs_of, whole
from .robot import ContactModel, IdealPlant, PlantModel
from .stability import GainLimit, gain_limit, passage

_ADMITTANCE: Final = ("mass", "damping", "stiffness")
_ROUNDS: Final = 100  # iterations toward the strongest drag that is stable for its own motion
_TOLERANCE: Final = 1e-6  # relative change of the drag at which this iteration ends


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosedLoop:
    """A sampled control loop of sensor, controller, robot and contact.

    Called with a scenario, a sensor and gains, it solves encounters like `find_contact`. So `design` and
    `robust` accept it as the argument `evaluate`. With the law and the chain of the example of `simulate`,
    `ClosedLoop(law=law, chain=chain).run(scenario, sensor, -0.7)` returns the same as `simulate`.

    Args:
        law: the controller; each tried gain replaces its gain (for a law other than the damper, its parameter).
        chain: the sensor chain between xi and the law's readings.
        plant: the robot; ideal by default.
        contact: the contact force, for a plant with a mass.
        seed: seed of the noise; every gain is tried with the same random numbers.
        first_run: index of the run whose noise the first encounter has; the next encounters have those that follow.
        horizon: longest time to wait for contact [s], from the start of the encounter.
        follow_time: time to continue after the first contact [s].
        start_distance: distance at which simulated runs begin [m]; None for the distance at the start of the encounter.
            From there to the start, the object keeps its velocity at the start. Times still count from the start, so
            they are negative before.
        recoil_share: share kappa of the motion of the robot's controller that the recoil of a floating base takes back.
            `law` then moves by 1 - kappa times as much as the controller on the robot, which is `robot_law`.

    Examples:
        >>> from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> loop = ClosedLoop(
        ...     law=Controller(
        ...         period=1e-3,
        ...         conditioning=Conditioning(floor=1e-3, sensor_period=4e-3),
        ...         law=VirtualDamper(gain=0.0),
        ...         admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     ),
        ...     chain=SensorChain(rate=250.0, exposure=170e-6, delay=120e-6),
        ... )
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> round(loop.run(scenario, sensor, -0.7).relative_velocity, 3)  # -0.0815 in continuous time
        -0.082
        >>> loop(scenario, sensor, [-0.7, -1.0]).contact.relative_velocity.round(3)
        array([-0.082, -0.069])
    """

    law: TunableLaw = field(metadata={"takes": SampledLaw})  # run without a gain needs only a SampledLaw
    chain: SensorChain
    plant: PlantModel = field(default_factory=IdealPlant)
    contact: ContactModel | None = None
    seed: int = 0
    first_run: int = 0
    horizon: float = HORIZON
    follow_time: float = FOLLOW
    start_distance: Any = quantity("m", None, sign="positive")
    recoil_share: float = 0.0

    def __post_init__(self) -> None:
        check_types(self)
        whole(self.first_run, "first_run", 0, 2**62)

    def __call__(self, scenario: Scenario, sensor: SensorModel, gain: ArrayLike) -> ContactResult:
        """Simulate encounters with the sampled control loop until contact.

        The i-th encounter of the scenario has the noise of run `first_run` + i, the same with every gain.

        Args:
            scenario: the encounter, or an array of them; an admittance other than that of the law is refused.
            sensor: the sensor curve.
            gain: D_p [N s], broadcast with the scenario.

        Returns:
            The state at the first contact, or at the end of a run without contact. Largest values are those until then;
            the acceleration is the mean over a step. There are no gradients and no impulse balance, because the loop
            does not know the equations of its law.
        """
        return self._until_contact(scenario, (sensor,), gain)

    def with_each(self, scenario: Scenario, sensors: Sequence[SensorModel], gain: ArrayLike) -> ContactResult:
        """Simulate encounters until contact, each with its own sensor curve."""
        return self._until_contact(scenario, tuple(sensors), gain, each=True)

    def _until_contact(
        self, scenario: Scenario, sensors: tuple[SensorModel, ...], gain: ArrayLike, *, each: bool = False
    ) -> ContactResult:
        self._check_admittance(scenario)
        loop = replace(self.encounters(scenario, sensors, gain, None, each=each), follow_time=0.0)
        out, *_ = run_loop(loop, np.arange(math.prod(loop.shape)), touches=1)
        columns = {name: out[:, i].reshape(loop.shape) for i, name in enumerate(RESULT_COLUMNS)}
        columns["gain"] = np.array(np.broadcast_to(np.asarray(gain, dtype=np.float64), loop.shape))
        columns["status"] = columns["status"].astype(np.int64)
        # the bodies press into each other only after contact
        reached = columns["status"] == ContactStatus.CONTACT
        columns["closest_distance"] = np.where(reached, 0.0, columns["closest_distance"])
        for name in ("settling_distance", "impulse_residual"):  # both need the equations of the law
            columns[name] = np.full(loop.shape, np.nan)
        return ContactResult(KnownColumns(columns), "loop")

    def detection(self, scenario: Scenario, sensor: SensorModel) -> DetectionRange | None:
        """Return where the controller detects the object of an encounter.

        Returns:
            The detection distance next to the start; None for an array of encounters and for a law whose floor is
            unknown.
        """
        law: Any = self.law
        if not isinstance(law, Controller) or scenario.shape:
            return None
        return detection_range(scenario, sensor, self.chain, law.conditioning)

    def farthest_start(self, scenario: Scenario, sensor: SensorModel) -> float:
        """Return the largest distance at which the controller detects the object of an encounter [m].

        An encounter that starts farther away runs as one that starts there. It is infinite if the distance is unknown:
        for another law, for an object that accelerates, and if the sensor curve ends before.
        """
        law, o = self.law, scenario.obstacle
        if not isinstance(law, Controller) or o.course or np.any(o.acceleration):
            return math.inf
        sensing = sensor, self.chain, law.conditioning
        return math.inf if detects_beyond_curve(*sensing) else detection_distance(*sensing) or math.inf

    def start_warnings(
        self, scenario: Scenario, sensor: SensorModel, predict: Callable[[Scenario], ContactResult] | None
    ) -> tuple[str, ...]:
        """Return a warning if the controller detects the object elsewhere than an encounter starts.

        Args:
            scenario: the encounter.
            sensor: the sensor curve.
            predict: function that predicts the contact of an encounter; a difference without effect on it is no reason
                for a warning. None for a warning about any difference.

        Returns:
            At most one warning.
        """
        return tuple(start_in_words(self.detection(scenario, sensor), scenario, predict))

    @property
    def robot_law(self) -> TunableLaw:
        """The controller that runs on the robot: that of the encounters, unless a floating base recoils."""
        if not self.recoil_share or not isinstance(self.law, Controller):
            return self.law
        return self.law.scale_motion(1 / (1 - self.recoil_share))

    @property
    def continuous(self) -> ContinuousLaw | None:
        """The continuous-time law that the controller approximates.

        It is None if the controller has no such law.
        """
        own = getattr(getattr(self.law, "law", self.law), "continuous", None)
        return None if own is None else continuous_law(own)

    def after(self, runs: int) -> ClosedLoop:
        """Return a control loop that skips the noise of earlier runs.

        The noise of the first encounter is shifted by `runs`.
        """
        return replace(self, first_run=self.first_run + runs)

    def run(
        self, scenario: Scenario, sensor: SensorModel, gain: ArrayLike, *, runs: int | None = None
    ) -> SimulationResult:
        """Simulate encounters with the sampled control loop, each with one gain.

        Args:
            scenario: the encounter, or an array of them.
            sensor: the sensor curve.
            gain: D_p [N s], broadcast with the scenario; every gain has the same noise.
            runs: number of repetitions of every encounter with independent noise, the first axis of the results.

        Returns:
            The result, as from `simulate`.
        """
        return result_of(self.encounters(scenario, (sensor,), gain, runs))

    def run_each(self, scenario: Scenario, sensors: Sequence[SensorModel], gain: ArrayLike) -> SimulationResult:
        """Simulate encounters including contact, each with its own sensor curve.

        Returns:
            The result, contact included.
        """
        return result_of(self.encounters(scenario, tuple(sensors), gain, None, each=True))

    def stability_limit(self, scenario: Scenario, sensor: SensorModel, value: float | None = None) -> GainLimit:
        """Find the strongest gain with a stable loop at every distance.

        The distances lie between start and contact.

        Args:
            scenario: the encounter.
            sensor: the sensor curve.
            value: for a law whose damping depends on the speed, such as a drag, the gain whose predicted motion is
                assumed; by default that of the loop's law. A gain up to the limit for its own motion is stable. With a
                weaker gain the object approaches faster, so the limit is smaller.

        Returns:
            The limit; takes some milliseconds.

        Raises:
            InvalidInputError: the timing or the damping of the law is unknown.
        """
        law: Any = self.law
        if not isinstance(law, Controller):
            raise InvalidInputError(
                f"stability: found a controller of the class {type(law).__name__}, expected the class Controller. "
                "Stability limits depend on the timing, and only the class Controller has a known timing"
            )
        continuous, assumed = continuous_law(law.law), law.law.value if value is None else value
        distance, velocity = passage(continuous, scenario, sensor, assumed, float(scenario.distance))
        return gain_limit(
            sensor,
            scenario.admittance,
            timing_of(self.chain, law),
            distance=distance,
            plant=self.plant,
            law=continuous,
            relative_velocity=velocity,
        )

    def stable_bounds(
        self, bounds: tuple[float, float], scenario: Scenario, sensor: SensorModel, margin: float
    ) -> tuple[float, float]:
        """Narrow the gain bounds to gains with the required gain margin.

        Returns:
            The narrowed bounds.

        Raises:
            InvalidInputError: no gain within the bounds has the required gain margin.
        """
        strongest = 0.0
        for _ in range(
            _ROUNDS
        ):  # with a stronger drag the approach is slower, which allows a stronger drag: each of them is stable
            limit = self.stability_limit(scenario, sensor, strongest)
            n, allowed = limit.law.number, limit.strongest / margin
            stronger = abs(strongest) * (1 + _TOLERANCE) < abs(allowed)
            strongest = allowed if stronger else strongest
            if not stronger or limit.law.degree == 1:  # its limit does not depend on the motion
                break
        low, high = max(bounds[0], -abs(strongest)), min(bounds[1], abs(strongest))
        if not low < high:
            interval, most = f"{bounds[0]:g} to {bounds[1]:g} {n.unit}", f"{strongest:.4g} {n.unit}"
            raise InvalidInputError(
                f"stability_margin: no {n.name} within the bounds of [gain] has the required gain margin of "
                f"{margin:g}. At a sensor rate of {self.chain.rate:g} Hz, the strongest {n.name} with this margin is "
                f"{most}. The bounds of [gain] are {interval}. Choose a smaller margin, bounds with a weaker {n.name}, "
                "a faster sensor or a larger virtual mass"
            )
        return low, high

    def encounters(
        self,
        scenario: Scenario,
        sensors: tuple[SensorModel, ...],
        gain: ArrayLike | None,
        runs: int | None,
        *,
        each: bool = False,
    ) -> Loop:
        """Combine the control loop with an array of encounters.

        If `gain` is None, the law keeps its own gain.

        Returns:
            The inputs of the simulation. The encounters share one sensor curve, or have one each.

        Raises:
            InvalidInputError: the shape of the gains does not match that of the encounters.
        """
        law = self.continuous
        gains = np.asarray(0.0 if gain is None else finite(gain, "gain", "" if law is None else law.number.unit))
        try:
            several = np.broadcast_shapes(scenario.shape, (len(sensors),)) if each else scenario.shape
            shape = np.broadcast_shapes(several, gains.shape)
        except ValueError:
            shapes = f"{scenario.shape} and {len(sensors)} sensors" if each else f"{scenario.shape}"
            raise InvalidInputError(
                f"gain: found an array of gains of the shape {gains.shape}, which does not broadcast with the array of "
                f"encounters of the shape {shapes}"
            ) from None
        first = () if runs is None else (runs_of(runs),)
        between = (1,) * (len(shape) - len(several))  # axes between the one of the runs and those of the scenario
        noise = np.arange(math.prod((*first, *several))).reshape((*first, *between, *several))
        shape = (*first, *shape)
        zeros = np.zeros(shape, dtype=np.int64)
        laws, law_of = self._laws(gains) if gain is not None else ((self.law,), 0)
        lead = self._lead(scenario)
        return check_loop(
            Loop(
                scenario=scenario,
                sensors=sensors,
                sensor_of=zeros + (np.arange(len(sensors)) if each else 0),
                laws=laws,
                law_of=zeros + law_of,
                noise_of=zeros + noise + self.first_run,
                chain=self.chain,
                plant=self.plant,
                contact=self.contact,
                horizon=self.horizon if lead is None else self.horizon + float(np.max(lead)),
                follow_time=self.follow_time,
                seed=self.seed,
                shape=shape,
                lead=lead,
            )
        )

    def _lead(self, scenario: Scenario) -> FloatArray | None:
        """Return how long runs take from `start_distance` to the start of each encounter [s].

        None if all runs begin at the start. An object that does not approach at the start begins there.
        """
        if self.start_distance is None:
            return None
        place = np.asarray(positive(self.start_distance, "start_distance", "m"))
        speed = -np.asarray(scenario.relative_velocity, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            time = np.where(speed > 0, np.maximum(place - scenario.distance, 0.0) / speed, 0.0)
        return np.broadcast_to(time, scenario.shape) if np.any(time > 0) else None

    def _laws(self, gains: FloatArray) -> tuple[tuple[SampledLaw, ...], IntArray]:
        """Return a controller for every distinct gain, and the index of the controller of each gain."""
        distinct, law_of = np.unique(gains, return_inverse=True)
        return tuple(self.law.with_value(float(g)) for g in distinct), law_of.reshape(gains.shape)

    def _check_admittance(self, scenario: Scenario) -> None:
        """Raise an error if encounter and controller have different admittances."""
        admittance = getattr(self.law, "admittance", None)
        for name in _ADMITTANCE:
            in_scenario, in_law = getattr(scenario.admittance, name), getattr(admittance, name, None)
            if np.ndim(in_scenario):
                raise InvalidInputError(
                    f"admittance.{name}: found an array, but the controller has only one admittance; use the same "
                    "value in all encounters"
                )
            if in_law is not None and not math.isclose(in_scenario, in_law, rel_tol=1e-9):
                raise InvalidInputError(
                    f"admittance.{name}: the scenario has the value {in_scenario:g}, but the controller has the value "
                    f"{in_law:g}; use the same value in both"
                )


Row = tuple[str, Cell]


def loop_section(loop: ClosedLoop, *first: Row) -> PageSection:
    """Return the report section that describes a sampled control loop. The rows `first` precede the loop's own rows."""
    parts = (
        ("Sensor chain", loop.chain.rows()),
        ("Controller", law_rows(loop.robot_law)),
        ("Robot", loop.plant.rows()),
        ("Contact", contact_rows(loop.contact)),
    )
    sections = (PageSection(title=title, blocks=(PageTable(rows=tuple(rows), wraps=True),)) for title, rows in parts)
    return PageSection(title="The loop", blocks=(PageTable(rows=(*first, *loop_rows(loop))), *sections))


def loop_sentences(loop: ClosedLoop) -> Iterator[str]:
    """Yield one sentence for each component of a control loop."""
    yield (
        f"Sensor: {_joined(loop.chain.rows())}; the noise has a normal distribution and is independent between "
        "readings."
    )
    yield f"Controller: {_joined(law_rows(loop.robot_law))}."
    extra = () if loop.contact is None else (("followed for", Measured(loop.follow_time, "s")),)
    for rows in (loop.plant.rows(), (*contact_rows(loop.contact), *extra)):
        (name, kind), *others = rows
        yield f"{name.capitalize()}: {'; '.join(part for part in (cell_as_text(kind), _joined(others)) if part)}."


def _joined(rows: Iterable[Row]) -> str:
    return "; ".join(f"{name} {cell_as_text(cell)}" for name, cell in rows).replace("\u03be", "xi")


def loop_rows(loop: ClosedLoop) -> Iterator[Row]:
    """Yield table rows with noise seed and duration of the runs."""
    yield "seed of the noise", str(loop.seed)
    yield "longest time until contact", Measured(loop.horizon, "s")
    if loop.recoil_share:
        yield "share of the motion that the base takes back", Measured(loop.recoil_share)
    if loop.start_distance is not None and not np.ndim(loop.start_distance):
        yield "distance at which runs begin", Measured(float(loop.start_distance), "m")
    if loop.contact is not None:
        yield "time after the first contact", Measured(loop.follow_time, "s")


def law_rows(law: SampledLaw) -> Iterable[Row]:
    """Return table rows with the parameters of a controller.

    For a user-defined law, they have only its name and period.
    """
    if isinstance(law, Controller):
        return law.rows()
    return ("law", type(law).__name__), ("period", Measured(law.period, "s"))


def contact_rows(contact: ContactModel | None) -> Iterator[Row]:
    """Yield table rows with the parameters of the contact force.

    Without a contact model, one row says so.
    """
    if contact is None:
        yield "contact", "no contact force: a run ends at contact"
    else:
        yield from contact.rows()
