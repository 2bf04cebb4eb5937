"""Record which tests reach what, draw mutants, try each on the tests that reach it, and list those that survive."""

from __future__ import annotations

import argparse
import contextlib
import fcntl
import hashlib
import json
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from typing import Any

from mutants import reach, tree
from mutants.drawing import Mutant, draw
from mutants.tested_by import seen_by

REACH = tree.WORK / "reach"
TRIED = tree.WORK / "tried.jsonl"
REASONS = Path(__file__).with_name("reasons.toml")
GOAL = 0.9
PATIENCE = 20.0
"""How many times its own processor time a test may take, beyond 20 s, before it counts as failed."""

STEPS = (0.03, 0.3, 3.0)
"""Seconds: quick tests run first, within a step file by file, so that what they share is made once."""


def main() -> None:
    """Try mutants; the exit code is 1 where fewer than the goal are killed."""
    parser = argparse.ArgumentParser(description="Try random mutants of src/ and native/ on the tests that reach them.")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--only", default="", help="only mutants of sources whose path matches this pattern")
    parser.add_argument("--map-only", action="store_true", help="only record which tests reach which lines")
    parser.add_argument("--record", default="", help="of tests never recorded, only those of files that match this")
    parser.add_argument("--budget", type=float, default=600.0, help="processor seconds of tests for one mutant")
    asked = parser.parse_args()
    tree.WORK.mkdir(parents=True, exist_ok=True)
    with (tree.WORK / "lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise SystemExit(f"another run works in {tree.WORK}") from None
        sys.exit(work(asked))


def work(asked: argparse.Namespace) -> int:
    """Copy the tree, record what its tests reach, and try mutants."""
    tree.copy_tree()
    if not tree.build_library():
        raise SystemExit("the compiled core of the tree as it is does not compile")
    known = read_map(asked.record)
    return 0 if asked.map_only else try_mutants(known, asked)


def read_map(record: str) -> reach.Reach:
    """Read which tests reach what, and record each group of tests that was changed, or is new and asked for."""
    known, groups = reach.Reach(tree.TREE), reach.groups(tree.TREE)
    for number, (name, paths) in enumerate(groups.items(), 1):
        kept = REACH / f"{name}.json"
        if not kept.exists() or json.loads(kept.read_text())["digest"] != reach.tests_digest(tree.TREE, paths):
            if not (kept.exists() or re.search(record, name)):
                continue
            print(f"recording {name}, {number} of {len(groups)}", flush=True)
            reach.record(tree.TREE, REACH, name, paths)
        known.add(REACH, name)
    if known.failing:
        print(f"{len(known.failing)} tests fail without any change and are left out:", *sorted(known.failing))
    return known


def try_mutants(known: reach.Reach, asked: argparse.Namespace) -> int:
    """Try as many mutants as were asked for, and print what became of them."""
    texts = reach.sources(tree.TREE)
    before = tried_before()
    outcomes: list[tuple[Mutant, dict[str, Any]]] = []
    for mutant in draw(texts, asked.seed):
        if len(outcomes) == asked.count:
            break
        if not re.search(asked.only, mutant.path):
            continue
        found = tried(mutant, texts, known, before, asked.budget)
        if found["outcome"] != "does not compile":
            outcomes.append((mutant, found))
            print(f"{len(outcomes)}: {found['outcome']} ({found['by']}): {mutant.path}:{mutant.line}", flush=True)
    return summary(outcomes)


def tried_before() -> dict[str, dict[str, Any]]:
    """Read what earlier runs found, by mutant and text of its source."""
    lines = TRIED.read_text(encoding="utf-8").splitlines() if TRIED.exists() else []
    found = {}
    for line in lines:
        try:
            one = json.loads(line)
        except ValueError:  # the last line of a run that was stopped
            continue
        found[one["key"]] = one
    return found


def tried(
    mutant: Mutant, texts: dict[str, str], known: reach.Reach, before: dict[str, dict[str, Any]], budget: float
) -> dict[str, Any]:
    """Return what becomes of a mutant: from before where nothing has changed that it depends on."""
    text = texts[mutant.path]
    key = hashlib.sha256(f"{text}\0{mutant.edit}".encode()).hexdigest()[:20]
    tests = within(ordered(seen_by(mutant, texts, known), known), known, budget)
    choice = hashlib.sha256(json.dumps([tests, test_texts(tests)]).encode()).hexdigest()[:20]
    old = before.get(key)
    if old is not None and (old["outcome"] != "survived" or old["choice"] == choice):
        return old
    began = time.monotonic()
    outcome, by = judged(mutant, text, tests, known)
    found = {"key": key, "choice": choice, "outcome": outcome, "by": by, "mutant": mutant.name, "tests": len(tests)}
    found["seconds"] = round(time.monotonic() - began, 1)
    with TRIED.open("a", encoding="utf-8") as file:
        file.write(json.dumps(found) + "\n")
        file.flush()
        os.fsync(file.fileno())
    return found


def test_texts(tests: list[str]) -> list[str]:
    """Return digests of the files that tests are in."""
    paths = sorted({name.partition("::")[0] for name in tests})
    return [reach.tests_digest(tree.TREE, [path]) for path in paths]


def ordered(tests: set[str], known: reach.Reach) -> list[str]:
    """Order tests: quick ones first, in a few steps, within which a file's tests stay together."""

    def place(name: str) -> tuple[int, str, str]:
        seconds = known.seconds.get(name, 0.0)
        return sum(seconds > step for step in STEPS), name.partition("::")[0], name

    return sorted(tests, key=place)


def within(tests: list[str], known: reach.Reach, budget: float) -> list[str]:
    """Return the first tests that together take no more than a budget of processor time."""
    spent, kept = 0.0, []
    for name in tests:
        spent += known.seconds.get(name, 0.0)
        if spent > budget:
            break
        kept.append(name)
    return kept


def judged(mutant: Mutant, text: str, tests: list[str], known: reach.Reach) -> tuple[str, str]:
    """Change the copy of the tree, run the tests until one fails, and undo the change."""
    if not tests:
        return "survived", "no test reaches it"
    compiled = not mutant.path.endswith(".py")
    try:
        tree.write(mutant.path, mutant.applied(text))
        if compiled and not tree.build_library():
            return "does not compile", ""
        return outcome_of(tests, known)
    finally:
        tree.write(mutant.path, text)
        if compiled:
            tree.build_library()


def outcome_of(tests: list[str], known: reach.Reach) -> tuple[str, str]:
    """Run tests on the copy of the tree; tell whether one fails, and which."""
    choice = tree.WORK / "choice.json"
    choice.write_text(json.dumps({name: 20.0 + PATIENCE * known.seconds.get(name, 1.0) for name in tests}))
    files = sorted({name.partition("::")[0] for name in tests})
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(tree.TREE / part) for part in ("tests", "tools", "src")]),
        "MUTANTS_CHOICE": str(choice),
    }
    command = [sys.executable, "-m", "pytest", "-x", "-q", "--tb=no", "-p", "no:xdist", "-p", "mutants.chosen", *files]
    longest = 600.0 + 10 * PATIENCE * sum(known.seconds.get(name, 1.0) for name in tests)
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    running = subprocess.Popen(command, cwd=tree.TREE, env=environment, start_new_session=True, **pipes)
    try:
        said = running.communicate(timeout=longest)[0]
    except subprocess.TimeoutExpired:
        return "killed", "it hangs"
    finally:
        end_session(running)
    code = running.returncode
    if code in {0, 5}:
        return "survived", f"{len(tests)} tests"
    if code < 0:
        return "killed", f"signal {signal.Signals(-code).name}"
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", said, re.MULTILINE)
    return "killed", failed.group(1) if failed else f"pytest ends with {code}"


