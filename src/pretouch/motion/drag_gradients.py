"""Compute derivatives of contact time and velocity under the virtual drag.

The derivatives with respect to the inputs are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Picklable
from pretouch.sensors.sensitivity import SlopeSensitivity

from .drag_demands import DragRun
from .layout import RELATIVE_INPUTS, ContactStatus


class DragRows(Picklable):
    """Derivatives of contact time and contact velocity with a virtual drag.

    They are NaN if an encounter does not end in contact, touches with l' = 0, or does not start with an approach.

    Args:
        columns: the encounters and their contacts.
    """

    __slots__ = ("_columns", "_followed", "_rows")

    degree = 2
    suspends_admittance = True

    def __init__(self, columns: DragRun) -> None:
        self._columns = columns
        self._rows: FloatArray | None = None
        self._followed: dict[str, FloatArray] = {}

    def take(self, which: Sequence[int]) -> FloatArray:
        """Return the derivatives of contact time and velocity with respect to selected inputs.

        `which` holds indices of RELATIVE_INPUTS. The result has the shape (2, k, n).
        """
        if self._rows is None:
            self._rows = self._by_inputs()
        return self._rows[:, list(which)]

    def of_slope(self, name: str, slope: SlopeSensitivity) -> FloatArray:
        """Return the derivatives of contact time and velocity with respect to a sensor parameter.

        `slope` is dg/d(parameter). The result has the shape (2, n).
        """
        if name not in self._followed:
            request, on = self._columns.request, self._columns.lanes

            def change(distance: FloatArray, which: IntArray) -> Any:
                return request.at_curves(lambda _, d: slope(d), distance, on[which])

            self._followed[name] = self._at_contact(self._columns.path.derivatives(change)[:, ::-1, 4].T)
        return self._followed[name]

    def _by_inputs(self) -> FloatArray:
        c = self._columns
        r, on = c.request, c.lanes
        by_path = c.path.derivatives()[:, ::-1].transpose(1, 2, 0)  # of t and l'^2
        by_strength, by_acceleration, by_distance = by_path[:, 0], by_path[:, 1], by_path[:, 2]
        by_velocity = 2 * r.velocity[on] * by_path[:, 3]
        none = np.zeros_like(by_distance)
        derivatives = {
            "mass": -r.strength[on] / r.mass[on] * by_strength,
            "damping": none,
            "stiffness": none,
            "x0": -by_distance,
            "u0": -by_velocity,
            "p": by_distance,
            "v": by_velocity,
            "a": by_acceleration,
            "gain": by_strength / r.mass[on],
        }
        return np.stack([self._at_contact(derivatives[name]) for name in RELATIVE_INPUTS], axis=1)

    def _at_contact(self, changes: FloatArray) -> FloatArray:
        """Convert derivatives of each approach's squared contact velocity to those of each encounter's velocity."""
        c = self._columns
        speed = c.raw("relative_velocity")
        rows = np.full((2, len(speed)), np.nan)
        rows[:, c.lanes] = changes
        with np.errstate(divide="ignore", invalid="ignore"):
            rows[1] /= 2 * speed
        valid = (c.raw("status") == ContactStatus.CONTACT) & (c.request.velocity < 0) & (speed < 0)
        return np.where(valid, rows + 0.0, np.nan)  # no negative zeros
