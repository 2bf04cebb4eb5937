"""Write the section [chain] of a scenario from a recording.

The section contains the measured rate, delay and noise of a sensor.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pretouch.simulation import SensorChain

from .noise import Noise
from .recording import Kind
from .timing import Timing


def chain_section(
    timing: Timing,
    noise: Noise,
    declared: SensorChain,
    *,
    kind: Kind,
    distance_noise: float | None,
    delay: tuple[float, str] | None,
    name: str,
    is_rate_stated: bool = False,
) -> str:
    """Return the measured sensor properties as a section [chain].

    The section belongs into a scenario file. It contains the rate, delay and noise. Properties that the recording does
    not show are those of the scenario, and a comment says so.

    Args:
        timing: when the readings came.
        noise: noise of the readings.
        declared: the sensor chain of the scenario.
        kind: whether the readings are distances.
        distance_noise: standard deviation of a measured distance [m]; None if unknown.
        delay: the delay [s], and how it was measured; None if unknown.
        name: name of the recording and its topic, for a comment.
        is_rate_stated: whether the user stated the rate, because the recording has no times.

    Returns:
        The text.
    """
    rows: list[tuple[str, str, str]] = []
    rate = timing.value_rate
    whence = "as stated" if is_rate_stated else "without gaps"
    repeated = f"{whence}; each value is published {timing.held} times"
    jitter = declared.jitter if is_rate_stated else timing.jitter
    exposure = min(declared.exposure, 1 / rate)
    rows += [
        ("rate", _quoted(rate, "Hz"), whence if timing.held == 1 else repeated),
        ("exposure", _quoted(exposure, "s"), "not measured; from the scenario"),
        ("delay", *_delay(declared, delay)),
        (
            "jitter",
            _quoted(min(jitter, 1 / rate / 4), "s"),
            "not measured; from the scenario" if is_rate_stated else "robust standard deviation",
        ),
        ("dropout", _number(timing.dropout), "readings missing in gaps of up to five periods"),
        *_level_rows(noise, declared, kind, distance_noise),
    ]
    if declared.misfit:
        rows.append(("misfit", _number(declared.misfit), "not measured; from the scenario"))
        rows.append(("misfit_length", _quoted(declared.misfit_length, "m"), "not measured; from the scenario"))
    width = max(len(f"{key} = {value}") for key, value, _ in rows)
    lines = [f"{f'{key} = {value}':<{width}}  # {remark}" for key, value, remark in rows]
    return "\n".join([f"# measured by pretouch replay in {name}", "[chain]", *lines]) + "\n"


def _delay(declared: SensorChain, delay: tuple[float, str] | None) -> tuple[str, str]:
    if delay is None:
        return _quoted(declared.delay, "s"), "not measured; from the scenario"
    return _quoted(max(delay[0], 0.0), "s"), delay[1]


def _level_rows(
    noise: Noise, declared: SensorChain, kind: Kind, distance_noise: float | None
) -> Iterator[tuple[str, str, str]]:
    """Yield the [chain] entries on noise, offset, resolution and saturation."""
    kept = "not measured; from the scenario"
    if kind == "distance":
        yield "measures_distance", "true", "the topic is a distance"
        measured = distance_noise is not None
        yield (
            "distance_noise",
            _quoted(distance_noise if measured else declared.distance_noise, "m"),
            "robust standard deviation" if measured else kept,
        )
        if noise.resolution:
            yield "distance_resolution", _quoted(noise.resolution, "m"), "step of the distances"
        return
    where = "with an object" if noise.limited else "without an object"
    remarks = {"noise": where, "offset": "median without an object"}
    for key, value in (("noise", noise.noise), ("relative_noise", noise.relative_noise), ("offset", noise.offset)):
        own = getattr(declared, key) + (declared.crosstalk if key == "offset" else 0.0)
        yield key, _number(own if value is None else value), kept if value is None else remarks.get(key, "of xi")
    if noise.limited and noise.offset is not None:
        yield "lowest", _number(noise.offset), "the readings stay at this value without an object"
    if noise.drift is not None:
        yield "drift", _number(noise.drift.rate), "per second, of the readings without an object"
    if noise.resolution:
        yield "resolution", _number(noise.resolution), "step of the readings"
    if noise.clipped and noise.largest is not None:
        yield "highest", _number(noise.largest), "the readings stay at this value"
    elif np.isfinite(declared.highest):
        yield "highest", _number(declared.highest), kept


def _number(value: float) -> str:
    return repr(float(f"{value:.6g}"))


def _quoted(value: float | None, unit: str) -> str:
    return f'"{float(f"{value or 0.0:.6g}")!r} {unit}"'
