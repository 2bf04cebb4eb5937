"""The server of the studio: what it answers, and what it refuses."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
import tomllib
import zipfile
from io import BytesIO
from pathlib import Path

import pytest
from command_text import in_this_process

import pretouch as pt
from page_core import built_core
from pretouch._core.errors import InvalidInputError
from pretouch.studio.opened_files import OpenedFiles, change_text
from pretouch.studio.page_file import figures_text, page_text
from pretouch.studio.page_scenario import scenario_of_page
from studio_server import running_studio
from wrong_reading import write_task

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")
pytest.importorskip("tomlkit")

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studio")
    for name in ("loop.toml", "sensor.csv"):
        shutil.copy(EXAMPLES / name, folder)
    with running_studio(folder / "loop.toml") as server:
        yield server


@pytest.fixture
def scenario():
    return (EXAMPLES / "loop.toml").read_text(encoding="utf-8")


# ---- who is answered ----


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({"host": "evil.example"}, 421),
        ({"host": "127.0.0.1"}, 421),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"X-Pretouch-Token": "x"}, 403),
        ({"X-Pretouch-Token": ""}, 403),
    ],
    ids=["foreign host", "host without port", "foreign origin", "origin null", "wrong token", "no token"],
)
def test_a_foreign_request_is_refused(studio, scenario, changes, status):
    found, _, content = studio.ask("POST", "/api/describe", {"text": scenario}, **changes)
    assert found == status
    assert b"fields" not in content


def test_the_page_needs_the_token(studio):
    assert studio.ask("GET", "/")[0] == 403
    assert studio.ask("GET", "/?token=wrong")[0] == 403
    status, headers, content = studio.ask("GET", f"/?token={studio.token}")
    assert status == 200
    assert b"loop.toml" in content
    assert "default-src 'none'" in headers["content-security-policy"]
    assert studio.ask("GET", f"/?token={studio.token}", host=f"rebound.example:{studio.port}")[0] == 421


def test_a_large_upload_is_refused_while_it_is_sent(studio):
    declared = studio.ask("POST", "/api/calibration", b"0,1\n" * 13_000_000, **{"X-Name": "large.csv"})
    assert declared[0] == 413
    assert b"10 MB" in declared[2]
    assert studio.ask("POST", "/api/describe", {"text": "#" * 2_000_000})[0] == 413


@pytest.mark.parametrize(
    "name", ["/etc/passwd", "../sensor.csv", "sensor.csv"], ids=["absolute", "upward", "next to the file"]
)
def test_a_scenario_of_the_page_names_only_opened_files(studio, name):
    text = f'[sensor]\ncalibration = "{name}"\n[robot]\nmodel = "{name}"\n'
    for request in ("describe", "simulate", "save"):
        answer = studio.answer(request, {"text": text})
        assert answer["status"] == 422
        assert "not been opened" in answer["message"]


def test_an_uploaded_name_is_no_path(tmp_path):
    files = OpenedFiles()
    try:
        name = files.add_file("../../evil\\..\\a b.csv", b"1,2\n")
        assert name == "a_b.csv"
        assert files.file(name).parent == files.folder
        with pytest.raises(InvalidInputError):
            files.file("../a_b.csv")
    finally:
        files.close()
    assert not files.folder.exists()


@pytest.mark.parametrize("body", [b"", b"[1]", b"{", b'{"text": 3}', b"\xff"])
def test_a_malformed_request_is_a_message(studio, body):
    status, _, content = studio.ask("POST", "/api/describe", body)
    assert status == 422
    assert json.loads(content)["message"]


HUGE = 10**400
"""An integer that no float can hold."""


@pytest.mark.parametrize(
    ("request_", "body"),
    [
        ("describe", b'{"text": ' + b"[" * 100_000 + b"]" * 100_000 + b"}"),
        ("simulate", {"gain": HUGE}),
        ("simulate", {"seed": HUGE}),
        ("simulate", {"seed": -HUGE}),
        ("fit", {"name": "sensor.csv", "window": [0.01, HUGE]}),
        ("fit", {"name": "sensor.csv", "window": [0.01]}),
        ("change", {"changes": {"sensor.model": {"a": [1]}}}),
        ("change", {"text": "[[sensor]]\n", "changes": {"sensor.model": "x"}}),
        ("change", {"text": "no TOML", "changes": {}}),
        ("describe", {"text": 'a = "\ud800"'}),
        ("jobs", {"verb": "verify", "text": "no TOML"}),
    ],
)
def test_what_the_page_never_sends_is_a_message(studio, scenario, request_, body):
    status, _, content = studio.ask(
        "POST", f"/api/{request_}", body if isinstance(body, bytes) else {"text": scenario, **body}
    )
    assert status == 422
    assert json.loads(content)["message"]


def test_a_distribution_that_is_none_stays_as_it_is():
    text = 'uncertainty = 3\n[obstacle]\nposition = "1 mm"\n'
    assert change_text(text, {"obstacle.position": "2 mm"}) == text.replace("1 mm", "2 mm")


@pytest.mark.parametrize("length", [250, 5000])
def test_an_upload_with_a_name_that_no_disk_allows_is_a_message(studio, length):
    content = (EXAMPLES / "sensor.csv").read_bytes()
    status, _, answer = studio.ask("POST", "/api/calibration", content, **{"X-Name": f"{'a' * length}.csv"})
    assert status == 422
    assert f"{length + 4} characters" in json.loads(answer)["message"]


# ---- what it leaves behind ----


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """A folder for all temporary files of the servers of one test."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    return folder


