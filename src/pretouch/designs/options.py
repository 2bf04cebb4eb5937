"""Define the task options for Pareto fronts, robust designs and verification."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any, Protocol, Self

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_declared, check_types, count, quantity
from pretouch._core.numbers import checked_probability
from pretouch._core.values import Value
from pretouch.motion import Scenario

from .quantities import check_quantity

if TYPE_CHECKING:
    from .robust.measures import Measure


class ExplainsNames:
    """Base class whose constructor explains unknown field names.

    A name may be misspelled or belong to another class.
    """

    __slots__ = ()

    def __new__(cls, *_: Any, **values: Any) -> Self:
        """Raise an error if a field name is unknown.

        Raises:
            TypeError: a field name is unknown; the message suggests the right place or spelling.
        """
        for name in values:
            if name not in cls.__dataclass_fields__:  # type: ignore[attr-defined]
                raise TypeError(f"{cls.__name__}: found an unknown name {name!r}{_hint(cls, name)}")
        return super().__new__(cls)


def _hint(cls: Any, name: str) -> str:
    """Return where an unknown field name belongs, or a similar valid name; empty without either."""
    places: dict[str, list[str]] = {}
    for f in fields(cls):
        places.setdefault(f.name, []).append(f.name)
        if isinstance(f.default, ExplainsNames):
            options: Any = f.default
            for inner in fields(options):
                place = f"{f.name}={type(options).__name__}({inner.name}=...)"
                places.setdefault(inner.name, []).append(place)
    if name in places:
        return f"; it belongs in {' or '.join(places[name])}"
    similar = [known for known in places if len(name) > 2 and name in known] or get_close_matches(name, places, n=1)
    return f"; did you mean {' or '.join(places[similar[0]])}?" if similar else ""


class Choice(Protocol):
    """Interface of the user's chosen design in a Pareto plot.

    The plot marks it as the user's choice.
    """

    @property
    def gain(self) -> Any:
        """The designed coefficient of the control law.

        It is the gain D_p [N s] for the virtual damper.
        """

    @property
    def scenario(self) -> Scenario:
        """The encounter for which the gain was designed, with its admittance."""


@dataclass(frozen=True, kw_only=True)
class ParetoOptions(ExplainsNames, Value):
    """Options of `pareto`, which a scenario file sets in its section [pareto].

    Args:
        quantities: the quantities of the front: two or three names of QUANTITY_UNITS; magnitudes are minimized.
        choice: the user's choice, which is marked on the front: a gain with the admittance of the scenario, or a
            design.

    Examples:
        >>> ParetoOptions(quantities=("time", "displacement")).choice is None
        True
    """

    quantities: Sequence[str] = ("displacement", "relative_velocity")
    choice: float | Choice | None = None

    def __post_init__(self) -> None:
        check_types(self)
        names = tuple(self.quantities)
        for name in names:
            check_quantity(name, "quantities")
        if len(names) not in {2, 3} or len(set(names)) < len(names):
            listed = ", ".join(names) or "none"
            raise InvalidInputError(
                f"quantities: found {listed}, expected two or three different names of quantities", value=names
            )
        object.__setattr__(self, "quantities", names)


@dataclass(frozen=True, kw_only=True)
class RobustOptions(ExplainsNames, Value):
    """Options of `robust`, which a scenario file sets in its section [robust].

    Args:
        measure: the measure that a robust gain minimizes, of the objective over all encounters: Quantile,
            ConditionalValueAtRisk, WorstCase or Expected() (the default, None).
        samples: number of encounters of the measure; None for 4096, or 256 with `evaluate` or a CustomLaw.
        validation: number of fresh encounters on which the gain is validated; None for 4096, for four times the samples
            with `evaluate`, or for four times the samples, and at least 1024, with a CustomLaw.
        seed: seed of all samples; runs on a loop have the seed of the loop.
        sampling: sampling method, as in `sample_inputs`, also of the validation.
        confidence: confidence level of the intervals, between 0 and 1.

    Examples:
        >>> RobustOptions(samples=512, seed=1).confidence
        0.95
    """

    measure: Measure | None = None
    samples: int | None = None
    validation: int | None = None
    seed: int = 0
    sampling: str = "sobol"
    confidence: float = 0.95

    def __post_init__(self) -> None:
        check_types(self)
        checked_probability(self.confidence, "confidence")


@dataclass(frozen=True, kw_only=True)
class VerifyOptions(ExplainsNames, Value):
    """Options of `verify`, which a scenario file sets in its section [verify].

    Args:
        runs: number of simulated runs, 1 or more.
        confidence: confidence level of the lower bounds of probabilities, between 0 and 1.
        speed_tolerance: the verdict reports contact that is faster than predicted, or than with an infinitely fast
            sensor, by more than this share.

    Examples:
        >>> VerifyOptions(runs=500).speed_tolerance
        0.1
    """

    runs: int = count(1, 1000, "1000")
    confidence: float = 0.95
    speed_tolerance: float = quantity("", 0.1, sign="nonnegative", example="0.1")

    def __post_init__(self) -> None:
        check_declared(self)
        checked_probability(self.confidence, "confidence")
        if self.runs < 1:
            raise InvalidInputError(f"runs: found {self.runs}, expected a positive whole number", value=self.runs)
