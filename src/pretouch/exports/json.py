"""Export a verified control law as JSON parameters.

The export includes difference equations, for example for MATLAB or PLCs.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from importlib.metadata import version
from typing import Any, Final

from pretouch._core.files import as_json

from .c import filled
from .law_design import SIGNS, LawDesign
from .law_source import structures
from .vectors import cases_as_csv

FORMAT: Final = "pretouch-law-1"
"""Version of the structure of `design.json`."""


def json_files(design: LawDesign) -> dict[str, str]:
    """Return the name and content of each file of a JSON export."""
    content = {
        "format": FORMAT,
        "pretouch": version("pretouch"),
        "law": design.law_text,
        "scenario": {"file": design.origin, "sha256": design.digest},
        "verification": {"text": design.verdict_text, "date": design.date},
        "signs": [line.replace("`", "") for line in SIGNS],
        "parameters": _parameters(design.controller.parameters()),
        "meanings": dict(_meanings(f"pretouch_parameters{design.suffix}")),
    }
    programs = ("pretouch_start.m", "pretouch_steady_low_pass.m", "pretouch_step.m", "test_law.m")
    return {
        "design.json": as_json(content) + "\n",
        "vectors.csv": cases_as_csv(design.cases),
        **{name: filled(f"json/{name}") for name in programs},
        "README.md": filled("json/README.md", design),
    }


def _parameters(values: Any) -> Any:
    """Convert a C structure of parameters to Python dictionaries, lists and numbers."""
    if isinstance(values, ctypes.Structure):
        return {name: _parameters(getattr(values, name)) for name, *_ in values._fields_}
    if isinstance(values, ctypes.Array):
        return [_parameters(item) for item in values]
    return values


def _meanings(kind: str, before: str = "") -> Iterator[tuple[str, str]]:
    """Yield the full name and the meaning of each controller parameter."""
    for field in structures()[kind]:
        path = f"{before}{field.name}"
        if field.comment:
            yield path, field.comment
        elif field.type in structures():
            yield from _meanings(field.type, f"{path}.")
