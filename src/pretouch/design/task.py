"""What every verb takes: one encounter, its sensor, and all that is asked of the gain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, Protocol, TypeVar, cast

from pretouch._core.arguments import Rule, rules_of_fields
from pretouch._core.errors import InvalidInputError
from pretouch._core.values import Value
from pretouch.motion import DAMPER, ContinuousLaw, Scenario
from pretouch.motion.evaluator import Evaluator
from pretouch.motion.laws import continuous_law
from pretouch.sensors import SensorModel
from pretouch.uncertainty import Uncertainty

from .constraints import Constraint, ImpactModel, each_once
from .objectives import AnyObjective, Objective, as_objective
from .search.scan import GainAxis

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport

    from .drag.limits import DragEffect
    from .robust.measures import Measure, Required


P = ParamSpec("P")
R = TypeVar("R")


class Choice(Protocol):
    """What can be marked as the user's choice: a design."""

    @property
    def gain(self) -> Any:
        """D_p [N s]."""

    @property
    def scenario(self) -> Scenario:
        """The encounter with its admittance."""


class Source(Protocol):
    """The file that a task was read from."""

    def placed(self, error: InvalidInputError) -> InvalidInputError:
        """Return what a verb refuses as a mistake of the file."""

    def explained(self, error: InvalidInputError) -> str:
        """Return the message of an error, with the reason that the file has for it."""


def _sparing(cls: type[R]) -> type[R]:
    """Let a task store what it is given only, since a design takes a few microseconds; the rest is its class's."""
    complete: Any = cls.__init__
    known = {name for name in cls.__annotations__ if name != "_"}
    rules: dict[str, Rule] = {}

    @wraps(complete)
    def __init__(self: Any, scenario: Any, sensor: Any, objective: Any = None, **asked: Any) -> None:  # noqa: N807
        if not known >= asked.keys():
            complete(self, scenario, sensor, objective, **asked)  # which refuses the name
        kept = self.__dict__
        if not rules:
            rules.update(rules_of_fields(cls))
        if type(scenario) not in rules["scenario"].quick:
            rules["scenario"].check(scenario)
        if type(sensor) not in rules["sensor"].quick:
            rules["sensor"].check(sensor)
        kept["scenario"], kept["sensor"], kept["uncertainty"] = scenario, sensor, {}
        for name, value in asked.items():
            rule = rules.get(name)
            kept[name] = value if rule is None or type(value) in rule.quick else rule.check(value)
        if "law" in asked:
            kept["law"] = continuous_law(asked["law"])
        elif (own := getattr(asked.get("loop"), "continuous", None)) is not None:
            kept["law"] = own
        if objective is not None:
            kept["objective"] = as_objective(objective)
        if "constraints" in asked:
            kept["constraints"] = tuple(asked["constraints"])
            each_once(self.limits)

    cls.__init__ = __init__  # type: ignore[assignment,method-assign]
    return cls


