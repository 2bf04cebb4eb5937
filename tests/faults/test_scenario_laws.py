"""Whatever a scenario file holds: it is read, or refused with a line, and nothing else happens."""

from __future__ import annotations

import math
import tomllib

import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from pretouch._core.errors import ScenarioFileError
from pretouch.config import load_scenario
from pretouch.config.key_lines import key_lines
from pretouch.config.quantities import Quantity
from properties import examples
from scenario_text import WHOLE


@pytest.mark.parametrize("value", ["1e999 m", "((((m", "1 m^9999999", "1" * 400, "1 nm^-40", "\0", "1 m\n", "inf", "%"])
def test_a_quantity_is_read_or_refused_and_nothing_else(value):
    try:
        number = Quantity("m")(value)
    except ValueError:
        return
    assert math.isfinite(number)


KEY = st.sampled_from(["a", "b-1", '"c d"', "'e.f'", '"g\\"h"', '"\\u00e9"', "4"])
SCALAR = st.sampled_from(
    ["1", "-2.5e3", "true", '"x # ]"', "'}'", '"""\na = 1\n\\""""', "'''\n[b]\n'''", "2020-01-01 10:00:00", "inf"]
)
VALUE = st.recursive(
    SCALAR,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3).map(lambda v: "[" + ", ".join(v) + "]"),
        st.lists(inner, min_size=1, max_size=3).map(lambda v: "[ # c ]\n  " + ",\n  ".join(v) + ",\n]"),
        st.lists(st.tuples(KEY, inner), max_size=3).map(lambda p: "{ " + ", ".join(f"{k} = {v}" for k, v in p) + " }"),
    ),
    max_leaves=5,
)
STATEMENT = st.one_of(
    st.tuples(st.lists(KEY, min_size=1, max_size=3), VALUE).map(lambda p: f"{' . '.join(p[0])} = {p[1]} # k = 1"),
    st.lists(KEY, min_size=1, max_size=3).map(lambda k: f"[ {'.'.join(k)} ]"),
    st.lists(KEY, min_size=1, max_size=2).map(lambda k: f"[[{'.'.join(k)}]] # ]"),
    st.just("# [x]"),
)


def paths_of(value, path=()):
    if path:
        yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield from paths_of(inner, (*path, key))


@examples(150)
@given(st.lists(STATEMENT, max_size=8).map("\n".join))
def test_the_scan_finds_every_key_of_any_toml(text):
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return
    lines = key_lines(text)
    assert set(lines) == set(paths_of(data))
    assert all(1 <= line <= text.count("\n") + 1 for line in lines.values())


MORE = """\
[impact]
robot_mass = "4 kg"
stiffness = "10 kN/m"
[motion]
method = "auto"
[uncertainty]
obstacle.velocity = { normal = [-0.3, 0.1], between = [-0.6, -0.05] }
sensor.exponent = { uniform = [3.0, 3.5] }
admittance.mass = { samples = ["1 kg", "2 kg"] }
[robust]
measure = "quantile"
probability = 0.9
samples = 100
required = { excursion = 0.9 }
"""
LINES = (WHOLE + MORE).splitlines()
ODD = st.one_of(
    st.sampled_from(
        ['"1 kg"', '"5 Hz"', "nan", "-inf", "[]", "{}", "true", '""', '"inf m"', "1e308", "-1", '"obstacle speed"', "0"]
    ),
    st.text(max_size=12).map(lambda t: '"' + t.replace("\\", "").replace('"', "") + '"'),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
)
MUTATION = st.one_of(
    st.tuples(st.just("drop"), st.integers(0, len(LINES) - 1), st.just("")),
    st.tuples(st.just("value"), st.integers(0, len(LINES) - 1), ODD),
    st.tuples(
        st.just("key"), st.integers(0, len(LINES) - 1), st.sampled_from(["mas", "kind", "rate", "recess", "x y"])
    ),
    st.tuples(st.just("swap"), st.integers(0, len(LINES) - 1), st.integers(0, len(LINES) - 1)),
    st.tuples(st.just("cut"), st.integers(0, len(LINES) - 1), st.integers(0, 20)),
)


def mutated(mutations):
    lines = list(LINES)
    for kind, at, what in mutations:
        key, equals, value = lines[at].partition(" = ")
        if kind == "drop":
            lines[at] = ""
        elif kind == "value" and equals:
            lines[at] = f"{key} = {what}"
        elif kind == "key" and equals:
            lines[at] = f"{what} = {value}"
        elif kind == "swap" and equals and " = " in lines[what]:
            other = lines[what].partition(" = ")
            lines[at], lines[what] = f"{key} = {other[2]}", f"{other[0]} = {value}"
        elif kind == "cut":
            lines[at] = lines[at][:what]
    return "\n".join(lines)


@pytest.mark.slow
@examples(200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(MUTATION, min_size=1, max_size=4).map(mutated))
def test_a_damaged_file_is_read_or_refused_with_a_line_and_nothing_else(tmp_path, text):
    file = tmp_path / "damaged.toml"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        problem = load_scenario(file)
    except ScenarioFileError as refused:
        for told in str(refused).split("\n"):
            assert told.isprintable()
            assert told.startswith(f"{file}, line ")
            line = int(told.removeprefix(f"{file}, line ").split(":")[0])
            assert 1 <= line <= text.count("\n") + 1
        return
    assert problem.scenario.distance > 0
    assert problem.bounds[0] < problem.bounds[1]
