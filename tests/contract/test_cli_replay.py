"""`pretouch replay` and `--mcap`: what they print and write, what they refuse, and the page that shows them."""

from __future__ import annotations

import doctest
import json
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_text import in_this_process as run

import pretouch as pt
from pretouch.errors import OutputExistsError
from pretouch.recording import read_recording, replay
from pretouch.recording.mcap_output import Series, series_of_replay, series_of_trace, write_mcap
from pretouch.recording.reading import read_recordings
from pretouch.verification import simulate

ROOT = Path(__file__).parents[2]
LOOP, TABLE = ROOT / "examples/loop.toml", ROOT / "examples/approaches.csv"
PAGE = (ROOT / "docs/how-to/what-did-my-sensor-see.md").read_text(encoding="utf-8")
GAIN = ["--gain", "-0.86 N*s"]


def test_a_table_is_replayed_as_json(tmp_path: Path) -> None:
    words = ["replay", str(LOOP), str(TABLE), "--topic", "reading", "--truth", "contact", *GAIN, "--json"]
    answer = run(*words, folder=tmp_path)
    assert answer.returncode == 1, answer.stderr
    told = json.loads(answer.stdout)
    assert told["status"] == "contradicted"
    assert (told["false_triggers"], told["missed"], told["clock"]) == (1, 0, "column")
    assert told["timing"]["rate"] == pytest.approx(217, rel=1e-3)
    assert told["noise"]["noise"] == pytest.approx(27, rel=0.06)
    assert [d["judgment"] for d in told["detections"]] == ["right", "right", "false", "right"]
    assert not list(tmp_path.iterdir())


CHECKED = ["replay", str(LOOP), str(ROOT / "examples/month-later.csv"), "--topic", "output", *GAIN]
BY_TIME = ["--distances", "0-2 s: none, 2.4-4.39 s: 2 mm, 7.2-9.19 s: 40 mm"]


def test_a_calibration_is_checked(tmp_path: Path) -> None:
    answer = run(*CHECKED, "--recheck", "--reference", "distance", "--elapsed", "30 d", "--json", folder=tmp_path)
    assert answer.returncode == 0, answer.stderr
    told = json.loads(answer.stdout)
    assert told["status"] == "fine"
    assert told["offset"] == pytest.approx(171, abs=5)
    assert told["interval"] == pytest.approx(30 * 86400)
    assert run(*CHECKED, "--elapsed", "30 d", folder=tmp_path).returncode == 2


@pytest.mark.slow
def test_known_distances_are_named_by_time_or_by_a_column(tmp_path: Path) -> None:
    words = [*CHECKED, "--recheck", "--json"]
    column = json.loads(run(*words, "--reference", "distance", folder=tmp_path).stdout)
    for part in ([], ["--from", "1 s"]):  # times count from the first reading of the file
        held = json.loads(run(*words, *BY_TIME, *part, folder=tmp_path).stdout)
        assert held["slope"] == pytest.approx(column["slope"], rel=0.02)
    unknown = run(*words, folder=tmp_path)
    assert (unknown.returncode, json.loads(unknown.stdout)["status"]) == (1, "not-decided")
    assert run(*words, *BY_TIME, "--reference", "distance", folder=tmp_path).returncode == 2


def test_true_contacts_by_time_and_a_part(tmp_path: Path) -> None:
    options = ["--contacts", "2.65 s, 6010 ms", "--to", "8 s", "--no-report", *GAIN]
    answer = run("replay", str(LOOP), str(TABLE), "--topic", "reading", *options, folder=tmp_path)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert len(answer.stdout.splitlines()) <= 15


@pytest.mark.slow
def test_the_files_are_written_and_read_back(tmp_path: Path) -> None:
    pytest.importorskip("mcap", reason="needs the extra ros")
    files = ["--chain", "chain.toml", "--calibration", "pairs.csv", "--mcap", "out.mcap"]
    words = ["replay", str(LOOP), str(TABLE), "--topic", "reading", "--reference", "distance", *GAIN, *files]
    answer = run(*words, folder=tmp_path)
    assert answer.returncode == 0, answer.stderr
    assert len(answer.stdout.splitlines()) <= 20  # with all warnings
    names = {"chain.toml", "pairs.csv", "out.mcap", "out.foxglove.json", "approaches-replay.html"}
    assert {path.name for path in tmp_path.iterdir()} == names
    page = (tmp_path / "approaches-replay.html").read_text(encoding="utf-8")
    assert page.index("<svg") < page.index("<details")  # the figure is on the first screen
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    again = run(*words, folder=tmp_path)
    assert again.returncode == 2
    assert "already exists" in again.stderr
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert run(*words, "--force", folder=tmp_path).returncode == 0


