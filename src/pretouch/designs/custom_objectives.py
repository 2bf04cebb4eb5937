"""Accept user-defined objectives in a gain design.

An objective is an instance with a method `value`, or a function of the state at contact.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final, Protocol, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.extensions import Extensions
from pretouch._core.messages import short_repr
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch.motion.contact import ContactState

from .impact import ImpactModel
from .objectives import Objective, Term, excursion_objective, time_objective

_SUM: Final = 1e-9  # largest relative error of the sum of the parts: far above rounding, invisible in reports


class Valued(Protocol):
    """Interface of a user-defined objective.

    Its method `value` computes the objective at contact.
    """

    def value(self, state: ContactState, obstacle_speed: Any, impact: ImpactModel | None) -> Any:
        """Return the objective at contact.

        The design minimizes this number, which must be >= 0.
        """


AnyObjective: TypeAlias = Objective | Valued | Callable[[ContactState], Any]
"""An `Objective`, or an instance of a user-defined class or a function that replaces it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CustomObjective(Objective):
    """Objective that calls a user-defined class or function.

    A function receives the state at contact.

    Its parts are those that the object's method `parts` returns, if they add up to the value; otherwise it has none.

    Args:
        terms: empty; the wrapped object may compute anything.
        name: the name of the class or of the function.
        wrapped: the wrapped object or function.
    """

    terms: tuple[Term, ...] = field(default=(), repr=False)
    wrapped: Any

    def __post_init__(self) -> None:
        pass

    def value(self, state: ContactState, obstacle_speed: Any, impact: ImpactModel | None = None) -> FloatArray:
        """Compute a user-defined objective for an array of contacts.

        Returns:
            The objective, with the shape of the array.

        Raises:
            InvalidInputError: the user-defined code fails for arrays, or returns values of another shape.
        """
        try:
            if callable(getattr(self.wrapped, "value", None)):
                value = self.wrapped.value(state, obstacle_speed, impact)
            else:
                value = self.wrapped(state)
            numbers = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(
                f'objective: the user-defined objective {self.name} failed with the error "{error}". pretouch '
                "evaluates the objective for many contacts in one call: use functions that accept arrays, such as "
                f"NumPy functions. In this call, the arrays of contact states had the shape {np.shape(state.time)}"
            ) from error
        if numbers.ndim and numbers.shape != np.shape(state.time):
            raise InvalidInputError(
                f"objective: the user-defined objective {self.name} returned an array of the shape {numbers.shape}, "
                f"expected one value for each contact (shape {np.shape(state.time)})"
            )
        return np.broadcast_to(numbers, np.shape(state.time))

    def parts(self, state: ContactState, obstacle_speed: Any, impact: ImpactModel | None = None) -> Mapping[str, Any]:
        """Return the terms of a user-defined objective.

        The result is empty unless the terms add up to the objective.
        """
        if not _declares_parts(self.wrapped):
            return {}
        parts: Mapping[str, Any] = self.wrapped.parts(state, obstacle_speed, impact)
        whole = self.value(state, obstacle_speed, impact)
        with np.errstate(invalid="ignore"):
            error = np.abs(np.asarray(sum(parts.values()), dtype=np.float64) - whole)
        finite = np.isfinite(whole)
        return parts if parts and np.all(error[finite] <= _SUM * np.abs(whole[finite])) else {}


def _objective_problem(name: str, objective: Any) -> str:  # noqa: ARG001 - an objective has no kind of its own
    """Return why an objective of an installed package is invalid; empty if it is valid."""
    if callable(getattr(objective, "value", None)) or (callable(objective) and not isinstance(objective, type)):
        return ""
    return (
        f"found {short_repr(objective)}, expected an objective: a function of the contact state, "
        "or a class or object with the method value(state, obstacle_speed, impact)"
    )


OBJECTIVE_KINDS: Final = Extensions(
    group="pretouch.objectives",
    built_in=lambda: {"excursion": excursion_objective, "time": time_objective, "custom": Objective},
    problem=_objective_problem,
)
"""The objectives that files may name: those of pretouch, and those of installed packages."""


def as_objective(objective: AnyObjective) -> Objective:
    """Convert a user-defined class instance or function to an `Objective`.

    Args:
        objective: an Objective; an object with `value(state, obstacle_speed, impact)` and, optionally, `parts` with the
            same arguments for reports; or a function of the state at contact.

    Returns:
        The objective itself if it is a plain sum of terms, otherwise a CustomObjective that wraps it.

    Raises:
        InvalidInputError: the argument is none of these.

    Examples:
        >>> def gentle(state):
        ...     return state.time**2 + 40 * state.relative_velocity**2
        >>> as_objective(gentle).name
        'gentle'
    """
    if type(objective) is CustomObjective or (
        type(objective) is Objective and all(type(t) is Term for t in objective.terms)
    ):
        return objective
    if isinstance(objective, type) or not (callable(getattr(objective, "value", None)) or callable(objective)):
        raise InvalidInputError(
            f"objective: found {objective!r}, expected an Objective. Other valid objectives are functions of the "
            "contact state, and objects with the method value(state, obstacle_speed, impact)",
            value=objective,
        )
    return CustomObjective(name=_name_of(objective), wrapped=objective)


def appraise(
    objective: Objective,
    state: ContactState,
    reached: BoolArray,
    obstacle_speed: Any,
    impact: ImpactModel | None,
) -> FloatArray:
    """Return the objective of each encounter.

    It is infinite without contact.

    Raises:
        InvalidInputError: a user-defined objective is negative.
    """
    value = objective.value(state, obstacle_speed, impact)
    if type(objective) is CustomObjective:
        wrong = np.asarray(reached) & ~(value >= 0)
        if wrong.any():
            time = np.broadcast_to(np.asarray(state.time), wrong.shape)[wrong]
            raise InvalidInputError(
                f"objective: the user-defined objective {objective.name} returned {float(value[wrong][0]):g}, expected "
                "0 or a positive number; add a constant to the objective. The contact with this value occurs at a time "
                f"of {float(time[0]):g} s"
            )
    return np.where(reached, value, np.inf)


def _declares_parts(wrapped: Any) -> bool:
    """Return True if a user-defined objective has a method for its terms. The method is `parts`."""
    if not callable(getattr(wrapped, "parts", None)):
        return False
    if not isinstance(wrapped, Objective):
        return True
    return type(wrapped).parts is not Objective.parts or type(wrapped).value is Objective.value


def _name_of(wrapped: Any) -> str:
    if type(wrapped) is Objective:
        return wrapped.name
    if isinstance(wrapped, partial):
        return _name_of(wrapped.func)
    name = getattr(wrapped, "__name__", type(wrapped).__name__)
    return "a function without a name" if name == "<lambda>" else str(name)
