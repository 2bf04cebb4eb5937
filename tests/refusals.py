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
    """Expect an error about an argument, an option, a key or a file, with the given fields: value, limit, remedy."""
    with pytest.raises(error) as caught:
        yield caught
    if argument is not None:
        assert caught.value.argument == argument
    for name, expected in fields.items():
        assert getattr(caught.value, name) == expected, name
