"""Compare the virtual drag with the letter's damper on noisy loops: contact, excursion, acceleration, rest, bounds.

Run with `python -m benchmarks.drag`; `--quick` runs few encounters of each kind.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import pretouch as pt
from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper, VirtualDrag
from pretouch.designs.drag import drag_by

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from mujoco_witness import witness_encounter

from . import bounds, drag_times
from .peers.protocol import missing

ADMITTANCE = {"mass": 1.0, "damping": 10.0, "stiffness": 25.0}
OFFSET, EXPONENT, START = 0.0419, 3.32, 0.0422  # l_0 and n of the letter's inverse power, l_d
LETTER = VirtualDamper(gain=-0.746)  # the optimum of its f_1 at 0.3 m/s
RATIO = 0.15
SEED = 16
ROBOT = pt.simulation.ImpedancePlant(mass=1.0, stiffness=4000.0, damping=126.0, bandwidth=80.0)
SLOW_ROBOT = pt.simulation.PositionPlant(mass=1.0, bandwidth=10.0)
CONTACT = pt.simulation.HuntCrossley(stiffness=1.33e6, dissipation=0.5, obstacle_mass=1.5)
FOLLOW = 0.02  # s after the first touch

Law = VirtualDamper | VirtualDrag


@dataclass(frozen=True)
class Part:
    """A sensor with the settings of the controller and the drag.

    Args:
        chain: the sensor chain; its noise is a parameter of the drag.
        scale: of the inverse power with the letter's exponent.
        floor: readings below it count as no object.
        smoothing_time: of the drag [s].
        share: additional noise relative to xi that the drag assumes.
        period: of the controller [s].
    """

    chain: pt.SensorChain
    scale: float
    floor: float
    smoothing_time: float
    share: float = 0.0
    period: float = 1e-3

    def drag(self, drag: float, known_acceleration: float) -> VirtualDrag:
        """Return the drag of this many N s^2 with the noise of the part."""
        return VirtualDrag(
            drag=drag,
            noise=self.chain.noise,
            relative_noise=self.chain.relative_noise + self.share,
            resolution=self.chain.resolution,
            smoothing_time=self.smoothing_time,
            own_advance=LETTER.gain,
            known_acceleration=known_acceleration,
        )

    def controller(self, law: Law) -> Controller:
        """Return a controller with this law for the part."""
        conditioning = Conditioning(floor=self.floor, sensor_period=max(self.chain.period, self.period))
        admittance = VirtualAdmittance(**ADMITTANCE)
        return Controller(period=self.period, conditioning=conditioning, law=law, admittance=admittance)


def bought(name: str, relative_noise: float = 0.0) -> pt.SensorChain:
    """Return the chain of a commercial part, with relative noise that its data sheet does not state."""
    return replace(pt.simulation.sensor_part(name).chain, random_phase=True, relative_noise=relative_noise)


COUNTS = 0.533  # 20,000 counts at contact, 2,000 at l_d
NOISE = {"noise": 20.0, "relative_noise": 3e-3, "resolution": 4.0, "lowest": 0.0, "highest": 65535.0}
NOISY = Part(pt.SensorChain(rate=250.0, delay=2e-3, offset=50.0, random_phase=True, **NOISE), COUNTS, 100.0, 7e-3)
PARTS = {
    "RPR-220": Part(bought("RPR-220"), 1.30e-5, 1e-2, 3e-3, period=1e-4),
    "VCNL4010": Part(bought("VCNL4010", 3e-3), COUNTS, 50.0, 6e-3),
    "VCNL4040": Part(bought("VCNL4040", 3e-3), COUNTS, 50.0, 6e-3),
    # it reports distances to 5 mm, which is n 5 mm/(l + l_0) of xi, told as in the middle of the way
    "VL53L5CX": Part(bought("VL53L5CX-4x4"), 1.30e-5, 1e-4, 12e-3, share=EXPONENT * 0.005 / 0.07),
}
KILOHERTZ = {"rate": 1000.0, "delay": 2e-4, "random_phase": True}
RATIOS_AT = {
    "no noise, smoothed over 2 ms": Part(pt.SensorChain(**KILOHERTZ), COUNTS, 100.0, 2e-3),
    "20 counts of noise, over 4 ms": Part(pt.SensorChain(**KILOHERTZ, **NOISE), COUNTS, 100.0, 4e-3),
    "20 counts of noise, over 5 ms": Part(pt.SensorChain(**KILOHERTZ, **NOISE), COUNTS, 100.0, 5e-3),
}


@dataclass(frozen=True, kw_only=True)
class Setting:
    """One row of the table: object, robot, sensor part, and requirements for the drag.

    Args:
        name: of the row.
        speed: approach speed of the object [m/s].
        push: its acceleration toward the robot [m/s^2].
        position: start of the object [m].
        course: stretches of another acceleration that come first: until [s], away from the robot [m/s^2].
        exponent: of the true curve, over the one that the drag is designed for.
        ratio: rho of the drag.
        known: acceleration of the object that the drag feeds forward [m/s^2].
        robot: the plant.
        contact: the contact force; None: a run ends at the touch.
        part: the sensor.
        horizon: how long a run waits for contact [s].
        asked: requirements for the drag, by their names in FIGURES.
    """

    name: str
    speed: float = 0.3
    push: float = 0.0
    position: float = START
    course: tuple[tuple[float, float], ...] = ()
    exponent: float = 1.0
    ratio: float = RATIO
    known: float = 0.0
    robot: Any = ROBOT
    contact: Any = None
    part: Part = NOISY
    horizon: float = 10.0
    asked: tuple[tuple[str, float], ...] = ()

    def drag(self) -> VirtualDrag:
        """Return the drag of the setting: rho for the letter's curve as it is assumed, from l_d on."""
        assumed = pt.InversePower(scale=self.part.scale, distance_offset=OFFSET, exponent=EXPONENT)
        return self.part.drag(drag_by(assumed, START, ADMITTANCE["mass"], ratio=self.ratio).drag, self.known)


