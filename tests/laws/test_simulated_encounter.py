"""One run of the loop beside its prediction: the numbers are those of the two, and nothing else."""

from __future__ import annotations

import dataclasses
import json
import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from figure_checks import assert_legible
from loop_samples import Answer, BareLaw, bare_step
from page_rows import line
from pretouch._core.files import as_json
from pretouch._core.units import format_quantity
from pretouch.control import Conditioning, Controller, Limits, VirtualAdmittance, VirtualDamper
from pretouch.report import plots
from pretouch.simulation import ClosedLoop
from refusals import refused

ADMITTANCE = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
SCENARIO = pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=0.0422, velocity=-0.3))
POWER = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
CONSTANT = pt.ExponentialFirstOrder(scale=1.0, rate=-60.0)
ROBOT = pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0)
SOFT_ROBOT = pt.simulation.ImpedancePlant(mass=1.5, stiffness=60.0, damping=2.0)
CONTACT = pt.simulation.HuntCrossley(stiffness=2e6, dissipation=1.0)
IMPACT = pt.HertzImpact(robot_mass=2.0, effective_modulus=1e7, radius=0.0225)
GAIN = -0.7
EXAMPLES = Path(__file__).parents[2] / "examples"


def law(floor: float = 1e-3, limits: Limits | None = None, period: float = 1e-3, **conditioning: Any) -> Controller:
    return Controller(
        period=period,
        conditioning=Conditioning(floor=floor, **conditioning),
        law=VirtualDamper(gain=-99.0),  # never tried: a loop puts the gain of the encounter in its place
        admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        limits=limits or Limits(),
    )


def loop(**given: Any) -> ClosedLoop:
    return ClosedLoop(**{"law": law(), "chain": pt.SensorChain(rate=1000.0), **given})


def compared(encounter: pt.verification.SimulatedEncounter) -> dict[str, tuple[float | None, ...]]:
    return {row.name: row.values for row in encounter.comparisons}


@pytest.mark.parametrize("sensor", [POWER, CONSTANT], ids=["any curve", "constant slope"])
def test_compared_numbers_are_those_of_simulate_and_find_contact(sensor: pt.sensors.SensorModel) -> None:
    built = loop(chain=pt.SensorChain(rate=250.0, noise=1e-3, delay=1e-3), law=law(sensor_period=4e-3), plant=ROBOT)
    rows = compared(pt.simulate(pt.Task(SCENARIO, sensor, loop=built, gain=GAIN)))
    assert list(rows) == ["time", "relative_velocity", "position", "largest_excursion", "largest_virtual_force"]
    runs = [
        pt.simulation.simulate_loop(SCENARIO, sensor, built.law.with_value(g), chain=built.chain, plant=ROBOT)
        for g in (GAIN, 0.0)
    ]
    solved = [pt.find_contact(SCENARIO, sensor, g).end for g in (GAIN, 0.0)]
    for name, row in rows.items():
        assert row == (
            *(getattr(source[0], name) for source in (runs, solved)),
            *(getattr(source[1], name) for source in (runs, solved)),
        )


def test_differences_are_of_the_loop_against_the_prediction() -> None:
    row = pt.simulate(pt.Task(SCENARIO, POWER, loop=loop(), gain=GAIN)).comparison("relative_velocity")
    assert row.loop is not None
    assert row.predicted is not None
    assert row.difference == row.loop - row.predicted
    assert row.relative_difference == pytest.approx(row.loop / row.predicted - 1)  # both approach
    # the loop is late by one period: its error is of the first order in T, 0.7 T in time
    # (docs/explanation/simulation.md)
    assert abs(row.relative_difference) < 0.02


