"""Measure time and memory of growing work, and draw both over its size.

Each size runs in a fresh process. Time is the processor time of all threads, without imports. Memory is the largest
resident memory of the process, with imports.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
_KILOBYTES = 1e6 if sys.platform == "darwin" else 1e3  # of ru_maxrss in a megabyte
_FRAME = """
import resource, sys, time
from dataclasses import replace
import numpy as np
import pretouch as pt
count, examples = int(sys.argv[1]), sys.argv[2]
{setup}
begun = time.process_time()
{work}
print(time.process_time() - begun, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


class Work(NamedTuple):
    """Work that grows with a number."""

    name: str  # what is counted
    setup: str
    work: str
    sizes: tuple[int, ...]


WORK = (
    Work(
        "designs in one array",
        "task = pt.load_scenario(examples + '/approach.toml').replace(constraints=())\n"
        "moving = replace(task.scenario.obstacle, velocity=-np.linspace(0.05, 1.0, count))\n"
        "task = task.replace(scenario=replace(task.scenario, obstacle=moving))",
        "pt.design(task)",
        (10, 100, 1000, 10_000, 100_000, 1_000_000),
    ),
    Work(
        "samples of a robust design",
        "task = pt.load_scenario(examples + '/robust.toml')\n"
        "task = task.replace(robust=replace(task.robust, samples=count, validation=count))\n"
        "import pretouch.designs.robust.design, scipy.special",
        "pt.robust(task)",
        (64, 256, 1024, 4096, 16_384),
    ),
    Work(
        "readings of a calibration",
        "from pretouch.calibration import Calibration, fit\n"
        "rng, distance = np.random.default_rng(1), np.linspace(0.005, 0.09, count)\n"
        "mean = 0.533 * (distance + 0.0419) ** -3.32\n"
        "readings = Calibration(distances=distance, outputs=mean + rng.normal(size=count) * 20)\n"
        "import scipy.special",
        "fit(readings)",
        (30, 100, 300, 1000, 10_000, 100_000),
    ),
    Work(
        "bodies of a robot",
        "import mujoco\n"
        "from pretouch.robots import SensorSite, make_data, project_site\n"
        'link = \'<body pos=".05 0 .05"><joint name="j{0}" axis="0 {1} {2}"/><geom size=".02" mass=".5"/>\'\n'
        "links = ''.join(link.format(i, i % 2, 1 - i % 2) for i in range(count))\n"
        'motors = \'\'.join(f\'<motor joint="j{i}" ctrllimited="true" ctrlrange="-50 50"/>\' for i in range(count))\n'
        "body = links + '<site name=\"tip\" pos=\".05 0 .05\"/>' + '</body>' * count\n"
        "text = f'<mujoco><worldbody>{body}</worldbody><actuator>{motors}</actuator></mujoco>'\n"
        "model = mujoco.MjModel.from_xml_string(text)\n"
        "data, site = make_data(model), SensorSite(name='tip')",
        "project_site(model, data, site, joint_speeds={f'j{i}': 3.0 for i in range(count)})",
        (2, 4, 8, 16, 32),
    ),
)


class Grown(NamedTuple):
    """Measurements of one kind of work."""

    name: str
    sizes: tuple[int, ...]
    seconds: tuple[float, ...]
    megabytes: tuple[float, ...]


def grow(largest: int) -> list[Grown]:
    """Measure each kind of work up to a size, and print a row for each size."""
    print(f"\n{'growing work':30s} {'size':>10s} {'processor time':>16s} {'memory':>10s}")
    return [_grow(work, largest) for work in WORK]


def _grow(work: Work, largest: int) -> Grown:
    sizes, seconds, memory = [], [], []
    program = _FRAME.format(setup=work.setup, work=work.work)
    for size in (size for size in work.sizes if size <= largest):
        command = [sys.executable, "-c", program, str(size), str(ROOT / "examples")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise SystemExit(f"{work.name}, {size}: {done.stderr[-500:]}")
        time, kilobytes = map(float, done.stdout.split())
        sizes.append(size)
        seconds.append(time)
        memory.append(kilobytes / _KILOBYTES)
        print(f"{work.name:30s} {size:>10,} {time:14.3f} s {memory[-1]:7.0f} MB", flush=True)
    return Grown(work.name, tuple(sizes), tuple(seconds), tuple(memory))


def draw(grown: list[Grown], file: Path) -> None:
    """Draw time and memory over the size, on logarithmic axes."""
    from pretouch.report import Curve, Panel, panel_figure  # noqa: PLC0415

    panels = [
        Panel(
            title=title,
            x_label="size [1]",
            y_label=label,
            curves=[
                Curve(x=one.sizes, y=getattr(one, column), label=one.name, style=i, kind="both")
                for i, one in enumerate(grown)
                if one.sizes
            ],
            x_log=True,
            y_log=True,
        )
        for title, label, column in (
            ("Time", "processor time [s]", "seconds"),
            ("Memory, with imports", "memory [MB]", "megabytes"),
        )
    ]
    panel_figure(*panels, height=3.8).savefig(file)
