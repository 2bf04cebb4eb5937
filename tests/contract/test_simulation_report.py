"""What figure and report of a simulated encounter promise: legible, repeatable, self-contained, true to the run."""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from figure_checks import assert_legible, visible_texts
from loop_samples import BareLaw
from page_checks import EVIL, assert_sound, parse
from page_rows import row, table
from pretouch._core.files import is_own_unchanged
from pretouch._core.units import format_quantity
from pretouch.control import Conditioning, Controller, Limits, VirtualAdmittance, VirtualDamper
from pretouch.report import plots, report_html, write_report
from pretouch.report.blocks_html import cell_as_html
from pretouch.simulation import PARTS, ClosedLoop, ContactModel, PlantModel
from pretouch.simulation.closed_loop import contact_rows, law_rows, loop_rows
from refusals import refused

ADMITTANCE = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
SCENARIO = pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=0.0422, velocity=-0.3))
FREE = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=0.0),
    obstacle=pt.Obstacle(position=0.0422),
    plant=pt.Plant(velocity=0.5),
)
VOLTS = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
COUNTS = pt.InversePower(scale=0.13, distance_offset=0.0419, exponent=3.32)
ROBOT = pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0, bandwidth=60.0, coulomb_friction=1.0)
CONTACT = pt.simulation.HuntCrossley(stiffness=2e6, dissipation=1.0)
IMPACT = pt.HertzImpact(robot_mass=2.0, effective_modulus=1e7, radius=0.0225)


def law(period: float = 1e-3, *, stiffness: float = 25.0, limits: Limits | None = None, **given: Any) -> Controller:
    return Controller(
        period=period,
        conditioning=Conditioning(**{"floor": 0.0455, **given}),
        law=VirtualDamper(gain=0.0),
        admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=stiffness),
        limits=limits or Limits(),
    )


def run(
    sensor: pt.sensors.SensorModel = VOLTS,
    gain: float = -0.7463,
    *,
    scenario: pt.Scenario = SCENARIO,
    impact: Any = None,
    **given: Any,
) -> pt.verification.SimulatedEncounter:
    built = ClosedLoop(**{"law": law(), "chain": pt.SensorChain(rate=1000.0), **given})
    return pt.simulate(pt.Task(scenario, sensor, loop=built, gain=gain, impact=impact))


CASES: dict[str, Callable[[], pt.verification.SimulatedEncounter]] = {
    "VCNL4010 that pushes": lambda: run(
        COUNTS,
        law=law(floor=460.0, sensor_period=4e-3),
        chain=pt.simulation.sensor_part("VCNL4010").chain,
        plant=ROBOT,
        contact=CONTACT,
        impact=IMPACT,
    ),
    "ideal at 10 kHz": lambda: run(
        law=law(1e-4, median_window=10, low_pass_order=5, cutoff=500.0),
        chain=pt.simulation.sensor_part("RPR-220").chain,
    ),
    "unstable": lambda: run(
        gain=-2.0,
        law=law(sensor_period=1 / 15),
        chain=pt.simulation.sensor_part("VL53L5CX-8x8").chain,
        plant=ROBOT,
        contact=CONTACT,
    ),
    "no contact": lambda: run(gain=-0.9, scenario=FREE, law=law(stiffness=0.0)),
    "repeated": lambda: run(
        COUNTS,
        -0.3,
        law=law(floor=460.0, sensor_period=4e-3),
        chain=pt.simulation.sensor_part("VCNL4010").chain,
        plant=pt.simulation.ImpedancePlant(mass=1.5, stiffness=60.0, damping=2.0),
        contact=pt.simulation.HuntCrossley(stiffness=1e7, dissipation=0.3),
        follow_time=0.3,
    ),
    "late": lambda: run(
        law=law(floor=0.15, sensor_period=5e-3, limits=Limits(force=6.0)),
        chain=pt.SensorChain(rate=200.0, exposure=1e-3, delay=2e-3, noise=5e-3),
        plant=pt.simulation.PositionPlant(mass=2.0, bandwidth=15.0),
        contact=pt.simulation.SpringDamper(stiffness=2e4, damping=15.0, obstacle_mass=1.0),
    ),
    "never seen": lambda: run(law=law(floor=10.0)),
    "horizon": lambda: run(horizon=0.05, plant=ROBOT, contact=CONTACT),
}


