"""Whether a calibration is good enough for a gain: the gain on the sensors that its readings allow."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from page_checks import assert_sound
from page_rows import row
from pretouch._core.files import as_json
from pretouch._core.units import format_quantity
from pretouch.report import report_html
from scenario_text import ENCOUNTER
from verification_samples import BOUNDS, OBJECTIVE, SCENARIO, SENSOR, loop_of, velocity_limit

pytestmark = pytest.mark.usefixtures("short_rest")

SCENE = (
    """\
[sensor]
calibration = "sensor.csv"
maximum_distance = "45 mm"
"""
    + ENCOUNTER
    + """\
[constraints]
relative_velocity = "0.1 m/s"
[chain]
rate = "1 kHz"
[controller]
rate = "1 kHz"
[verify]
runs = 20
"""
)
ON_ITS_LIMIT = SCENE.replace("0.1 m/s", "0.075 m/s")


def write_scene(folder: Path, text: str, *, far: float, no_object: bool, seed: int = 0) -> Path:
    """Write a scenario with its calibration: the letter's curve on a pedestal, 8 distances, 4 readings at each."""
    rng = np.random.default_rng(seed)
    rows = ["distance [mm],output [V]"]
    for distance in np.linspace(0, far, 8):
        rows += [f"{1e3 * distance:.6f},{y:.6f}" for y in SENSOR.output(distance) + 0.05 + 1e-3 * rng.normal(size=4)]
    rows += [f"inf,{0.05 + 1e-3 * rng.normal():.6f}" for _ in range(50)] if no_object else []
    (folder / "sensor.csv").write_text("\n".join(rows) + "\n")
    (folder / "scene.toml").write_text(text)
    return folder / "scene.toml"


@pytest.mark.slow
def test_a_calibration_with_its_offset_holds(tmp_path: Path) -> None:
    """The readings know g within 1 %, and contact moves by less: no sensor that they allow is 15 % off."""
    file = write_scene(tmp_path, SCENE, far=0.06, no_object=True)
    problem = pt.load_scenario(file)
    assert problem.calibration.verdict == "usable"
    found = pt.verify(problem, changes=False)
    check = found.calibration_check
    assert found.status.value == "holds"
    assert check.is_good_enough
    assert (check.failing, check.decisive, check.remedy) == (0, "", "")
    assert check.low <= check.median <= check.high < 1.05 * check.predicted
    assert check.text in str(found)
    assert found.to_dict()["calibration_check"]["draws"] == check.draws == 100


@pytest.mark.slow
def test_a_calibration_whose_offset_is_withheld_is_not_good_enough(tmp_path: Path) -> None:
    """8 distances up to 14 mm, extended to 45 mm: many more sensors fail where the offset is withheld."""
    file = write_scene(tmp_path, ON_ITS_LIMIT, far=0.014, no_object=True, seed=4)
    known = pt.verify(pt.load_scenario(file), changes=False).calibration_check
    assert known.failing < 20
    file = write_scene(tmp_path, ON_ITS_LIMIT, far=0.014, no_object=False, seed=4)
    problem = pt.load_scenario(file)
    found = pt.verify(problem, changes=False)
    check = found.calibration_check
    assert found.status is pt.verification.VerdictStatus.DOES_NOT_HOLD
    assert check.reason in found.reasons
    assert f"  {check.reason}\n" in str(found)
    assert check.failing > 2 * known.failing
    assert (check.decisive, check.draws) == ("offset", 100)
    assert (
        check.remedy
        == "record readings without an object in range, and add these readings to the calibration as its argument "
        "`no_object`"
    )
    assert check.high > 1.15 * check.predicted
    page = report_html(found, calibration=problem.calibration)
    assert_sound(page)
    harder = row(page, "sensors with a contact more than 15 % harder", "Is the calibration good enough?")
    assert harder == [f"{check.harder_count} of 100"]
    told = json.loads(as_json(found.to_dict()))["calibration_check"]
    assert (told["is_good_enough"], told["decisive"]) == (False, "offset")
    assert told["failing"] == check.failing
    assert told["high"] == pytest.approx(check.high)


@dataclass(frozen=True)
class Drawn:
    sensor: pt.sensors.SensorModel
    offset: float
    ignored: float | None = None


@dataclass(frozen=True)
class Allowed:
    """Curves that somebody else draws: a function of a generator makes each."""

    make: Callable[[np.random.Generator], Drawn]

    def draw(self, count: int, seed: int) -> tuple[Drawn, ...]:
        rng = np.random.default_rng(seed)
        return tuple(self.make(rng) for _ in range(count))

    through_readings = draw


@cache
def report() -> pt.calibration.CalibrationReport:
    """The letter's curve without noise, its offset of 0.05 known."""
    distance = np.linspace(0, 0.06, 20)
    outputs = SENSOR.output(distance) + 0.05
    calibration = pt.Calibration(distances=distance, outputs=outputs, no_object=[0.05, 0.05, 0.05], unit="V")
    return pt.fit(calibration, models=("inverse-power",))


def judged(
    make: Callable[[np.random.Generator], Drawn], sensor: Any = SENSOR, **options: Any
) -> pt.verification.Verdict:
    """Judge the letter's gain with a calibration that allows these curves."""
    known = replace(report(), curves=Allowed(make))
    chain = {"offset": 0.05} | options.pop("chain", {})
    loop = loop_of(rate=1000.0, conditioning={"offset": 0.05, "floor": 1e-3}, **chain)
    return pt.verify(
        pt.Task(
            SCENARIO,
            sensor,
            OBJECTIVE,
            loop=loop,
            bounds=BOUNDS,
            verify=pt.designs.VerifyOptions(runs=2),
            calibration=known,
            **options,
        ),
        changes=False,
    )


