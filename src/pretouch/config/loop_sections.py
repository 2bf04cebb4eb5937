"""Define the scenario-file keys of the simulated control loop.

They describe sensor chain, controller, robot and contact.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

from pretouch._core.errors import UnitError
from pretouch._core.units import has_workable_magnitude, parse_unit
from pretouch.control import Conditioning, Limits, VirtualDamper, VirtualDrag
from pretouch.motion.laws import DAMPER, DRAG, LAWS, ContinuousLaw
from pretouch.simulation.chain import SensorChain
from pretouch.simulation.disturbance import KINDS, Disturbance
from pretouch.simulation.robot import PLANT_KINDS, HuntCrossley, SpringDamper

from .quantities import Quantity, UnfitValueError
from .robot_section import MODEL, ROBOT_MODEL
from .section import (
    EFFECTS,
    REQUIRED,
    TAG,
    ByLaw,
    Key,
    Section,
    declared_keys,
    described_section,
    gain_of,
    name_of,
    text,
    whole,
)

_POWER_LAW: Final = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*(\w*N)/(\w*m)(?:\^(\d+\.?\d*))?\s*", re.I
)
_SPAN: Final = Quantity("s", '"1 ms"', "positive")


def _check_rate(values: Mapping[str, Any]) -> None:
    if not {"part", "rate"} & set(values):
        raise UnfitValueError(
            'missing rate, expected rate = "250 Hz", or a part with a known rate, such as part = "VCNL4010"'
        )


def _check_period(values: Mapping[str, Any]) -> None:
    expected = 'expected one of rate = "1 kHz" and period = "1 ms"'
    if not {"rate", "period"} & set(values):
        raise UnfitValueError(f"missing rate, {expected}")
    if {"rate", "period"} <= set(values):
        raise UnfitValueError(f"found both rate and period, {expected}", "period")


def _check_margin(values: Mapping[str, Any]) -> None:
    margin = values.get("stability_margin", 2.0)
    if not margin > 1:
        raise UnfitValueError(
            f"found a gain margin of {margin:g}, expected a number above 1, such as 2. The gain margin is the "
            "factor by which the gain can grow before the loop becomes unstable",
            "stability_margin",
        )


def _stiffness_reader(exponent: float | None) -> Callable[[Any], Any]:
    """Make a parser for a contact stiffness. The exponent determines the unit of the stiffness, such as N/m^1.5."""
    power = 1.5 if exponent is None else exponent

    def read(value: Any) -> Any:
        if not isinstance(value, str):
            return _STIFFNESS(value)
        match = _POWER_LAW.fullmatch(value)
        try:
            if match and float(match[4] or 1) == power:
                force, length = parse_unit(match[2]).factor, parse_unit(match[3]).factor
                number = float(match[1]) * force / length**power
                if has_workable_magnitude(number):
                    return _STIFFNESS(number)
        except (UnitError, ArithmeticError):
            pass
        raise UnfitValueError(f'expected a positive quantity in the unit N/m^{power:g}, such as "1e6 N/m^{power:g}"')

    return read


def _limits() -> dict[str, Key]:
    return {f"largest_{name}": key for name, key in declared_keys(Limits).items()}


_CHAIN: Final = Section(
    {
        "part": Key(text('"VCNL4010"')),
        "phase": Key(Quantity("s", '"random"', "nonnegative", words=("random",)), "random"),
        **declared_keys(SensorChain, optional=True, without=("phase", "random_phase")),
    },
    _check_rate,
)
"""The sensor chain between distance and readings; missing values are taken from the part or the calibration."""


def _controller(law: ContinuousLaw) -> Section:
    """Return the keys of [controller] for a law; its virtual admittance is that of [admittance]."""
    keys = {
        "rate": Key(Quantity("Hz", '"1 kHz"', "positive")),
        "period": Key(_SPAN),
        "floor": Key(Quantity("output", "30.0", "positive")),
        "offset": Key(Quantity("output", "0.0")),
        "contact_gain": Key(Quantity("", "0.0", "nonnegative")),
        "contact_threshold": Key(Quantity("N", '"20 N"', "positive"), 1.0),
        **declared_keys(Conditioning, without=("floor", "offset", "sensor_period")),
        **_limits(),
    }
    if law == DAMPER:  # the keys of other sampled laws are in [law]
        keys |= {"gain": Key(gain_of(law)), **declared_keys(VirtualDamper, without=("gain",))}
        keys["release"] = replace(keys["release"], default=None)  # from the noise of the chain
    return Section(keys, _check_period)


def _check_drag(values: Mapping[str, Any]) -> None:
    """Check that only one key sets the virtual drag."""
    ways = [name for name in ("drag", *EFFECTS) if name in values]
    if len(ways) > 1:
        raise UnfitValueError(
            f"found the keys {ways[0]} and {ways[1]}, expected only one of these keys: {', '.join((*EFFECTS, 'drag'))}",
            ways[1],
        )
    if "largest_speed" in values and ways[:1] not in [[name] for name in AT_A_SPEED]:
        allowed = ", ".join(AT_A_SPEED)
        sentence = f"this key is allowed only with one of the keys {allowed}, but the section has none of them"
        if ways:
            sentence = f"this key is allowed only with one of the keys {allowed}, but the section has the key {ways[0]}"
        raise UnfitValueError(sentence, "largest_speed")


_DRAG: Final = declared_keys(VirtualDrag)
SAMPLED_DRAG: Final = tuple(_DRAG)
"""The keys of [law] that are parameters of the sampled drag."""

FROM_CHAIN: Final = ("noise", "relative_noise", "resolution")
"""The keys of SAMPLED_DRAG whose default values are those of the chain."""

AT_A_SPEED: Final = ("acceleration", "contact_speed", "impact_force")
"""The effects that hold up to a largest approach speed."""


def law_section(law: Any) -> Section:
    """Describe the keys of the section [law] for one control law."""
    return described_section(law, {law.number.key: Key(gain_of(law))})


_LAW: Final[Mapping[str, Section]] = {kind: law_section(law) for kind, law in LAWS.items()} | {
    DAMPER.kind: Section({"kind": TAG}),
    DRAG.kind: Section(
        {
            "kind": TAG,
            "drag": Key(_DRAG["drag"].read),
            "ratio": Key(Quantity("", "0.15", "positive")),
            "excursion": Key(Quantity("m", '"60 mm"', "positive")),
            "acceleration": Key(Quantity("m/s^2", '"2 m/s^2"', "positive")),
            "contact_speed": Key(Quantity("m/s", '"50 mm/s"', "positive")),
            "impact_force": Key(Quantity("N", '"20 N"', "positive")),
            "largest_speed": Key(Quantity("m/s", '"0.5 m/s"', "positive")),
            **{name: Key(_DRAG[name].read) for name in FROM_CHAIN},
            **{name: key for name, key in _DRAG.items() if name not in {"drag", *FROM_CHAIN}},
        },
        _check_drag,
    ),
}
"""The variants of [law], by kind; the keys of a sampled damper are in [controller]."""

_STIFFNESS: Final = declared_keys(HuntCrossley)["stiffness"].read

LOOP_VARIANTS: Final[Mapping[str, Mapping[str, Section]]] = {
    "chain": {"": _CHAIN},
    "controller": ByLaw(_controller),
    "disturbance": {
        "": Section({"kind": Key(name_of(*KINDS), REQUIRED, '"cable"'), **declared_keys(Disturbance)}, make=Disturbance)
    },
    "law": _LAW,
    "robot": {
        MODEL: ROBOT_MODEL,
        **{kind: described_section(plant) for kind, plant in PLANT_KINDS.built_in().items()},
    },
    "contact": {
        HuntCrossley.kind: Section(
            {
                "kind": TAG,
                "exponent": Key(Quantity("", "1.5", "positive"), 1.5),  # read before the stiffness
                **declared_keys(HuntCrossley, without=("exponent",)),
                "stiffness": Key(_STIFFNESS, REQUIRED, after=("exponent", _stiffness_reader)),
            },
            make=HuntCrossley,
        ),
        SpringDamper.kind: Section({"kind": TAG, **declared_keys(SpringDamper)}, make=SpringDamper),
    },
    "loop": {
        "": Section(
            {
                "seed": Key(whole(0, "0"), 0),
                "horizon": Key(_SPAN, 10.0),
                "follow_time": Key(Quantity("s", '"1 ms"', "nonnegative"), 0.2),
                "start_distance": Key(Quantity("m", '"300 mm"', "positive")),
                "stability_margin": Key(Quantity("", "2.0", "positive")),
            },
            _check_margin,
        )
    },
}
"""The variants of the sections of a loop."""