def test_contact_quantities_are_those_of_the_loop_and_of_the_impact_model() -> None:
    built = loop(plant=ROBOT, contact=CONTACT)
    encounter = pt.simulate(pt.Task(SCENARIO, POWER, loop=built, gain=GAIN, impact=IMPACT))
    rows = compared(encounter)
    for name in ("impact_force", "peak_force", "impulse"):
        assert rows[name][0] == getattr(encounter.run, name)
        assert rows[name][2] == getattr(encounter.unmitigated, name)
    assert rows["impact_force"][1] == IMPACT.peak_force(encounter.prediction.end.relative_velocity)
    assert rows["impact_force"][3] == IMPACT.peak_force(-0.3)
    assert rows["peak_force"][1] is None
    without = compared(pt.simulate(pt.Task(SCENARIO, POWER, loop=built, gain=GAIN)))
    assert without["impact_force"] == (rows["impact_force"][0], None, rows["impact_force"][2], None)


def test_both_runs_meet_the_same_noise() -> None:
    """A reading a period, without exposure and delay, is xi of the distance at that step and its own noise."""
    noisy = pt.SensorChain(rate=1000.0, noise=2e-3)

    def noise(trace: pt.simulation.LoopTrace) -> Any:
        return trace.reading - POWER.output(trace.distance)

    one = pt.simulate(pt.Task(SCENARIO, POWER, loop=loop(chain=noisy), gain=GAIN))
    with_gain, without = noise(one.trace), noise(one.unmitigated_trace)
    count = min(len(with_gain), len(without))
    assert count > 100
    # ln xi is tabulated to 1e-12, and xi is below 0.5
    assert with_gain[:count] == pytest.approx(without[:count], abs=1e-11)
    assert np.std(without) == pytest.approx(2e-3, rel=0.3)  # of 140 readings: 5 standard errors
    other = pt.simulate(pt.Task(SCENARIO, POWER, loop=loop(chain=noisy, seed=1), gain=GAIN))
    assert not np.allclose(noise(other.trace)[:count], with_gain[:count], atol=1e-5)


def test_the_law_sees_the_object_where_a_reading_first_exceeds_its_floor() -> None:
    reach = 0.020
    chain = pt.SensorChain(rate=200.0, delay=2e-3)
    floor = float(CONSTANT.output(reach))
    encounter = pt.simulate(
        pt.Task(SCENARIO, CONSTANT, loop=loop(law=law(floor, sensor_period=5e-3), chain=chain), gain=GAIN)
    )
    seen = encounter.detection
    assert seen is not None
    assert seen.time == encounter.run.detection_time
    # nothing has moved the robot: the object is where it would be, and was within reach one delay before, but not
    # another period of the sensor before that
    assert seen.distance == pytest.approx(0.0422 - 0.3 * seen.time, abs=1e-12)
    assert reach - 0.3 * (2e-3 + 5e-3 + 1e-3) <= seen.distance <= reach - 0.3 * 2e-3 + 1e-12
    assert seen.start_distance == 0.0422
    assert seen.time_left == encounter.run.time - seen.time
    # of a constant slope, ln xi changes with the distance: L(5)
    assert seen.missed_share == pytest.approx(1 - seen.distance / 0.0422, abs=1e-12)
    assert encounter.warnings[0].startswith("PT421")
    assert all(distance in encounter.warnings[0] for distance in ("20 mm", "42.2 mm"))


def speeds_by_reach(*reaches: float) -> list[float]:
    """Contact speeds where the law sees the object from these distances on, and where it says so."""
    found = []
    for reach in reaches:
        encounter = pt.simulate(
            pt.Task(SCENARIO, CONSTANT, loop=loop(law=law(float(CONSTANT.output(reach)))), gain=GAIN)
        )
        assert encounter.detection is not None
        assert encounter.detection.missed_share == pytest.approx(
            1 - reach / 0.0422, abs=0.3 * 1e-3 / 0.0422 + 1e-9
        )  # a step of the law
        found.append(abs(encounter.run.relative_velocity))
    return found