def test_descriptions_and_refused_computations_leave_no_files(tmp_path, temporary, scenario):
    file = tmp_path / "own.toml"
    file.write_text(scenario, encoding="utf-8")
    with running_studio(file) as server:
        for text in (scenario, "no TOML"):
            for request in ("describe", "reservations", "save"):
                server.answer(request, {"text": text, "gain": -0.8})
        server.answer("jobs", {"verb": "verify", "text": "no TOML"})
        (folder,) = temporary.iterdir()
        assert [path.name for path in folder.iterdir()] == ["in-use.lock"]
    assert not list(temporary.iterdir())


def test_a_killed_server_leaves_no_computation_and_the_next_one_removes_its_folder(temporary, scenario):
    with running_studio() as server, running_studio() as other:
        text = scenario.replace("runs = 500", "runs = 100000")
        job = server.answer("jobs", {"verb": "verify", "text": text, "gain": -0.86})["job"]
        while "running" not in (answer := server.answer(f"jobs/{job}", method="GET"))["progress"]:
            assert answer["state"] == "running", answer
            time.sleep(0.05)
        children = Path(f"/proc/{server.process.pid}/task/{server.process.pid}/children")
        computing = [int(pid) for pid in children.read_text().split()] if children.exists() else []
        server.process.kill()
        server.process.wait(30)
        while any(is_running(pid) for pid in computing):  # this test hangs if the computation goes on
            time.sleep(0.05)
        assert len(list(temporary.iterdir())) == 2
        with running_studio() as third:
            assert len(list(temporary.iterdir())) == 2  # the third server's folder, and that of the other running one
            assert other.answer("describe", {"text": scenario})["status"] == 200
            if hasattr(signal, "SIGHUP"):  # as when its terminal is closed
                third.process.send_signal(signal.SIGHUP)
                third.process.wait(30)
                assert len(list(temporary.iterdir())) == 1


