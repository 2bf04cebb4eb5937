"""Fields of tasks for robust designs, with their options written next to the other fields."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from pretouch.designs import RobustOptions

_NAMES = {f.name for f in fields(RobustOptions)}


def with_robust_options(**mixed: Any) -> dict[str, Any]:
    """Collect those fields that are robust options in the field `robust`."""
    options = {name: value for name, value in mixed.items() if name in _NAMES}
    others = {name: value for name, value in mixed.items() if name not in _NAMES}
    return {**others, "robust": RobustOptions(**options)}
