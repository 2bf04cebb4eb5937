"""[[disturbance]]: what the simulated loop takes from a scenario file, and what is refused with its line."""

from __future__ import annotations

import pytest

import pretouch as pt
from loop_text import LOOPED
from pretouch.config import load_scenario
from pretouch.simulation import Disturbance, SensorChain
from refusals import refused
from scenario_text import refusal, writer


@pytest.fixture
def write(tmp_path, monkeypatch):
    return writer(tmp_path, monkeypatch)


def table(*lines: str) -> str:
    return "[[disturbance]]\n" + "".join(f"{line}\n" for line in lines)


CABLE = table('kind = "cable"', 'distance = "20 mm"')
BRIGHT = table('kind = "reflectance"', 'time = "40 ms"', "factor = 2.0", 'duration = "50 ms"')


def test_the_loop_has_the_disturbances_of_the_file(write) -> None:
    chain = load_scenario(write(LOOPED + CABLE + BRIGHT)).loop.chain
    assert chain.disturbances == (
        Disturbance(kind="cable", distance=0.02),
        Disturbance(kind="reflectance", time=0.04, factor=2.0, duration=0.05),
    )
    assert load_scenario(write(LOOPED)).loop.chain.disturbances == ()
    assert [text for name, text in chain.rows() if name == "disturbance"] == [one.text for one in chain.disturbances]


@pytest.mark.parametrize(
    ("text", "line", "key", "says"),
    [
        (table('kind = "cabel"', "time = 0"), 1, "disturbance[0].kind", 'did you mean "cable"?'),
        (table("time = 0"), 0, "disturbance[0].kind", 'missing; add, for example: kind = "cable"'),
        (table('kind = "cable"'), 0, "disturbance[0].time", "found neither time nor distance"),
        (
            CABLE + table('kind = "stuck"', "time = 0", "distance = 1"),
            5,
            "disturbance[1].time",
            "both time and distance",
        ),
        (table('kind = "reflectance"', "time = 0"), 0, "disturbance[0].factor", "found no factor"),
        (table('kind = "stuck"', "time = 0", "factor = 2"), 3, "disturbance[0].factor", "found the factor 2"),
        (table('kind = "cable"', 'time = "1 m"'), 2, "disturbance[0].time", "expected a quantity in s"),
        (table('kind = "cable"', "time = 0", "until = 1"), 3, "disturbance[0].until", "found an unknown key"),
        ('[disturbance]\nkind = "cable"\n', 0, "disturbance", "expected one or more of [[disturbance]]"),
    ],
)
def test_a_mistake_is_named_with_line_and_key(write, text: str, line: int, key: str, says: str) -> None:
    told = refusal(write(LOOPED + text))
    assert told.startswith(f"approach.toml, line {LOOPED.count(chr(10)) + 1 + line}: {key}: "), told
    assert says in told


def test_a_disturbance_that_the_sensor_cannot_have_is_refused(write) -> None:
    endless = LOOPED.replace('noise = "20 counts"', 'noise = "20 counts"\nhighest = "inf"')
    assert "highest" in refusal(write(endless + table('kind = "full-scale"', "time = 0")))
    with refused("disturbances", limit=8):
        SensorChain(rate=100.0, disturbances=[Disturbance(kind="cable", time=0.0)] * 9)
    bright = Disturbance(kind="reflectance", time=0.0, factor=2.0)
    with refused("disturbances"):
        SensorChain(rate=100.0, measures_distance=True, disturbances=[bright])
    with refused("disturbances", value="cable"):
        SensorChain(rate=100.0, disturbances="cable")


def test_a_file_with_disturbances_alone_asks_for_the_loop(write) -> None:
    assert "the section [disturbance] also needs the section [chain]" in refusal(
        write(LOOPED.split("[chain]")[0] + CABLE)
    )


def test_simulate_runs_the_disturbance(write) -> None:
    plain, broken = (pt.simulate(load_scenario(write(LOOPED + more)).replace(gain=-0.7)).run for more in ("", CABLE))
    before, after = plain.trace(), broken.trace()
    at = int((after.distance <= 0.02).argmax())
    assert (before.reading[:at] == after.reading[:at]).all()
    assert (after.reading[at + 12 :] == 0.0).all()
    assert (before.reading[at + 12 :] > 0.0).all()
