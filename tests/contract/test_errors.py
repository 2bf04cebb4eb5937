"""The error tree is the one that is drawn, and all of it is exported."""

from __future__ import annotations

import inspect
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import pretouch as pt
from pretouch._core import errors
from refusals import refused


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


def test_an_error_has_argument_value_and_limit() -> None:
    with refused("mass", value=-1.0, limit=(0.0, np.inf)):
        pt.Admittance(mass=-1.0, damping=10.0, stiffness=25.0)
    with refused("name", value="VCNL4000") as caught:
        pt.simulation.sensor_part("VCNL4000")
    assert "VCNL4010" in caught.value.limit
    with refused("mass", error=pt.errors.InvalidInputError, value="1 kg", limit=None):
        pt.Admittance(mass="1 kg", damping=10.0, stiffness=25.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", sorted(_actual()))
def test_the_fields_of_an_error_survive_pickle(name: str) -> None:
    error = getattr(errors, name)("sweep.nc: exists", value=(1, "a"), limit=(0.0, 1.0), remedy="--force")
    copy = pickle.loads(pickle.dumps(error))  # noqa: S301
    assert (str(copy), copy.argument, copy.fields) == ("sweep.nc: exists", "sweep.nc", error.fields)
    unsendable = getattr(errors, name)("law: wrong", value=lambda: 0)
    assert pickle.loads(pickle.dumps(unsendable)).value is None  # noqa: S301


def test_an_error_of_a_scenario_file_has_all_mistakes(tmp_path: Path) -> None:
    file = tmp_path / "approach.toml"
    text = (Path(__file__).parents[2] / "examples/approach.toml").read_text(encoding="utf-8")
    file.write_text(text.replace('"1 kg"', '"-1 kg"').replace('"0.2 m"', '"2 s"'), encoding="utf-8")
    with refused("admittance.mass", error=pt.errors.ScenarioFileError, value="-1 kg") as caught:
        pt.load_scenario(file)
    assert [(m.line, m.key) for m in caught.value.mistakes] == [(10, "admittance.mass"), (27, "constraints.excursion")]