@pytest.fixture(scope="module", params=CASES)
def encounter(request: pytest.FixtureRequest) -> pt.verification.SimulatedEncounter:
    return CASES[request.param]()


@pytest.fixture(scope="module")
def pushing() -> pt.verification.SimulatedEncounter:
    return CASES["VCNL4010 that pushes"]()


@pytest.mark.slow(keep=1)
def test_figures_are_legible(encounter: pt.verification.SimulatedEncounter) -> None:
    assert_legible(plots.simulation(encounter))


def test_panels_share_their_time_and_the_force_of_the_contact_has_its_own(
    pushing: pt.verification.SimulatedEncounter,
) -> None:
    *shared, impact = plots.simulation(pushing).axes
    assert [axes.get_ylabel() for axes in (*shared, impact)] == [
        "distance l [mm]",
        "relative velocity l\u2032 [m/s]",
        "virtual force F\u209a [N]",
        "sensor reading [unit of \u03be]",
        "contact force [N]",
        "contact force [N]",
    ]
    assert len({axes.get_xlim() for axes in shared}) == 1
    assert {axes.get_xlabel() for axes in shared} == {"time [ms]"}
    assert impact.get_xlabel() == "time since the first touch [ms]"
    assert impact.get_xlim()[1] < 0.1 * shared[0].get_xlim()[1]
    assert len(plots.simulation(CASES["ideal at 10 kHz"]()).axes) == 4


def test_curves_end_at_the_numbers_of_the_contact(pushing: pt.verification.SimulatedEncounter) -> None:
    """The lines of the loop pass through the first contact, those of the prediction end there."""
    distance, velocity, *_, impact = plots.simulation(pushing).axes
    free, loop, predicted = (line.get_data() for line in distance.lines[:3])
    assert [float(free[0][-1]), float(free[1][-1])] == pytest.approx([1e3 * pushing.unmitigated.time, 0.0], abs=1e-9)
    assert float(predicted[0][-1]) == pytest.approx(1e3 * pushing.prediction.end.time)
    touch = int(np.argmin(np.abs(loop[0] - 1e3 * pushing.run.time)))
    assert loop[1][touch] == pytest.approx(0.0, abs=1e-9)
    marked = [tuple(map(float, np.ravel(line.get_data()))) for line in velocity.lines if len(line.get_xdata()) == 1]
    for ending in (pushing.unmitigated, pushing.prediction.end, pushing.run):
        there = (1e3 * ending.time, ending.relative_velocity)  # a time in ms is rounded, once here and once there
        assert any(mark == pytest.approx(there, rel=4 * np.finfo(float).eps) for mark in marked)
    forces = [np.max(line.get_ydata()) for line in impact.lines[:2]]
    assert forces == pytest.approx([pushing.unmitigated.impact_force, pushing.run.impact_force], rel=2e-3)


def test_figures_show_the_numbers_of_the_run(pushing: pt.verification.SimulatedEncounter) -> None:
    texts = " ".join(text for text, _ in visible_texts(plots.simulation(pushing)))
    assert pushing.detection is not None
    for shown in (
        f"detected at {1e3 * pushing.detection.distance:.1f} mm",
        f"\u2212{abs(pushing.run.relative_velocity):.4f} m/s",
        f"\u2212{abs(pushing.prediction.end.relative_velocity):.4f} m/s",
        "\u22120.300 m/s",
        f"{pushing.run.impact_force:.1f} N",
        f"{pushing.unmitigated.impact_force:.0f} N",
        "on the loop",
        "predicted",
        "no mitigation",
        "contact",
    ):
        assert shown in texts.replace("\n", " ")