def test_the_messages_of_a_replay_are_its_steps(tmp_path: Path) -> None:
    pytest.importorskip("mcap", reason="needs the extra ros")
    task = pt.load_scenario(LOOP).replace(gain=-0.86)
    result = replay(task, read_recording(TABLE, "reading"), end=3.0)
    path, layout = write_mcap(tmp_path / "x.mcap", series_of_replay(result))
    for name in ("virtual_force", "position", "reading", "log_level"):
        own = read_recording(path, f"/pretouch/law.{name}")
        assert own.values.tolist() == getattr(result.steps, name).tolist()
    detected = read_recording(path, "/pretouch/law.detected")
    assert detected.values.sum() == ((result.steps.status & 1) != 0).sum()
    assert detected.stamps[0] == result.recording.stamps[0]
    assert np.diff(detected.stamps).tolist() == [1_000_000] * (len(detected.stamps) - 1)
    panels = json.loads(layout.read_text())
    paths = [p["value"] for panel in panels["configById"].values() for p in panel["paths"]]
    assert {"/pretouch/law.xi", "/pretouch/law.virtual_force"} <= set(paths)
    assert json.dumps(panels["layout"]).count("Plot!") == len(panels["configById"]) == len(paths)
    with pytest.raises(OutputExistsError):
        write_mcap(path, series_of_replay(result))


def test_messages_in_a_file_satisfy_their_schema(tmp_path: Path) -> None:
    """Numbers that are not finite are left out: Foxglove reads no schema that allows null."""
    reader = pytest.importorskip("mcap.reader", reason="needs the extra ros")
    columns = {
        "reading": np.array([np.nan, 1.5, np.inf]),
        "position": np.array([0.25, 0.5, 0.75]),
        "detected": np.array([False, True, True]),
        "status": np.array([1, 2, 3]),
    }
    series = Series(topic="/pretouch/law", stamps=np.array([1, 2, 3]), columns=columns)
    path, _ = write_mcap(tmp_path / "x.mcap", [series])
    kinds = {"number": float, "integer": int, "boolean": bool}
    messages = []
    with path.open("rb") as stream:
        for schema, _, message in reader.make_reader(stream).iter_messages():
            properties = json.loads(schema.data)["properties"]
            messages.append(json.loads(message.data))
            assert all(type(value) is kinds[properties[name]["type"]] for name, value in messages[-1].items())
    assert messages == [
        {"position": 0.25, "detected": False, "status": 1},
        {"reading": 1.5, "position": 0.5, "detected": True, "status": 2},
        {"position": 0.75, "detected": True, "status": 3},
    ]
    own = read_recording(path, "/pretouch/law.reading").values
    assert np.isnan(own).tolist() == [True, False, True]


