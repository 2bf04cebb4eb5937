"""What `verify` advises holds when it is followed, and its chain of advice ends."""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import beta

import pretouch as pt
from pretouch._core.units import written_unit
from pretouch._core.warning_codes import split_code
from pretouch.designs.page import gain_page
from pretouch.exports import export
from pretouch.exports.page import export_page
from pretouch.verification import advice as advice_search
from pretouch.verification.appraisal import count_to_show, draw_encounters, make_problem
from pretouch.verification.changed_loop import candidates_of, rounded_up
from pretouch.verification.missed_runs import missed_in_words
from pretouch.verification.result import Advice
from pretouch.verification.settings import settings_between
from verification_samples import NOISY, SCENARIO, SENSOR, velocity_limit, verdict

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.advice import Document, follow, load, shares

pytestmark = pytest.mark.usefixtures("short_rest")

SPEED = {"obstacle.velocity": pt.uncertainty.TruncatedNormal(location=-0.3, deviation=0.05, low=-0.4, high=-0.2)}
FILE = """\
[sensor]
model = "inverse-power"
scale = "0.533 counts"
distance_offset = "41.9 mm"
exponent = 3.32
[admittance]
mass = "1 kg"
damping = "10 N*s/m"
stiffness = "25 N/m"
[obstacle]
position = "42.2 mm"
velocity = "-0.3 m/s"
[objective]
kind = "excursion"
position_scale = "0.5 m"
velocity_scale = "0.3 m/s"
[gain]
bounds = ["-10 N*s", "-0.01 N*s"]
[constraints]
excursion = "0.2 m"
relative_velocity = "0.1 m/s"
[uncertainty]
obstacle.velocity = { normal = ["-0.3 m/s", "0.1 m/s"], between = ["-0.6 m/s", "-0.05 m/s"] }
[robust]
required = { relative_velocity = 0.95, excursion = 0.9 }
[chain]
rate = "250 Hz"
exposure = "3.9 ms"
delay = "2 ms"
noise = "20 counts"
relative_noise = 0.002
drift = "1 counts/s"
crosstalk = "150 counts"
phase = "random"
[controller]
rate = "1 kHz"
floor = "2500 counts"
offset = "100 counts"
[robot]
kind = "impedance"
mass = "4 kg"
stiffness = "4 kN/m"
damping = "250 N*s/m"
bandwidth = "80 Hz"
[verify]
runs = 300
"""
FILTERED = FILE.replace(
    'floor = "2500 counts"', 'floor = "2500 counts"\nmedian_window = 5\nlow_pass_order = 2\ncutoff = 50.0'
)


def document(text: str = FILE) -> Document:
    return tomllib.loads(text)


@pytest.mark.parametrize("text", [FILE, FILTERED], ids=["plain", "filtered"])
def test_the_settings_of_a_change_make_the_loop_that_was_simulated(text: str, tmp_path: Path) -> None:
    """Bit by bit: a value that was rounded for its sentence was rounded before it was tried."""
    task = load(document(text), tmp_path)
    loops = candidates_of(task.loop, 24.0, 0.01, start=2000.0)
    assert {"sensor-rate", "noise", "controller-rate", "robot-bandwidth", "offset", "floor"} <= {c.name for c in loops}
    for candidate in loops:
        changed = task.replace(gain=-0.8, loop=candidate.loop, verify=replace(task.verify, runs=400))
        settings = settings_between(task, changed)
        assert settings["controller.gain"] == "-0.8 N*s"
        read = load(follow(document(text), settings), tmp_path)
        assert read.loop.chain == candidate.loop.chain, candidate.name
        assert read.loop.plant == candidate.loop.plant, candidate.name
        assert replace(read.loop.law, law=task.loop.law.law) == candidate.loop.law, candidate.name
        assert (read.gain, read.verify.runs) == (-0.8, 400)


