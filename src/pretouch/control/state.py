"""The controller as numbers: what stays, and what goes on from step to step. Only `law` depends on the law."""

from __future__ import annotations

from typing import Any, NamedTuple

from .drive import DriveNumbers, DriveState
from .log_slope import SensingNumbers, SensingState

__all__ = ["ControllerNumbers", "ControllerState"]


class ControllerNumbers(NamedTuple):
    """The parameters of a step: numbers, truth values and tuples of them."""

    sensing: SensingNumbers
    law: Any
    drive: DriveNumbers


class ControllerState(NamedTuple):
    """The state of a step: numbers, truth values and tuples of them."""

    sensing: SensingState
    law: Any
    drive: DriveState
