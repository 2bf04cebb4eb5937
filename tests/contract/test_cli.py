"""The command line: what it prints, what it writes, how it ends."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_text import SCENARIO, command, lay_out, stand_in_for_reports, strict

from pretouch._core.files import as_json, is_own_unchanged, plain
from pretouch.cli import main
from pretouch.cli.app import app


@pytest.fixture
def folder(tmp_path, monkeypatch):
    return lay_out(tmp_path, monkeypatch)


@pytest.fixture
def run(folder, monkeypatch, capsys):
    return command(monkeypatch, capsys)


@pytest.fixture
def pages(monkeypatch):
    stand_in_for_reports(monkeypatch)


# --- help and version


def test_help_names_every_verb_and_option(run):
    code, out, err = run("--help")
    assert (code, err) == (0, "")
    common = ["--json", "--output", "--no-report", "--force", "Exit status: 0", "2 a mistake"]
    own = {
        "record": ["FILE", "--port", "--topic", "--i2c", "--stdin", "--distances", "--stage", "--resume", "1 more"],
        "fit": [
            "FILE",
            "--offset",
            "--no-object",
            "--columns",
            "--labels",
            "--select",
            "--saturation",
            "--near-field-peak",
            "--model",
            "--floor-sigmas",
            "1 no",
        ],
        "design": ["FILE", "1 no"],
        "pareto": ["FILE", "1 no"],
        "robust": ["FILE", "--samples", "--seed", "1 no"],
        "simulate": ["FILE", "--gain", "--seed", "1 it did not"],
        "verify": ["FILE", "--gain", "--runs", "--seed", "--no-changes", "1 it does not"],
        "export": ["TARGET", "FILE", "--gain", "--unverified", "1 the gain does not hold"],
        "replay": ["FILE", "BAG", "--topic", "--truth", "--clock", "--mcap", "1 almost no reading could be used"],
        "reproduce": ["[ID]...", "table-2", "impact-force", "1 some differences"],
    }
    assert all(verb in out for verb in own)
    for verb, options in own.items():
        code, out, err = run(verb, "--help")
        assert (code, err) == (0, "")
        told = " ".join(out.split())  # lines break where they may
        absent = {"export": {"--no-report"}, "record": {"--no-report", "--output", "--force"}}.get(verb, set())
        shared = [option for option in common if option not in absent]
        assert [option for option in [*shared, *options] if option not in told] == []


def test_the_version_is_that_of_the_package(run):
    from importlib.metadata import version

    assert run("--version") == (0, f"pretouch {version('pretouch')}\n", "")


def test_as_a_module_it_is_the_same_command():
    done = subprocess.run([sys.executable, "-m", "pretouch", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("pretouch ")


def test_help_loads_nothing_heavy():
    code = "import sys, pretouch.cli; print([m for m in ('scipy', 'matplotlib') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("arguments", [["fly"], ["design"], ["design", "a", "b"], ["design", "--jsn", "a"]])
def test_a_mistake_on_the_command_line_ends_with_2(run, arguments):
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert "Usage: pretouch" in err


# --- design


def test_design_prints_the_gain_and_where_the_report_is(run, pages):
    code, out, err = run("design", "approach.toml")
    assert (code, err) == (0, "")
    assert "-0.808" in out
    assert "approach-design.html" in out.splitlines()[-1]
    assert is_own_unchanged("approach-design.html")


def test_design_as_json_is_one_object_and_writes_nothing(run, folder):
    before = sorted(p.name for p in folder.iterdir())
    code, out, err = run("design", "approach.toml", "--json")
    assert (code, err) == (0, "")
    told = strict(out)
    assert told["status"] == "optimal"
    assert round(told["gain"], 4) == -0.8081
    assert {"method", "objective", "contact", "no_mitigation", "constraints", "warnings"} <= set(told)
    for encounter in ("contact", "no_mitigation"):
        assert {"time", "position", "relative_velocity"} <= set(told[encounter])
    assert sorted(p.name for p in folder.iterdir()) == before


@pytest.mark.parametrize(
    ("old", "new", "status"),
    [('excursion = "0.2 m"', 'excursion = "1 um"', "infeasible"), ('"-0.3 m/s"', '"0.3 m/s"', "no-contact")],
)
def test_a_design_whose_answer_is_no_ends_with_1_and_its_object(run, old, new, status):
    Path("no.toml").write_text(SCENARIO.replace(old, new))
    code, out, err = run("design", "no.toml", "--json")
    assert (code, err) == (1, "")
    assert strict(out)["status"] == status
    code, out, _ = run("design", "no.toml", "--no-report")
    assert code == 1
    assert out.strip()


def test_a_mistake_in_the_file_ends_with_2_and_a_message_on_stderr(run):
    Path("wrong.toml").write_text(SCENARIO.replace("10 N*s/m", "10 N/m").replace("1 kg", "1 s"))
    expected = [
        'wrong.toml, line 6: admittance.mass: found "1 s", expected a quantity in kg',
        'wrong.toml, line 7: admittance.damping: found "10 N/m", expected a quantity in N*s/m',
    ]
    code, out, err = run("design", "wrong.toml")
    assert (code, out) == (2, "")
    assert err == "".join(f"pretouch: {line}\n" for line in expected)
    code, out, err = run("design", "wrong.toml", "--json")
    assert code == 2
    assert strict(out) == {"status": "error", "message": "\n".join(expected)}
    assert err.count("pretouch: ") == 2


def test_what_only_the_design_finds_out_ends_with_2_too(run):
    curved = SCENARIO.replace("exponential-1", "exponential-2").replace("[adm", 'curvature = "474 1/m^2"\n[adm', 1)
    Path("wrong.toml").write_text(curved + '[motion]\nmethod = "closed-form"\n')
    code, out, err = run("design", "wrong.toml")
    assert (code, out) == (2, "")
    assert err.startswith("pretouch: wrong.toml, line 22: motion.method: ")


def test_an_unexpected_error_keeps_its_traceback(folder, monkeypatch):
    def fail(path):
        raise RuntimeError("a bug")

    monkeypatch.setattr("pretouch.config.load_scenario", fail)
    monkeypatch.setattr(sys, "argv", ["pretouch", "design", "approach.toml"])
    with pytest.raises(RuntimeError, match="a bug"):
        main()


def test_an_interrupt_ends_with_130_and_no_traceback(run, monkeypatch):
    def interrupt(path):
        raise KeyboardInterrupt

    monkeypatch.setattr("pretouch.config.load_scenario", interrupt)
    assert run("design", "approach.toml") == (130, "", "")


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals and pipes")
def test_a_reader_that_leaves_is_no_error(folder):
    command = [sys.executable, "-m", "pretouch", "design", "approach.toml", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        told = process.stderr.read()
        assert (process.wait(), told) == (141, b"")


WAITING = """
import sys, time
import pretouch.config
from pretouch.cli import main

