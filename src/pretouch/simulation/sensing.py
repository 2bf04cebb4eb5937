"""Simulate a proximity sensor alone, for robots whose motion another program simulates."""

from __future__ import annotations

import ctypes
from ctypes import byref
from typing import Final

import numpy as np

from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, kernel
from pretouch.control import Arrival
from pretouch.sensors import SensorModel

from .chain import SensorChain
from .native_loop import chain_structure, curve_structure, waiting_readings

_size: Final = kernel("sensor_size", result=INTEGER)
_start: Final = kernel("sensor_start", POINTER, POINTER, POINTER, ctypes.c_uint64, INTEGER, POINTER, INTEGER, DOUBLE)
_next: Final = kernel("sensor_next", POINTER, result=DOUBLE)
_look: Final = kernel("sensor_look", POINTER, DOUBLE)
_deliver: Final = kernel("sensor_deliver", POINTER, DOUBLE, POINTER, POINTER, result=INTEGER)


class SensorRun:
    """One simulated run of a sensor.

    The sensor converts distances to readings in the same way as `simulate`.

    Args:
        chain: the sensor chain.
        sensor: the sensor curve.
        distance: distance at t = 0 [m].
        farthest: largest distance at which objects are seen [m]; beyond it, the output is 0.
        period: longest time between two deliveries [s].
        seed: seed of the noise.
        run: index of the run; every run has its own noise.

    Examples:
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> curve = ExponentialFirstOrder(scale=1.0, rate=-60.0)
        >>> run = SensorRun(SensorChain(rate=1000.0), curve, distance=0.05, farthest=0.2, period=1e-3)
        >>> fresh = run.deliver(0.0)
        >>> fresh.name, round(run.reading, 6)
        ('READING', 0.049787)
    """

    __slots__ = ("_held", "_memory", "_place", "_values")

    def __init__(
        self,
        chain: SensorChain,
        sensor: SensorModel,
        *,
        distance: float,
        farthest: float,
        period: float,
        seed: int = 0,
        run: int = 0,
    ) -> None:
        native, (curve, table) = chain_structure(chain), curve_structure(sensor, farthest)
        waiting = waiting_readings(chain, period)
        self._memory = np.zeros(-(-_size() // 8))
        self._place = address(self._memory)
        self._values = DOUBLE(), DOUBLE()
        self._held = native, curve, table, waiting
        _start(self._place, byref(native), byref(curve), seed, run, address(waiting), len(waiting), distance)

    @property
    def place(self) -> int:
        """The address of the sensor for compiled code, valid as long as this object lives."""
        return self._place

    @property
    def next(self) -> float:
        """The time [s] at which the sensor needs the next distance."""
        return float(_next(self._place))

    @property
    def reading(self) -> float:
        """The newest delivered reading, in the sensor's output unit."""
        return self._values[0].value

    @property
    def measured(self) -> float:
        """The time [s] at which the newest delivered reading was measured."""
        return self._values[1].value

    def look(self, distance: float) -> None:
        """Pass the distance [m] at the next sampling instant to the sensor.

        `next` returns this instant.
        """
        _look(self._place, distance)

    def deliver(self, time: float) -> Arrival:
        """Deliver the newest reading available at a given time [s].

        Returns:
            What was not delivered before: a reading, "no object", or nothing.
        """
        return Arrival(_deliver(self._place, time, byref(self._values[0]), byref(self._values[1])))