def drawn(exponent: float = 3.32, offset: float = 0.0) -> Drawn:
    own = report().offset.value
    curve = replace(SENSOR, exponent=exponent, minimum_distance=0.0, maximum_distance=0.06)
    return Drawn(sensor=curve, offset=own + offset)


def fitted_one(_rng: np.random.Generator) -> Drawn:
    return drawn()


def test_curves_that_are_the_fitted_one_promise_what_it_promises() -> None:
    found = judged(fitted_one)
    check = found.calibration_check
    assert (check.low, check.median, check.high) == pytest.approx((check.predicted,) * 3, rel=1e-5)
    assert check.predicted == pytest.approx(found.comparison("relative_velocity").simulated.mean, rel=0.01)
    assert check.failing == 0
    assert report().verdict == "usable"
    assert (found.status.value, found.reasons) == ("holds", ())


@pytest.mark.slow
def test_what_matters_most_is_what_is_open() -> None:
    """Each of the three alone, wide enough to move contact by far more than 15 %."""
    found = judged(lambda rng: drawn(exponent=rng.uniform(1.0, 5.0)))
    curve = found.calibration_check
    assert found.status is pt.verification.VerdictStatus.DOES_NOT_HOLD
    assert found.reasons == (curve.reason,)
    assert curve.reason in found.headline
    assert not curve.is_good_enough
    assert curve.decisive == "curve"
    assert curve.remedy.startswith("record readings at more distances, and more readings at each distance around ")
    offset = judged(lambda rng: drawn(offset=rng.normal(0.0, 0.1))).calibration_check
    assert offset.decisive == "offset"
    assert offset.remedy.startswith("record more readings without an object in range")
    misfit = judged(fitted_one, chain={"misfit": 0.2, "misfit_length": 0.006}).calibration_check
    assert misfit.decisive == "misfit"
    assert "with steps of at most 6 mm between distances" in misfit.remedy
    for check in (curve, offset, misfit):
        assert check.failing >= max(check.harder_count, check.broken, check.missing) > 0
        assert check.failing <= check.harder_count + check.broken + check.missing


@pytest.mark.slow
def test_a_limit_counts_as_missed_only_where_the_calibration_moves_it() -> None:
    """The gain is on its limit: with every second curve it misses that by a little, which no calibration mends."""
    little = {"constraints": [velocity_limit(0.07)]}
    near = judged(lambda rng: drawn(exponent=rng.normal(3.32, 0.01)), **little)
    assert near.calibration_check.high > 0.07
    assert near.calibration_check.broken == 0
    far = judged(lambda rng: drawn(exponent=rng.normal(3.32, 0.5)), **little)
    assert far.calibration_check.broken > 5
    assert any("a limit is missed with " in reason for reason in far.reasons)


def test_drawn_curves_are_sunk_and_extended_as_the_fitted_one() -> None:
    recessed = pt.Recessed(sensor=replace(SENSOR, minimum_distance=0.005, maximum_distance=0.06), recess=0.005)

    def nearby(rng: np.random.Generator) -> Drawn:
        return replace(drawn(), sensor=replace(SENSOR, minimum_distance=0.006, maximum_distance=0.05))

    check = judged(nearby, recessed).calibration_check
    assert (check.low, check.high) == pytest.approx((check.predicted,) * 2, rel=1e-5)


def test_without_a_calibration_or_with_too_few_readings_nothing_is_said() -> None:
    loop = loop_of(rate=1000.0)
    given: dict[str, Any] = {"bounds": BOUNDS, "verify": pt.designs.VerifyOptions(runs=2)}
    assert pt.verify(pt.Task(SCENARIO, SENSOR, OBJECTIVE, loop=loop, **given), changes=False).calibration_check is None
    few = replace(report(), curves=None)
    found = pt.verify(pt.Task(SCENARIO, SENSOR, OBJECTIVE, loop=loop, calibration=few, **given), changes=False)
    assert found.calibration_check is None
    assert any(
        "too few to check whether the calibration is good enough: record readings at more distances" in warning
        for warning in found.warnings
    )
    assert found.to_dict()["calibration_check"] is None


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(("exponent", "way"), [(3.0, "softer"), (3.5, "harder"), (3.32, "")])
def test_a_prediction_outside_of_the_range_of_the_sensors_is_explained(exponent: float, way: str) -> None:
    """A flatter curve brakes less, so that contact is harder than on the fitted curve, but by less than 15 %."""
    check = judged(lambda _: drawn(exponent)).calibration_check
    assert check is not None
    assert check.is_good_enough
    on_loop, in_time = (format_quantity(v, "m/s", 3) for v in (check.predicted, check.witness.predicted))
    assert f"On the sampled loop without noise, the contact speed is {on_loop} with the fitted curve" in check.text
    assert "in continuous time: on 98 % of the sensor curves that fit the readings, the contact speed is " in check.text
    assert f"The fitted curve predicts {in_time}" in check.text
    assert (f"the fitted curve predicts a {way} contact than most of these sensors" in check.text) is bool(way)
    assert (
        ". This prediction is outside of the range. A difference of up to 15 % counts as agreement." in check.text
    ) is bool(way)
    assert (" A contact that is up to 15 % harder counts as agreement." in check.text) is (way == "softer")
