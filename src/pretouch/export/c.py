"""Export a verified control law as C99 source.

The export includes parameters, test vectors and a test program.
"""

from __future__ import annotations

import ctypes
import re
import textwrap
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from string import Template
from typing import Any, Final

from pretouch._core.units import format_quantity
from pretouch.control import Controller, Status
from pretouch.control.components import NO_LIMIT

from .law_design import WEAKER_NUMBER, LawDesign
from .law_source import HEADER, SOURCE, Field, law_text, structures
from .vectors import cases_as_csv

_WIDTH: Final = 116
_ASCII: Final = {
    "ξ": "xi",
    "ρ": "rho",
    "φ": "phi",
    "²": "^2",
    "³": "^3",
    "′": "'",
    "−": "-",
    "·": "*",
    "°": " deg",
    "ₚ": "_p",
}


def c_files(design: LawDesign) -> dict[str, str]:
    """Return the files of a C export by name."""
    files = {
        "pretouch_design.h": design_header(design),
        HEADER: law_text(HEADER),
        SOURCE: law_text(SOURCE),
        "vectors.csv": cases_as_csv(design.cases),
    }
    for name in ("test_law.c", "Makefile", "CMakeLists.txt"):
        files[name] = filled(f"c/{name}")
    return {**files, "README.md": filled("c/README.md", design)}


def filled(name: str, design: LawDesign | None = None, **more: str) -> str:
    """Return a template file filled with values of a design.

    Args:
        name: path of the file in the folder `templates`.
        design: the design; without it, the text is returned unchanged.
        **more: further texts, by the name that stands for them in the file.
    """
    text = (Path(__file__).with_name("templates") / name).read_text(encoding="utf-8")
    if design is None:
        return text
    return Template(text).substitute(
        law=design.law_text,
        version=version("pretouch"),
        origin=design.origin,
        verdict=design.verdict_text,
        steps=sum(len(case.samples) for case in design.cases),
        period=format_quantity(design.controller.period, "s"),
        number=design.number,
        weaker=WEAKER_NUMBER.format(name=design.number),
        suffix=design.suffix,
        step=f"pretouch_step{design.suffix}",
        limits="\n".join(_limit_lines(design.controller)),
        flags="\n".join(_flag_table()),
        **more,
    )


def design_header(design: LawDesign) -> str:
    """Return the C header with the parameters of a controller.

    Each parameter has a comment with its meaning and unit.
    """
    about = [
        f"Parameters of one controller for the file {SOURCE}, written by pretouch version {version('pretouch')}. Do "
        "not edit this file. Change the scenario file instead, and export again.",
        "",
        f"Scenario: {design.origin}" + (f", SHA-256 {design.digest}" if design.digest else ""),
        f"Law: {design.law_text}",
        f"Verification: {design.verdict_text}",
        "",
        "pretouch predicts contacts under the assumptions of the scenario; the integrator assesses the robot cell.",
    ]
    return filled(
        "c/pretouch_design.h",
        design,
        about=block_comment(about),
        values="\n".join(_values(f"pretouch_parameters{design.suffix}", design.controller.parameters(), 1)),
    )


def block_comment(lines: list[str]) -> str:
    """Return lines of text as an ASCII C comment.

    Comment delimiters in the text become `* /`.
    """
    wrapped = []
    for line in lines:
        plain = re.sub(r"\*/|/\*", "* /", _ascii(line))
        wrapped += textwrap.wrap(plain, _WIDTH - 3, break_on_hyphens=False) or [""]
    return "/* " + "\n".join(f" * {line}".rstrip() for line in wrapped)[3:] + " */"


def _ascii(text: str) -> str:
    for symbol, name in _ASCII.items():
        text = text.replace(symbol, name)
    return text.encode("ascii", "replace").decode()


def _values(kind: str, values: Any, level: int) -> Iterator[str]:
    """Yield the lines of a C initializer for a structure."""
    indent = "    " * level
    for field in structures()[kind]:
        value = getattr(values, field.name)
        if isinstance(value, ctypes.Structure):
            yield f"{indent}{{ /* {field.name} */"
            yield from _values(field.type, value, level + 1)
            yield f"{indent}}},"
        elif isinstance(value, ctypes.Array):
            yield f"{indent}{{ /* {_meaning(field)} */"
            yield from (f"{indent}    {_initializer(item)}," for item in value)
            yield f"{indent}}},"
        else:
            yield f"{indent}{_initializer(value)}, /* {_meaning(field)} */"


def _meaning(field: Field) -> str:
    return f"{field.name}: {field.comment}" if field.comment else field.name


def _initializer(value: Any) -> str:
    """Convert a number or structure to an exact C expression."""
    if isinstance(value, ctypes.Structure):
        return f"{{{', '.join(_initializer(getattr(value, name)) for name, *_ in value._fields_)}}}"
    if isinstance(value, int):
        return str(value)
    return f"PRETOUCH_R({value!r})"


def _limit_lines(controller: Controller) -> Iterator[str]:
    """Yield the limits of a controller as a Markdown list."""
    limits = controller.limits
    rows = (
        ("virtual force", limits.force, "N"),
        ("speed", limits.speed, "m/s"),
        ("acceleration", limits.acceleration, "m/s^2"),
        ("excursion", limits.excursion, "m"),
    )
    for name, value, unit in rows:
        given = value is not None and value < NO_LIMIT
        yield f"- largest {name}: {format_quantity(value, unit) if given and value is not None else 'no limit'}"


def _flag_table() -> Iterator[str]:
    """Yield the rows of a Markdown table of status flags."""
    yield "| flag | value | meaning |"
    yield "|---|---|---|"
    for flag in Status:  # without NONE
        yield f"| `PRETOUCH_{flag.name}` | {flag.value} | {flag.meaning} |"
