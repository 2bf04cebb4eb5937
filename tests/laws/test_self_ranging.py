"""The example that ranges by itself stays within its rails, keeps the weak one's guarantee, and is softer for it."""

from __future__ import annotations

import importlib.util
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch.designs.drag import DragLimits, predict_drag
from refusals import refused

PATH = Path(__file__).parents[2] / "examples" / "self_ranging.py"


@pytest.fixture(scope="module")
def example() -> Any:
    spec = importlib.util.spec_from_file_location("self_ranging", PATH)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["self_ranging"] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(("speed", "acceleration"), [(0.3, 0.0), (0.05, 0.0), (1.0, 0.0), (0.3, -0.5), (0.3, -2.0)])
def test_it_stays_within_its_rails_and_is_never_faster_than_the_weak_one(
    example: Any, speed: float, acceleration: float
) -> None:
    """On the loop, with its delay, lag and noise, run by run beside the constant weak drag with the same noise."""
    chosen: list[float] = []

    class Noted(example.SelfRanging):
        def _chosen(self, *given: Any) -> float:
            chosen.append(super()._chosen(*given))
            return chosen[-1]

    rails = example.RAILS
    found, way = example.encounters(Noted(drag=example.NOISE, rails=rails), speed, acceleration, runs=5)
    weak, least = example.encounters(example.NOISE.with_value(rails.weak.drag), speed, acceleration, runs=5)
    assert len(chosen) > 250
    assert rails.weak.drag <= min(chosen) <= max(chosen) <= rails.strong.drag
    assert (found <= weak * (1 + 1e-9)).all()  # equal to rounding where it stays at the weak rail
    assert (way >= least * (1 - 1e-9)).all()


@pytest.mark.parametrize(("speed", "acceleration"), [(0.3, 0.0), (1.0, 0.0), (0.3, -0.5), (0.3, -2.0)])
def test_without_noise_and_delay_it_keeps_the_bound_of_the_weak_rail(
    example: Any, speed: float, acceleration: float
) -> None:
    """At 4 kHz, where a constant drag is within 1 % of its continuous ratio (test_control_drag.py)."""
    law = example.SelfRanging(
        drag=pt.control.VirtualDrag(drag=1.0, noise=0.0, smoothing_time=5e-4), rails=example.RAILS
    )
    controller = pt.control.Controller(
        period=2.5e-4,
        conditioning=pt.control.Conditioning(floor=100.0),
        law=law,
        admittance=pt.control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=example.START, velocity=-speed, acceleration=acceleration),
    )
    found = pt.simulation.simulate_loop(scenario, example.SENSOR, controller, chain=pt.SensorChain(rate=4000.0))
    assert -found.relative_velocity <= 1.01 * example.RAILS.contact_speed_bound(speed, -acceleration)


@pytest.mark.slow
def test_it_is_softer_than_the_constant_drag_that_gives_way_as_far(
    example: Any, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The study found 17 %: 50 instead of 60 mm/s at 40 mm. The 50 runs here show it with an error of about 1.6 %."""
    monkeypatch.setattr(example, "encounters", partial(example.encounters, runs=10))
    example.main()
    rows = {line[:22].strip(): np.array(line[22:].split(), float) for line in capsys.readouterr().out.splitlines()[2:]}
    assert list(rows) == [f"{v:g} m/s, {a:g} m/s^2" for v, a in example.SETTINGS]
    speed, _, way, constant, _, its_way = rows["0.3 m/s, 0 m/s^2"]
    assert way == pytest.approx(its_way, rel=0.02)
    assert 0.78 < speed / constant < 0.88
    accelerated = rows["0.3 m/s, -2 m/s^2"]
    assert accelerated[0] > accelerated[3]  # it stays at its weak rail


def test_a_curve_that_tells_no_distance_is_refused(example: Any) -> None:
    curve = pt.ExponentialFirstOrder(scale=1.0, rate=-60.0)
    rails = DragLimits(weak=predict_drag(curve, 0.04, 1.0, 0.005), strong=predict_drag(curve, 0.04, 1.0, 0.01))
    with refused("sensor"):
        example.SelfRanging(drag=example.NOISE, rails=rails)


def test_it_is_a_law_as_others_are(example: Any) -> None:
    law = example.SelfRanging(drag=example.NOISE, rails=example.RAILS)
    assert law.with_value(0.01).value == 0.01
    assert law.with_value(0.01).rails.strong == law.rails.strong
    assert law.start() == law.start()