def test_an_object_that_is_seen_in_the_last_moment_is_met_as_without_mitigation() -> None:
    speeds = speeds_by_reach(0.01, 0.005, 0.002, 0.0005)
    assert speeds == sorted(speeds)
    assert speeds[0] < 0.2
    # the whole impulse that is left, D_p g l = 0.021 N s, takes 0.021 m/s off the 0.3 m/s of a mass of 1 kg
    assert 0.3 - 0.7 * 60 * 0.0005 <= speeds[-1] < 0.3


def test_an_object_that_is_seen_earlier_is_not_always_met_softer() -> None:
    """Giving way early winds up the spring of the admittance, which brings the robot back before the contact."""
    far, near = speeds_by_reach(0.04, 0.02)
    assert near < far


def test_a_law_that_sees_nothing_is_said_to_see_nothing() -> None:
    encounter = pt.simulate(pt.Task(SCENARIO, POWER, loop=loop(law=law(floor=10.0)), gain=GAIN))
    assert encounter.detection is None
    assert "never detected" in encounter.warnings[0]
    rows = compared(encounter)
    assert rows["relative_velocity"][0] == rows["relative_velocity"][2]
    assert encounter.to_dict()["detection"] is None


def test_repeated_contacts_are_told_one_by_one() -> None:
    built = loop(plant=SOFT_ROBOT, contact=pt.simulation.HuntCrossley(stiffness=1e7, dissipation=0.3), follow_time=0.2)
    encounter = pt.simulate(pt.Task(SCENARIO, POWER, loop=built, gain=-0.3))
    run, contacts = encounter.run, encounter.contacts
    assert len(contacts) == run.contacts > 2
    assert contacts[0].time == run.time
    assert contacts[0].relative_velocity == run.relative_velocity
    assert contacts[0].rebound_velocity == run.rebound_velocity
    assert max(c.peak_force or 0.0 for c in contacts) == run.peak_force
    # the same numbers, added in another order
    assert sum(c.impulse or 0.0 for c in contacts) == pytest.approx(run.impulse, rel=1e-12)
    for before, after in pairwise(contacts):
        assert before.duration is not None
        assert before.time + before.duration < after.time
    assert any(f"There are {run.contacts} contacts" in warning for warning in encounter.warnings)
    assert f"{run.contacts} contacts." in encounter.headline


def test_a_contact_that_lasts_has_no_end() -> None:
    encounter = pt.simulate(pt.Task(SCENARIO, POWER, loop=loop(plant=ROBOT, contact=CONTACT), gain=GAIN))
    last = encounter.contacts[-1]
    assert last.rebound_velocity is None
    assert " in contact at the end " in line(str(encounter), f"after {format_quantity(last.time, 's')}")
    first = encounter.unmitigated_contacts[0]
    assert (first.time, first.peak_force) == (
        encounter.unmitigated.time,
        pytest.approx(encounter.unmitigated.peak_force),
    )
    assert encounter.grows_after_impact
    assert "PT407" in {warning[:5] for warning in encounter.warnings}


def test_flags_say_what_was_reported_since_when_and_for_how_long() -> None:
    built = loop(law=law(float(POWER.output(0.03)), limits=Limits(force=2.0)), plant=ROBOT, contact=CONTACT)
    encounter = pt.simulate(pt.Task(SCENARIO, POWER, loop=built, gain=GAIN))
    flags, trace = {flag.name: flag for flag in encounter.flags}, encounter.trace
    assert set(flags) == {"detecting", "force-limited", "in-contact"}
    assert next(iter(flags)) == "detecting"
    assert encounter.detection is not None
    assert flags["detecting"].since == encounter.detection.time
    on = (trace.flags.astype(int) & 64) != 0
    assert flags["force-limited"].since == trace.time[on][0]
    assert flags["force-limited"].duration == pytest.approx(1e-3 * on.sum())
    assert flags["force-limited"].approach_duration == pytest.approx(
        1e-3 * (on & (trace.time < encounter.run.time)).sum()
    )
    assert flags["in-contact"].approach_duration == 0
    assert any(
        warning.startswith("PT409: The controller reported before contact, from ")
        and warning.partition(": raise largest_force")[0].endswith(": the virtual force was limited")
        for warning in encounter.warnings
    )
    assert not any("in-contact" in warning for warning in encounter.warnings)


