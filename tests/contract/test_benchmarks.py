"""The peers of benchmarks/ do the same work as pretouch: a smoke test on tiny sizes, of those that are installed."""

from __future__ import annotations

import dataclasses
import importlib
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.peers import builds, growing, registry, rows, work
from benchmarks.peers.measuring import in_turn, inputs_for, problem_for, relative_error
from benchmarks.peers.protocol import missing

ROOT = Path(__file__).parents[2]
NEEDED_BY_ALL = {"pretouch", "numpy", "scipy"}
TINY = {"A": 1, "B": 5, "C": 2, "E": 3, "F": 5}


def ours(case: str, sensor: str, inputs: tuple[np.ndarray, ...]) -> np.ndarray:
    first, *others = (
        w.make(*inputs)() for w in registry.load("pretouch").cases() if w.sensor == sensor and case in w.cases
    )
    for found in others:
        assert relative_error(found, first) <= work.ACCURACY[case]
    return first


@pytest.mark.parametrize("name", registry.PEERS)
def test_a_peer_says_what_it_is_without_its_library(name: str) -> None:
    peer = registry.load(name)
    assert peer.name
    assert isinstance(peer.available(), str)
    assert name not in NEEDED_BY_ALL or not peer.available()
    assert peer.cases()
    for way in peer.cases():
        assert way.sensor in work.SENSORS
        assert way.cases
        assert set(way.cases) <= set(work.CASES)
        alone = len(way.cases) == 1 or not set(way.cases) & set("BEF")
        assert alone, "contacts, designs and drags are made from different inputs"
        assert not way.grows or way.cases == "B"
        assert 0 < way.tolerance <= 0.1


@pytest.mark.parametrize("name", [n for n in registry.PEERS if n != "pretouch"])
def test_a_peer_agrees_with_ours_to_its_tolerance(name: str) -> None:
    peer = registry.load(name)
    if peer.available():
        pytest.skip(peer.available())
    for way in peer.cases():
        for case in set(way.cases) & set(TINY):
            inputs = inputs_for(case, TINY[case])
            found = way.make(*inputs)()
            assert found.shape == (TINY[case],), way
            own = ours(case, way.sensor, inputs)
            assert relative_error(found, own) <= way.tolerance + work.ACCURACY[case], way


@pytest.mark.parametrize("sensor", work.SENSORS)
@pytest.mark.parametrize("case", TINY)
def test_the_reference_takes_another_way_and_agrees(case: str, sensor: str) -> None:
    """Contacts by integration, optima from contacts alone; both are good to far more than the work asks for."""
    problem = problem_for(case, sensor, 5 * TINY[case])
    assert relative_error(ours(case, sensor, problem.inputs), problem.answers) <= work.ACCURACY[case]


def test_fewer_encounters_are_the_first_ones_of_more() -> None:
    few, many = work.contacts(3), work.contacts(7)
    for a, b in zip(few, many, strict=True):
        np.testing.assert_array_equal(a, b[:3])
    assert work.designs(1).tolist() == [work.VELOCITY]


def test_pairs_are_run_in_turn() -> None:
    order: list[str] = []

    def job(name: str) -> None:
        order.append(name)
        sum(range(20_000))  # processor time, which is measured

    pair = in_turn(lambda: job("a"), lambda: job("b"), 0.0)
    assert pair.rounds == 3
    assert re.fullmatch(r"(a+b+){4}", "".join(order))
    assert pair.ratio > 0


def test_a_missing_module_is_a_reason() -> None:
    assert missing("numpy") == ""
    assert missing("numpy", "no_such_module_at_all") == "no_such_module_at_all not installed"


