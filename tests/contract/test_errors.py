"""The error tree is the one that is drawn, and all of it is exported."""

from __future__ import annotations

import inspect
import re

import pytest

import pretouch as pt
from pretouch._core import errors


def _drawn() -> dict[str, str]:
    """Read the drawing at the head of errors.py: the parent of each class, "Exception" for the root."""
    drawn, path = {}, ["Exception"]
    for line in (pt.errors.__doc__ or "").splitlines():
        match = re.match(r"    ((?:│   |    )*)(├── |└── )?(\w+Error)\b", line)
        if match:
            depth = len(match[1]) // 4 + bool(match[2])
            path[depth + 1 :] = [match[3]]
            drawn[match[3]] = path[depth]
    return drawn


def _actual() -> dict[str, str]:
    """The first base of each error class of pretouch, wherever it is defined in errors.py."""
    classes = [c for c in vars(errors).values() if inspect.isclass(c) and issubclass(c, BaseException)]
    return {c.__name__: c.__bases__[0].__name__ for c in classes}


def test_the_drawn_tree_is_the_actual_tree() -> None:
    assert _drawn() == _actual()
    assert _drawn()["PretouchError"] == "Exception"
    assert _drawn()["UnitError"] == "InvalidInputError"


def test_every_error_is_there_for_the_user() -> None:
    assert all(getattr(pt.errors, name) is getattr(errors, name) for name in _actual())


@pytest.mark.parametrize("name", sorted(_actual()))
def test_every_error_says_what_it_is_for_and_is_caught_by_the_root(name: str) -> None:
    error = getattr(errors, name)
    assert issubclass(error, errors.PretouchError)
    assert error.__doc__
    assert (pt.errors.__doc__ or "").count(f"{name} ") + (pt.errors.__doc__ or "").count(f"{name}\n") == 1


def test_what_is_drawn_as_also_another_error_is_one() -> None:
    also = re.findall(r"(\w+Error) \(also an? (\w+)\)", pt.errors.__doc__ or "")
    assert also == [("InvalidInputError", "ValueError"), ("OutputError", "OSError"), ("BrokenCoreError", "ImportError")]
    assert issubclass(errors.BrokenCoreError, ImportError)
    assert issubclass(errors.InvalidInputError, ValueError)
    assert not issubclass(errors.ResultUnavailableError, ValueError)
