"""Model robots as linear state-space systems of any order, for example with flexible joints."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Final

import numpy as np

from pretouch._core.blocks import Cell, Measured
from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_types
from pretouch._core.numbers import FloatArray, finite

from .robot import COEFFICIENTS, PlantModel

_INPUTS: Final = ("virtual position", "virtual velocity", "virtual acceleration", "force on the robot")
_MOST: Final = 32  # states: PRETOUCH_MOST_HIDDEN of native/core/pretouch.h, position and velocity
_ERROR: Final = 1e-9  # largest relative rounding of a condition on the matrices


@dataclass(frozen=True, kw_only=True)
class StateSpace:
    """A linear robot in state-space form.

    Its equations are w' = A w + B u and x = C w, with the states w. The inputs are u = (x_v, x_v', x_v'', F): x_v is
    the position of the virtual object that the robot follows, and F a force on the contact surface in the direction of
    x. x is the position of the contact surface. All numbers are SI.

    Args:
        states: the names of the n states.
        a: A, n rows of n numbers.
        b: B, n rows of 4 numbers.
        c: C, n numbers.

    Valid for:
        A robot that reaches a virtual object at rest, and keeps up with one of constant velocity at a constant lag. No
        input may change x or x' at once, and a force must accelerate the contact surface: 1 / m = C A B_F > 0.
    """

    states: tuple[str, ...]
    a: Any
    b: Any
    c: Any

    def __post_init__(self) -> None:
        check_types(self)
        n = len(self.states)
        if not 2 <= n <= _MOST:
            raise InvalidInputError(f"states: found {n}, expected 2 to {_MOST}", value=n)
        for name, shape in (("a", (n, n)), ("b", (n, len(_INPUTS))), ("c", (n,))):
            matrix = np.asarray(finite(getattr(self, name), name))
            if matrix.shape != shape:
                raise InvalidInputError(
                    f"{name}: found a matrix of the shape {matrix.shape}, expected the shape {shape} for {n} states"
                )
            object.__setattr__(self, name, _as_tuple(matrix))
        jumps = np.abs(self.arrays[2] @ self.arrays[1])
        if (jumps > _ERROR * np.abs(self.arrays[1]).max() * np.abs(self.arrays[2]).max()).any():
            raise InvalidInputError(
                f"b: the input {_INPUTS[int(jumps.argmax())]} changes the robot's velocity directly, expected a direct "
                "change of the acceleration only (C B = 0). Add the lag of the drive to the model"
            )
        if not self.inverse_mass > 0:
            raise InvalidInputError(
                f"b: a force of 1 N on the contact surface causes an acceleration of {self.inverse_mass:g} m/s^2, "
                "expected a positive acceleration. Check the signs of the matrices A, B and C. The acceleration equals "
                "C A B_F, where B_F is the column of the contact force in the matrix B"
            )
        _ = self.steady  # refuses a robot that does not follow

    @cached_property
    def arrays(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The state-space matrices A, B and C as arrays."""
        return np.array(self.a), np.array(self.b), np.array(self.c)

    @property
    def inverse_mass(self) -> float:
        """The inverse of the robot's mass [1/kg] at the contact surface.

        A sudden contact force accelerates this mass first.
        """
        a, b, c = self.arrays
        return float(c @ a @ b[:, 3])

    @cached_property
    def steady(self) -> FloatArray:
        """The states of the robot at rest and at constant velocity.

        The robot is at rest at x = 1 m, or moves at 1 m/s through x = 0. The shape is (n, 2).
        """
        a, b, c = self.arrays
        rest = _solved(a, c, -b[:, 0], 1.0, "at rest")
        moving = _solved(a, c, rest - b[:, 1], None, "of constant velocity")
        return np.column_stack([rest, moving - rest * float(c @ moving)])

    @cached_property
    def basis(self) -> FloatArray:
        """Matrix that converts the states to position, velocity and remaining states.

        The shape is (n, n), with n - 2 remaining states.
        """
        a, _, c = self.arrays
        first = np.array([c, c @ a])
        hidden = np.linalg.svd(first)[2][2:]
        return np.vstack([first, hidden])

    @property
    def fastest(self) -> float:
        """The largest magnitude of an eigenvalue of the matrix A [rad/s]."""
        return float(np.abs(np.linalg.eigvals(self.arrays[0])).max())


