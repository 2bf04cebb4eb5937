"""Provide complete Python scripts that draw the figures of the published letter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from typing import Any

from pretouch._core.values import Value


@dataclass(frozen=True, slots=True)
class Program(Value):
    """A short, complete Python script that uses pretouch and draws a figure.

    Args:
        about: the docstring of the script.
        inputs: inputs of the letter by their variable names. The script contains the calls that create them; the call
            of a later input may use the variable of an earlier one.
        body: the rest of the script; it assigns `figure` and the values that the figure shows.
        imports: import lines in addition to pretouch and, if it is used, NumPy.
    """

    about: str
    inputs: Mapping[str, Any]
    body: str
    imports: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The whole script as text."""
        lines = [f'"""{self.about}"""', ""]
        third_party = [*(["import numpy as np"] if "np." in self.body else []), *self.imports]
        lines += [*third_party, *([""] if third_party else []), "import pretouch as pt", ""]
        names: dict[str, Any] = {}
        for name, value in self.inputs.items():
            lines.append(f"{name} = {_as_code(value, names)}")
            names[name] = value
        return "\n".join([*lines, self.body])

    def run(self, name: str = "program") -> dict[str, Any]:
        """Run the script and return its variables."""
        variables: dict[str, Any] = {"__name__": name}
        exec(compile(self.text, name, "exec"), variables)  # noqa: S102 - the text is part of pretouch, and the report shows it
        return variables


def _as_code(value: Any, names: Mapping[str, Any]) -> str:
    """Return Python code that creates a given value, with default arguments omitted."""
    for name, earlier in names.items():
        if value == earlier:
            return name
    if not is_dataclass(value):
        return repr(value)
    arguments = ((f.name, getattr(value, f.name), _default(f)) for f in fields(value) if f.init)
    text = ", ".join(f"{name}={_as_code(item, names)}" for name, item, default in arguments if item != default)
    return f"pt.{type(value).__name__}({text})"


def _default(of: Field[Any]) -> Any:
    return of.default if of.default_factory is MISSING else of.default_factory()
