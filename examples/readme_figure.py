"""The figure of the README: the motion with the optimal gain and without mitigation, for examples/approach.toml."""

import sys
from pathlib import Path

import pretouch as pt


def main(target: str) -> None:
    """Draw the figure to a PNG file."""
    design = pt.design_gain(pt.load_scenario(Path(__file__).parent / "approach.toml"))
    pt.plots.motion(design).savefig(target, dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main(sys.argv[1])
