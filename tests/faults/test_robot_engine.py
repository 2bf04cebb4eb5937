"""Errors and warnings of MuJoCo in compiled runs of robots."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pretouch.control import Output
from pretouch.errors import InvalidInputError
from pretouch.robots import ComputedTorque, SensorSite, SiteLaw, simulate_robot
from pretouch.robots.compiled_run import Runner
from pretouch.robots.engine import Engine, address_of, contact_list, engine
from pretouch.robots.run_scene import RunScene
from pretouch.simulation import SensorChain
from robot_scenes import CURVE, controller, slide_with_ball

mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

LAW = SiteLaw(site=SensorSite("tip", CURVE), controller=controller())


def runner_of(scene: Any) -> Runner:
    options: dict[str, Any] = {"tracking": ComputedTorque(), "centering": None, "horizon": 5.0, "follow_time": 0.02}
    return Runner(RunScene.of(*scene, [LAW], **options), seed=0)


def test_an_error_of_mujoco_ends_the_run_and_not_the_process() -> None:
    """mju_error takes the place of mj_step1; the model, which starts with a small number, is its message."""
    runner, own = runner_of(slide_with_ball(1.0, 0.3, floats=False)), Engine.from_buffer_copy(engine())
    library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco*"))))
    own.step1 = ctypes.cast(library.mju_error, ctypes.c_void_p).value
    runner._native.engine = ctypes.addressof(own)
    with pytest.raises(InvalidInputError, match="MuJoCo has stopped"):
        runner.run(0)
    runner._native.engine = ctypes.addressof(engine())
    assert runner.run(0).contacts == runner_of(slide_with_ball(1.0, 0.3, floats=False)).run(0).contacts


def test_an_unstable_simulation_is_said_and_writes_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    model, data = slide_with_ball(1.0, 0.3, floats=False)
    model.dof_damping[0] = -1e5  # an unstable joint
    result = simulate_robot(model, data, [LAW], horizon=0.01)
    assert any(warning.startswith("PT550") for warning in result.warnings)
    assert list(tmp_path.iterdir()) == []


def test_a_stable_simulation_has_no_such_warning() -> None:
    result = simulate_robot(*slide_with_ball(1.0, 0.3, floats=False), [LAW])
    assert not any(warning.startswith("PT550") for warning in result.warnings)


def test_the_list_of_contacts_is_where_mujoco_has_it() -> None:
    model, data = slide_with_ball(1.0, 0.3, floats=False, distance=-1e-4)  # the ball touches the site
    assert data.ncon == 1
    contacts = contact_list(data)
    assert ctypes.c_int32.from_address(contacts.count).value == 1
    assert data.ncon == 1
    for name, offset in zip(("geom", "flex", "pos", "frame"), contacts.fields, strict=True):
        assert contacts.start + offset == address_of(getattr(data.contact, name))
    mujoco.mj_resetData(model, data)
    assert ctypes.c_int32.from_address(contacts.count).value == 0


def test_threads_give_the_same_results_as_one_thread() -> None:
    chain = SensorChain(rate=250.0, random_phase=True, noise=1e-3)
    law = SiteLaw(site=LAW.site, controller=controller(rate=250.0), chain=chain)
    scene = slide_with_ball(1.0, 0.6, floats=False, offset=0.01)
    one = simulate_robot(*scene, [law], runs=5)
    several = simulate_robot(*scene, [law], runs=5, workers=3)
    assert several.contacts == one.contacts
    assert several.touches == one.touches
    assert len({contacts[0].excursion for contacts in zip(*one.contacts, strict=True)}) == 5


class _Failing:
    """A law in Python that raises an error in its third step."""

    period = 1e-3

    def __init__(self) -> None:
        self.steps = 0

    def step(self, _: Any, state: Any, __: Any) -> tuple[Any, Output]:
        self.steps += 1
        if self.steps > 2:
            raise RuntimeError("broken law")
        return state, Output(0.0, 0.0, 0.0, 0.0, 0.0, 0)

    def parameters(self) -> Any:
        return np.zeros(1)

    def start(self, **_: float) -> Any:
        return np.zeros(1)


def test_an_error_of_a_law_in_python_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    failing = _Failing()
    monkeypatch.setattr(SiteLaw, "running", property(lambda _: failing))
    with pytest.raises(RuntimeError, match="broken law"):
        simulate_robot(*slide_with_ball(1.0, 0.3, floats=False), [LAW])
    assert failing.steps == 3