def wait(*_, **__):
    print("reading", flush=True)
    time.sleep(600)

pretouch.config.load_scenario = wait
sys.argv = ["pretouch", "design", "approach.toml"]
main()
"""


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals and pipes")
def test_ctrl_c_ends_with_130_and_no_traceback(folder):
    # what a shell runs in the background ignores the signal, and so would what is started here
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    command = [sys.executable, "-c", WAITING]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        signal.signal(signal.SIGINT, before)
        assert process.stdout.readline() == b"reading\n"
        process.send_signal(signal.SIGINT)
        told = process.stderr.read()
        assert (process.wait(), told) == (130, b"")


@pytest.mark.slow
@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-8"])
def test_a_terminal_that_cannot_show_every_character_is_no_error(folder, encoding):
    environment = {**os.environ, "PYTHONIOENCODING": encoding}
    for options in (["--json"], ["--no-report"]):
        command = [sys.executable, "-m", "pretouch", "design", "approach.toml", *options]
        done = subprocess.run(command, capture_output=True, check=True, env=environment)
        assert b"0.808" in done.stdout
        assert done.stderr == b""


# --- where reports go


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(("verb", "file"), [("design", "approach.toml"), ("fit", "sensor.csv")])
def test_a_report_is_written_again_but_nothing_of_the_user_is_overwritten(run, pages, verb, file):
    report = Path(f"{Path(file).stem}-{verb}.html")
    assert run(verb, file)[0] == 0
    assert run(verb, file)[0] == 0

    report.write_text(report.read_text().replace("<body>", "<body>my notes "))
    edited = report.read_text()
    code, _, err = run(verb, file)
    assert code == 2
    assert err.startswith(f"pretouch: {report}: this file already exists, and pretouch does not overwrite it")
    assert "--output" in err
    assert "--force" in err
    assert report.read_text() == edited

    assert run(verb, file, "--output", "other.html")[0] == 0
    assert is_own_unchanged("other.html")
    assert run(verb, file, "--force")[0] == 0
    assert is_own_unchanged(report)


def test_with_json_a_report_is_written_only_where_it_is_asked_for(run, pages, folder):
    Path("mine.html").write_text("mine")
    code, out, _ = run("design", "approach.toml", "--json", "--output", "mine.html")
    assert code == 2
    assert strict(out)["status"] == "error"
    assert Path("mine.html").read_text() == "mine"
    code, out, _ = run("design", "approach.toml", "--json", "--output", "new.html")
    assert code == 0
    assert strict(out)["status"] == "optimal"
    assert is_own_unchanged("new.html")
    assert not Path("approach-design.html").exists()


def test_without_a_report_nothing_is_written(run, folder):
    before = sorted(p.name for p in folder.iterdir())
    assert run("design", "approach.toml", "--no-report")[0] == 0
    assert run("fit", "sensor.csv", "--no-report")[0] == 0
    assert sorted(p.name for p in folder.iterdir()) == before


# --- JSON


def test_everything_a_result_may_hold_becomes_json():
    held = {
        "array": np.array([1.0, np.nan]),
        "scalar": np.float64(2.0),
        "count": np.int64(3),
        "truth": np.bool_(True),
        "nothing": None,
        "path": Path("a"),
        "tuple": (1, "ξ"),
        "infinite": -np.inf,
    }
    assert plain(held) == {
        "array": [1.0, None],
        "scalar": 2.0,
        "count": 3,
        "truth": True,
        "nothing": None,
        "path": "a",
        "tuple": [1, "ξ"],
        "infinite": None,
    }
    assert as_json(held).isascii()
    assert strict(as_json(held, indent=None)) == strict(as_json(held)) == plain(held)


def test_the_reference_names_the_options_that_there_are(run):
    text = (Path(__file__).parents[2] / "docs" / "reference/cli.md").read_text(encoding="utf-8")
    documented = set(re.findall(r"--[a-z][a-z-]+", text)) - {"--help", "--version", "--install-completion"}
    helps = [run(command.callback.__name__, "--help")[1] for command in app.registered_commands]
    offered = {option for text in helps for option in re.findall(r"--[a-z][a-z-]+", text)}
    assert documented == offered - {"--help", "--report", "--changes", "--empty-scene"}  # defaults, spelled out
