"""Design one gain in this process and print it: `python -m benchmarks.peers.fresh PEER SENSOR`; case D times it."""

from __future__ import annotations

import sys

from .registry import load
from .work import designs


def main(name: str, sensor: str) -> None:
    """Print the gain that the peer's way for fresh processes finds."""
    way = next(way for way in load(name).cases() if way.sensor == sensor and "D" in way.cases)
    print(repr(float(way.make(designs(1))()[0])))


if __name__ == "__main__":
    main(*sys.argv[1:])
