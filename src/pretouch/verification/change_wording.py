"""What to change, in one imperative sentence with numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from pretouch._core.units import format_quantity
from pretouch.simulation import ClosedLoop

from .timing import fills_period

__all__ = ["change_sentence", "redesign_sentence"]


def change_sentence(name: str, before: ClosedLoop, after: ClosedLoop) -> str:
    """Say what to do.

    Args:
        name: of the change, one of those of `candidates_of`.
        before: the loop as it is.
        after: the loop with the change.

    Returns:
        An imperative sentence.
    """
    return _SENTENCES[name](before, after)


def redesign_sentence(gain: float, loop_gain: float, margin: float | None) -> str:
    """Say which gain to take.

    Args:
        gain: as it is [N s].
        loop_gain: the better one [N s].
        margin: to instability with the better one; None where it is not known.

    Returns:
        An imperative sentence.
    """
    beside = "" if margin is None or margin > 1e3 else f"; the loop is unstable at {margin:.3g} times that"
    return f"Take D_p = {format_quantity(loop_gain, 'N*s')} instead of {format_quantity(gain, 'N*s')}{beside}."


def _hertz(rate: float) -> str:
    return f"{rate:.6g} times a second"


def _sensor_rate(before: ClosedLoop, after: ClosedLoop) -> str:
    text = f"Read the sensor {_hertz(after.chain.rate)} instead of {before.chain.rate:.6g}"
    if fills_period(before.chain):
        text += f", with an exposure of {format_quantity(after.chain.exposure, 's')}"
    if after.law.period < before.law.period:
        text += f", and step the controller {_hertz(1 / after.law.period)}"
    return text + "."


def _noise(before: ClosedLoop, after: ClosedLoop) -> str:
    chain, parts = after.chain, []
    if chain.noise:
        parts.append(f"{chain.noise:.3g} in the unit of xi instead of {before.chain.noise:.3g}")
    if chain.relative_noise:
        parts.append(f"{100 * chain.relative_noise:.3g} % of xi instead of {100 * before.chain.relative_noise:.3g} %")
    if chain.distance_noise:
        noise = (format_quantity(c.distance_noise, "m") for c in (chain, before.chain))
        parts.append(" instead of ".join(noise))
    return f"Halve the noise of the sensor to a standard deviation of {' and '.join(parts)}."


def _delay(before: ClosedLoop, _: ClosedLoop) -> str:
    return f"Hand over readings without the delay of {format_quantity(before.chain.delay, 's')} after their exposure."


def _median(before: ClosedLoop, _: ClosedLoop) -> str:
    law: Any = before.law
    return f"Leave out the median over {law.conditioning.median_window} readings."


def _low_pass(before: ClosedLoop, _: ClosedLoop) -> str:
    c: Any = before.law
    cutoff = format_quantity(c.conditioning.cutoff, "Hz")
    return f"Leave out the low-pass of order {c.conditioning.low_pass_order} at {cutoff}."


def _add_median(_: ClosedLoop, after: ClosedLoop) -> str:
    return f"Take the running median over {_any(after).law.conditioning.median_window} readings."


def _add_low_pass(_: ClosedLoop, after: ClosedLoop) -> str:
    c = _any(after).law.conditioning
    return f"Filter readings by a low-pass of order {c.low_pass_order} at {format_quantity(c.cutoff, 'Hz')}."


def _controller_rate(before: ClosedLoop, after: ClosedLoop) -> str:
    return f"Step the controller {_hertz(1 / after.law.period)} instead of {1 / before.law.period:.6g}."


def _bandwidth(before: ClosedLoop, after: ClosedLoop) -> str:
    new, old = (format_quantity(one.plant.bandwidth, "Hz") for one in (_any(after), _any(before)))
    return f"Give the robot's own control a bandwidth of {new} instead of {old}."


def _stiffness(before: ClosedLoop, after: ClosedLoop) -> str:
    new, old = (_any(one).plant for one in (after, before))
    return (
        f"Raise the stiffness of the robot's impedance controller to {format_quantity(new.stiffness, 'N/m')} from "
        f"{format_quantity(old.stiffness, 'N/m')}, and its damping to {format_quantity(new.damping, 'N*s/m')}."
    )


def _offset(before: ClosedLoop, after: ClosedLoop) -> str:
    new, old = (_any(one).law.conditioning.offset for one in (after, before))
    text = f"Subtract the offset exactly, {new:.4g} in the unit of xi"
    text += f" instead of {old:.4g}" if new != old else ""
    return text + (", and follow its drift." if before.chain.drift else ".")


def _largest_rate(before: ClosedLoop, after: ClosedLoop) -> str:
    rate, chain = _any(after).law.conditioning.largest_rate, before.chain
    noise = " and what noise adds" if chain.noise + chain.relative_noise + chain.distance_noise else ""
    made = f"twice what the fastest approach makes of ln xi{noise}"
    return f"Set largest_rate to {format_quantity(rate, '1/s')}: {made}."


def _any(value: Any) -> Any:
    return value


_SENTENCES: Final[dict[str, Callable[[ClosedLoop, ClosedLoop], str]]] = {
    "sensor-rate": _sensor_rate,
    "delay": _delay,
    "noise": _noise,
    "median": _median,
    "low-pass": _low_pass,
    "add-median": _add_median,
    "add-low-pass": _add_low_pass,
    "controller-rate": _controller_rate,
    "robot-bandwidth": _bandwidth,
    "robot-stiffness": _stiffness,
    "offset": _offset,
    "largest-rate": _largest_rate,
}
