"""Libraries of optional extras, loaded where they are used and nowhere else."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from pretouch._core.errors import MissingExtraError

__all__ = ["require"]


def require(module: str, *, extra: str = "sweep") -> Any:
    """Load a library of an optional extra.

    Args:
        module: its name.
        extra: the extra of pretouch that installs it.

    Returns:
        The module.

    Raises:
        MissingExtraError: it is not installed.
        ModuleNotFoundError: it is, but something that it needs is not.

    Examples:
        >>> require("json").__name__
        'json'
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != module.partition(".")[0]:
            raise  # its own message says more
        name = module.partition(".")[0]
        raise MissingExtraError(
            f"{name}: found no such library, which this call needs; install it with: pip install 'pretouch[{extra}]'"
        ) from None
