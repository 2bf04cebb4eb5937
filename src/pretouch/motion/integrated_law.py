"""Solve encounters with any control law by numerical integration.

The obstacle may accelerate or turn back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

from .contact import ContactResult, ContactState, KnownColumns, Motion
from .custom_force import ForceLaw
from .integrated_path import encounters_of
from .integrated_result import columns_of, sample
from .integration import Integration
from .request import COURSE, Request, check_integration, make_request
from .scenario import Scenario

_COLUMNS: Final = (
    *ContactState.names(),
    *("status", "gain", "closest_distance", "settling_distance", "impulse_residual"),
)
_COURSE: Final = (
    *("time", "distance", "position", "velocity", "acceleration", "displacement", "relative_velocity"),
    "virtual_force",
)
_TOGETHER: Final = 4096  # encounters that are integrated side by side


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegratedLaw(Value):
    """A control law whose encounters are solved by numerical integration.

    Args:
        kind: name of the law, for messages.
        force: function of the law's number, s and s' that returns F [N].
        vectorized: whether `force` takes and returns arrays.
        suspends_admittance: whether the admittance's pull is switched off in an approach.
    """

    kind: str
    force: Callable[[Any, Any, Any], Any]
    vectorized: bool = True
    suspends_admittance: bool = False

    def contact(
        self, scenario: Scenario, sensor: SensorModel, value: ArrayLike, method: str, horizon: float
    ) -> ContactResult:
        """Solve encounters until their first contact, and return their final states."""
        request = self._request(scenario, sensor, value, method, horizon)
        return _result(request, [columns_of(run) for run in self._integrate(request)])

    def motion(
        self, scenario: Scenario, sensor: SensorModel, value: ArrayLike, method: str, horizon: float, *, samples: int
    ) -> Motion:
        """Compute sampled motions of robot and obstacle until the first contact."""
        request = self._request(scenario, sensor, value, method, horizon)
        runs = [(columns_of(run), sample(run, samples)) for run in self._integrate(request)]
        course, shape = [arrays for _, arrays in runs], (*request.shape, samples)
        arrays = {name: _joined(course, name, shape) for name in _COURSE}
        return Motion(**arrays, result=_result(request, [columns for columns, _ in runs]))

    def _request(
        self, scenario: Scenario, sensor: SensorModel, value: ArrayLike, method: str, horizon: float
    ) -> Request:
        method = check_integration(method, COURSE if scenario.obstacle.course else f"the custom law {self.kind}")
        return make_request(scenario, sensor, value, method, horizon, with_course=True)

    def _integrate(self, request: Request) -> Iterator[Integration]:
        """Integrate all encounters in groups to limit the required memory."""
        law = ForceLaw(
            kind=self.kind,
            force=self.force,
            vectorized=self.vectorized,
            suspends_admittance=self.suspends_admittance,
            sensor=request.sensor,
        )
        encounters = encounters_of(request)
        for first in range(0, len(encounters), _TOGETHER):
            yield Integration(encounters.part(slice(first, first + _TOGETHER)), law, request.horizon)


def _result(request: Request, parts: list[dict[str, FloatArray]]) -> ContactResult:
    columns = {name: _joined(parts, name, request.shape) for name in _COLUMNS}
    columns["status"] = columns["status"].astype(np.int64)
    return ContactResult(KnownColumns(columns), "integration")


def _joined(parts: list[dict[str, FloatArray]], name: str, shape: tuple[int, ...]) -> FloatArray:
    return np.concatenate([part[name] for part in parts] or [np.zeros(0)]).reshape(shape)