class Size(NamedTuple):
    """Number of encounters per cell: reflectances from half to twice the assumed one, and runs of each."""

    reflectances: int
    draws: int


FULL, QUICK = Size(40, 25), Size(2, 4)


def run(setting: Setting, law: Law, size: Size) -> pt.SimulationResult:
    """Run a cell, at once: a row per draw of the noise, a column per reflectance; every law meets the same noise."""
    scenario = pt.Scenario(
        admittance=pt.Admittance(**ADMITTANCE),
        obstacle=pt.Obstacle(
            position=np.full((size.draws, 1), setting.position),
            velocity=-setting.speed,
            acceleration=-setting.push,
            course=tuple(pt.motion.Stretch(until=until, acceleration=away) for until, away in setting.course),
        ),
    )
    exponent = EXPONENT * setting.exponent
    at_contact = setting.part.scale * OFFSET**-EXPONENT
    sensors = [
        pt.InversePower(scale=share * at_contact * OFFSET**exponent, distance_offset=OFFSET, exponent=exponent)
        for share in np.geomspace(0.5, 2.0, size.reflectances)
    ]
    loop = pt.ClosedLoop(
        law=setting.part.controller(law),
        chain=setting.part.chain,
        plant=setting.robot,
        contact=setting.contact,
        seed=SEED,
        horizon=setting.horizon,
        follow_time=FOLLOW,
    )
    return loop.run_each(scenario, sensors, law.gain if isinstance(law, VirtualDamper) else law.drag)


FIGURES = {
    "contacts": "%",
    **{"mean": "mm/s", "95 %": "mm/s", "worst": "mm/s"},
    **{"excursion": "mm", "acceleration": "m/s^2"},
}
AT_ONCE = ("mean", "excursion", "acceleration")  # in which the drag is to be better than the letter


def figures(result: pt.SimulationResult) -> dict[str, float]:
    """Share of contacts, contact speed (NaN without any), means of the largest excursion and acceleration: FIGURES."""
    speed = -1e3 * result.relative_velocity[result.touched]
    speeds = (speed.mean(), np.quantile(speed, 0.95), speed.max()) if speed.size else (math.nan,) * 3
    both = 1e3 * result.largest_excursion.mean(), result.largest_acceleration.mean()
    return dict(zip(FIGURES, map(float, (100 * result.touched.mean(), *speeds, *both)), strict=True))