def test_a_simulation_that_is_written_and_replayed_is_the_same_run(tmp_path: Path) -> None:
    """Its own readings, as the law got them, give its own forces bit for bit; until contact, which moves the flags."""
    pytest.importorskip("mcap", reason="needs the extra ros")
    task = pt.load_scenario(LOOP).replace(gain=-0.86)
    encounter = simulate(task)
    path, _ = write_mcap(tmp_path / "sim.mcap", series_of_trace(encounter.trace, 100.0))
    reading, force, distance = read_recordings(
        path, ("/pretouch/law.reading", "/pretouch/law.virtual_force", "/pretouch/encounter.distance [m]")
    )
    assert force.values.tolist() == encounter.trace.virtual_force.tolist()
    assert distance.values.tolist() == encounter.trace.distance.tolist()
    fresh = np.flatnonzero(np.diff(reading.values, prepend=0.0))  # noise makes each reading another number
    steps = replay(task, reading.part(fresh)).steps
    count = 400
    assert steps.virtual_force[:count].tolist() == force.values[fresh[0] : fresh[0] + count].tolist()
    assert np.abs(steps.virtual_force[:count]).max() > 1


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["simulate", "verify"])
def test_simulate_and_verify_write_mcap(verb: str, tmp_path: Path) -> None:
    pytest.importorskip("mcap", reason="needs the extra ros")
    quick = ["--runs", "20", "--no-changes"] if verb == "verify" else []
    words = [verb, str(LOOP), *GAIN, *quick, "--no-report", "--mcap", "run.mcap"]
    answer = run(*words, folder=tmp_path)
    assert answer.returncode in {0, 1}, answer.stderr  # 20 runs are too few for some verdicts
    assert {path.name for path in tmp_path.iterdir()} == {"run.mcap", "run.foxglove.json"}
    contact = read_recording(tmp_path / "run.mcap", "/pretouch/encounter.contact_force")
    assert contact.values.max() > 1
    again = run(*words, folder=tmp_path)
    assert again.returncode == 2
    assert "already exists" in again.stderr


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["no.toml", "TABLE", "--topic", "reading"], "no.toml"),
        (["LOOP", "no-bag", "--topic", "reading"], "no-bag"),
        (["LOOP", "TABLE", "--topic", "raeding"], "reading"),
        (["LOOP", "TABLE"], "--topic"),
        (["TABLE", "LOOP", "--topic", "reading"], "scenario file first"),
        (["APPROACH", "TABLE", "--topic", "reading"], "[controller]"),
        (["LOOP", "TABLE", "--topic", "reading", "--contacts", "2 m"], "--contacts"),
        (["LOOP", "TABLE", "--topic", "reading", "--contacts", "99"], "contacts"),
        (["LOOP", "TABLE", "--topic", "reading", "--calibration", "x.csv"], "--reference"),
        (["LOOP", "TABLE", "--topic", "reading", "--from", "99 s"], "from, to"),
        (["LOOP", "TABLE", "--topic", "reading", "--chain", "full"], "already exists"),
        (["LOOP", "TABLE", "--topic", "reading", "--mcap", "TABLE", "--force"], "input"),
        (["LOOP", "TABLE", "--topic", "reading", "--clock", "header"], "clock"),
    ],
)
def test_a_mistake_is_one_sentence_and_writes_nothing(words: list[str], told: str, tmp_path: Path) -> None:
    (tmp_path / "full").touch()
    shutil.copy(TABLE, tmp_path / "TABLE")
    shutil.move(tmp_path / "TABLE", tmp_path / "t.csv")
    places = {"LOOP": str(LOOP), "TABLE": "t.csv", "APPROACH": str(LOOP.with_name("approach.toml"))}
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    answer = run("replay", *[places.get(word, word) for word in words], *GAIN, folder=tmp_path)
    assert answer.returncode == 2, answer.stdout
    assert answer.stdout == ""
    assert told in answer.stderr
    assert "Traceback" not in answer.stderr
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_file_of_the_bag_is_never_overwritten(tmp_path: Path) -> None:
    recorded = pytest.importorskip("recorded")
    pytest.importorskip("rosbags", reason="needs the extra ros")
    bag = recorded.float_bag(tmp_path / "bag", np.arange(100) * 4e-3, np.full(100, 200.0))
    content = (bag / "bag.mcap").read_bytes()
    for option in ("--mcap", "--output"):
        words = ["replay", str(LOOP), "bag", "--topic", "/reading", *GAIN, option, "bag/bag.mcap", "--force"]
        answer = run(*words, folder=tmp_path)
        assert answer.returncode == 2
        assert "input" in answer.stderr
    assert (bag / "bag.mcap").read_bytes() == content


def test_the_example_is_what_its_program_prints() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "examples/make_recording.py")], capture_output=True, text=True, check=True
    )
    assert done.stdout == TABLE.read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_sessions_of_the_page_run(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="needs the extra ros")
    pytest.importorskip("mcap", reason="needs the extra ros")
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    sessions = re.findall(r"^\$ (.+)\n((?:(?!\$ |```).*\n)*)", PAGE, re.MULTILINE)
    assert len(sessions) == 4
    for command, expected in sessions:
        words = shlex.split(command)
        if words[0] == "python":
            subprocess.run([sys.executable, *words[1:]], check=True, cwd=tmp_path)
            continue
        (tmp_path / "approaches-replay.html").unlink(missing_ok=True)
        shown = run(*words[1:], folder=tmp_path).stdout
        assert doctest.OutputChecker().check_output(expected, shown, doctest.ELLIPSIS), shown


def test_the_python_example_of_the_page_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    parser, runner = doctest.DocTestParser(), doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    runner.run(parser.get_doctest(block, {}, "page", "page", 0))
    assert runner.summarize().failed == 0
