"""Set the precision of mpmath above that of floats for all tests of this folder."""

from __future__ import annotations

from collections.abc import Iterator

import mpmath
import pytest
from printed_letter import DIGITS


@pytest.fixture(scope="module", autouse=True)
def _extended_precision() -> Iterator[None]:
    with mpmath.workdps(DIGITS):
        yield