SETTINGS = (
    Setting(name="0.3 m/s", asked=(("mean", 48.0), ("95 %", 51.0), ("excursion", 54.0), ("acceleration", 3.0))),
    Setting(name="0.05 m/s", speed=0.05),
    Setting(name="1 m/s", speed=1.0, asked=(("mean", 135.0),)),
    Setting(name="exponent 0.9 of the assumed", exponent=0.9),
    Setting(name="exponent 1.1 of the assumed", exponent=1.1),
    Setting(name="pushed on, 0.5 m/s^2", push=0.5),
    Setting(name="pushed on, 0.5 m/s^2, rho 0.10", push=0.5, ratio=0.10),
    Setting(name="pushed on, 0.5 m/s^2, fed forward", push=0.5, known=-0.5),
    Setting(name="pushed on, 2 m/s^2", push=2.0),
    Setting(name="pushed on, 2 m/s^2, rho 0.10", push=2.0, ratio=0.10),
    Setting(name="pushed on, 2 m/s^2, fed forward", push=2.0, known=-2.0),
    Setting(name="10 Hz position-controlled", robot=SLOW_ROBOT),
)
STOPPING = 3.0  # m/s^2, from 0.3 m/s and to it
RETURNS = tuple(
    Setting(name=f"at {1e3 * (START - 0.015 - 0.3 * since):.0f} mm", course=((since, 0.0), (since + 0.1, STOPPING)))
    for since in (0.1, 0.12, 0.16, 0.2)
)
GRAVITY = 9.81
COURSES = (
    Setting(
        name="rests 0.5 s at 12 mm, comes again",
        course=((0.05, 0.0), (0.15, STOPPING), (0.65, 0.0), (0.75, -STOPPING)),
    ),
    Setting(
        name="rests 0.5 s at -3 mm, comes again",
        course=((0.1, 0.0), (0.2, STOPPING), (0.7, 0.0), (0.8, -STOPPING)),
    ),
    Setting(name="recedes, comes back with 1.5 m/s^2", course=((0.35, 1.5),), push=1.5),
    Setting(name="from 0.1 to 0.5 m/s within 0.1 s", speed=0.1, course=((0.1, 0.0), (0.2, -4.0))),
    Setting(name="dropped after 0.1 s", speed=0.0, course=((0.1, 0.0),), push=GRAVITY),
    Setting(name="dropped after 0.1 s, fed forward", speed=0.0, course=((0.1, 0.0),), push=GRAVITY, known=-GRAVITY),
    Setting(name="thrown up at 1 m/s", speed=1.0, push=-GRAVITY),
)
SPEEDS = (0.05, 0.1, 0.3, 0.5, 1.0)
WITNESSED = (0.05, 0.3, 1.0)
RATIOS = (0.05, 0.1, 0.2, 0.3, 0.5, 1.0)
LEAVING = (
    Setting(name="leaves 30 mm at 0.1 m/s", position=0.03, speed=-0.1, horizon=1.0),
    Setting(name="leaves 30 mm at 0.3 m/s", position=0.03, speed=-0.3, horizon=1.0),
    Setting(name="leaves 30 mm at 1.5 m/s^2", position=0.03, speed=0.0, push=-1.5, horizon=1.0),
    Setting(name="comes, and turns at 1.5 m/s^2", push=-1.5, horizon=1.0),
)


class Lines(NamedTuple):
    """Printed lines of a section, and its missed requirements."""

    text: list[str]
    missed: list[str]


