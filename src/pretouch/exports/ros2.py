"""Export a verified control law as a ROS 2 package.

The package contains a controller for ros2_control.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any, Final

from pretouch._core.units import format_quantity
from pretouch.simulation import ImpedancePlant

from .c import c_files, filled
from .curve_table import curve_table
from .law_design import LawDesign

_FILLED: Final = (  # with numbers and texts of the design
    "README.md",
    "config/admittance_controller.yaml",
    "config/controllers.yaml",
    "src/law.hpp",
    "src/parameters.hpp",
    "src/pretouch_controller_parameters.yaml",
    "src/sensor_curve.hpp",
)
_FIXED: Final = (  # the same for every design; .in hides Python files, which import ROS, from tools of this project
    "CMakeLists.txt",
    "package.xml",
    "pretouch_controller.xml",
    "launch/mock_robot.launch.py.in",
    "scripts/play_vectors.py.in",
    "src/pretouch_controller.cpp",
    "src/pretouch_controller.hpp",
    "src/report.cpp",
    "src/range_reading.hpp",
    "src/report.hpp",
    "urdf/mock_robot.urdf",
)
_CURVE_STEPS: Final = 1024
_CLEAR: Final = 4.0  # standard deviations of the noise, between the readings without an object and the lowest reading
_RARE: Final = 1e-6  # probability that all readings up to the timeout are equal, below which a constant one is a fault


def ros2_files(design: LawDesign) -> dict[str, str]:
    """Return the path and content of each file of a ROS 2 package."""
    values = {
        "rate": str(round(1 / design.controller.period)),
        **_parameters(design),
        **_names(design.number),
        **_curve(design),
        **_admittance(design),
    }
    own = {name: filled(f"ros2/{name}", design, **values) for name in _FILLED}
    fixed = {name.removesuffix(".in"): filled(f"ros2/{name}") for name in _FIXED}
    return own | fixed | {f"law/{name}": text for name, text in c_files(design).items()}


def _parameters(design: LawDesign) -> dict[str, str]:
    """Return the ROS parameters of the exported controller as text."""
    numbers = design.controller.parameters()
    sensing, drive = numbers.sensing, numbers.drive
    loop: Any = design.task.loop  # law_design checked that the task has one
    chain, plant = loop.chain, loop.plant
    value = numbers.law.drag if design.is_drag else numbers.law.gain
    follows = plant if isinstance(plant, ImpedancePlant) else None
    defaults: dict[str, float] = {
        "value": value,
        **{name: getattr(sensing, name) for name in ("offset", "floor", "saturation", "timeout", "largest_rate")},
        **{name: getattr(drive, name) for name in ("largest_force", "contact_gain", "contact_threshold")},
        **{f"largest_{name}": getattr(drive.limits, name) for name in ("speed", "acceleration", "excursion")},
        "sensor_period": sensing.sensor_period,
        "delay": chain.latency,
        "effort_stiffness": follows.stiffness if follows else 0.0,
        "effort_damping": follows.damping if follows else 0.0,
        "effort_mass": follows.mass if follows and follows.feedforward else 0.0,
    }
    texts = {name: yaml_number(number) for name, number in defaults.items()}
    return texts | {
        "value_bounds": ", ".join(yaml_number(bound) for bound in sorted((value, 0.0))),
        "value_description": "Drag phi" if design.is_drag else "Gain D_p",
        "value_unit": "N s^2" if design.is_drag else "N s",
        "new_when": "every_period" if sensing.sensor_period < 1.5 * sensing.period else "change",
        "constant_is_lost": "true" if _never_repeats(chain, sensing) else "false",
        "quantity": "distance" if chain.measures_distance else "raw",
    }


def _never_repeats(chain: Any, sensing: Any) -> bool:
    """Return whether noise changes so many readings that equal ones up to the timeout mean a fault."""
    if chain.measures_distance or chain.noise <= 0:
        return False  # an idle distance is a code, which repeats
    if chain.offset + chain.crosstalk - chain.lowest < _CLEAR * chain.noise:
        return False  # without an object, readings are clipped
    equal = min(chain.resolution / (2 * math.sqrt(math.pi) * chain.noise), 1.0)  # of two readings in a row
    return bool(equal ** (sensing.timeout / sensing.sensor_period) < _RARE)


def _names(number: str) -> dict[str, str]:
    """Return the C++ lines that list the ROS parameters and check the numbers among them."""
    kinds = dict(_kinds(filled("ros2/src/pretouch_controller_parameters.yaml").replace("$number", number)))
    numbers = [name for name, kind in kinds.items() if kind == "double"]
    return {
        "parameter_names": "\n".join(f'    "{name}",' for name in kinds),
        "finite_checks": "\n".join(f'    if (!std::isfinite(parameters.{name})) return "{name}";' for name in numbers),
    }


def _kinds(text: str) -> Iterator[tuple[str, str]]:
    """Yield the name and the type of each parameter in a YAML file of generate_parameter_library."""
    groups: list[tuple[int, str]] = []
    for indent, key, value in re.findall(r"^( *)(\w+):[ ]?(.*)$", text, re.MULTILINE):
        groups = [(depth, name) for depth, name in groups if depth < len(indent)]
        if key == "type" and value:
            yield ".".join(name for _, name in groups[1:]), value
        groups.append((len(indent), key))


def yaml_number(value: float) -> str:
    """Return a number as exact text for YAML 1.1."""
    digits, exponent, power = repr(float(value)).partition("e")
    return (digits if "." in digits else f"{digits}.0") + exponent + power


def _curve(design: LawDesign) -> dict[str, str]:
    """Return the sensor curve as text of C++."""
    table = curve_table(design, _CURVE_STEPS)
    return {
        "curve": table.curve,
        "curve_error": f"{table.error:.2g}",
        "curve_start": repr(table.start),
        "curve_step": repr(table.step),
        "curve_steps": str(_CURVE_STEPS),
        "curve_reach": table.reach_text("", "std::numeric_limits<double>::infinity()"),
        "curve_values": table.rows(),
    }


def _admittance(design: LawDesign) -> dict[str, str]:
    """Return virtual mass, damping ratio and stiffness for an admittance_controller of ros2_controllers."""
    a = design.controller.admittance
    critical = 2 * math.sqrt(a.mass * a.stiffness)
    note = (
        "The damping ratio is D_a / (2 sqrt(M_a K_a)), with the virtual mass M_a, the stiffness K_a and the damping "
        f"D_a = {format_quantity(a.damping, 'N*s/m')}."
        if critical > 0
        else "An admittance_controller computes its damping from the stiffness. In this design, the stiffness is 0. "
        "Therefore, the admittance_controller would move without this design's damping of "
        f"{format_quantity(a.damping, 'N*s/m')}."
    )
    return {
        "mass": yaml_number(a.mass),
        "stiffness": yaml_number(a.stiffness),
        "damping_ratio": yaml_number(a.damping / critical if critical > 0 else 0.0),
        "damping_note": note,
    }