def loud_step(parameters: Any, state: Any, sample: Any) -> Any:
    """The bare law with a flag of its own."""
    state, answer = bare_step(parameters, state, sample)
    return state, Answer(
        answer.position, answer.velocity, answer.acceleration, answer.virtual_force, answer.log_level, 4097
    )


@dataclass(frozen=True)
class LoudLaw(BareLaw):
    """A law of a user's own: nothing of pretouch.control is in it."""

    @property
    def step(self) -> Any:
        return loud_step

    def with_value(self, value: float) -> LoudLaw:
        return dataclasses.replace(self, gain=value)


def test_any_law_can_be_looked_at() -> None:
    encounter = pt.simulate(pt.Task(SCENARIO, POWER, loop=loop(law=LoudLaw(0.0, 1e-3)), gain=GAIN))
    # as close as the law of pretouch.control is: an error of the first order in T
    assert abs(encounter.comparison("relative_velocity").relative_difference or 1.0) < 0.02
    assert [flag.name for flag in encounter.flags] == ["detecting", "flag-4096"]
    assert encounter.detection is not None
    assert encounter.detection.time == 0
    assert line(str(encounter), "The object was detected at the start,").startswith("at 42.2 mm")
    assert encounter.warnings == ()


def test_a_loop_that_runs_away_says_so() -> None:
    with np.errstate(over="ignore"):
        encounter = pt.simulate(pt.Task(SCENARIO, POWER, loop=loop(law=LoudLaw(0.0, 1e-3)), gain=-1e308))
    assert encounter.run.status is pt.motion.ContactStatus.UNRESOLVED
    assert encounter.headline.startswith("The simulated loop diverges: its values exceed all bounds after ")
    assert json.loads(as_json(encounter.to_dict()))["status"] == "unresolved"
    assert_legible(plots.simulation(encounter))


def test_runs_that_do_not_come_to_a_contact_say_so() -> None:
    short = pt.simulate(pt.Task(SCENARIO, POWER, loop=loop(horizon=0.2), gain=GAIN))
    assert short.headline.startswith(
        "The run on the simulated loop ends after 200 ms without contact; the smallest distance is "
    )
    assert "predicted 0.0815 m/s" in short.headline
    assert compared(short)["time"][:2] == (None, short.prediction.end.time)
    assert compared(short)["closest_distance"][:3] == (short.run.closest_distance, 0.0, 0.0)
    assert short.comparison("time").difference is None
    assert short.motion.time[-1] == short.prediction.end.time
    assert short.unmitigated_motion.time[-1] == short.unmitigated_prediction.end.time
    free = pt.Admittance(mass=1.0, damping=10.0, stiffness=0.0)
    thrown = pt.Scenario(admittance=free, obstacle=pt.Obstacle(position=0.0422), plant=pt.Plant(velocity=0.5))
    built = loop(law=dataclasses.replace(law(), admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=0.0)))
    never = pt.simulate(pt.Task(thrown, POWER, loop=built, gain=-0.9))
    assert never.prediction.status is pt.motion.ContactStatus.NEVER
    assert "predicted: never in contact" in never.headline
    assert compared(never)["largest_excursion"][1] is None
    assert never.contacts == ()
    # an error of the first order in T: l' changes by 20 / s, so by 2 % in a period of 1 ms
    nearest = never.comparison("closest_distance")
    assert nearest.loop == pytest.approx(nearest.predicted, rel=0.02)


