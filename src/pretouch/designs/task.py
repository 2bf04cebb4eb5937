"""Define the design task: encounter, sensor, objective, constraints and options."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import partial, wraps
from typing import TYPE_CHECKING, Any, Concatenate, Final, ParamSpec, Protocol, TypeVar, cast

import numpy as np

from pretouch._core.display import Described
from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_declared, quantity
from pretouch._core.values import Value
from pretouch.motion import DAMPER, ContactResult, ContinuousLaw, Scenario
from pretouch.motion.evaluator import Evaluator
from pretouch.motion.laws import continuous_law
from pretouch.sensors import SensorModel
from pretouch.uncertainty import Uncertainty

from .constraints import Constraint, each_once
from .custom_objectives import AnyObjective, as_objective
from .impact import ImpactModel
from .objectives import Objective
from .options import ExplainsNames, ParetoOptions, RobustOptions, VerifyOptions
from .search.gain_axis import GainAxis

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport

    from .drag.limits import DragEffect
    from .robust.required import Required


P = ParamSpec("P")
R = TypeVar("R")


class Source(Protocol):
    """The scenario file that describes a task."""

    def placed(self, error: InvalidInputError) -> InvalidInputError:
        """Add the location in the scenario file to an error.

        The location is the line and the key that caused the error.
        """

    def explained(self, error: InvalidInputError) -> str:
        """Return an error message with the calibrated range of distances.

        The range is added only if a distance is out of range.
        """


_OF_LOOP: Final[Any] = None
"""The default law: that of the controller of the loop, or else the virtual damper."""


@dataclass(frozen=True)
class Task(ExplainsNames, Described, Value):
    """The complete design problem of functions such as `design_gain`.

    It consists of an encounter, a sensor and all options. Each verb uses the fields that it needs and raises an error
    if one is missing. Options that only one verb reads are one value: `pareto`, `robust` and `verify`. `load_scenario`
    returns a Task from a scenario file, whose sections have the same names. Numbers without a stated unit are SI.

    Args:
        scenario: the encounter; for `design_gain` also an array of encounters, each of which gets its own gain. The
            virtual mass is always kept, and so are natural frequency and damping ratio unless they are free.
        sensor: the sensor curve, over the distance from the contact surface.
        objective: the objective to minimize: an Objective, or a user-defined object or function
            (docs/explanation/design.md).
        bounds: smallest and largest gain of a design, in the unit of the law's number, such as N s; mitigating gains
            D_p are negative.
        constraints: limits that the encounter must keep, at most one per quantity, in any order. A `Constraint` must
            always hold. A `Required` constraint must hold with its probability if inputs are uncertain or runs have
            noise, otherwise always. On a Pareto front, the limits of acceleration and speed also define the robot of
            the physical bound.
        impact: physical properties, for objectives, constraints and quantities that are forces.
        method: how encounters are solved in continuous time, as in `find_contact`.
        horizon: the longest simulated time until contact in continuous time [s].
        law: the law whose number is chosen: a law in continuous time or its name, "virtual-damper" (the letter's
            force law L(2), the default) or "virtual-drag"; with a loop, by default the law of its controller. A gain
            always means the number of this law in its unit, such as D_p [N s] or phi [N s^2].
        drag_effect: the effect by which `design` chooses a drag, such as `DragEffect(ratio=0.15)`.
        evaluate: a function of scenario, sensor and an array of gains that solves encounters instead of
            `find_contact`, or a `ClosedLoop`, for the gain that is optimal on the sampled loop.
        natural_frequency: bounds of sqrt(K_a / M_a) [rad/s] if it is free; None keeps that of the scenario.
        damping_ratio: bounds of D_a / (2 sqrt(M_a K_a)) if it is free; None keeps that of the scenario.
        gain: the law's number, such as D_p [N s], that is verified, simulated or swept; None for the designed one.
        uncertainty: distributions of uncertain inputs by name, such as
            `{"obstacle.velocity": Uniform(low=-0.4, high=-0.2)}`.
        loop: the `ClosedLoop` on which the gain runs: sensor chain, controller, robot and contact.
        stability_margin: smallest gain margin of a designed gain on the loop, a factor; the bounds then exclude gains
            with a smaller margin. None: no margin is required.
        calibration: the report of the fit of the sensor curve; a verdict then also tests the gain on other sensor
            curves that agree with the readings.
        source: the file that the task was read from; errors then name its line.
        warnings: sentences about the inputs, such as those on a robot model, which reports repeat.
        sensor_part: the sensor part, named in a file, that gives the default sensor chain of the loop.
        pareto: the options of `pareto`.
        robust: the options of `robust`.
        verify: the options of `verify`.

    Examples:
        >>> from pretouch.designs import design_gain, excursion_objective
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
    horizon: float = quantity("s", 600.0, sign="positive", example='"1 h"')
    law: ContinuousLaw = field(default=_OF_LOOP, metadata={"checked": False})
    drag_effect: DragEffect | None = None
    evaluate: Evaluator | None = None
    natural_frequency: tuple[float, float] | None = None
    damping_ratio: tuple[float, float] | None = None
    gain: float | None = None
    uncertainty: Uncertainty = field(default_factory=dict)
    loop: Any = field(default=None, metadata={"takes": "ClosedLoop | None"})
    stability_margin: float | None = None
    calibration: CalibrationReport | None = None
    source: Source | None = field(default=None, compare=False)
    warnings: tuple[str, ...] = ()
    sensor_part: Any = None
    pareto: ParetoOptions = field(default=ParetoOptions())
    robust: RobustOptions = field(default=RobustOptions())
    verify: VerifyOptions = field(default=VerifyOptions())

    __str__ = object.__str__  # its fields, not its page

    def __post_init__(self) -> None:
        check_declared(self)
        objective = None if self.objective is None else as_objective(self.objective)
        law = continuous_law(_law_of(self.loop) if self.law is _OF_LOOP else self.law)
        for name, value in (("objective", objective), ("law", law), ("constraints", tuple(self.constraints))):
            object.__setattr__(self, name, value)
        each_once(self.limits)

    @property
    def goal(self) -> Objective:
        """The objective of the task.

        Raises:
            InvalidInputError: the task has no objective.
        """
        if self.objective is None:
            raise InvalidInputError("objective: found None, expected an Objective, such as excursion_objective(...)")
        return cast("Objective", self.objective)  # converted by `__post_init__`

    @property
    def limits(self) -> tuple[Constraint, ...]:
        """The constraints of the task, without their required probabilities."""
        return tuple([c if isinstance(c, Constraint) else c.constraint for c in self.constraints])

    @property
    def is_admittance_free(self) -> bool:
        """True if the design may change the admittance.

        It may change the natural frequency, the damping ratio or both.
        """
        return self.natural_frequency is not None or self.damping_ratio is not None

    def refuse_free_admittance(self, reason: str) -> None:
        """Raise an error if the admittance has bounds.

        Args:
            reason: why the function needs one admittance.

        Raises:
            InvalidInputError: natural frequency or damping ratio are free.
        """
        if self.is_admittance_free:
            free = [name for name in ("natural_frequency", "damping_ratio") if getattr(self, name) is not None]
            advice = (
                f"set {' and '.join(f'{name}=None' for name in free)}, with the admittance of `design` in the scenario "
                "and in any loop"
                if self.source is None
                else "replace [admittance] by the lines without bounds that pretouch design prints"
            )
            raise InvalidInputError(
                f"admittance {free[0]}_bounds: found bounds of the admittance, expected one admittance, because "
                f"{reason}; {advice}",
                argument=free[0],
            )

    def stable_bounds(self) -> tuple[float, float]:
        """Return the gain bounds that guarantee the required gain margin.

        The bounds of the task are narrowed to gains with this margin on the sampled loop.

        Raises:
            InvalidInputError: there are no bounds, or no gain between them has the gain margin.
        """
        if self.bounds is None:
            raise InvalidInputError(
                "bounds: found none, expected the smallest and the largest gain [N s], such as bounds=(-10.0, -0.01)"
            )
        if self.stability_margin is None:
            return self.bounds
        if self.loop is None:
            raise InvalidInputError("stability_margin: found one without a loop; pass loop=ClosedLoop(...) as well")
        axis = GainAxis.between(
            self.bounds, self.law.number
        )  # an error then quotes the user's bounds, not the cut ones
        stable: tuple[float, float] = self.loop.stable_bounds(
            axis.ends, self.scenario, self.sensor, self.stability_margin
        )
        return stable

    @property
    def largest_sensor_rate(self) -> float:
        """The largest rate of the named sensor part [Hz]; infinite if it is unknown."""
        return math.inf if self.sensor_part is None else float(self.sensor_part.largest_rate)

    @property
    def farthest_start(self) -> float:
        """The largest distance at which the controller of the loop detects the object [m]; infinite if unknown."""
        detect = getattr(self.loop, "farthest_start", None)  # a custom loop may have no such method
        return math.inf if detect is None else float(detect(self.scenario, self.sensor))

    def from_detection(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Let drawn encounters that start undetected begin where the controller of the loop detects the object.

        The law acts from there on. Without a loop, nothing changes.

        Args:
            values: the drawn inputs by name.

        Returns:
            The inputs, with smaller positions of the objects that start undetected.
        """
        name = "obstacle.position"
        if name not in values:
            return dict(values)
        plant = values.get("plant.position", self.scenario.plant.position)
        return {**values, name: np.minimum(values[name], plant + self.farthest_start)}

    @property
    def subtracted_offset(self) -> float | None:
        """The offset that the controller of the loop subtracts from each reading; None without such a controller."""
        conditioning = getattr(getattr(self.loop, "law", None), "conditioning", None)
        return cast("float | None", getattr(conditioning, "offset", None))

    def start_warnings(self, gain: float | None) -> tuple[str, ...]:
        """Return a warning if the controller of the loop detects the object elsewhere than the encounter starts.

        Args:
            gain: the law's number, whose effect decides whether the difference matters; None for any difference.

        Returns:
            At most one warning; none without a loop.
        """
        if self.loop is None:
            return ()

        how: dict[str, Any] = {"method": self.method, "horizon": self.horizon}
        predict = None
        if gain is not None:
            predict = partial(_contact_of, self.law, self.sensor, gain, how)
        return cast("tuple[str, ...]", self.loop.start_warnings(self.scenario, self.sensor, predict))

    def replace(self, **changes: Any) -> Task:
        """Return a copy of the task with some new values.

        A new loop also brings its own control law.

        Options are replaced as a whole: `task.replace(robust=dataclasses.replace(task.robust, samples=512))`.
        """
        law_of_loop = {"law": _OF_LOOP} if changes.get("loop") is not None else {}
        return dataclasses.replace(self, **{**law_of_loop, **changes})


def _contact_of(
    law: ContinuousLaw, sensor: SensorModel, gain: float, how: dict[str, Any], scenario: Scenario
) -> ContactResult:
    """Predict the contact of an encounter."""
    return law.contact(scenario, sensor, gain, **how)


def _law_of(loop: Any) -> ContinuousLaw:
    """Return the continuous-time control law of a sampled loop."""
    if loop is None:
        return DAMPER
    if loop.continuous is None:
        raise InvalidInputError(
            "loop: the prediction needs a control law in continuous time, but the control law "
            f"{type(getattr(loop.law, 'law', loop.law)).__name__} has none. Set the attribute `continuous` of this "
            'law, for example to "virtual-damper" or to a CustomLaw. Alternatively, set the attribute `law` of the task'
        )
    return cast("ContinuousLaw", loop.continuous)


_ALIKE: Final = 1e-9  # relative rounding error of a bound


def at_bound_in_words(task: Task, gain: float) -> str:
    """Explain why an optimal gain lies on a bound.

    Returns:
        A sentence that also says how to widen the range.
    """
    number = task.law.number
    at_own = any(math.isclose(gain, bound, rel_tol=_ALIKE) for bound in task.bounds or ())
    if task.stability_margin is not None and not at_own:
        return (
            f"the required gain margin of {task.stability_margin:g} limits the {number.name} to "
            f"{number.text(gain)}; a faster sensor, less latency or a faster robot allows a stronger {number.name}"
        )
    return f"the optimal {number.name} lies on its bound {number.text(gain)}; a wider range may contain a better value"


def with_file_location(verb: Callable[Concatenate[Task, P], R]) -> Callable[Concatenate[Task, P], R]:
    """Add the scenario file location to a function's error messages.

    Returns:
        The decorated function, whose errors name the line and the key.
    """

    # The task may also be passed by name; the type `Concatenate` cannot express that.
    @wraps(verb)
    def call(task: Task, *args: P.args, **options: P.kwargs) -> R:
        try:
            return verb(task, *args, **options)
        except InvalidInputError as error:
            located = error if task.source is None else task.source.placed(error)
            if located is error:
                raise
            raise located from error

    return cast("Callable[Concatenate[Task, P], R]", call)