@pytest.mark.slow
def test_following_the_advice_gives_the_promised_verdict_and_fresh_runs_confirm_it(tmp_path: Path) -> None:
    file = document()
    task = load(file, tmp_path)
    found = pt.verify(task)
    assert found.status is pt.verification.VerdictStatus.DOES_NOT_HOLD
    advice = found.advice
    assert advice is not None
    assert advice.kind == "change"
    assert advice.status is not pt.verification.VerdictStatus.DOES_NOT_HOLD
    assert found.to_dict()["advice"]["settings"] == advice.settings
    after = load(follow(file, dict(advice.settings)), tmp_path)
    assert after.gain != task.gain
    again = pt.verify(after, changes=False)
    assert again.status is advice.status
    assert again.gain is not None
    softer, held = shares(after, again.gain, 5000)
    assert softer
    assert all(share >= p for share, p in held)


def followed(found: pt.verification.Verdict, **fields: Any) -> pt.verification.Verdict:
    """The verdict on the advised gain, runs and limit, as they are printed."""
    assert found.advice is not None
    number = str(found.advice.settings["controller.gain"]).removesuffix(f" {written_unit('N*s')}")
    return verdict(NOISY, gain=float(number), changes=False, **fields)


@pytest.mark.slow
def test_a_probability_that_the_runs_cannot_show_is_advised_with_enough_runs() -> None:
    """To show 99 %, 299 runs are needed; the user has 100, and the search must not be content with them."""
    fields: dict[str, Any] = {"constraints": [velocity_limit(0.078, 0.99)], "uncertainty": SPEED}
    found = verdict(NOISY, gain=-0.7463, runs=100, **fields)
    assert found.status is pt.verification.VerdictStatus.DOES_NOT_HOLD
    assert found.advice is not None
    runs = found.advice.settings["verify.runs"]
    assert isinstance(runs, int)
    assert runs >= 299
    assert f"simulate {runs} runs" in found.advice.sentence
    assert found.advice.status is pt.verification.VerdictStatus.HOLDS
    assert followed(found, runs=runs, **fields).status is pt.verification.VerdictStatus.HOLDS


@pytest.mark.slow
def test_a_limit_that_no_gain_keeps_is_relaxed_to_a_value_that_a_gain_keeps() -> None:
    """The excursion grows with the gain, the speed falls: at most one limit can be kept, as a scan of gains shows."""
    limits = [velocity_limit(0.05, 0.9), pt.designs.Required(constraint=pt.Constraint(name="excursion", limit=0.1))]
    found = verdict(NOISY, gain=-0.7463, runs=60, constraints=limits)
    advice = found.advice
    assert advice is not None
    assert advice.kind == "limit"
    for gain in -np.geomspace(0.01, 10.0, 40):
        result = NOISY.run(SCENARIO, SENSOR, float(gain), runs=40)
        kept = np.mean(np.abs(result.relative_velocity) <= 0.05) >= 0.9 and np.all(result.largest_excursion <= 0.1)
        assert not kept
    (name,) = (key for key in advice.settings if key.startswith("constraints."))
    value = float(str(advice.settings[name]).split()[0])
    old = {"constraints.relative_velocity": 0.05, "constraints.excursion": 0.1}[name]
    assert 1 < value / old < 2.5
    relaxed = [
        replace(one, constraint=replace(one.constraint, limit=value)) if name.endswith(one.constraint.name) else one
        for one in limits
    ]
    assert followed(found, runs=60, constraints=relaxed).status is advice.status is pt.verification.VerdictStatus.HOLDS


@pytest.mark.slow
def test_the_advised_value_is_never_the_one_that_is_set() -> None:
    for limit in (0.07, 0.075, 0.08):
        found = verdict(NOISY, gain=-0.8, runs=60, constraints=[velocity_limit(limit, 0.9)], uncertainty=SPEED)
        if found.advice is not None and found.advice.kind == "change":
            assert found.advice.settings
            assert found.advice.settings.get("controller.gain") != "-0.8 N*s" or len(found.advice.settings) > 1


