"""`pretouch robust`: what it prints, what it writes, how it ends."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from command_text import SCENARIO, command, lay_out, stand_in_for_reports, strict

from page_rows import line
from pretouch._core.files import is_own_unchanged

UNCERTAIN = (
    SCENARIO
    + """\
[uncertainty]
obstacle.velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }
[robust]
samples = 128
validation = 64
required = { excursion = 0.9 }
"""
)


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    lay_out(tmp_path, monkeypatch)
    Path("unsure.toml").write_text(UNCERTAIN)
    stand_in_for_reports(monkeypatch)
    return command(monkeypatch, capsys)


def test_the_next_step_names_the_robust_gain_because_verify_would_take_another(run):
    out = " ".join(run("robust", "unsure.toml", "--no-report")[1].split())
    gain = re.search(r"Robust gain D_p = (-[\d.]+ N s)", out)
    assert gain is not None
    assert f'run pretouch verify with --gain "{gain[1]}" to check the gain' in out


def test_it_prints_the_gain_and_where_the_report_is(run):
    code, out, err = run("robust", "unsure.toml", "--verbose")
    assert (code, err) == (0, "")
    assert out.startswith("Robust gain D_p = -0.8")
    assert line(out, "obstacle.velocity") == "uniform, -0.4 m/s to -0.2 m/s"
    assert line(out, "on 64 fresh samples") == "(95 % confidence) robust gain nominal gain no mitigation"
    assert line(out, "largest excursion").startswith("200 mm 90 % 100 % 95.42 % ")  # 0.05^(1/64): all of 64
    assert line(out, "seed") == "0"
    assert "unsure-robust.html" in out.splitlines()[-1]
    assert is_own_unchanged("unsure-robust.html")
    assert run("robust", "unsure.toml", "--verbose") == (code, out, err)


def test_as_json_it_is_one_object_and_writes_nothing(run):
    code, out, err = run("robust", "unsure.toml", "--json")
    assert (code, err) == (0, "")
    told = strict(out)
    assert told["status"] == "optimal"
    assert told["measure"] == {"kind": "Expected", "label": "expected value"}
    assert told["validation"]["low"] < told["validation"]["value"] < told["validation"]["high"]
    (limit,) = told["validation"]["constraints"]
    assert (limit["name"], limit["probability"], limit["held"]) == ("excursion", 0.9, 1.0)
    assert 0.9 < limit["held_at_least"] < 1
    assert {"nominal_gain", "value", "worst", "local_minima", "samples", "seed", "uncertainty"} <= set(told)
    assert not Path("unsure-robust.html").exists()


def test_samples_and_seed_may_be_given_on_the_command_line(run):
    told = strict(run("robust", "unsure.toml", "--json", "--samples", "32", "--seed", "5")[1])
    assert (told["samples"], told["seed"], told["validation"]["samples"]) == (32, 5, 32)
    for wrong in (["--samples", "1"], ["--seed", "-1"]):
        assert run("robust", "unsure.toml", *wrong)[0] == 2


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({'excursion = "0.2 m"': 'excursion = "1 um"'}, "infeasible"),
        ({'"-0.4 m/s", "-0.2 m/s"': '"0.2 m/s", "0.4 m/s"', '"-0.3 m/s"': '"0.3 m/s"'}, "no-contact"),
    ],
)
def test_an_answer_that_is_no_ends_with_1_and_its_object(run, changes, status):
    text = UNCERTAIN
    for old, new in changes.items():
        text = text.replace(old, new)
    Path("no.toml").write_text(text)
    code, out, err = run("robust", "no.toml", "--json")
    assert (code, err) == (1, "")
    assert strict(out)["status"] == status
    code, out, _ = run("robust", "no.toml")
    assert code == 1
    assert is_own_unchanged("no-robust.html")


@pytest.mark.parametrize(
    ("file", "says"),
    [
        ("approach.toml", "approach.toml: uncertainty: found none, expected distributions of inputs"),
        ("wrong.toml", "wrong.toml, line 21: uncertainty.obstacle.velocity.uniform[0]: found "),
        (
            "fast.toml",
            "fast.toml, line 21: uncertainty.obstacle.velocity: the nominal value of obstacle.velocity is -1.5 m/s, "
            "but its distribution covers -0.4 m/s to -0.2 m/s",
        ),
        ("wide.toml", "wide.toml, line 20: uncertainty: mass: found -"),
    ],
)
def test_a_mistake_ends_with_2_and_its_line(run, file, says):
    Path("wrong.toml").write_text(UNCERTAIN.replace('"-0.4 m/s"', '"-0.4 m"'))
    Path("fast.toml").write_text(UNCERTAIN.replace('velocity = "-0.3 m/s"', 'velocity = "-1.5 m/s"'))
    Path("wide.toml").write_text(UNCERTAIN.replace("obstacle.velocity = {", "admittance.mass = { normal = [1, 1] } #"))
    code, out, err = run("robust", file)
    assert (code, out) == (2, "")
    assert err.startswith(f"pretouch: {says}")
    assert err.count("\n") == 1


def test_design_goes_on_for_the_given_values(run):
    plain, unsure = (strict(run("design", name, "--json")[1])["gain"] for name in ("approach.toml", "unsure.toml"))
    assert plain == unsure
