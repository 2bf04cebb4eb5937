"""How many examples a property is tried on, and which: the same in every test run, new ones in a fuzz run.

`make test` uses the profile "fixed": examples follow from the test itself, so that no run finds what another does not.
`make fuzz` uses "random": new examples, times as many. What it finds becomes an `@example` of its test.
"""

from __future__ import annotations

from typing import Any

from hypothesis import settings

__all__ = ["examples", "register_profiles"]

_WHOLE = 100


def register_profiles(times: int) -> None:
    """Name the two profiles and choose the fixed one; `--hypothesis-profile=random` on the command line wins."""
    settings.register_profile("fixed", derandomize=True, deadline=None, database=None, max_examples=_WHOLE)
    settings.register_profile("random", deadline=None, print_blob=True, max_examples=_WHOLE * times)
    settings.load_profile("fixed")


def examples(count: int, **options: Any) -> settings:
    """Try a property on so many examples in a test run, and on proportionally more in a fuzz run."""
    return settings(max_examples=count * settings().max_examples // _WHOLE, **options)