def test_a_step_that_the_gain_does_not_need_is_not_advised(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search is made to find a gain on a loop with two changes only; the gain alone is enough."""
    loops = candidates_of(NOISY, 24.0, 0.01)
    first = next(one for one in loops if one.name == "controller-rate")
    plain = advice_search._Start(NOISY, ())
    one = advice_search._Start(first.loop, ("run the controller faster",), first.name, plain)
    second = next(one for one in candidates_of(first.loop, 24.0, 0.01) if one.name == "noise")
    two = advice_search._Start(second.loop, (*one.words, "halve the noise"), second.name, one)

    def searches(seeker: Any) -> Iterator[Any]:
        yield two, seeker._search(two.loop)

    monkeypatch.setattr(advice_search._Seeker, "_searches", searches)
    found = verdict(NOISY, gain=-0.5, runs=60, constraints=[velocity_limit(0.1, 0.9)], uncertainty=SPEED)
    assert found.advice is not None
    assert found.advice.kind == "change"
    assert set(found.advice.settings) == {"controller.gain"}
    assert found.advice.status is pt.verification.VerdictStatus.HOLDS


def test_fewer_changes_are_tried_in_the_order_of_their_number(monkeypatch: pytest.MonkeyPatch) -> None:
    loops = {one.name: one for one in candidates_of(NOISY, 24.0, 0.01)}
    plain = advice_search._Start(NOISY, ())
    one = advice_search._Start(loops["noise"].loop, ("noise",), "noise", plain)
    changed = {id(NOISY): [one, advice_search._Start(loops["delay"].loop, ("delay",), "delay", plain)]}
    monkeypatch.setattr(
        advice_search._Seeker,
        "_changed",
        lambda _, start, is_free: [] if is_free else changed.get(id(start.loop), []),
    )
    two = advice_search._Start(loops["delay"].loop, ("noise", "delay"), "delay", one)
    seeker: Any = object.__new__(advice_search._Seeker)
    words = [fewer.words for fewer in seeker._with_fewer_changes(two)]
    assert words[0] == ()
    assert sorted(words[1:]) == [("delay",), ("noise",)]


def test_only_a_limit_that_fell_short_gets_more_reserve() -> None:
    factors = advice_search._stricter(np.array([0.0, 0.9, 1.02, 1.5]))
    assert factors.tolist() == [1.0, 1.0, 1.02, 1.15]
    assert advice_search._stricter(np.array([1.02]), 1)[0] > 1.02


def relaxed(limits: list[pt.designs.Required], **fields: Any) -> Any:
    """The verdict on limits that no gain keeps; only the gain is varied, so that the search ends soon."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(advice_search._Seeker, "_searches", lambda _: iter(()))
        return verdict(NOISY, gain=-0.7463, runs=60, constraints=limits, uncertainty=SPEED, **fields)


def test_no_limit_is_offered_that_is_met_without_mitigation() -> None:
    """With a tiny excursion, only a weak gain is left: the contact speed is then about that without mitigation."""
    excursion = pt.designs.Required(constraint=pt.Constraint(name="excursion", limit=1e-4))
    found = relaxed([velocity_limit(0.05, 0.9), excursion])
    assert found.advice.kind in {"limit", "none"}
    if (value := found.advice.settings.get("constraints.relative_velocity")) is not None:
        assert float(str(value).split()[0]) < np.abs(found.unmitigated.relative_velocity).mean()


def test_the_runs_that_miss_a_limit_are_named_by_what_is_uncertain_in_them() -> None:
    found = relaxed([velocity_limit(0.09), pt.designs.Required(constraint=pt.Constraint(name="excursion", limit=0.1))])
    assert "obstacle.velocity" in found.advice.sentence
    task = found.design.problem.task.replace(loop=NOISY, verify=pt.designs.VerifyOptions(runs=60), uncertainty=SPEED)
    draws = draw_encounters(task)
    missed = draws.speed > np.quantile(draws.speed, 0.7)
    assert f"{draws.speed.max():.3g} m/s" in missed_in_words(draws, missed)
    scattered = np.argsort(np.argsort(draws.speed)) % 2 == 0
    assert missed_in_words(draws, scattered) == ""


def test_an_infeasible_design_gets_limits_that_hold_on_the_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit that suffices for the ideal design is missed on the loop by fast objects."""
    monkeypatch.setattr(advice_search._Seeker, "_searches", lambda _: iter(()))
    limits = [velocity_limit(0.07), pt.designs.Required(constraint=pt.Constraint(name="excursion", limit=0.09))]
    found = verdict(NOISY, runs=60, constraints=limits, uncertainty=SPEED)
    assert found.status is pt.verification.VerdictStatus.NO_GAIN
    assert found.advice.kind == "limit"
    ideal = {f"constraints.{limit.name}": limit.raised for one in found.design.relaxations for limit in one.limits}
    ((name, value),) = ((k, v) for k, v in found.advice.settings.items() if k.startswith("constraints."))
    limit = float(str(value).split()[0])
    assert limit > ideal[name]
    raised = [
        replace(one, constraint=replace(one.constraint, limit=limit)) if name.endswith(one.constraint.name) else one
        for one in limits
    ]
    assert followed(found, runs=60, constraints=raised, uncertainty=SPEED).status is found.advice.status
    plain = verdict(NOISY, runs=60, constraints=limits, uncertainty=SPEED, changes=False)
    assert plain.advice.kind == "design"
    assert "sampled loop may need more" in plain.advice.sentence


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("padding", ["modulus", "stiffness"])
def test_the_computed_padding_keeps_the_force_in_the_same_runs(padding: str) -> None:
    impact: Any = pt.HertzImpact(robot_mass=4.0, effective_modulus=1e7, radius=0.01)
    key = "effective_modulus"
    if padding == "stiffness":
        impact, key = pt.designs.SpringImpact(robot_mass=4.0, stiffness=2e4), "stiffness"
    limits = [
        pt.designs.Required(constraint=pt.Constraint(name="impact_force", limit=5.0)),
        pt.designs.Required(constraint=pt.Constraint(name="excursion", limit=0.15)),
    ]
    found = relaxed(limits, impact=impact)
    assert set(found.advice.settings) == {"controller.gain", "constraints.impact_force"}
    text = found.advice.sentence.partition(f"{key} = ")[2]
    value = float(text.split()[0]) * (1e6 if key == "effective_modulus" else 1.0)
    assert value < getattr(impact, key)
    softer = replace(impact, **{key: value})
    assert followed(found, runs=60, constraints=limits, uncertainty=SPEED, impact=softer).status is found.advice.status


@pytest.mark.parametrize(("total", "p"), [(59, 0.95), (60, 0.9), (200, 0.95), (298, 0.99), (299, 0.99), (1000, 0.99)])
def test_a_reserve_is_a_lower_bound_that_reaches_the_required_probability(total: int, p: float) -> None:
    k = count_to_show(total, p, 0.95)
    if k <= total:
        assert beta.ppf(0.05, k, total - k + 1) >= p
    assert k - 1 == 0 or beta.ppf(0.05, k - 1, total - k + 2) < p


def test_a_shortfall_of_the_first_runs_is_a_lower_bound_of_that_of_all_runs() -> None:
    task = pt.Task(
        SCENARIO,
        SENSOR,
        pt.excursion_objective(position_scale=0.5, velocity_scale=0.3),
        loop=NOISY,
        bounds=(-10.0, -0.01),
        constraints=[velocity_limit(0.078, 0.9)],
        uncertainty=SPEED,
        verify=pt.designs.VerifyOptions(runs=100),
    )
    problem = make_problem(task, -0.8)
    first, whole = (problem.appraise(NOISY, -0.8, count).shortfalls(100, 0.95) for count in (30, 100))
    assert np.all(first <= whole + 1e-12)
    assert whole.max() > 0


@pytest.mark.parametrize("seed", range(8))
def test_no_seed_draws_encounters_that_are_too_easy(seed: int) -> None:
    """Evenly spread speeds: the share of any range is within two runs of its probability, for 0 as for any seed.

    The share of 500 independent draws below the 95 % quantile has a standard deviation of five runs.
    """
    task = pt.Task(
        SCENARIO,
        SENSOR,
        pt.excursion_objective(position_scale=0.5, velocity_scale=0.3),
        loop=replace(NOISY, seed=seed),
        bounds=(-10.0, -0.01),
        uncertainty=SPEED,
        verify=pt.designs.VerifyOptions(runs=500),
    )
    speed = draw_encounters(task).speed
    for p in (0.05, 0.5, 0.9, 0.95, 0.99):
        slower = -float(SPEED["obstacle.velocity"].quantile(1 - p))
        assert abs(int((speed <= slower).sum()) - 500 * p) <= 2


@pytest.mark.slow
@pytest.mark.parametrize(("limit", "kind"), [("0.06 m/s", "readings"), ("0.08 m/s", "change")])
def test_a_verdict_on_a_noise_that_is_a_guess_first_asks_for_repeated_readings(
    limit: str, kind: str, tmp_path: Path
) -> None:
    """One reading per distance does not show the noise: filters and less noise are no advice before it is known.

    Another gain that holds is advised all the same.
    """
    rng = np.random.default_rng(3)
    distances = np.linspace(0, 60, 14)
    xi = np.asarray(SENSOR.output(1e-3 * distances)) * (1 + 3e-3 * rng.normal(size=14)) + 0.05
    rows = [f"{d:.3f},{y:.6f}" for d, y in zip(distances, xi, strict=True)] + ["inf,0.05"]
    (tmp_path / "sensor.csv").write_text("distance [mm],output [V]\n" + "\n".join(rows) + "\n")
    text = FILE.partition("[admittance]")[2].partition("[chain]")[0]
    loop = '[chain]\nrate = "250 Hz"\n[controller]\nrate = "1 kHz"\nfloor = 0.0482\n[verify]\nruns = 60\n'
    assert 'relative_velocity = "0.1 m/s"' in text
    text = text.replace('"0.1 m/s"', f'"{limit}"')
    (tmp_path / "scene.toml").write_text(f'[sensor]\ncalibration = "sensor.csv"\n[admittance]{text}{loop}')
    task = pt.load_scenario(tmp_path / "scene.toml")
    assert any("PT102" in reason for reason in (*task.calibration.reasons, *task.calibration.notes))
    found = pt.verify(task)
    assert found.calibration_check is None or found.calibration_check.is_good_enough
    assert isinstance(found.advice, Advice)
    assert found.advice.kind == kind
    assert ("controller.gain" in found.advice.settings) == (kind == "change")
    known = found.design.problem.task
    assert known.calibration is task.calibration


@pytest.mark.slow
@pytest.mark.parametrize("floor", ["100 counts", "1000 counts"])
def test_a_start_that_differs_from_the_detection_distance_is_advised_first_and_the_chain_goes_on(
    floor: str, tmp_path: Path
) -> None:
    document: Document = tomllib.loads(FILE.replace('"2500 counts"', f'"{floor}"').replace("runs = 300", "runs = 60"))
    verdict = pt.verify(load(document, tmp_path))
    assert verdict.approach is not None
    assert not verdict.approach.is_met
    advice = verdict.advice
    assert advice is not None
    assert (advice.kind, advice.status) == ("start", None)
    assert set(advice.settings) <= {"obstacle.position", "obstacle.velocity", "controller.floor"}
    after = pt.verify(load(follow(document, dict(advice.settings)), tmp_path), changes=False)
    assert after.approach is None
    assert after.gain is not None


@pytest.mark.slow
def test_with_an_uncertain_start_the_floor_is_advised_that_detects_there(tmp_path: Path) -> None:
    """Another start would need another distribution, so only the floor can change."""
    text = FILE.replace('"2500 counts"', '"100 counts"').replace("runs = 300", "runs = 60")
    document: Document = tomllib.loads(text)
    document["uncertainty"]["obstacle"]["position"] = {"uniform": ["40 mm", "44.4 mm"]}
    advice = pt.verify(load(document, tmp_path)).advice
    assert advice is not None
    assert advice.kind == "start"
    assert set(advice.settings) == {"controller.floor"}
    assert "position" not in advice.sentence
    after = pt.verify(load(follow(document, dict(advice.settings)), tmp_path), changes=False)
    assert after.approach is None


def test_no_advice_names_a_rate_that_the_sensor_part_cannot_reach(tmp_path: Path) -> None:
    """Without the part, the same loop gets a rate of more than 250 Hz."""
    margin = FILE.replace("[verify]", "[loop]\nstability_margin = 8.0\n[verify]")
    named = margin.replace('rate = "250 Hz"\nexposure', 'part = "VCNL4010"\nexposure')
    free, held = (pt.verify(load(document(text), tmp_path), changes=False) for text in (margin, named))
    assert free.needed_rate == pytest.approx(held.needed_rate)
    assert free.needed_rate > 250
    assert re.search(r"read the sensor at \d+ Hz", free.advice.sentence)
    assert "at most 250 Hz" in held.advice.sentence
    assert "at most 250 Hz" in held.reasons[0]
    assert "VCNL4010" in gain_page(held.design).next_step
    for text, count in ((margin, 0), (named, 1)):
        strong = load(document(text), tmp_path).replace(gain=-3.0, verify=pt.designs.VerifyOptions(runs=10))
        words = " ".join(str(pt.verify(strong)).split())
        assert "a gain margin of 2 needs a sensor rate of" in words
        assert words.count("the VCNL4010 reaches at most 250 Hz") == count

    task = load(document(FILE.replace('rate = "250 Hz"\nexposure', 'part = "VCNL4010"\nexposure')), tmp_path)
    assert task.largest_sensor_rate == 250
    most = {"most": task.largest_sensor_rate}
    assert "sensor-rate" not in {one.name for one in candidates_of(task.loop, 24.0, 0.01, **most)}
    slow = replace(task.loop, chain=replace(task.loop.chain, rate=200.0))
    faster = next(one for one in candidates_of(slow, 24.0, 0.01, **most) if one.name == "sensor-rate")
    assert faster.loop.chain.rate == 250


@pytest.mark.parametrize(("rate", "count"), [("250 Hz", 0), ("251 Hz", 1)])
def test_a_rate_above_that_of_the_part_is_a_warning_of_verdict_and_export(
    rate: str, count: int, tmp_path: Path
) -> None:
    text = FILE.replace('rate = "250 Hz"\nexposure', f'part = "VCNL4010"\nrate = "{rate}"\nexposure')
    task = load(document(text), tmp_path).replace(verify=pt.designs.VerifyOptions(runs=10))
    found = pt.verify(task, changes=False)
    exported = export(task.replace(gain=found.gain), tmp_path / "law", "json", verify=False)
    infeasible = pt.verify(task.replace(constraints=[velocity_limit(1e-3)]), changes=False)
    assert infeasible.gain is None
    for warnings in (found.warnings, found.design.warnings, infeasible.warnings, export_page(exported).warnings):
        assert sum(split_code(one)[0] == "PT418" for one in warnings) == count


def test_only_a_rate_that_the_source_of_a_part_states_is_a_limit() -> None:
    parts = pt.simulation.PARTS.values()
    unknown = {part.name for part in parts if np.isinf(part.largest_rate)}
    assert unknown == {"RPR-220", "APDS-9960"}
    assert all(part.largest_rate == part.chain.rate for part in parts if part.name not in unknown)


@pytest.mark.slow
@pytest.mark.parametrize("uncertain", [True, False])
def test_the_rate_of_a_required_margin_is_advised_with_the_settings_that_hold_at_it(
    uncertain: bool, tmp_path: Path
) -> None:
    """A certain encounter needs only the rate; uncertain ones need another gain and a changed loop, too."""
    file = document((Path(__file__).parents[2] / "examples/loop.toml").read_text(encoding="utf-8"))
    file["chain"]["rate"] = "15 Hz"
    if not uncertain:
        del file["uncertainty"], file["robust"]
    task = load(file, tmp_path)
    found = pt.verify(task)
    assert found.gain is None
    assert found.needed_rate is not None
    settings = found.advice.settings
    assert settings["chain.rate"] == f"{rounded_up(found.needed_rate)!r} Hz"
    assert (set(settings) == {"chain.rate"}) is not uncertain
    again = pt.verify(load(follow(file, settings), tmp_path), changes=False)
    assert again.status is found.advice.status
    assert again.status.is_passed
    assert again.stability.margin >= 2
    plain = pt.verify(task, changes=False)
    assert plain.advice.sentence.endswith("the limits in simulated runs may need more")
    if uncertain:  # the gain is searched within the bounds of the file, and has the margin only on the changed loop
        faster = load(follow(file, {"chain.rate": settings["chain.rate"]}), tmp_path)
        assert again.gain < faster.stable_bounds()[0]


@pytest.mark.slow
def test_a_force_limit_that_acts_in_every_run_is_named_and_a_larger_one_is_advised(tmp_path: Path) -> None:
    file = document((Path(__file__).parents[2] / "examples/loop.toml").read_text(encoding="utf-8"))
    file["controller"]["largest_force"] = "3 N"
    task = load(file, tmp_path)
    found = pt.verify(task)
    assert found.status is pt.verification.VerdictStatus.DOES_NOT_HOLD
    assert found.mitigated.largest_virtual_force.min() == pytest.approx(3.0)
    assert any(reason.startswith("the virtual force reaches its limit of 3 N") for reason in found.reasons)
    settings = found.advice.settings
    assert set(settings) >= {"controller.gain", "controller.largest_force"}
    again = pt.verify(load(follow(file, settings), tmp_path), changes=False)
    assert again.status is found.advice.status
    assert again.mitigated.largest_virtual_force.max() < float(str(settings["controller.largest_force"]).split()[0])
    assert not any("largest_force" in text for text in (*again.reasons, *again.warnings))


def test_a_larger_force_limit_is_a_change_only_if_the_gain_needs_it(tmp_path: Path) -> None:
    """By L(2), a gain of -0.5 N s with |d ln xi / dt| = 24 1/s needs 12 N."""
    loop = load(document(FILE.replace("[robot]", 'largest_force = "11.9 N"\n[robot]')), tmp_path).loop
    change = {one.name: one for one in candidates_of(loop, 24.0, 0.01, gain=-0.5)}["largest-force"]
    assert change.loop.law == replace(loop.law, limits=replace(loop.law.limits, force=24.0))
    assert not change.is_free
    enough = replace(loop, law=replace(loop.law, limits=replace(loop.law.limits, force=12.1)))
    for one, gain in ((enough, -0.5), (loop, None), (loop, -0.4)):
        assert "largest-force" not in {each.name for each in candidates_of(one, 24.0, 0.01, gain=gain)}


@pytest.mark.slow
def test_advice_keeps_the_required_margin_if_the_part_does_not_reach_the_rate_for_it(tmp_path: Path) -> None:
    """Without the changes of the loop, the advised gain would hold as narrowly, but with about half of the margin."""
    file = document((Path(__file__).parents[2] / "examples/loop.toml").read_text(encoding="utf-8"))
    file["loop"]["stability_margin"] = 4.0
    found = pt.verify(load(file, tmp_path))
    assert found.gain is None
    assert found.needed_rate is not None
    assert found.needed_rate > 250
    settings = found.advice.settings
    assert "chain.rate" not in settings
    again = pt.verify(load(follow(file, settings), tmp_path), changes=False)
    assert again.status is found.advice.status
    assert again.status.is_passed
    assert again.stability.margin >= 4 * (1 - 5e-3)
    only_gain = load(follow(file, {"controller.gain": settings["controller.gain"]}), tmp_path)
    assert pt.verify(only_gain, changes=False).stability.margin < 3