@pytest.mark.slow(keep=1)
def test_reports_are_sound_however_a_run_ends(encounter: pt.verification.SimulatedEncounter) -> None:
    page = report_html(encounter)
    words = assert_sound(page).words
    assert encounter.headline in words
    assert "Method and assumptions" in words
    assert "Whether a robot cell is acceptable is for its integrator to assess" in words
    for warning in encounter.warnings:
        assert warning in words
    for flag in encounter.flags:
        times = (flag.since, flag.duration, flag.approach_duration)
        assert row(page, flag.meaning, "Detection") == [format_quantity(t, "s", 3) for t in times]
    assert bool(table(page, "Contacts")) == (encounter.has_contact_force and bool(encounter.run.touched))
    assert ("on the loop: contact" in words) == bool(encounter.run.touched)
    ends = {"relative velocity at contact, on the loop": True, "smallest distance, on the loop": False}
    for key_figure, of_contact in ends.items():
        assert (key_figure in words) == (of_contact == bool(encounter.run.touched))


def test_a_report_contains_the_numbers_of_the_run(pushing: pt.verification.SimulatedEncounter) -> None:
    page, loop, free = report_html(pushing), pushing.run, pushing.unmitigated
    assert row(page, "relative velocity at contact l\u2032") == [
        f"{loop.relative_velocity:.4g} m/s",
        "-0.07906 m/s",
        pushing.comparison("relative_velocity").difference_in_words,
        "-0.3 m/s",
        "-0.3 m/s",
    ]
    assert row(page, "time of contact t")[:2] == [f"{1e3 * loop.time:.4g} ms", "463.6 ms"]
    elastic = IMPACT.peak_force(pushing.prediction.end.relative_velocity)
    force = row(page, "peak impact force F")
    assert force[:2] == [f"{loop.impact_force:.4g} N", f"{elastic:.4g} N"]
    assert force[3] == f"{free.impact_force:.4g} N"
    assert row(page, "peak contact force max F")[:3] == [f"{loop.peak_force:.4g} N", "\u2013", "\u2013"]
    assert row(page, "impulse of all contacts \u222bF dt")[0] == f"{loop.impulse:.4g} N s"
    assert row(page, "gain D_p") == ["-0.7463 N s"]
    assert row(page, "readings") == ["250 Hz, one every 4 ms"]
    assert row(page, "stiffness k") == ["2e+06 N/m\u207f"]
    assert table(page, "Contacts")[-1][4] == "in contact at the end"
    assert "of a lossless impact" in parse(page).words


def test_each_contact_of_a_repeated_one_is_a_row() -> None:
    repeated = CASES["repeated"]()
    _, *rows = table(report_html(repeated), "Contacts")
    assert repeated.run.contacts == len(repeated.contacts) == len(rows) > 2
    for contact, shown in zip(repeated.contacts, rows, strict=True):
        peak = f"{contact.peak_force:.4g} N"
        assert shown[:3] == [f"after {1e3 * contact.time:.4g} ms", f"{contact.relative_velocity:.4g} m/s", peak]


@pytest.mark.slow
def test_reports_repeat_and_recognize_themselves(tmp_path: Path) -> None:
    made = CASES["never seen"]()
    page = report_html(made)
    assert page == report_html(CASES["never seen"]())
    path = write_report(made, tmp_path / "run.html")
    assert path.read_text(encoding="utf-8") == page
    assert is_own_unchanged(path)
    (tmp_path / "mine.html").write_text("mine", encoding="utf-8")
    with refused(str(tmp_path / "mine.html"), error=pt.errors.OutputExistsError, remedy="--force"):
        write_report(made, tmp_path / "mine.html")


@pytest.mark.slow
def test_reports_escape_what_users_wrote_and_show_where_a_curve_is_from() -> None:
    made = CASES["never seen"]()
    report = pt.fit(pt.read_calibration(Path(__file__).parents[2] / "examples" / "sensor.csv"))
    source = {"name": f"{EVIL}.toml".replace("/", ""), "text": f"# {EVIL}", "sha256": "abc"}
    page = report_html(made, calibration=report, source=source)
    words = assert_sound(page).words
    assert "<script" not in page
    assert "Sensor calibration: sensor.csv" in words


def shown(rows: Iterable[tuple[str, Any]]) -> dict[str, str]:
    return {name: html.unescape(cell_as_html(cell)) for name, cell in rows}