def test_the_headline_is_made_of_the_numbers() -> None:
    encounter = pt.simulate(pt.Task(SCENARIO, POWER, loop=loop(), gain=GAIN))
    speed, time = encounter.comparison("relative_velocity"), encounter.comparison("time")
    assert speed.relative_difference is not None
    assert time.difference is not None
    higher = "higher" if speed.relative_difference > 0 else "lower"
    later = "later" if time.difference > 0 else "earlier"
    assert encounter.headline == (
        f"Contact on the loop at {abs(encounter.run.relative_velocity):.3g} m/s; predicted 0.0815 m/s "
        f"({abs(100 * speed.relative_difference):.2g} % {higher} and "
        f"{abs(1e3 * time.difference):.2g} ms {later} on the loop); "
        "without mitigation 0.3 m/s."
    )


def test_an_encounter_is_one_json_object_one_line_and_a_report() -> None:
    encounter = pt.simulate(pt.Task(SCENARIO, POWER, loop=loop(plant=ROBOT, contact=CONTACT), gain=GAIN, impact=IMPACT))
    found = json.loads(as_json(encounter.to_dict()))
    assert found["status"] == "contact"
    assert found["loop"]["time"] == encounter.run.time
    assert found["predicted"]["time"] == encounter.prediction.end.time
    assert found["setup"]["plant"] == {"model": "ImpedancePlant", **found["setup"]["plant"]}
    assert found["setup"]["plant"]["bandwidth"] is None
    assert {row["name"] for row in found["comparisons"]} >= {"time", "relative_velocity", "impact_force"}
    assert repr(encounter) == f"<SimulatedEncounter: {encounter.headline}>"
    assert str(encounter).startswith(encounter.headline)
    assert "<table>" in encounter._repr_html_()


@pytest.mark.slow
def test_an_obstacle_with_a_course_is_run_and_predicted(tmp_path: Path) -> None:
    """The example comes, stops at 28 mm, and comes again: by its stretches at 0.3 m/s, from 0.4 s on."""
    encounter = pt.simulate(pt.load_scenario(EXAMPLES / "course.toml"))
    # 42.2 mm: 10 mm and 4 mm until it is at rest, 15 mm while it comes again, 13.2 mm at 0.3 m/s; the robot rests
    assert encounter.unmitigated.time == pytest.approx(0.444, abs=1e-9)
    assert encounter.unmitigated.relative_velocity == pytest.approx(-0.3, abs=1e-9)
    assert encounter.unmitigated_prediction.contact.time == pytest.approx(0.444, abs=1e-9)
    assert encounter.unmitigated_prediction.contact.relative_velocity == pytest.approx(-0.3, abs=1e-9)
    assert encounter.run.time > encounter.unmitigated.time
    # the loop detects the object 20 ms late and samples it at its rate, so it agrees within a few percent
    assert encounter.run.time == pytest.approx(encounter.prediction.contact.time, rel=0.05)
    assert "predicted" in encounter.headline
    assert json.loads(as_json(encounter.to_dict()))["predicted"]["status"] == "contact"
    pt.report.write_report(encounter, tmp_path / "run.html")
    assert "Of the prediction" in (tmp_path / "run.html").read_text(encoding="utf-8")
    assert_legible(plots.simulation(encounter))
    assert encounter.motion.distance[-1] == 0.0


def test_an_encounter_that_cannot_be_asked_for_is_refused() -> None:
    many = pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=0.0422, velocity=[-0.3, -0.4]))
    with refused("scenario"):
        pt.simulate(pt.Task(many, POWER, loop=loop(), gain=GAIN))
    with refused("gain"):
        pt.simulate(pt.Task(SCENARIO, POWER, loop=loop(), gain=[-0.7, -0.8]))  # type: ignore[arg-type]
    with refused("gain"):
        pt.simulate(pt.Task(SCENARIO, POWER, loop=loop(), gain=math.nan))
    with refused("name", value="speed"):
        pt.simulate(pt.Task(SCENARIO, POWER, loop=loop(), gain=GAIN)).comparison("speed")