def end_session(running: subprocess.Popen[str]) -> None:
    """End what a run of tests has started and left."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(running.pid, signal.SIGKILL)
    running.wait()


def known_reasons() -> dict[str, str]:
    """Read why some mutants may survive, by what they change."""
    listed = tomllib.loads(REASONS.read_text(encoding="utf-8"))["survivor"] if REASONS.exists() else ()
    return {f"{one['path']}: {one['before']}  ->  {one['after']}": one["reason"] for one in listed}


def summary(outcomes: list[tuple[Mutant, dict[str, Any]]]) -> int:
    """Print the survivors with what is known of them, and the share that was killed."""
    reasons = known_reasons()
    killed = sum(found["outcome"] == "killed" for _, found in outcomes)
    for mutant, found in outcomes:
        if found["outcome"] != "killed":
            print(f"\nsurvivor, {found['by']}: {mutant.path}:{mutant.line}")
            print(f"  - {mutant.before.strip()}\n  + {mutant.after.strip()}")
            print(f"  {reasons.get(mutant.name, 'no reason is known: a test is missing')}")
    share = killed / len(outcomes) if outcomes else 0.0
    print(f"\n{killed} of {len(outcomes)} mutants killed, {100 * share:.1f} %; the goal is {100 * GOAL:.0f} %")
    return int(share < GOAL)


if __name__ == "__main__":
    main()