def is_running(pid: int) -> bool:
    """Return whether a process runs; one that has ended may still wait for its parent to notice."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


# ---- what is answered ----


def test_a_scenario_is_described_with_its_own_texts(studio, scenario):
    answer = studio.answer("describe", {"text": scenario})
    assert answer["fields"]["obstacle.position"] == "42.2 mm"
    assert answer["fields"]["gain.bounds"] == ["-10 N*s", "-0.01 N*s"]
    assert "sensor" not in answer["fixed"]


def test_a_mistake_names_its_key_and_no_temporary_file(studio, scenario):
    answer = studio.answer("describe", {"text": scenario.replace('"42.2 mm"', '"42.2 kg"')})
    assert answer["status"] == 422
    assert "position" in answer["message"]
    assert "pretouch-studio-" not in answer["message"]


def test_changes_keep_comments_and_everything_else(scenario):
    changed = change_text(scenario, {"obstacle.position": "40 mm", "plant.velocity": "0 m/s", "sensor.exponent": "3"})
    before, after = scenario.splitlines(), changed.splitlines()
    assert {line for line in before if line not in after} == {'position = "42.2 mm"', "exponent = 3.32"}
    assert changed.count("#") == scenario.count("#")
    document = tomllib.loads(changed)
    assert document["obstacle"]["position"] == "40 mm"
    assert document["sensor"]["exponent"] == 3
    assert document["plant"] == {"velocity": "0 m/s"}
    assert tomllib.loads(change_text(changed, {"plant.velocity": None})).get("plant") is None


def test_the_distribution_of_a_value_moves_with_it(tmp_path: Path) -> None:
    """Otherwise a drag of the speed would contradict the distribution, and every verdict would be refused."""
    text = (EXAMPLES / "loop.toml").read_text(encoding="utf-8")
    changed = change_text(text, {"obstacle.velocity": "-0.5 m/s", "obstacle.position": "50 mm"})
    speed = tomllib.loads(changed)["uncertainty"]["obstacle"]["velocity"]
    assert speed == {"normal": ["-0.5 m/s", "0.1 m/s"], "between": ["-0.8 m/s", "-0.25 m/s"]}
    assert "# measured; overrides the assumption for the part" in changed
    (tmp_path / "fast.toml").write_text(changed, encoding="utf-8")
    task = pt.load_scenario(tmp_path / "fast.toml")
    assert (task.scenario.obstacle.velocity, task.uncertainty["obstacle.velocity"].location) == (-0.5, -0.5)
    assert change_text(text, {"obstacle.velocity": "fast"}).count("fast") == text.count("fast") + 1


def test_a_file_is_saved_where_it_was_opened(tmp_path, scenario):
    file = tmp_path / "own.toml"
    file.write_text(scenario, encoding="utf-8")
    with running_studio(file) as server:
        text = change_text(scenario, {"obstacle.velocity": "-0.5 m/s"})
        assert server.answer("save", {"text": text})["saved"] == "own.toml"
        assert server.answer("save", {"text": "not TOML ="})["status"] == 422
    assert file.read_text(encoding="utf-8") == text
    assert pt.load_scenario(file).scenario.obstacle.velocity == -0.5


def test_a_file_that_was_changed_outside_is_not_overwritten_unasked(tmp_path, scenario):
    """The page sends the text that it knows; the answer has the present one, and `known: null` overwrites."""
    file = tmp_path / "own.toml"
    file.write_text(scenario, encoding="utf-8")
    with running_studio(file) as server:
        text = change_text(scenario, {"obstacle.velocity": "-0.5 m/s"})
        edited = scenario + "\n# a note from an editor\n"
        file.write_text(edited, encoding="utf-8")
        assert server.answer("save", {"text": text, "known": scenario})["changed"] == edited
        assert file.read_text(encoding="utf-8") == edited
        assert server.answer("reload", {})["text"] == edited
        assert server.answer("save", {"text": text, "known": edited})["saved"] == "own.toml"
        other = change_text(scenario, {"obstacle.velocity": "-0.6 m/s"})  # of a second tab, which read the first text
        assert server.answer("save", {"text": other, "known": scenario})["changed"] == text
        assert server.answer("save", {"text": other, "known": None})["saved"] == "own.toml"
    assert file.read_text(encoding="utf-8") == other


def test_saving_keeps_link_permissions_and_line_ends(tmp_path, scenario):
    (tmp_path / "far").mkdir()
    target, link = tmp_path / "far/real.toml", tmp_path / "own.toml"
    target.write_bytes(scenario.replace("\n", "\r\n").encode("utf-8-sig"))
    target.chmod(0o600)
    link.symlink_to(target)
    with running_studio(link) as server:
        text = change_text(scenario, {"obstacle.velocity": "-0.5 m/s"})
        assert server.answer("save", {"text": text, "known": scenario})["saved"] == "own.toml"
    assert link.is_symlink()
    assert target.read_bytes() == text.replace("\n", "\r\n").encode("utf-8-sig")
    assert target.stat().st_mode & 0o777 == 0o600
    assert [path.name for path in (tmp_path / "far").iterdir()] == ["real.toml"]


def test_a_fit_follows_the_window(studio):
    content = (EXAMPLES / "sensor.csv").read_bytes()
    status, _, found = studio.ask("POST", "/api/calibration", content, **{"X-Name": "own.csv"})
    data = json.loads(found)
    report = pt.fit(pt.read_calibration(EXAMPLES / "sensor.csv"))
    assert status == 200
    assert data["fit"]["slope"]["value"] == pytest.approx(report.best.middle_slope.value, rel=1e-9)
    assert data["fit"]["offset"]["value"] == pytest.approx(report.best.offset.value, rel=1e-9)
    narrow = studio.answer("fit", {"name": "own.csv", "window": [0.01, 0.04]})
    assert narrow["window"][0] >= 0.01
    assert narrow["window"][1] <= 0.04
    assert narrow["slope"]["value"] < data["fit"]["slope"]["value"]  # steeper nearer to the sensor
    assert studio.answer("fit", {"name": "own.csv", "window": [0.01, 0.011]})["status"] == 422
    assert studio.answer("fit", {"name": "other.csv", "window": None})["status"] == 422


def test_a_bad_calibration_is_a_message(studio):
    status, _, content = studio.ask("POST", "/api/calibration", b"\x00\x01\xff no table", **{"X-Name": "bad.csv"})
    assert status == 422
    assert json.loads(content)["message"]


def test_a_simulated_run_and_a_cloud_are_those_of_python(studio, scenario):
    run = studio.answer("simulate", {"text": scenario, "gain": -0.8, "seed": 3})
    assert run["distance"][0] == pytest.approx(0.0422)
    assert min(run["distance"]) < 0.002
    cloud = studio.answer("cloud", {"text": scenario, "gain": -0.8})
    assert len(cloud["speed"]) == cloud["count"]
    assert 0.5 < cloud["shares"]["relative_velocity"] < 1
    missing = studio.answer("cloud", {"text": scenario.replace("[uncertainty]", "[verify2]"), "gain": -0.8})
    assert missing["status"] == 422


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("error", [0.1, 0.27], ids=["a range", "not supported"])
def test_the_range_of_contact_speeds_is_that_of_the_command(tmp_path, error):
    file = write_task(tmp_path, error)
    design = json.loads(in_this_process("design", file, "--json", "--no-report", folder=tmp_path).stdout)
    with running_studio(file) as server:
        answer = server.answer("reservations", {"text": file.read_text(encoding="utf-8"), "gain": design["gain"]})
    assert (answer["headline"] is None) == (answer["spread"] is not None) == (error < 0.2)
    said = answer["headline"] or answer["spread"]
    assert said in design["headline"]
    assert said in scenario_of_page(file)["note"]


def test_a_scenario_without_a_calibration_has_no_range(studio, scenario):
    answer = studio.answer("reservations", {"text": scenario, "gain": -0.8})
    assert (answer["headline"], answer["spread"]) == (None, None)


def finish(studio, job, seconds=240):
    for _ in range(seconds * 5):
        answer = studio.answer(f"jobs/{job}", method="GET")
        if answer["state"] != "running":
            return answer
        time.sleep(0.2)
    raise AssertionError("the computation does not end")


def test_a_computation_runs_beside_and_writes_its_report(studio, scenario):
    text = scenario.replace("runs = 500", "runs = 60")
    job = studio.answer("jobs", {"verb": "verify", "text": text, "gain": -0.86})["job"]
    assert studio.answer("describe", {"text": scenario})["status"] == 200  # while it runs
    answer = finish(studio, job)
    assert answer["state"] == "done"
    assert answer["json"]["gain"] == -0.86
    status, _, report = studio.ask("GET", f"/api/jobs/{job}/report.html")
    assert status == 200
    assert b"<svg" in report
    assert studio.ask("GET", f"/api/jobs/{job}/..%2f..%2fpasswd")[0] in {404, 422}


def test_a_computation_is_canceled(studio, scenario):
    text = scenario.replace("runs = 500", "runs = 100000")
    job = studio.answer("jobs", {"verb": "verify", "text": text, "gain": -0.86})["job"]
    assert studio.answer(f"jobs/{job}", method="DELETE")["state"] == "canceled"
    assert studio.answer("jobs/none", method="GET")["status"] == 422
    assert studio.answer("jobs", {"verb": "rm", "text": scenario})["status"] == 422


def test_an_export_brings_the_law_in_c(studio, scenario):
    text = scenario.replace("runs = 500", "runs = 60")
    job = studio.answer("jobs", {"verb": "export", "text": text, "gain": -0.9})["job"]
    answer = finish(studio, job)
    assert answer["state"] == "done", answer
    assert answer["json"]["written"]
    _, _, content = studio.ask("GET", f"/api/jobs/{job}/export.zip")
    names = zipfile.ZipFile(BytesIO(content)).namelist()
    assert any(name.endswith("pretouch_law.c") for name in names)


# ---- the page as a file ----


def test_the_page_asks_for_nothing_outside():
    built_core()
    for text in (page_text(), figures_text()):
        assert "<script src" not in text
        addresses = {part.split("/")[2] for part in text.split('"') if part.startswith(("http://", "https://"))}
        assert addresses <= {"www.w3.org"}
    assert len(page_text()) <= 256_000


def test_the_page_is_written_to_a_file(tmp_path):
    built_core()
    target = tmp_path / "try.html"
    command = [sys.executable, "-m", "pretouch", "studio", "--output", str(target)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    assert target.read_text(encoding="utf-8") == page_text()
    assert subprocess.run(command, capture_output=True, check=False).returncode == 2


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("none.toml", "there is no such file"),
        ("course.toml", "without a course"),
        ("fingertip.toml", "[constraints] also has the constraints impact_force"),
        ("tradeoff.toml", "the admittance has bounds"),
        ("robots/arm.toml", "[robot] names a robot model"),
    ],
)
def test_a_page_without_server_refuses_what_it_cannot_compute(tmp_path, name, reason):
    built_core()
    target = tmp_path / "page.html"
    done = in_this_process("studio", EXAMPLES / name, "--output", target, folder=tmp_path)
    assert (done.returncode, target.exists()) == (2, False)
    assert reason in done.stderr
    assert "Traceback" not in done.stderr


def test_the_page_does_not_replace_the_scenario(tmp_path):
    scenario = Path(shutil.copy(EXAMPLES / "loop.toml", tmp_path))
    before = scenario.read_bytes()
    words = ["studio", scenario, "--output", scenario, "--force"]
    assert in_this_process(*words, folder=tmp_path).returncode == 2
    assert scenario.read_bytes() == before


def test_a_file_that_is_missing_is_one_sentence(tmp_path):
    built_core()
    command = [sys.executable, "-m", "pretouch", "studio", str(tmp_path / "none.toml"), "--no-browser"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "none.toml" in done.stderr
    assert "Traceback" not in done.stderr
