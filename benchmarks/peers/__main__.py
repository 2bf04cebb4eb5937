"""Run pretouch and each peer on the same problems, pair by pair: `python -m benchmarks.peers --help`."""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .protocol import Peer
from .registry import OURS, PEERS, load
from .work import CASES, QUICK, SIZES


def arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.peers", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--case", nargs="*", choices=CASES, default=list(CASES), help="which work; all of it by default"
    )
    parser.add_argument("--peer", nargs="+", choices=PEERS, default=list(PEERS), help="beside whom; all by default")
    parser.add_argument("--quick", action="store_true", help="less work and shorter times: to see that it runs")
    parser.add_argument("--threads", type=int, default=1, help="processors that every library may use (default 1)")
    parser.add_argument("--seconds", type=float, help="how long each pair is measured (default 3, quick 0.3)")
    parser.add_argument("--json", type=Path, help="write every number to this file")
    parser.add_argument("--figure", type=Path, help="measure cost over batch size and draw it to this file")
    parser.add_argument("--old", metavar="COMMIT", help="an earlier build as another peer")
    parser.add_argument("--growth", type=Path, help="measure time and memory of growing work; draw it to this file")
    return parser.parse_args()


def hold_to(threads: int) -> None:
    """Limit this process and its children to a number of processors, before any library counts them."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-threads:])
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = str(threads)


def installed(names: list[str]) -> dict[str, Peer]:
    """Load the installed peers, and print the missing ones."""
    peers = {}
    for name in dict.fromkeys([OURS, *names]):
        peer = load(name)
        reason = peer.available()
        if reason:
            print(f"skipped: {peer.name}: {reason}")
        else:
            peers[name] = peer
    return peers


def main() -> None:
    """Run the requested cases."""
    asked = arguments()
    hold_to(asked.threads)
    seconds = asked.seconds or (0.3 if asked.quick else 3.0)
    peers = installed(asked.peer)
    record: dict[str, Any] = {**_conditions(asked.threads), "seconds_per_pair": seconds}
    print(", ".join(map(str, record.values())), "s per pair\n")
    if asked.case:
        record["rows"] = _rows(asked, peers, seconds)
    if asked.figure:
        record |= _cost(asked, peers, seconds)
    if asked.growth:
        record["work"] = _growth(asked)
    if asked.json:
        asked.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def _conditions(threads: int) -> dict[str, str]:
    """Return date, processor, system and threads."""
    cpuinfo = Path("/proc/cpuinfo")  # Linux
    lines = cpuinfo.read_text(encoding="utf-8").splitlines() if cpuinfo.exists() else []
    processor = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "")
    return {
        "date": time.strftime("%Y-%m-%d"),
        "processor": processor or platform.processor(),
        "machine": f"{platform.system()} {platform.machine()}",
        "python": f"Python {platform.python_version()}",
        "threads": f"{threads} thread{'s' if threads > 1 else ''}",
    }


def _rows(asked: argparse.Namespace, peers: dict[str, Peer], seconds: float) -> list[dict[str, Any]]:
    from .builds import earlier_build  # noqa: PLC0415 - after the processors are counted
    from .reference import evidence  # noqa: PLC0415
    from .rows import HEADER, Row, measure, measure_commands  # noqa: PLC0415
    from .work import SENSORS  # noqa: PLC0415

    rows = []
    sizes, least = (QUICK, 1) if asked.quick else (SIZES, 3)
    print("reference: Taylor series of pretouch; " + ";\n  ".join(evidence(sensor) for sensor in SENSORS) + "\n")
    with earlier_build(asked.old) if asked.old else nullcontext() as old:
        if old:
            peers = {OURS: peers[OURS], "old": old, **peers}
        print(HEADER)
        for case in asked.case:
            of_commands = measure_commands(sizes[case], old, least)
            for row in of_commands if case == "G" else measure(case, sizes[case], peers, seconds, least):
                print(row, flush=True)
                if isinstance(row, Row):
                    rows.append(asdict(row))
    return rows


def _cost(asked: argparse.Namespace, peers: dict[str, Peer], seconds: float) -> dict[str, Any]:
    from .figure import draw, follow  # noqa: PLC0415
    from .measuring import exp_cost  # noqa: PLC0415

    limit = exp_cost()
    grown = follow(list(peers.values()), 1000 if asked.quick else 10**6, seconds / 10)
    draw(grown, limit, asked.figure)
    print(f"\none exp(): {limit * 1e9:.2f} ns; {asked.figure} shows cost over batch size")
    return {"exp_seconds": limit, "growth": [growth.as_dict() for growth in grown]}


def _growth(asked: argparse.Namespace) -> list[dict[str, Any]]:
    from .growing import draw, grow  # noqa: PLC0415

    grown = grow(1000 if asked.quick else 10**7)
    draw(grown, asked.growth)
    return [one._asdict() for one in grown]


if __name__ == "__main__":
    main()
