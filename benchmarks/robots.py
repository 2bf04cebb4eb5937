"""Compare encounters of whole robots in MuJoCo with their 1-D prediction, and measure the time of runs.

    python -m benchmarks.robots --runs 1000 --passes 10000 --workers 2

Each line has the simulated and the predicted contact speed, their difference, and the required largest difference. Then
come the time of a step of a six-axis arm next to that of MuJoCo's own step, and the time of many runs of the planar arm
in threads. The last line lists missed requirements. `--quick` takes few runs.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from pretouch.control import VirtualAdmittance, VirtualDrag
from pretouch.robots import (
    Centering,
    ComputedTorque,
    OperationalSpace,
    SensorSite,
    SiteLaw,
    load_model,
    make_data,
    simulate_robot,
)
from pretouch.robots.compiled_run import Runner
from pretouch.robots.run_scene import RunScene
from pretouch.simulation import SensorChain

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from robot_scenes import (
    ARM,
    CURVE,
    arm_with_ball,
    continuous_speed,
    controller,
    six_axis_with_ball,
    slide_with_ball,
    speed_by_shape,
)

TIP = SensorSite("tip", CURVE)
FINGERTIP = SensorSite("fingertip", CURVE, field_of_view="8 deg")
CENTERED = Centering(sites=("left", "right"), equal_reflectance=True)
SLOW = SensorChain(rate=250.0, random_phase=True, exposure=170e-6, delay=120e-6)

Row = tuple[str, float, float, float]  # name, simulated, predicted, required largest relative difference


def contact(scene: tuple[Any, Any], law: SiteLaw, **options: Any) -> tuple[float, float]:
    """The contact speeds of a run with the largest difference from its prediction: simulated and predicted [m/s]."""
    result = simulate_robot(*scene, [law], **options)
    name = law.site.name
    simulated, predicted = (np.abs(f(name, "relative_velocity")) for f in (result.simulated, result.predicted))
    worst = int(np.argmax(np.abs(simulated / predicted - 1)))
    return float(simulated[worst]), float(predicted[worst])


def arm_rows(quick: bool) -> Iterator[Row]:
    law = SiteLaw(site=FINGERTIP, controller=controller())
    for speed in (0.3,) if quick else (0.1, 0.2, 0.3, 0.45, 0.6):
        for error in (0.0,) if quick else (0.0, 0.3, -0.3):
            found = contact(arm_with_ball("bent", speed), law, tracking=ComputedTorque(model_error=error))
            yield f"arm, computed torque, {speed} m/s, mass model {100 * error:+.0f} %", *found, 0.005
        slow = SiteLaw(site=FINGERTIP, controller=controller(rate=250.0), chain=SLOW)
        found = contact(arm_with_ball("bent", speed), slow, runs=2 if quick else 20)
        yield f"arm, sensor at 250 Hz, {speed} m/s, worst run", *found, 0.03
    postures = (("bent", 0.005), ("forward", 0.005), ("stretched", math.inf))
    for posture, required in postures[:1] if quick else postures:
        found = contact(arm_with_ball(posture, 0.3), law, tracking=OperationalSpace())
        yield f"arm, operational space, {posture}", *found, required


def base_rows(quick: bool) -> Iterator[Row]:
    for mass in (1.0,) if quick else (1.0, 2.0, 5.0, 20.0):
        found = contact(slide_with_ball(mass, 0.3), SiteLaw(site=TIP, controller=controller()))
        yield f"floating base of {mass:g} kg", *found, 0.01
        yield f"floating base of {mass:g} kg, without kappa", found[0], abs(continuous_speed(0.3)), math.inf


def beam_rows(quick: bool) -> Iterator[Row]:
    """Balls beside the axis and tilted plates, with a beam of 8 deg.

    The first row of each object compares with the prediction, which takes the object for a facing plane. The second one
    compares with a prediction that knows the ln xi that the beam reads from this shape; the drag has to meet it. The
    sampled drag smooths its readings, so it is compared with its own deviation for a facing plate.
    """
    drag = replace(controller(), law=VirtualDrag(drag=0.0144, noise=1e-6))
    wide = replace(TIP, field_of_view=math.radians(8))
    plate = '<geom type="box" size="0.01 1 1" mass="0.5" euler="0 {} 0" contype="0" conaffinity="0"/>'
    ball = '<geom type="sphere" size="0.035" mass="0.5" contype="0" conaffinity="0"/>'
    for label, law in (("damper", controller()), ("drag", drag)):
        site_law = SiteLaw(site=wide, controller=law)
        number, kind = law.law.value, law.law.continuous
        facing = contact(slide_with_ball(1.0, 0.3, floats=False, radius=0.01, geom=plate.format(0)), site_law)
        share = facing[0] / facing[1] if label == "drag" else 1.0
        yield f"facing plate, {label}", *facing, math.inf
        for offset in (0.02,) if quick else (0.0, 0.01, 0.02, 0.03):
            scene = slide_with_ball(1.0, 0.3, floats=False, offset=offset, geom=ball)
            found, name = contact(scene, site_law), f"ball {1e3 * offset:g} mm beside the axis, {label}"
            yield name, found[0], share * found[1], math.inf
            yield f"  by its shape, {label}", found[0], share * speed_by_shape(scene, wide, number, kind, 1), 0.01
        for angle in (30,) if quick else (15, 30, 45):
            thick = 0.01 / math.cos(math.radians(angle))
            scene = slide_with_ball(1.0, 0.3, floats=False, radius=thick, geom=plate.format(angle))
            found, name = contact(scene, site_law), f"plate tilted by {angle} deg, {label}"
            yield name, found[0], share * found[1], math.inf
            yield f"  by its shape, {label}", found[0], share * speed_by_shape(scene, wide, number, kind, 1), 0.01


def jumps(passes: int, seed: int) -> int:
    """The number of random passes in which the reference moves toward the object."""
    rng, law, found = np.random.default_rng(seed), SiteLaw(site=TIP, controller=controller()), 0
    for _ in range(passes):
        angle, turn = rng.uniform(math.radians(30), math.pi), rng.uniform(0, 2 * math.pi)
        way = np.array([math.cos(angle), math.sin(angle) * math.cos(turn), math.sin(angle) * math.sin(turn)])
        options = {"distance": rng.uniform(0.02, 0.08), "offset": rng.uniform(-0.03, 0.03), "direction": way}
        model, data = slide_with_ball(1.0, rng.uniform(0.1, 1.0), floats=False, **options)
        found += bool(simulate_robot(model, data, [law], horizon=0.3).trace().reference.max() > 1e-9)
    return found


def gripper(reflectance: float = 1.0, centering: Centering | None = CENTERED) -> tuple[float, float]:
    """The time between both touches [s], and how far the object has moved until the second one [m].

    The object is 10 mm off center, and reflects `reflectance` times as much to the right finger.
    """
    model = load_model(ARM.with_name("gripper.xml"))
    law = replace(controller(-0.05), admittance=VirtualAdmittance(mass=0.2, damping=4.0, stiffness=25.0))
    curves = {"left": CURVE, "right": replace(CURVE, scale=reflectance * CURVE.scale)}
    laws = [SiteLaw(site=SensorSite(name, c), controller=law, approach=0.1) for name, c in curves.items()]
    result = simulate_robot(model, make_data(model), laws, centering=centering)
    times = [float(result.simulated(name, "time")[0]) for name in ("left", "right")]
    trace = result.trace()
    second = min(int(np.searchsorted(trace.time, max(times))), len(trace.time) - 1)
    return abs(times[0] - times[1]), abs(float(trace.configuration[second, 2] - trace.configuration[0, 2]))


def step_times(degrees: float, rounds: int) -> tuple[float, float]:
    """The processor time of a step of the whole robot, and of MuJoCo's own step of the same model [s].

    Both alternate in one process, and the median of the rounds counts. The robot's step includes what a run does once.
    """
    site = SensorSite("flange", CURVE, field_of_view=math.radians(degrees))
    model, data = six_axis_with_ball(0.3)
    laws = [SiteLaw(site=site, controller=controller())]
    options: dict[str, Any] = {"tracking": ComputedTorque(), "centering": None, "horizon": 5.0, "follow_time": 0.02}
    runner = Runner(RunScene.of(model, data, laws, **options), seed=0)
    steps = len(simulate_robot(model, data, laws).trace().time)
    runner.run(0)
    pairs = []
    for number in range(rounds):
        start = time.thread_time()
        runner.run(number)
        own, start = time.thread_time() - start, time.thread_time()
        state = mujoco.MjData(model)
        state.qpos[:], state.qvel[:] = data.qpos, data.qvel
        mujoco.mj_step(model, state, steps)
        pairs.append((own / steps, (time.thread_time() - start) / steps))
    return float(np.median([own for own, _ in pairs])), float(np.median([engine for _, engine in pairs]))


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--passes", type=int, default=100)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args(arguments)
    missed: list[str] = []
    print(f"{'contact speed [m/s]':52} simulated predicted difference required")
    for rows in (arm_rows, base_rows, beam_rows):
        for name, simulated, predicted, required in rows(asked.quick):
            difference = simulated / predicted - 1
            limit = f"{100 * required:.1f} %" if math.isfinite(required) else "-"
            missed += [name] * (abs(difference) > required)
            print(f"{name:52} {simulated:9.5f} {predicted:9.5f} {100 * difference:+9.3f} % {limit:>8}")
    passes = 3 if asked.quick else asked.passes
    found = jumps(passes, asked.seed)
    missed += ["passes"] * (found > 0)
    print(f"references that move toward an object that passes: {found} of {passes} (required 0)")
    grippers: tuple[tuple[str, dict[str, Any], bool], ...] = (
        ("without centering", {"centering": None}, False),
        ("with centering", {}, True),
        ("centering, reflectances 1 to 2", {"reflectance": 2.0}, False),
    )
    for name, options, required in grippers[:2] if asked.quick else grippers:
        apart, pushed = gripper(**options)
        limits = " (required 5 ms, 1 mm)" if required else ""
        missed += [f"gripper {name}"] * (required and (apart > 5e-3 or pushed > 1e-3))
        print(f"gripper {name}: touches {1e3 * apart:.1f} ms apart, object pushed by {1e3 * pushed:.2f} mm{limits}")
    for degrees, required in ((0, 6.0), (8, 10.0)):
        own, engine = step_times(degrees, 1 if asked.quick else 7)
        missed += [f"step with a beam of {degrees} deg"] * (own / engine > required)
        print(
            f"six-axis arm, beam of {degrees} deg: {1e6 * own:.1f} us per step, MuJoCo alone {1e6 * engine:.1f} us, "
            f"ratio {own / engine:.2f} (required {required:g})"
        )
    runs, workers = (4, 1) if asked.quick else (asked.runs, asked.workers)
    law = SiteLaw(site=FINGERTIP, controller=controller(rate=250.0), chain=SLOW)
    scene, start, processor = arm_with_ball("bent", 0.3), time.perf_counter(), time.process_time()
    simulate_robot(*scene, [law], runs=runs, workers=workers)
    passed, spent = time.perf_counter() - start, time.process_time() - processor
    print(
        f"arm at 250 Hz and 1 kHz: {runs} runs in {passed:.1f} s with {workers} threads, {1e3 * spent / runs:.1f} "
        "ms of processor time each (required 6 s for 1000 runs on two cores)"
    )
    print(f"missed requirements: {', '.join(missed) or 'none'}")


if __name__ == "__main__":
    main()
