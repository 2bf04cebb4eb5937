"""Meet an object with any robot model, such as one of MuJoCo Menagerie, and print where one gain holds.

    python examples/robots/any_model.py path/to/franka_emika_panda/panda.xml attachment_site

Without a site, the sites of the model are listed. The axis +z of a site usually points away from the flange.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import pretouch as pt

SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)


def main(path: str, name: str = "", axis: str = "+z", count: int = 20) -> pt.robots.Workspace | None:
    """Project the model in random postures, and print reflected mass and retreat of each."""
    model = pt.robots.load_model(Path(path))
    if not name:
        print(pt.robots.project(model))
        return None
    site = pt.robots.SensorSite(name, SENSOR, axis=axis)
    workspace = pt.robots.project_workspace(model, site, pt.robots.random_postures(model, site, count))
    task = pt.Task(
        pt.Scenario(
            admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
            obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
        ),
        SENSOR,
        gain=-0.75,
    )
    results = ("relative_velocity", "largest_excursion", "largest_acceleration")
    dataset = workspace.describe(pt.sweep(task, workspace.axes(task), results=results))
    masses = np.asarray(dataset["reflected_mass"])
    print(f"reflected mass from {masses.min():.3g} to {masses.max():.3g} kg")
    print(f"contact at {abs(float(dataset['relative_velocity'].mean())):.3g} m/s instead of 0.3 m/s")
    print(f"the gain holds in {float(dataset['holds'].mean()):.0%} of {masses.size} postures")
    return workspace


if __name__ == "__main__":
    main(*sys.argv[1:4])