def _as_tuple(matrix: FloatArray) -> Any:
    return tuple(map(_as_tuple, matrix)) if matrix.ndim else float(matrix)


def _solved(a: FloatArray, c: FloatArray, right: FloatArray, output: float | None, motion: str) -> FloatArray:
    """Solve the linear system A w = right for the states w."""
    rows = a if output is None else np.vstack([a, c])
    values = right if output is None else np.append(right, output)
    scale = np.abs(rows).max(axis=1, initial=0.0)
    scale[scale == 0] = 1.0
    solution = np.linalg.lstsq(rows / scale[:, None], values / scale, rcond=None)[0]
    error = np.abs(rows @ solution - values) / scale
    if error.max() > _ERROR * max(1.0, float(np.abs(solution).max())):
        raise InvalidInputError(
            f"a: the robot model does not follow the commanded motion of a virtual object {motion}; check the signs "
            "and units of the matrices A and B"
        )
    return np.asarray(solution)


def native_rows(system: StateSpace) -> tuple[FloatArray, FloatArray]:
    """Return the matrices of the state space for the compiled simulation."""
    a, b, _ = system.arrays
    basis = system.basis
    back = np.linalg.inv(basis)
    rows = np.column_stack([basis @ a @ back, basis @ b])[1:]
    return np.ascontiguousarray(rows), np.ascontiguousarray(basis[2:] @ system.steady)


class LinearPlant(PlantModel):
    """Base class of linear robots in state-space form.

    A user-defined robot implements the method `system`.
    """

    __slots__ = ()

    @abstractmethod
    def system(self) -> StateSpace:
        """Return the state-space model of the robot."""

    def coefficients(self) -> tuple[float, ...]:
        """Return the coefficients of the robot; only the mass has an effect.

        The state-space model describes the rest.
        """
        numbers = dict.fromkeys(COEFFICIENTS, 0.0) | {"mass": 1 / self.system().inverse_mass, "friction_speed": 1.0}
        return tuple(numbers.values())

    def rows(self) -> Iterator[tuple[str, Cell]]:
        """Yield table rows with states, mass and eigenvalues of the robot."""
        system = self.system()
        yield "robot", f"{type(self).__name__}: a linear state space"
        yield "states", ", ".join(system.states)
        yield "mass at the contact surface", Measured(1 / system.inverse_mass, "kg")
        yield "fastest eigenvalue", Measured(system.fastest, "rad/s")


@dataclass(frozen=True, kw_only=True)
class StateSpacePlant(LinearPlant):
    """A linear robot that is described by its state-space matrices; see `StateSpace`.

    Args:
        states: the names of the n states.
        a: A, n rows of n numbers.
        b: B, n rows of 4 numbers: by virtual position, velocity and acceleration, and by a force on the robot.
        c: C, n numbers: the position of the contact surface.

    Examples:
        A mass of 2 kg that a spring of 4 kN/m and a damper of 180 N s/m pull to the virtual object:

        >>> plant = StateSpacePlant(
        ...     states=("position", "velocity"),
        ...     a=[[0.0, 1.0], [-2000.0, -90.0]],
        ...     b=[[0.0, 0.0, 0.0, 0.0], [2000.0, 90.0, 0.0, 0.5]],
        ...     c=[1.0, 0.0],
        ... )
        >>> plant.coefficients()[0]
        2.0
    """

    kind: ClassVar[str] = "state-space"

    states: tuple[str, ...]
    a: Any
    b: Any
    c: Any

    def __post_init__(self) -> None:
        check_types(self)
        system = self.system()
        for name in ("a", "b", "c"):
            object.__setattr__(self, name, getattr(system, name))

    def system(self) -> StateSpace:
        """Return the state-space model of the robot."""
        return StateSpace(states=self.states, a=self.a, b=self.b, c=self.c)
