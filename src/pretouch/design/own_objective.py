"""Objectives of a user's own: a subclass of `Objective`, any object with a `value`, or a function of the contact."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final, Protocol, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch.motion.contact import ContactState

from .impact import ImpactModel
from .objectives import Objective, Term

__all__ = ["AnyObjective", "OwnObjective", "Valued", "appraise", "as_objective"]

_SUM: Final = 1e-9  # of the value, to which items must add up to it: far above rounding, far below what is read


class Valued(Protocol):
    """An object of a user's own that says what a contact is worth; it may have `parts` with the same arguments."""

    def value(self, state: ContactState, obstacle_speed: Any, impact: ImpactModel | None) -> Any:
        """Return a number >= 0 of the shape of the state, the less the better."""


AnyObjective: TypeAlias = Objective | Valued | Callable[[ContactState], Any]
"""An objective, or what a user hands over in its place."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnObjective(Objective):
    """What a user has handed over in the place of an Objective, under its own name.

    Its items are those that it declares by `parts`, where they add up to the value; else it is known as a whole only.

    Args:
        terms: none, for it may compute anything.
        name: that of its class, or of the function.
        given: what was handed over.
    """

    terms: tuple[Term, ...] = field(default=(), repr=False)
    given: Any

    def __post_init__(self) -> None:
        pass

    def value(self, state: ContactState, obstacle_speed: Any, impact: ImpactModel | None = None) -> FloatArray:
        """Ask it for the objective, of the shape of the state."""
        try:
            if callable(getattr(self.given, "value", None)):
                found = self.given.value(state, obstacle_speed, impact)
            else:
                found = self.given(state)
            numbers = np.asarray(found, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(
                f"objective: {self.name} failed on contacts of the shape {np.shape(state.time)} ({error}); it is asked "
                "for many at once, so that it needs functions of arrays, such as those of NumPy"
            ) from error
        if numbers.ndim and numbers.shape != np.shape(state.time):
            raise InvalidInputError(
                f"objective: {self.name} gave the shape {numbers.shape} for contacts of the shape "
                f"{np.shape(state.time)}, expected the same"
            )
        return np.broadcast_to(numbers, np.shape(state.time))

    def parts(self, state: ContactState, obstacle_speed: Any, impact: ImpactModel | None = None) -> Mapping[str, Any]:
        """Ask it for its items; none where it declares none, or such as do not add up to the value."""
        if not _declares_parts(self.given):
            return {}
        found: Mapping[str, Any] = self.given.parts(state, obstacle_speed, impact)
        whole = self.value(state, obstacle_speed, impact)
        with np.errstate(invalid="ignore"):
            missed = np.abs(np.asarray(sum(found.values()), dtype=np.float64) - whole)
        known = np.isfinite(whole)
        return found if found and np.all(missed[known] <= _SUM * np.abs(whole[known])) else {}


def as_objective(given: AnyObjective) -> Objective:
    """Take an objective, or what a user hands over in its place.

    Args:
        given: an Objective; an object with `value(state, obstacle_speed, impact)` and, if its items are to be told,
            `parts` with the same arguments; or a function of the state at contact.

    Returns:
        The objective itself where it is the sum of its terms and nothing else, otherwise an OwnObjective.

    Raises:
        InvalidInputError: it is none of these.

    Examples:
        >>> def gentle(state):
        ...     return state.time**2 + 40 * state.relative_velocity**2
        >>> as_objective(gentle).name
        'gentle'
    """
    if type(given) is OwnObjective or (type(given) is Objective and all(type(t) is Term for t in given.terms)):
        return given
    if isinstance(given, type) or not (callable(getattr(given, "value", None)) or callable(given)):
        raise InvalidInputError(
            f"objective: found {given!r}, expected an Objective, an object with value(state, obstacle_speed, impact), "
            "or a function of the state at contact"
        )
    return OwnObjective(name=_name_of(given), given=given)


def appraise(
    objective: Objective,
    state: ContactState,
    reached: BoolArray,
    obstacle_speed: Any,
    impact: ImpactModel | None,
) -> FloatArray:
    """Evaluate an objective, infinite without contact; refuse one of a user's own that is negative or no number."""
    value = objective.value(state, obstacle_speed, impact)
    if type(objective) is OwnObjective:
        wrong = np.asarray(reached) & ~(value >= 0)
        if wrong.any():
            time = np.broadcast_to(np.asarray(state.time), wrong.shape)[wrong]
            raise InvalidInputError(
                f"objective: {objective.name} gave {float(value[wrong][0]):g} for a contact after "
                f"{float(time[0]):g} s, expected a number that is not negative: what is lost is told as a share of it; "
                "add a constant"
            )
    return np.where(reached, value, np.inf)


def _declares_parts(given: Any) -> bool:
    """Tell whether items are its own: those of a sum of terms say nothing of a value that is computed otherwise."""
    if not callable(getattr(given, "parts", None)):
        return False
    if not isinstance(given, Objective):
        return True
    return type(given).parts is not Objective.parts or type(given).value is Objective.value


def _name_of(given: Any) -> str:
    if type(given) is Objective:
        return given.name
    if isinstance(given, partial):
        return _name_of(given.func)
    name = getattr(given, "__name__", type(given).__name__)
    return "a function without a name" if name == "<lambda>" else str(name)