def compared(settings: tuple[Setting, ...], size: Size) -> Lines:
    """Run settings with both laws; of the drag its figures in `asked` are asked, and the letter's in AT_ONCE."""
    found = Lines([f"{'':43s}contacts: mean/95 %/worst; excursion; acceleration"], [])
    for setting in settings:
        letter, drag = (figures(run(setting, law, size)) for law in (LETTER, setting.drag()))
        told = ", ".join(f"{name} <= {limit:g}" for name, limit in setting.asked)
        text = f"{setting.name:36s}letter {in_a_row(letter)}   drag {in_a_row(drag)}"
        found.text.append(f"{text}   required {told}" if told else text)
        limits = [(name, letter[name], "the letter's") for name in ("contacts", *AT_ONCE)]
        limits += [(name, limit, "required <=") for name, limit in setting.asked]
        found.missed.extend(
            f"{setting.name}: {name} {drag[name]:.4g} {FIGURES[name]}, {what} {limit:.4g}"
            for name, limit, what in limits
            if drag[name] > limit
        )
    return found


def in_a_row(found: dict[str, float]) -> str:
    """Format figures in the order of FIGURES."""
    contacts, mean, high, worst, excursion, acceleration = found.values()
    return f"{contacts:3.0f} %: {mean:6.1f}/{high:6.1f}/{worst:6.1f}; {excursion:5.1f}; {acceleration:5.2f}"


def impacts(size: Size) -> Lines:
    """Compare impact forces at 0.3 m/s, without mitigation as well."""
    setting = Setting(name="impact force", contact=CONTACT)
    laws = {"none": VirtualDamper(gain=0.0), "letter": LETTER, "drag": setting.drag()}
    force = {name: float(run(setting, law, size).impact_force.mean()) for name, law in laws.items()}
    missed = [] if force["drag"] < force["letter"] else [f"impact force {force['drag']:.3g} N"]
    return Lines(["   ".join(f"{name} {value:.2f} N" for name, value in force.items())], missed)


def after_it(result: pt.SimulationResult) -> tuple[float, float]:
    """How far beyond its reference [mm] and how fast [mm/s] the robot goes after the object, in the worst of runs."""
    traces = [result.trace(index) for index in np.ndindex(result.shape)]
    return 1e3 * max(t.position.max() for t in traces), 1e3 * max(t.velocity.max() for t in traces)


def leaving(size: Size) -> Lines:
    """Report how far and how fast the robot follows an object that leaves: the maximum over all encounters."""
    found = Lines([], [])
    for setting in LEAVING:
        letter, drag = (after_it(run(setting, law, size)) for law in (LETTER, setting.drag()))
        told = "   ".join(
            f"{name} {ahead:6.2f} mm, {fast:6.1f} mm/s" for name, (ahead, fast) in (("letter", letter), ("drag", drag))
        )
        found.text.append(f"{setting.name:36s}{told}   required 0 mm")
        if drag[0] > 0:
            found.missed.append(f"{setting.name}: {drag[0]:.3g} mm after the object")
    return found


