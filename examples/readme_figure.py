"""Draw the figures of the README, for examples/approach.toml: python examples/readme_figure.py docs/images."""

import sys
from pathlib import Path

import pretouch as pt


def main(folder: Path) -> None:
    """Draw the motion with the optimal gain and without mitigation, and the virtual drag compared with that gain."""
    task = pt.load_scenario(Path(__file__).parent / "approach.toml")
    drag = pt.design(task.replace(drag_effect=pt.DragEffect(ratio=0.15)))
    drawn = {"approach": pt.plots.motion(pt.design(task)), "virtual-drag": pt.plots.drag(drag)}
    for name, figure in drawn.items():
        figure.savefig(folder / f"{name}.png", dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]))