def test_rows_of_a_loop_name_what_it_is_made_of_with_units() -> None:
    built = ClosedLoop(law=law(), chain=pt.SensorChain(rate=100.0), plant=ROBOT, contact=CONTACT, follow_time=0.1)
    assert shown(loop_rows(built))["time after the first contact"] == "100 ms"
    assert shown(ROBOT.rows())["bandwidth of the force servo"] == "60 Hz"
    assert shown(contact_rows(CONTACT))["dissipation a"] == "1 s/m"
    assert shown(contact_rows(pt.simulation.SpringDamper(stiffness=1e4, obstacle_mass=1.5)))["obstacle"] == "of 1.5 kg"
    assert list(contact_rows(None)) == [("contact", "no contact force: a run ends at contact")]
    rows = shown(law_rows(law(1e-4, median_window=10, low_pass_order=5, cutoff=500.0, limits=Limits(speed=0.5))))
    assert rows["running median"] == "over 10 readings"
    assert rows["low-pass"] == "Butterworth of order 5 at 500 Hz"
    assert rows["limit: largest speed"] == "0.5 m/s"
    assert rows["virtual mass M_a"] == "1 kg"
    gradual = VirtualDamper(gain=-0.5, approach_only=True, release=0.02, ramp_time=0.1)
    rows = shown(law_rows(dataclasses.replace(law(saturation=4.0, largest_rate=50.0), law=gradual)))
    assert rows["ramp of the gain"] == "100 ms"
    assert "0.02" in rows["acts"]
    assert rows["saturation level"].startswith("4 ")
    assert rows["largest plausible |d ln \u03be/dt|"] == "50 1/s"


@pytest.mark.parametrize("name", PARTS)
def test_rows_of_a_sensor_part_hold_every_number_of_its_chain(name: str) -> None:
    chain = PARTS[name].chain
    rows = shown(chain.rows())
    assert rows["readings"].startswith(f"{chain.rate:.4g} Hz")
    assert ("noise of the distance" in rows) == chain.measures_distance
    assert ("clipping" in rows) == np.isfinite(chain.highest)
    assert ("step" in rows) == bool(chain.resolution)


def test_rows_of_a_chain_name_what_can_go_wrong_in_it() -> None:
    chain = pt.SensorChain(
        rate=100.0,
        random_phase=True,
        jitter=1e-3,
        dropout=0.1,
        drift=0.5,
        offset=0.2,
        crosstalk=0.1,
        relative_noise=0.01,
        misfit=0.02,
        misfit_length=0.005,
    )
    rows = shown(chain.rows())
    assert rows["missing readings"] == "10 %"
    assert rows["jitter of an exposure"] == "1 ms"
    assert rows["drift"] == "0.5 per s, in the sensor's output unit"
    assert rows["noise relative to \u03be"] == "1 %"
    assert rows["misfit of the curve relative to \u03be"] == "2 %, random in each run, correlation length 5 mm"
    assert "in each run" in rows["first exposure"]
    assert {"ambient offset", "crosstalk"} <= set(rows)


@dataclass(frozen=True)
class OwnPlant(PlantModel):
    """A robot of a user's own."""

    def coefficients(self) -> tuple[float, ...]:
        return (3.0, 500.0, 20.0, 25.0, 0.0, 0.0, 2.0, 1e-3)


@dataclass(frozen=True, kw_only=True)
class OwnContact(ContactModel):
    """A contact force of a user's own."""

    def numbers(self) -> tuple[float, float, float, bool, float]:
        return 1e4, 30.0, 1.0, False, 1 / self.obstacle_mass


def test_rows_of_what_a_user_wrote_name_its_class_and_its_numbers() -> None:
    assert shown(law_rows(BareLaw(-0.7, 2e-3))) == {"law": "BareLaw", "period": "2 ms"}
    rows = shown(OwnPlant().rows())
    assert (rows["robot"], rows["mass"], rows["Coulomb friction"]) == ("OwnPlant", "3 kg", "2 N")
    rows = shown(contact_rows(OwnContact()))
    assert (rows["contact"], rows["damping"]) == ("OwnContact", "30, the same at any depth")
    assert rows["obstacle"] == "driven: it does not yield"
    assert shown(pt.simulation.PositionPlant(mass=2.0, bandwidth=20.0).rows())["bandwidth"] == "20 Hz"
