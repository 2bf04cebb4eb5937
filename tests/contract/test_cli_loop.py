"""`pretouch simulate` and `pretouch verify`: what they print, what they write, how they end."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from command_text import SCENARIO, command, lay_out, stand_in_for_reports, strict

import pretouch as pt
from pretouch._core.files import is_own_unchanged

pytestmark = pytest.mark.usefixtures("short_rest")

LOOP = (
    SCENARIO.replace("scale = 0.458", 'scale = "0.458 V"')
    + """\
relative_velocity = "0.12 m/s"
[chain]
rate = "500 Hz"
delay = "1 ms"
noise = "1 mV"
[controller]
rate = "1 kHz"
floor = "34.9 mV"
[robot]
kind = "impedance"
mass = "4 kg"
stiffness = "4 kN/m"
damping = "250 N*s/m"
[contact]
kind = "spring-damper"
stiffness = "100 kN/m"
obstacle_mass = "1.5 kg"
[loop]
follow_time = "50 ms"
[verify]
runs = 40
"""
)


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    lay_out(tmp_path, monkeypatch)
    Path("loop.toml").write_text(LOOP)
    stand_in_for_reports(monkeypatch)
    return command(monkeypatch, capsys)


def test_simulate_prints_the_contact_and_where_the_report_is(run):
    code, out, err = run("simulate", "loop.toml", "--verbose")
    assert (code, err) == (0, "")
    assert out.startswith("Contact on the loop at 0.0")
    for words in (
        "predicted",
        "without mitigation 0.3 m/s",
        "impact force",
        "The simulated sensor measures at 500 Hz",
        "The random seed is 0",
    ):
        assert words in out
    assert "loop-simulate.html" in out.splitlines()[-1]
    assert is_own_unchanged("loop-simulate.html")
    assert run("simulate", "loop.toml", "--verbose") == (code, out, err)


def seeded(seed: int) -> pt.ClosedLoop:
    return dataclasses.replace(pt.load_scenario("loop.toml").loop, seed=seed)


def test_simulate_as_json_is_the_run_of_the_file(run):
    code, out, err = run("simulate", "loop.toml", "--json")
    assert (code, err) == (0, "")
    told, problem = strict(out), pt.load_scenario("loop.toml")
    assert told["gain"] == pt.design(problem).gain
    assert told["loop"]["time"] == pt.simulate(problem).run.time
    assert not Path("loop-simulate.html").exists()


def test_gain_and_seed_may_be_given(run):
    first = strict(run("simulate", "loop.toml", "--json", "--gain", "-0.5 N*s", "--seed", "3")[1])
    again = pt.simulate(pt.load_scenario("loop.toml").replace(gain=-0.5, loop=seeded(3)))
    assert (first["gain"], first["setup"]["seed"]) == (-0.5, 3)
    assert first["loop"]["relative_velocity"] == again.run.relative_velocity
    assert (
        first["loop"]["time"] != strict(run("simulate", "loop.toml", "--json", "--gain", "-0.5 N*s")[1])["loop"]["time"]
    )
    Path("given.toml").write_text(LOOP.replace('rate = "1 kHz"', 'rate = "1 kHz"\ngain = "-0.4 N*s"'))
    assert strict(run("simulate", "given.toml", "--json")[1])["gain"] == -0.4


def test_a_run_without_contact_ends_with_1(run):
    Path("away.toml").write_text(LOOP.replace('velocity = "-0.3 m/s"', 'velocity = "0.3 m/s"'))
    code, out, err = run("simulate", "away.toml", "--gain", "-0.5 N*s", "--no-report")
    assert (code, err) == (1, "")
    assert "contact" in out


@pytest.mark.slow
def test_verify_prints_the_verdict_and_where_the_page_is(run):
    code, out, err = run("verify", "loop.toml", "--no-changes")
    assert (code, err) == (0, "")
    for words in ("relative velocity at contact", "40 runs (every run required)", "predicted", "without mitigation"):
        assert words in " ".join(out.split())
    assert "loop-verify.html" in out.splitlines()[-1]
    assert is_own_unchanged("loop-verify.html")
    assert run("verify", "loop.toml", "--no-changes") == (code, out, err)


@pytest.mark.slow
def test_verify_as_json_is_the_verdict_of_the_file(run):
    code, out, err = run("verify", "loop.toml", "--json", "--runs", "30", "--seed", "2")
    assert (code, err) == (0, "")
    told = strict(out)
    found = pt.verify(pt.load_scenario("loop.toml").replace(verify=pt.designs.VerifyOptions(runs=30), loop=seeded(2)))
    assert (told["runs"], told["seed"]) == (30, 2)
    assert told["status"] == found.status.value
    assert told["gain"] == found.gain
    assert [change["name"] for change in told["changes"]] == [change.name for change in found.changes] != []
    assert {limit["name"] for limit in told["limits"]} == {"excursion", "relative_velocity"}


@pytest.mark.slow
def test_a_gain_that_does_not_hold_ends_with_1(run):
    code, out, err = run("verify", "loop.toml", "--json", "--gain", "-0.3 N*s", "--no-changes")
    assert (code, err) == (1, "")
    told = strict(out)
    assert told["status"] == "does-not-hold"
    assert [limit["is_met"] for limit in told["limits"] if limit["name"] == "relative_velocity"] == [False]


def test_without_a_gain_verify_says_so_and_simulate_asks_for_one(run):
    Path("no.toml").write_text(LOOP.replace('excursion = "0.2 m"', 'excursion = "1 mm"'))
    code, out, _ = run("verify", "no.toml", "--json")
    assert (code, strict(out)["status"]) == (1, "no-gain")
    code, out, err = run("simulate", "no.toml")
    assert (code, out) == (2, "")
    assert "there is no gain to simulate, because the design is infeasible" in err


@pytest.mark.parametrize("verb", ["simulate", "verify"])
def test_mistakes_end_with_2_and_one_sentence(run, verb):
    for arguments, says in (
        (["approach.toml"], "approach.toml: found no sections [chain] and [controller], expected both"),
        (["loop.toml", "--gain", "-0.5 N"], "--gain: found "),
        (["none.toml"], "none.toml: there is no such file"),
    ):
        code, out, err = run(verb, *arguments)
        assert (code, out) == (2, "")
        assert err.startswith(f"pretouch: {says}")
        assert err.count("\n") == 1
    assert run(verb, "loop.toml", "--seed", "-1")[0] == 2