@_sparing
@dataclass(frozen=True)
class Task(Value):
    """One problem, which every verb takes: the encounter, the sensor, and what is asked for.

    Each verb uses what it needs and refuses what is missing. `load_scenario` returns one; where nothing is said of a
    unit, numbers are SI.

    Args:
        scenario: the encounter; for `design_gain` also an array of them, each of which gets its own gain. Its virtual
            mass is always kept, and so is what is not free.
        sensor: the sensor curve, over the distance from the contact surface.
        objective: what is minimized: an Objective, or an object or a function of your own (docs/design.md).
        bounds: smallest and largest gain of a design [N s]; mitigating gains D_p are negative.
        constraints: limits that the encounter must keep, each once, in any sequence. Where inputs are uncertain, or
            runs have noise, a Constraint must hold always, a `Required` one with its probability; elsewhere both
            always. For a front, those of acceleration and speed are the limits of the robot, of which the physical
            bound speaks.
        impact: physical properties, for objectives, constraints and quantities that speak of forces.
        method: how encounters are solved in continuous time, as in `find_contact`.
        horizon: how long to wait for contact there [s].
        law: whose number is chosen: a law in continuous time or its name, "virtual-damper" of the letter's L(2), the
            default, or "virtual-drag"; where a loop is given, that of its controller. A gain is the number of this law,
            wherever one is spoken of, in its unit: D_p [N s], phi [N s^2].
        effect: what `design_drag` chooses a drag by, such as `DragEffect(ratio=0.15)`.
        evaluate: solves encounters in the place of `find_contact`, from scenario, sensor and an array of gains: a
            `ClosedLoop`, for the gain that is optimal on the sampled loop, or a function.
        natural_frequency: bounds of sqrt(K_a / M_a) [rad/s] where it is free; None keeps that of the scenario.
        damping_ratio: bounds of D_a / (2 sqrt(M_a K_a)) where it is free; None keeps that of the scenario.
        quantities: what a front trades: two or three names of QUANTITY_UNITS, whose magnitudes are minimized.
        choice: what is marked beside a front: a gain [N s] with the admittance of the scenario, or a design.
        gain: D_p [N s] that is verified, simulated or swept with; the designed one where None.
        uncertainty: what is known of inputs, by name, such as `{"obstacle.velocity": Uniform(low=-0.4, high=-0.2)}`.
        measure: what a robust gain makes of the objectives of all encounters: Expected() where None, Quantile,
            ConditionalValueAtRisk or WorstCase.
        samples: how many encounters the measure is taken over; None for 4096, or 256 with `evaluate`.
        validation: how many fresh ones a robust gain is held against; None for 4096, or four times the samples with
            `evaluate`.
        seed: of all samples of a robust gain; runs on a loop have the seed of the loop.
        sampling: how samples are drawn, as in `sample_inputs`.
        confidence: of intervals and of the lower bounds of shares.
        loop: the `ClosedLoop` on which the gain is to run: sensor chain, controller, robot and contact.
        runs: how many runs a verdict rests on.
        stability_margin: by how much a designed gain must be able to grow until the loop is unstable; it cuts the
            bounds. None: not asked for.
        speed_tolerance: by which share contact may be harder than predicted, and than with an infinitely fast sensor,
            until a verdict says so.
        calibration: the report of the fit that the sensor comes from; a verdict then tries the gain on what else its
            readings allow.
        source: the file that the task was read from; what a verb refuses then names its line.
        part: the sensor part that the chain of the loop starts from, where a file names one.

    Examples:
        >>> from pretouch.design import design_gain, excursion_objective
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> task = Task(
        ...     Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ...     ),
        ...     InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        ...     excursion_objective(position_scale=0.5, velocity_scale=0.3),
        ...     bounds=(-10.0, -0.01),
        ... )
        >>> round(design_gain(task).gain, 4)
        -0.7463
        >>> weaker = task.replace(bounds=(-0.5, -0.01))
        >>> round(design_gain(weaker).gain, 4)
        -0.5
    """

    scenario: Scenario
    sensor: SensorModel
    objective: AnyObjective | None = field(default=None, metadata={"checked": False})
    _: KW_ONLY
    bounds: tuple[float, float] | None = None
    constraints: Sequence[Constraint | Required] = ()
    impact: ImpactModel | None = None
    method: str = "auto"
    horizon: float = 600.0
    law: ContinuousLaw = field(default=DAMPER, metadata={"checked": False})
    effect: DragEffect | None = None
    evaluate: Evaluator | None = None
    natural_frequency: tuple[float, float] | None = None
    damping_ratio: tuple[float, float] | None = None
    quantities: Sequence[str] = ("displacement", "relative_velocity")
    choice: float | Choice | None = None
    gain: float | None = None
    uncertainty: Uncertainty = field(default_factory=dict)
    measure: Measure | None = None
    samples: int | None = None
    validation: int | None = None
    seed: int | None = None
    sampling: str = "sobol"
    confidence: float = 0.95
    loop: Any = field(default=None, metadata={"takes": "ClosedLoop | None"})
    runs: int = 1000
    stability_margin: float | None = None
    speed_tolerance: float = 0.1
    calibration: CalibrationReport | None = None
    source: Source | None = field(default=None, compare=False)
    part: Any = None

    @property
    def goal(self) -> Objective:
        """The objective, for a verb that needs one.

        Raises:
            InvalidInputError: there is none.
        """
        found: Objective | None = self.__dict__.get("objective")  # which was made one at the start
        if found is None:
            raise InvalidInputError("objective: found None, expected an Objective, such as excursion_objective(...)")
        return found

    @property
    def limits(self) -> tuple[Constraint, ...]:
        """The constraints without their probabilities."""
        return tuple([c if isinstance(c, Constraint) else c.constraint for c in self.constraints])

    @property
    def is_admittance_free(self) -> bool:
        """Whether natural frequency or damping ratio is left open."""
        return self.natural_frequency is not None or self.damping_ratio is not None

    def stable_bounds(self) -> tuple[float, float]:
        """Return the gains [N s] between which a design looks: the bounds, cut where a margin to instability is asked.

        Raises:
            InvalidInputError: there are no bounds, or nothing is left of them.
        """
        if self.bounds is None:
            raise InvalidInputError(
                "bounds: found none, expected the smallest and the largest gain [N s], such as bounds=(-10.0, -0.01)"
            )
        if self.stability_margin is None:
            return self.bounds
        if self.loop is None:
            raise InvalidInputError("stability_margin: found one without a loop, expected loop=ClosedLoop(...) with it")
        axis = GainAxis.between(self.bounds, self.law.number)  # refuses bounds as they are given, and not as cut
        found: tuple[float, float] = self.loop.stable_bounds(
            axis.ends, self.scenario, self.sensor, self.stability_margin
        )
        return found

    def replace(self, **changes: Any) -> Task:
        """Return the task with other values of some fields; with another loop, its law is that of the loop."""
        kept = {name: value for name, value in self.__dict__.items() if name != "law" or "loop" not in changes}
        return Task(**{**kept, **changes})


def placed(verb: Callable[Concatenate[Task, P], R]) -> Callable[Concatenate[Task, P], R]:
    """Make a verb that names line and key of what it refuses, where its task comes from a file."""

    # by its name as well, which `Concatenate` cannot say
    @wraps(verb)
    def told(task: Task, *args: P.args, **options: P.kwargs) -> R:
        try:
            return verb(task, *args, **options)
        except InvalidInputError as error:
            found = error if task.source is None else task.source.placed(error)
            if found is error:
                raise
            raise found from error

    return cast("Callable[Concatenate[Task, P], R]", told)