def at_rest(size: Size, horizon: float) -> Lines:
    """Report how many runs move by more than 1 mm in front of an object at rest, and how many at all."""
    places = {"at 100 mm": (0.1, size)}
    for level in (110.0, 150.0, 250.0, 600.0):
        distance = ((level - NOISY.chain.offset) / NOISY.scale) ** (-1 / EXPONENT) - OFFSET
        places[f"the assumed one reads {level:g} counts"] = distance, size._replace(draws=size.draws // 4)
    found = Lines([], [])
    for where, (position, runs) in places.items():
        setting = Setting(name=where, speed=0.0, position=position, horizon=horizon)
        letter, drag = (1e3 * run(setting, law, runs).largest_excursion for law in (LETTER, setting.drag()))
        told = "   ".join(
            f"{name} {(way > 1).mean():6.1%} (moved at all {(way > 0).mean():6.1%}, most {way.max():6.2f} mm)"
            for name, way in (("letter", letter), ("drag", drag))
        )
        found.text.append(f"{where:36s}{told}   required 0 %")
        if (drag > 1).any():
            found.missed.append(f"at rest {where}: {(drag > 1).mean():.2%} move by more than 1 mm in {horizon:g} s")
    return found


def ratios(size: Size) -> Lines:
    """Report contact speed over approach speed, divided by rho, at 1 kHz on a robot without lag."""
    found = Lines([f"{'':36s}" + "".join(f"{speed:>8g}" for speed in RATIOS) + " m/s; required within 5 %"], [])
    for name, which in RATIOS_AT.items():
        text = f"{name:36s}"
        for speed in RATIOS:
            setting = Setting(name=name, speed=speed, part=which, robot=pt.simulation.IdealPlant())
            share = figures(run(setting, setting.drag(), size))["mean"] / (1e3 * speed * RATIO)
            text += f"{share:8.3f}"
            if not abs(share - 1) <= 0.05:
                found.missed.append(f"{name}: ratio over rho {share:.3f} at {speed:g} m/s, required within 5 %")
        found.text.append(text)
    return found


def witnessed(speeds: tuple[float, ...]) -> Lines:
    """Compare single encounters with MuJoCo: the same law with another robot and contact, without noise."""
    absent = missing("mujoco")
    if absent:
        return Lines([absent], [])
    law = replace(NOISY, chain=pt.SensorChain(rate=1000.0)).controller(Setting(name="").drag())
    around = {
        "plant": pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0),
        "contact": pt.simulation.SpringDamper(stiffness=3e4, damping=60.0, obstacle_mass=1.0),
    }
    found = Lines([], [])
    for speed in speeds:
        scenario = pt.Scenario(
            admittance=pt.Admittance(**ADMITTANCE), obstacle=pt.Obstacle(position=START, velocity=-speed)
        )
        sensor = pt.InversePower(scale=COUNTS, distance_offset=OFFSET, exponent=EXPONENT)
        ours = pt.simulation.simulate_loop(scenario, sensor, law, follow_time=FOLLOW, **around).relative_velocity
        theirs = witness_encounter(
            scenario, sensor, law, time_step=2.5e-5, follow_time=FOLLOW, **around
        ).relative_velocity
        apart = abs(theirs / ours - 1)
        found.text.append(
            f"{speed:g} m/s: contact at {-1e3 * ours:.3f} mm/s, MuJoCo differs by {apart:.1e}, required <= 1e-3"
        )
        if not apart <= 1e-3:
            found.missed.append(f"MuJoCo at {speed:g} m/s: {apart:.1e}")
    return found


def sections(quick: bool) -> Iterator[tuple[str, Lines]]:
    """Yield each section when it is finished, with its title."""
    size, speeds = (QUICK, SPEEDS[2:3]) if quick else (FULL, SPEEDS)
    yield f"contact speed [mm/s], excursion [mm], acceleration [m/s^2], rho {RATIO}", compared(SETTINGS, size)
    yield "impact force at 0.3 m/s", impacts(size)
    yield "an object that leaves: how far, and how fast, the robot goes beyond its reference after it", leaving(size)
    yield "an object that comes and stops: the robot goes home onto it", compared(RETURNS, size)
    yield "an object of another course", compared(COURSES, size)
    horizon = 5.0 if quick else 60.0
    yield f"at rest, {horizon:g} s: share that moves by more than 1 mm", at_rest(size, horizon)
    for name, which in PARTS.items():
        rows = tuple(Setting(name=f"{name}, {speed:g} m/s", speed=speed, part=which) for speed in speeds)
        yield name, compared(rows, size)
    yield "share of the speed that is left at 1 kHz, over rho", ratios(size)
    yield "processor times next to NumPy", Lines(*drag_times.lines(quick))
    count = 2_000 if quick else 100_000
    yield f"bounds of docs/explanation/drag.md over {count:,} encounters", Lines(*bounds.measure(count))
    yield "beside MuJoCo", witnessed(WITNESSED[-1:] if quick else WITNESSED)


def main() -> None:
    """Print all sections, then the missed requirements."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.drag", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few encounters, one speed of each part")
    quick, missed = parser.parse_args().quick, []
    size = QUICK if quick else FULL
    print(f"\nletter's damper and virtual drag, {size.reflectances * size.draws:,} encounters a cell")
    for title, (text, misses) in sections(quick):
        print(f"\n{title}", *text, sep="\n", flush=True)
        missed += misses
    print("\nmissed requirements:", *(missed or ["none"]), sep="\n")


if __name__ == "__main__":
    main()