@pytest.mark.slow
def test_the_program_prints_a_row_per_way_and_writes_its_numbers(tmp_path: Path) -> None:
    """Case A and the figure beside NumPy alone, in a process of its own: it holds itself to one processor."""
    file, figure = tmp_path / "rows.json", tmp_path / "cost.png"
    options = ["--case", "A", "--peer", "numpy", "--quick", "--seconds", "0.01"]
    run = subprocess.run(
        [sys.executable, "-m", "benchmarks.peers", *options, "--json", str(file), "--figure", str(figure)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONIOENCODING": "utf-8", "PYTHONPATH": os.pathsep.join([str(ROOT / "src")])},
    )
    assert run.returncode == 0, run.stderr
    record = json.loads(file.read_text(encoding="utf-8"))
    assert [(row["peer"], row["sensor"]) for row in record["rows"]] == [
        ("pretouch", "exponential-1"),
        ("NumPy", "exponential-1"),
        ("pretouch", "inverse-power"),
    ]
    for row in record["rows"]:
        assert row["exact"]
        assert f"{row['error']:.0e}" in run.stdout
    assert {growth["peer"] for growth in record["growth"]} == {"pretouch", "NumPy"}
    assert figure.read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "options", "printed"),
    [
        (
            "robots",
            ["--quick"],
            [r"floating base of 1 kg +0\.09\d+ +0\.09", r"without kappa .* \+1\d\.", r"passes: 0 of 3", r"ms apart"],
        ),
        ("loops", ["--quick"], [r"[\d,]+ runs/s", r"200 contacts", r"largest difference 0\.\d\d%"]),
        ("advice", ["--quick"], [r"bounds of \d+ limits", r"loops that do not hold, after advice: \d end"]),
        ("verdicts", ["--quick"], [r"verdicts over 20 runs", r"s with changes", r"which loses -?\d+\.\d\d \+- "]),
        (
            "calibrations",
            ["--count", "6"],
            [r"within 15 % of the predicted contact speed: (\d+) of \1 ", r"without a warning: 0", r"ms a fit"],
        ),
        (
            "calibrations",
            ["--sparse", "--count", "6"],
            [
                r"within 15 % of the predicted contact speed: (\d+) of \1 ",
                r"without a warning: 0",
                r"although within 15 %",
            ],
        ),
        ("fitting", ["--count", "2"], [r"2 curves of one file: \d+\.\d\d s", r"by SciPy: .* ms a curve; ratio \d+"]),
        (
            "gradients",
            ["--count", "300", "--seconds", "0.01"],
            [r"exponential-1 .*ns", r"table .*ns", r"0\.\d\d ms each"],
        ),
        (
            "drag",
            ["--quick"],
            [
                r"0\.3 m/s +letter .* drag .* required mean <= 48",
                r"VCNL4040",
                r"40 encounters with all peaks, table +\S+ ms",
                r"\(6\) peak acceleration +[01]\.",
                r"missed requirements:",
            ],
        ),
        (
            "custom_laws",
            ["--encounters", "8", "--quick"],
            [r"times as fast, largest difference of l' \de-[01]\d", r"design, force of arrays: [\d.]+ s"],
        ),
        (
            "policies.__main__",
            ["--quick"],
            [r"constant deceleration: excursion 0\.\d{3}", r"rate s' only( +[\d.]+ \+- [\d.]+){6}"],
        ),
        ("wrong_distances", ["--count", "1", "--case", "zero"], [r"zero +zero +1( +\d+\.\d){8}"]),
        ("bounds", ["--count", "1000"], [r"any schedule .*[01]\.\d{9} of the bound at most", r"exceeded: 0 of 7"]),
    ],
)
def test_a_program_prints_what_it_measures(
    name: str,
    options: list[str],
    printed: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    short_rest: None,
) -> None:
    """In this process; verdicts have a short rest, which no benchmark prints."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", [name, *options])
    status = 0
    try:
        status = importlib.import_module(f"benchmarks.{name}").main()
    except SystemExit as ended:
        status = ended.code
    assert not status
    shown = capsys.readouterr().out
    for pattern in printed:
        assert re.search(pattern, shown), (pattern, shown)


def test_the_page_names_every_program() -> None:
    page = (ROOT / "docs" / "developers/benchmarks.md").read_text(encoding="utf-8")
    folder = ROOT / "benchmarks"
    programs = {file.stem for file in folder.glob("*.py") if not file.stem.startswith("_")}
    programs |= {file.parent.name for file in folder.glob("*/__main__.py")}
    assert {"bounds", "peers"} <= programs
    assert {name for name in programs if f"python -m benchmarks.{name}`" not in page} == set()


def test_starts_and_detection_distances_are_compared() -> None:
    from benchmarks import starts

    assert starts.check(3, 7) == 0


def test_designs_with_limits_agree_with_the_full_search() -> None:
    from benchmarks import limits

    assert limits.check(6, 7) == 0


def test_random_robots_say_what_differs_from_their_prediction() -> None:
    pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")
    from benchmarks import random_robots

    assert random_robots.check(2, 10) == 0


def test_a_robot_that_says_nothing_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")
    from benchmarks import random_robots

    from pretouch.robots import encounter

    monkeypatch.setattr(encounter, "report_deviations", lambda _: [])
    assert random_robots.check(1, 23) > 0


def test_co_designs_are_compared_with_narrowed_grids(monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks import limits

    monkeypatch.setattr(limits, "_STARTS", 1)
    monkeypatch.setattr(limits, "_ADMITTANCES", {1: 21, 2: 9})
    assert limits.check_together(1, 14) == 0
    design = limits.design_admittance
    monkeypatch.setattr(
        limits, "design_admittance", lambda task: SimpleNamespace(gain=-1.0, objective=1.01 * design(task).objective)
    )
    assert limits.check_together(1, 14) == 1


def test_tasks_with_a_narrow_band_are_feasible() -> None:
    from benchmarks import narrow_bands

    for kind in narrow_bands.KINDS[:2]:
        assert narrow_bands.check(kind, 1, 7) == 0


def test_the_compiled_search_decides_tasks_with_a_narrow_band() -> None:
    """The studio has no other search."""
    from benchmarks import narrow_bands

    from pretouch.designs.search.compiled import OPTIMAL, search_compiled

    tasks = [task for _, task, _ in narrow_bands.tasks(narrow_bands.KINDS[0], 20, 7)]
    found = [search_compiled(narrow_bands.problem_of(task).within_gain_limit()) for task in tasks]
    assert sum(f is not None and f[2, 0] == OPTIMAL for f in found) >= 18


def test_a_wrong_design_with_limits_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks import limits

    search = limits.search_compiled
    monkeypatch.setattr(limits, "search_compiled", lambda problem: search(problem) * [[1.0], [1.001], [1.0]])
    assert limits.check(6, 7) > 0


@pytest.mark.slow
def test_the_reader_of_recordings_finds_as_many_messages_as_the_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    """As soon as a library finds as many in all cases, it can replace the reader of pretouch."""
    pytest.importorskip("rosbags", reason="needs the extra ros")
    pytest.importorskip("mcap", reason="needs the extra ros")
    from benchmarks import replaying

    monkeypatch.setattr(replaying, "DAMAGED", 3000)
    shares = replaying.compare_readers(1000, 6, 2)
    for found in shares.values():
        assert found["pretouch"] == max(found.values())
    for library in ("rosbags", "mcap"):
        assert any(found["pretouch"] > found[library] for found in shares.values() if library in found)


def test_no_drifted_sensor_is_called_fine_wrongly() -> None:
    from benchmarks import rechecks

    counts, wrong = rechecks.count_verdicts(6, 0)
    assert (counts.total(), wrong) == (6, 0)


@pytest.mark.slow
def test_the_chain_of_each_recording_is_that_of_its_sensor() -> None:
    pytest.importorskip("rosbags", reason="needs the extra ros")
    from benchmarks import recordings

    assert recordings.check(1, 1) == 0


def test_a_narrow_range_of_feasible_gains_is_not_called_infeasible() -> None:
    """One of 20,000 random tasks: the smallest contact speed of all gains is just below its limit."""
    from benchmarks import limits

    problem = limits.random_problem(np.random.default_rng([6, 14721]))
    found, known = limits.search_compiled(problem), limits.GainEvidence(problem=problem, settled=None)
    assert known.status.value == "optimal"
    assert found is not None
    assert found[2, 0] != limits.INFEASIBLE


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_failing_sensors_stay_below_the_bound_of_the_verdict() -> None:
    from benchmarks import disturbances

    failures = disturbances.draw_failures(3, 7)
    task, bound, gain = disturbances.guarded("loop")
    assert disturbances.judge("loop", lambda f, e: disturbances.run_loop(task, gain, f, e), failures, bound) == 0


def test_a_sensor_that_fails_without_a_check_of_jumps_is_noticed() -> None:
    from benchmarks import disturbances

    event = disturbances.Disturbance(kind="cable", distance=0.025)
    failures = [disturbances.Failure(event, 0.0422, -0.3, 0)]
    task = disturbances.pt.load_scenario(disturbances.EXAMPLES / "loop.toml")
    law = task.loop.law
    conditioning = dataclasses.replace(law.conditioning, largest_rate=None)
    damper = dataclasses.replace(law.law, approach_only=False)
    bare = task.replace(
        loop=dataclasses.replace(task.loop, law=dataclasses.replace(law, conditioning=conditioning, law=damper))
    )
    assert disturbances.judge("loop", lambda f, e: disturbances.run_loop(bare, -0.86, f, e), failures, 0.05) > 0


def test_models_of_other_people_are_projected_and_compared(capsys: pytest.CaptureFixture[str], monkeypatch) -> None:
    pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")
    from benchmarks import models

    monkeypatch.setattr(sys, "argv", ["models", "/nowhere"])
    assert models.main() == 0
    assert "skipped" in capsys.readouterr().out
    paths = models.find_models([ROOT / "examples/robots"])
    assert {path.name for path in paths} >= {"arm.xml", "arm.urdf", "leg.xml", "gripper.xml"}
    found = models.examine(ROOT / "examples/robots/arm.urdf")
    assert {"reflected mass", "moved mass", "recoil share"} <= set(found["differences"])
    assert max(found["differences"].values()) <= models.SAME


def test_live_topics_without_ros_are_skipped(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from benchmarks import live_topics

    monkeypatch.setattr(sys, "argv", ["live_topics"])
    monkeypatch.setattr(live_topics.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(SystemExit) as ended:
        live_topics.main()
    assert ended.value.code == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines] == ["Kilted", "Jazzy", "Humble"]
    assert all("skipped" in line for line in lines)


def test_an_earlier_build_solves_and_times_the_same_work_in_its_own_process() -> None:
    (way,) = (w for w in builds.EarlierBuild("0b8b367b", ROOT).cases() if (w.sensor, w.cases) == ("inverse-power", "B"))
    inputs = inputs_for("B", 5)
    job = way.make(*inputs)
    np.testing.assert_array_equal(job(), ours("B", "inverse-power", inputs))
    assert 0 < job.timed(3) < job.timed(1) * 100
    assert in_turn(job, job, 0.0).ratio > 0


def test_commands_of_two_builds_are_rows_of_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    listed = builds.commands(points=4)
    assert {"--help", "verify, text", "verify, report on top", "sweep of 4 designs, limit"} <= {c.name for c in listed}
    monkeypatch.setattr(rows, "commands", lambda _: listed[:1])
    own, old = rows.measure_commands(4, builds.EarlierBuild("0b8b367bff", ROOT), least=1)
    assert (own.peer, own.way, own.ratio) == ("pretouch", "--help", 1.0)
    assert (old.peer, old.way) == ("pretouch 0b8b367b", "--help")
    assert old.ratio == pytest.approx(old.seconds / own.seconds)
    assert str(old).startswith("| G |  | pretouch 0b8b367b | --help | ")
    assert str(old).count("|") == rows.HEADER.splitlines()[1].count("|")


def test_growing_work_is_measured_and_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    work = {one.name: one for one in growing.WORK}
    assert len(work) == 4
    small = [one._replace(sizes=one.sizes[:2]) for one in growing.WORK if one.name.startswith("designs")]
    monkeypatch.setattr(growing, "WORK", small)
    (grown,) = growing.grow(largest=100)
    assert grown.sizes == (10, 100)
    assert min(grown.megabytes) > 10
    growing.draw([grown], tmp_path / "growth.png")
    assert (tmp_path / "growth.png").stat().st_size > 1000
