"""Random sensor curves of every class, and the check that no class was forgotten."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import sys
from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

import pretouch.sensors
from pretouch.sensors import (
    CustomSensor,
    ExponentialFirstOrder,
    ExponentialSecondOrder,
    InversePower,
    MittagLeffler,
    PiecewiseCubic,
    Recessed,
    SensorModel,
    Table,
)

REACH = 0.1  # how far beyond its start a curve without end is looked at [m]


def concrete_sensors() -> list[type[SensorModel]]:
    """Every class of pretouch that is a sensor curve, whether exported or not."""
    for module in pkgutil.walk_packages(pretouch.sensors.__path__, "pretouch.sensors."):
        importlib.import_module(module.name)
    found, pending = set(), [SensorModel]
    while pending:
        for cls in pending.pop().__subclasses__():
            pending.append(cls)
            # a dataclass with slots is made anew from its body, which lingers under the same name
            shipped = getattr(sys.modules[cls.__module__], cls.__name__, None) is cls
            if cls.__module__.startswith("pretouch.") and shipped and not inspect.isabstract(cls):
                found.add(cls)
    return sorted(found, key=lambda cls: cls.__name__)


def _power_of_ten(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda e: 10.0**e)


def _custom(slope: float, depth: float, width: float) -> CustomSensor:
    return CustomSensor(
        log_output_function=lambda d: -slope * d - depth * np.tanh(d / width),
        log_slope_function=lambda d: -slope - depth / width / np.cosh(d / width) ** 2,
    )


def _table(first: float, steps: list[tuple[float, float]]) -> Table:
    width, fall = np.array(steps).T
    return Table(
        distances=tuple(first + np.concatenate([[0.0], np.cumsum(width)])),
        outputs=tuple(np.exp(-np.concatenate([[0.0], np.cumsum(fall)]))),
    )


def _piecewise(first: float, steps: list[tuple[float, float]]) -> PiecewiseCubic:
    """Straight lines in ln xi, so that the slope jumps at every point."""
    width, fall = np.array(steps).T
    return PiecewiseCubic(
        distances=tuple(first + np.concatenate([[0.0], np.cumsum(width)])),
        log_outputs=tuple(-np.concatenate([[0.0], np.cumsum(fall)])),
        slopes=tuple(zip(-fall / width, -fall / width, strict=True)),
    )


STEPS = st.lists(st.tuples(st.floats(1e-3, 0.02), _power_of_ten(-4, 0.5)), min_size=1, max_size=6)
RATE = st.floats(-300, -5)
SCALE = _power_of_ten(-8, 4)
_BARE: dict[type[SensorModel], st.SearchStrategy[SensorModel]] = {
    CustomSensor: st.builds(_custom, st.floats(1, 200), st.floats(0, 4), st.floats(0.02, 0.1)),
    ExponentialFirstOrder: st.builds(ExponentialFirstOrder, scale=SCALE, rate=RATE),
    ExponentialSecondOrder: st.builds(
        ExponentialSecondOrder, scale=SCALE, rate=RATE, curvature=st.floats(-2e3, 2e3) | st.just(0.0)
    ),
    InversePower: st.builds(
        InversePower, scale=SCALE, distance_offset=st.floats(5e-4, 0.2), exponent=st.floats(0.3, 8)
    ),
    MittagLeffler: st.builds(
        MittagLeffler,
        scale=SCALE,
        rate=RATE,
        order=st.floats(0.05, 1) | _power_of_ten(-15, -2).map(lambda e: 1 - e) | st.just(1.0),
    ),
    PiecewiseCubic: st.builds(_piecewise, st.floats(0, 0.01), STEPS),
    Table: st.builds(_table, st.floats(0, 0.01), STEPS),
}


def _recessed(sensor: SensorModel, share: float) -> Recessed:
    low, high = sensor.valid_range
    return Recessed(sensor=sensor, recess=low + share * min(high - low, 0.02))


SAMPLES: dict[type[SensorModel], st.SearchStrategy[SensorModel]] = {
    **_BARE,
    Recessed: st.builds(_recessed, st.one_of(*_BARE.values()), st.floats(0, 0.9)),
}
"""A strategy for each class: whoever adds a class adds a line here, or the tests say so."""


def looked_at(sensor: SensorModel) -> tuple[float, float]:
    """The part of the valid range that the tests look at [m]."""
    low, high = sensor.valid_range
    return low, min(high, low + REACH)


def distances(sensor: SensorModel) -> st.SearchStrategy[float]:
    """Distances in the part that is looked at, its ends among them."""
    low, high = looked_at(sensor)
    return st.floats(low, high) | st.sampled_from([low, high])


def rescaled(sensor: SensorModel, factor: float) -> SensorModel:
    """The same curve from a sensor whose output is `factor` times as large."""
    if isinstance(sensor, Recessed):
        return replace(sensor, sensor=rescaled(sensor.sensor, factor))
    if isinstance(sensor, Table):
        return replace(sensor, outputs=tuple(factor * o for o in sensor.outputs))
    if isinstance(sensor, PiecewiseCubic):
        return replace(sensor, log_outputs=tuple(np.log(factor) + level for level in sensor.log_outputs))
    if isinstance(sensor, CustomSensor):
        function = sensor.log_output_function
        return replace(sensor, log_output_function=lambda d: np.log(factor) + function(d))
    return replace(sensor, scale=factor * sensor.scale)  # type: ignore[call-arg, attr-defined]
