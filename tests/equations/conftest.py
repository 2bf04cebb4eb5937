"""All arithmetic of mpmath in these tests has more digits than a float, also where a test asks for none."""

from __future__ import annotations

from collections.abc import Iterator

import mpmath
import pytest
from printed_letter import DIGITS


@pytest.fixture(scope="module", autouse=True)
def _extended_precision() -> Iterator[None]:
    with mpmath.workdps(DIGITS):
        yield
