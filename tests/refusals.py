"""What an error refuses, by its class and fields, so that tests need not know its sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from pretouch._core.errors import InvalidInputError, PretouchError


@contextmanager
def refused(
    argument: str | None = None, *, error: type[PretouchError] = InvalidInputError, **fields: Any
) -> Iterator[pytest.ExceptionInfo[PretouchError]]:
    """Expect an error about an argument, an option, a key or a file, with the given fields: value, limit, remedy.

    The sentences of errors are in tests/contract/snapshots; a test asserts one only if its wording is the point.
    """
    with pytest.raises(error) as caught:
        yield caught
    if argument is not None:
        assert caught.value.argument == argument
    for name, expected in fields.items():
        assert getattr(caught.value, name) == _nearly(expected), name


def _nearly(expected: Any) -> Any:
    """Return a number or a pair of numbers that compares as equal up to the rounding of what tests write down."""
    numbers = expected if isinstance(expected, tuple) else (expected,)
    exact = not numbers or any(isinstance(each, bool) or not isinstance(each, int | float) for each in numbers)
    return expected if exact else pytest.approx(expected, rel=1e-5, nan_ok=True)
