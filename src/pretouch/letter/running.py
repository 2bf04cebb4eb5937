"""Running the script of a reproduction: the text that the report shows is the program that made the figure."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

__all__ = ["run_script", "script_text"]

_FOLDER = Path(__file__).parent / "scripts"


def script_text(name: str) -> str:
    """Return the script of a reproduction.

    Args:
        name: the id of the reproduction.

    Returns:
        Its text.
    """
    return (_FOLDER / f"{name.replace('-', '_')}.py").read_text(encoding="utf-8")


def run_script(name: str) -> tuple[str, Mapping[str, Any]]:
    """Run the script of a reproduction.

    Args:
        name: the id of the reproduction.

    Returns:
        Its text, and the variables that it leaves: `figure` and what the figure shows.
    """
    text = script_text(name)
    variables: dict[str, Any] = {"__name__": f"pretouch.letter.scripts.{name.replace('-', '_')}"}
    exec(compile(text, f"{name}.py", "exec"), variables)  # noqa: S102 - our own file, shown beside what it makes
    return text, variables
