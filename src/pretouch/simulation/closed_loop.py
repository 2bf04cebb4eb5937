"""A loop without its encounter and its gain, and what pages say of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.blocks import Cell, Chapter, Measured, Rows, cell_as_text
from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_types
from pretouch._core.numbers import FloatArray, IntArray, finite
from pretouch.control import Controller
from pretouch.motion import ContactResult, ContactStatus, ContinuousLaw, Scenario
from pretouch.motion.contact import KnownColumns
from pretouch.motion.laws import continuous_law
from pretouch.sensors import SensorModel

from .chain import SensorChain, timing_of
from .law import SampledLaw, TunableLaw
from .native_loop import RESULT_COLUMNS, Loop, run_loop
from .result import FOLLOW, HORIZON, SimulationResult, check_loop, result_of, runs_of, whole
from .robot import ContactModel, IdealPlant, PlantModel
from .stability import GainLimit, gain_limit, passage

_OWN: Final = ("mass", "damping", "stiffness")
_ROUNDS: Final = 100  # toward the strongest drag that is stable with its own motion
_ALIKE: Final = 1e-6  # of it


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosedLoop:
    """A sampled loop, all but the encounter and the gain: sensor chain, law, robot and contact.

    Called with a scenario, a sensor and gains it solves encounters as `find_contact` does, so that `design_gain` and
    `design_robust_gain` take it as their `evaluate`. With the law and the chain of the example of `simulate`,
    `ClosedLoop(law=law, chain=chain).run(scenario, sensor, -0.7)` is what `simulate` returns.

    Args:
        law: the controller; its gain is replaced by whichever is tried: of another law than the damper its one number.
        chain: what lies between xi and the law's readings.
        plant: the robot; ideal by default.
        contact: the contact force, for a plant with a mass.
        seed: of the noise; every gain is tried with the same random numbers.
        first_run: which run's noise the first encounter meets; the others meet those that follow.
        horizon: how long to wait for contact [s].
        follow: how long to go on after the first contact [s].

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

    law: TunableLaw = field(metadata={"takes": SampledLaw})  # for one run no other value of its number is needed
    chain: SensorChain
    plant: PlantModel = field(default_factory=IdealPlant)
    contact: ContactModel | None = None
    seed: int = 0
    first_run: int = 0
    horizon: float = HORIZON
    follow: float = FOLLOW

    def __post_init__(self) -> None:
        check_types(self)
        whole(self.first_run, "first_run", 0, 2**62)

    def __call__(self, scenario: Scenario, sensor: SensorModel, gain: ArrayLike) -> ContactResult:
        """Run encounters until contact.

        The i-th encounter of the scenario meets the noise of run `first_run` + i, the same with every gain.

        Args:
            scenario: the encounter, or an array of them; any other admittance than that of the law is refused.
            sensor: the sensor curve.
            gain: D_p [N s], broadcast with the scenario.

        Returns:
            The state at the first contact, or in which each run ended. Largest values are those until then, the
            acceleration is the mean over a step. There are no gradients and no impulse balance: the loop does not know
            its law.
        """
        return self._until_contact(scenario, (sensor,), gain)

    def with_each(self, scenario: Scenario, sensors: Sequence[SensorModel], gain: ArrayLike) -> ContactResult:
        """Run encounters until contact, those along the last axis with n curves of their own; see `__call__`."""
        return self._until_contact(scenario, tuple(sensors), gain, each=True)

    def _until_contact(
        self, scenario: Scenario, sensors: tuple[SensorModel, ...], gain: ArrayLike, *, each: bool = False
    ) -> ContactResult:
        self._check_admittance(scenario)
        loop = replace(self.encounters(scenario, sensors, gain, None, each=each), follow=0.0)
        out, *_ = run_loop(loop, np.arange(math.prod(loop.shape)), touches=1)
        columns = {name: out[:, i].reshape(loop.shape) for i, name in enumerate(RESULT_COLUMNS)}
        columns["gain"] = np.array(np.broadcast_to(np.asarray(gain, dtype=np.float64), loop.shape))
        columns["status"] = columns["status"].astype(np.int64)
        # a body with a mass presses into the other: that comes after the contact
        reached = columns["status"] == ContactStatus.CONTACT
        columns["closest_distance"] = np.where(reached, 0.0, columns["closest_distance"])
        for name in ("settling_distance", "impulse_residual"):  # a loop that does not know its law knows neither
            columns[name] = np.full(loop.shape, np.nan)
        return ContactResult(KnownColumns(columns), "loop")

    @property
    def continuous(self) -> ContinuousLaw | None:
        """The law in continuous time that its controller samples; None where that tells none."""
        own = getattr(getattr(self.law, "law", self.law), "continuous", None)
        return None if own is None else continuous_law(own)

    def after(self, runs: int) -> ClosedLoop:
        """Return the same loop, whose first encounter meets the noise of so many runs later."""
        return replace(self, first_run=self.first_run + runs)

    def run(
        self, scenario: Scenario, sensor: SensorModel, gain: ArrayLike, *, runs: int | None = None
    ) -> SimulationResult:
        """Run encounters, each with one gain.

        Args:
            scenario: the encounter, or an array of them.
            sensor: the sensor curve.
            gain: D_p [N s], broadcast with the scenario; every gain meets the same noise.
            runs: repeat every encounter so often, each with noise of its own: a first axis of the results.

        Returns:
            What `simulate` returns.
        """
        return result_of(self.encounters(scenario, (sensor,), gain, runs))

    def run_each(self, scenario: Scenario, sensors: Sequence[SensorModel], gain: ArrayLike) -> SimulationResult:
        """Run encounters, those along the last axis with n curves of their own; see `run`."""
        return result_of(self.encounters(scenario, tuple(sensors), gain, None, each=True))

    def stability_limit(self, scenario: Scenario, sensor: SensorModel, value: float | None = None) -> GainLimit:
        """Find the strongest number of the law that is stable from the start of an encounter to its contact.

        Args:
            scenario: the encounter.
            sensor: the sensor curve.
            value: where the damping of the law follows the speed, as that of a drag, the number with whose predicted
                motion the object comes; by default that of the loop's law. A number up to the limit that its own motion
                has is stable; a weaker one comes faster, so that its motion has a smaller limit.

        Returns:
            The limit; some milliseconds of work.

        Raises:
            InvalidInputError: nothing is known of the timing of the law, or of its damping.
        """
        law: Any = self.law
        if not isinstance(law, Controller):
            raise InvalidInputError(
                f"stability: found a law ({type(law).__name__}) that is no Controller, whose timing is not known"
            )
        known, number = continuous_law(law.law), law.law.value if value is None else value
        distance, velocity = passage(known, scenario, sensor, number, float(scenario.distance))
        return gain_limit(
            sensor,
            scenario.admittance,
            timing_of(self.chain, law),
            distance=distance,
            plant=self.plant,
            law=known,
            relative_velocity=velocity,
        )

    def stable_bounds(
        self, bounds: tuple[float, float], scenario: Scenario, sensor: SensorModel, margin: float
    ) -> tuple[float, float]:
        """Cut bounds of the number so that it can grow by a factor until the loop is unstable; refuse none left."""
        strongest = 0.0
        for _ in range(_ROUNDS):  # an object comes slower with a stronger one, which allows more: each found is stable
            limit = self.stability_limit(scenario, sensor, strongest)
            n, found = limit.law.number, limit.strongest / margin
            stronger = abs(strongest) * (1 + _ALIKE) < abs(found)
            strongest = found if stronger else strongest
            if not stronger or limit.law.degree == 1:  # whose limit follows no motion
                break
        low, high = max(bounds[0], -abs(strongest)), min(bounds[1], abs(strongest))
        if not low < high:
            raise InvalidInputError(
                f"stability_margin: found {margin:g}, which allows {n.name}s up to {strongest:.4g} {n.unit}, but "
                f"[gain] has bounds from {bounds[0]:g} to {bounds[1]:g} {n.unit}, expected a smaller margin, "
                f"weaker {n.name}s, a faster sensor or a larger virtual mass"
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
        """Put encounters together, of one sensor or one for each along the last axis; no gain: that of the law."""
        law = self.continuous
        gains = np.asarray(0.0 if gain is None else finite(gain, "gain", "" if law is None else law.number.unit))
        try:
            several = np.broadcast_shapes(scenario.shape, (len(sensors),)) if each else scenario.shape
            shape = np.broadcast_shapes(several, gains.shape)
        except ValueError:
            alike = f"{scenario.shape} and {len(sensors)} sensors" if each else f"{scenario.shape}"
            raise InvalidInputError(f"gain: shape {gains.shape} does not broadcast with {alike}") from None
        first = () if runs is None else (runs_of(runs),)
        apart = (1,) * (len(shape) - len(several))  # between the axis of the runs and those of the scenario
        noise = np.arange(math.prod((*first, *several))).reshape((*first, *apart, *several))
        shape = (*first, *shape)
        every = np.zeros(shape, dtype=np.int64)
        laws, law_of = self._laws(gains) if gain is not None else ((self.law,), 0)
        return check_loop(
            Loop(
                scenario=scenario,
                sensors=sensors,
                sensor_of=every + (np.arange(len(sensors)) if each else 0),
                laws=laws,
                law_of=every + law_of,
                noise_of=every + noise + self.first_run,
                chain=self.chain,
                plant=self.plant,
                contact=self.contact,
                horizon=self.horizon,
                follow=self.follow,
                seed=self.seed,
                shape=shape,
            )
        )

    def _laws(self, gains: FloatArray) -> tuple[tuple[SampledLaw, ...], IntArray]:
        """Return a law for every gain that there is, and which of them each has."""
        every, law_of = np.unique(gains, return_inverse=True)
        return tuple(self.law.with_value(float(g)) for g in every), law_of.reshape(gains.shape)

    def _check_admittance(self, scenario: Scenario) -> None:
        """Refuse an encounter that speaks of another admittance than the law has, as far as the law tells its own."""
        own = getattr(self.law, "admittance", None)
        for name in _OWN:
            asked, has = getattr(scenario.admittance, name), getattr(own, name, None)
            if np.ndim(asked):
                raise InvalidInputError(
                    f"admittance.{name}: found an array, but a loop has the admittance of its law, the same in all "
                    "encounters"
                )
            if has is not None and not math.isclose(asked, has, rel_tol=1e-9):
                raise InvalidInputError(
                    f"admittance.{name}: found {asked:g} in the scenario and {has:g} in the law of the loop, expected "
                    "the same in both"
                )


Row = tuple[str, Cell]


def loop_section(loop: ClosedLoop, *first: Row) -> Chapter:
    """Return the section of a page that says what a loop is made of, after rows of the page's own."""
    parts = (
        ("Sensor chain", loop.chain.rows()),
        ("Controller", law_rows(loop.law)),
        ("Robot", loop.plant.rows()),
        ("Contact", contact_rows(loop.contact)),
    )
    sections = (Chapter(title=title, blocks=(Rows(rows=tuple(rows), wraps=True),)) for title, rows in parts)
    return Chapter(title="The loop", blocks=(Rows(rows=(*first, *loop_rows(loop))), *sections))


def loop_sentences(loop: ClosedLoop) -> Iterator[str]:
    """Yield what a loop is made of in a sentence for each part, in plain text."""
    yield f"Sensor: {_joined(loop.chain.rows())}; noise is normal, and independent from reading to reading."
    yield f"Controller: {_joined(law_rows(loop.law))}."
    follow = () if loop.contact is None else (("followed for", Measured(loop.follow, "s")),)
    for rows in (loop.plant.rows(), (*contact_rows(loop.contact), *follow)):
        (name, kind), *others = rows
        yield f"{name.capitalize()}: {'; '.join(part for part in (cell_as_text(kind), _joined(others)) if part)}."


def _joined(rows: Iterable[Row]) -> str:
    return "; ".join(f"{name} {cell_as_text(cell)}" for name, cell in rows).replace("\u03be", "xi")


def loop_rows(loop: ClosedLoop) -> Iterator[Row]:
    """Yield how runs of a loop are drawn and how long they last."""
    yield "seed of the noise", str(loop.seed)
    yield "waits for contact", Measured(loop.horizon, "s")
    if loop.contact is not None:
        yield "goes on after the first contact", Measured(loop.follow, "s")


def law_rows(law: SampledLaw) -> Iterable[Row]:
    """Return the parameters of a controller, its gain left out; of any other law its name and its period."""
    if isinstance(law, Controller):
        return law.rows()
    return ("law", type(law).__name__), ("period", Measured(law.period, "s"))


def contact_rows(contact: ContactModel | None) -> Iterator[Row]:
    """Yield the parameters of a contact force, where the loop has one."""
    if contact is None:
        yield "contact", "no contact force: a run ends at the touch"
    else:
        yield from contact.rows()
