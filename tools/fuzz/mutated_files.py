"""Run mutated files through the command line, and look for what must never happen.

    PYTHONPATH=tests:tools python -m fuzz.mutated_files --count 10000 --seed 1

A traceback, a warning, another exit code than 0, 1 and 2, more than 10 s of processor time, a half-written or forgotten
file, text that says nan, JSON that is none. A worker process runs all commands, so that nothing is compiled twice;
where it hangs, dies or asks for too much memory, another one takes its place. What is found is reduced to the fewest
mutations and printed; each kind once, then counted. The exit code is 1 if anything was found.
"""

from __future__ import annotations

import argparse
import contextlib
import difflib
import io
import json
import multiprocessing
import os
import re
import shlex
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from mutations import EXAMPLES, Case, make_case

SECONDS = 10.0
HANGS = 60.0
MEMORY = 12 << 30
WARM = (
    ("fit", "", "--no-report"),
    ("fit", ""),
    ("design", "approach.toml"),
    ("design", "tradeoff.toml", "--no-report"),
    ("design", "fingertip.toml", "--no-report"),
    ("pareto", "fingertip.toml", "--no-report"),
    ("robust", "robust.toml", "--samples", "64"),
    ("sweep", "approach.toml", "--axis", "gain=-1:-0.1:20", "--output", "out.nc"),
    ("simulate", "loop.toml"),
    ("verify", "loop.toml", "--runs", "8"),
    ("verify", "drag.toml", "--runs", "8", "--no-changes", "--no-report"),
    ("design", "drag.toml", "--no-report"),
    ("simulate", "course.toml", "--no-report"),
    ("reproduce", ""),
)
_ALLOWED = {0, 1, 2}


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a command came to.

    Args:
        problem: what is wrong, alike for the same fault; empty where all is well.
        detail: more of it, for a person.
        code: the exit code.
        seconds: of processor time, of all threads.
    """

    problem: str
    detail: str
    code: Any
    seconds: float


def run(case: Case) -> Outcome:
    """Run a case in this process, in a folder of its own; what is too slow is run twice, for it may have compiled."""
    found = _run_once(case)
    if found.problem == "" and found.seconds > SECONDS:
        found = _run_once(case)
        if found.problem == "" and found.seconds > SECONDS:
            return replace(found, problem=f"slow: {case.verb}", detail=f"{found.seconds:.1f} s of processor time")
    return found


def _run_once(case: Case) -> Outcome:
    with tempfile.TemporaryDirectory() as folder:
        files = case.files()
        for name, content in files.items():
            Path(folder, name).write_bytes(content)
        os.chdir(folder)
        try:
            code, out, err, seconds = _call(case.command)
        finally:
            os.chdir(EXAMPLES)
        if isinstance(code, BaseException):
            return Outcome(problem=_signature(code), detail=err, code=None, seconds=seconds)
        problem = _flaw(code, out, err, "--json" in case.arguments) or _stray(Path(folder), files, code)
        return Outcome(problem=problem, detail=(err or out)[-2000:], code=code, seconds=seconds)


def _call(command: tuple[str, ...]) -> tuple[Any, str, str, float]:
    """Run a command through main with every warning an error; return code or exception, stdout, stderr, seconds."""
    from pretouch.cli import main

    out, err = io.TextIOWrapper(io.BytesIO(), "utf-8"), io.TextIOWrapper(io.BytesIO(), "utf-8")
    sys.argv = ["pretouch", *command]
    code: Any = None
    start = time.process_time()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            main()
        except SystemExit as ended:
            code = ended.code
        except BaseException as error:  # whatever it is, it is a find
            code = error
            traceback.print_exc()
    seconds = time.process_time() - start
    texts = []
    for stream in (out, err):
        stream.flush()
        texts.append(stream.buffer.getvalue().decode())  # type: ignore[attr-defined]
    return code, texts[0], texts[1], seconds


def _signature(error: BaseException) -> str:
    """Name an exception by its type and the innermost line of ours."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [f for f in frames if f"{os.sep}pretouch{os.sep}" in f.filename]
    place = f"{ours[-1].filename.rpartition(f'pretouch{os.sep}')[2]}:{ours[-1].lineno}" if ours else "nowhere"
    return f"{type(error).__name__} at {place}"


def _flaw(code: Any, out: str, err: str, json_wanted: bool) -> str:
    if code not in _ALLOWED:
        return f"exit code {code}"
    if code == 2 and not err.strip():
        return "exit code 2 without a word"
    if code != 2 and err.strip():
        return "exit code 0 or 1 with words on stderr"
    if code != 2 and not json_wanted and re.search(r"(?<![\w=-])[-+]?(nan)(?![\w-])", out):
        return "text that says nan"
    if json_wanted and not (code == 2 and "Usage:" in err):
        try:
            json.loads(out, parse_constant=lambda name: int(f"no {name}"))
        except ValueError:
            return "no JSON"
    return ""


def _stray(folder: Path, files: dict[str, bytes], code: Any) -> str:
    """Look for files that should not be there, or are not whole."""
    for path in sorted(folder.iterdir()):
        if path.name in files:
            if path.read_bytes() != files[path.name]:
                return "an input was changed"
            continue
        if path.name.startswith(".") or "unfinished" in path.name or path.suffix == ".tmp":
            return f"a temporary file is left: {re.sub(r'[0-9a-f]{12}', '*', path.name)}"
        if code == 2:
            return f"a mistake, but a file was written: {path.name}"
        if path.suffix == ".html" and not path.read_text(encoding="utf-8").rstrip().endswith("</html>"):
            return "half a report"
    return ""


def _work(connection: Any) -> None:
    """Run cases that come until none does."""
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    for verb, scenario, *more in WARM:  # compiles what is needed, once
        run(Case(verb=verb, scenario=scenario, changes=(), arguments=tuple(more), seed=(0,)))
    connection.send(None)
    while (case := connection.recv()) is not None:
        connection.send(run(case))


class Workplace:
    """A worker process, replaced where it does not answer."""

    def __init__(self) -> None:
        self._context = multiprocessing.get_context("spawn")
        self._start()

    def _start(self) -> None:
        self._connection, there = self._context.Pipe()
        self._process = self._context.Process(target=_work, args=(there,), daemon=True)
        self._process.start()
        there.close()
        self._connection.recv()

    def run(self, case: Case) -> Outcome:
        start = self._seconds()
        self._connection.send(case)
        problem = f"hangs: {case.verb}"
        try:
            while self._seconds() < start + HANGS:
                if self._connection.poll(1.0):
                    found: Outcome = self._connection.recv()
                    return found
        except EOFError:
            problem = f"the process died: {case.verb}"
        seconds = self._seconds() - start
        self._process.kill()
        self._process.join()
        self._start()
        return Outcome(problem=problem, detail="", code=None, seconds=seconds)

    def _seconds(self) -> float:
        """Return the processor time of the worker, or the time where the system does not tell."""
        try:
            fields = Path(f"/proc/{self._process.pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        except OSError:
            return time.monotonic()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def close(self) -> None:
        self._connection.send(None)
        self._process.join()


def reduce(case: Case, problem: str, place: Workplace) -> Case:
    """Leave mutations and arguments out as long as the same is found."""
    smaller = True
    while smaller:
        smaller = False
        tries = [replace(case, changes=case.changes[:i] + case.changes[i + 1 :]) for i in range(len(case.changes))]
        for i, name in enumerate(case.arguments):
            width = 1 if name in {"--json", "--no-report", "--no-changes"} else 2
            if name.startswith("--") and name not in {"--axis", "--no-report", "--no-changes"}:
                tries.append(replace(case, arguments=case.arguments[:i] + case.arguments[i + width :]))
        for tried in tries:
            if place.run(tried).problem == problem:
                case, smaller = tried, True
                break
    return case


def told(case: Case) -> str:
    """Write a case down: its command, and how its files differ from the examples."""
    lines = [shlex.join(("pretouch", *case.command))]
    for name, content in case.files().items():
        try:
            old, new = ((EXAMPLES / name).read_text(encoding="utf-8"), content.decode())
        except UnicodeDecodeError:
            lines.append(f"{name}: {content!r}"[:2000])
            continue
        lines += list(difflib.unified_diff(old.split("\n"), new.split("\n"), name, name, lineterm="", n=0))[:40]
    return "\n".join(line[:300].encode("unicode_escape").decode() for line in lines)


def say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def main() -> int:
    """Run the cases of a seed and say what was found."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=1000, help="how many cases")
    parser.add_argument("--seed", type=int, default=0, help="of all cases")
    parser.add_argument("--verb", default="", help="of all cases; any where none is named")
    parser.add_argument("--first", type=int, default=0, help="the first case, to repeat one that was found")
    asked = parser.parse_args()
    say(f"{asked.count} mutated files, seed {asked.seed}")
    place, finds, codes, verbs = Workplace(), Counter[str](), Counter[Any](), Counter[str]()
    again = f" --verb {asked.verb}" if asked.verb else ""
    start, times = time.monotonic(), []
    for index in range(asked.first, asked.first + asked.count):
        case = make_case(asked.seed, index, asked.verb)
        found = place.run(case)
        codes[found.code] += 1
        verbs[case.verb] += 1
        times.append((found.seconds, index, case.verb))
        if found.problem:
            finds[found.problem] += 1
            if finds[found.problem] == 1:
                small = reduce(case, found.problem, place) if "hangs" not in found.problem else case
                say(f"\n{found.problem} (--seed {asked.seed}{again} --first {index} --count 1)\n{told(small)}")
                say(f"{found.detail[-1500:]}")
        if (index + 1) % 500 == 0:
            say(f"... {index + 1} at {time.monotonic() - start:.0f} s, finds {sum(finds.values())}")
    place.close()
    wall = time.monotonic() - start
    say(
        f"\n{asked.count} cases in {wall:.0f} s ({asked.count / wall:.1f} per second), "
        f"{sum(seconds for seconds, *_ in times):.0f} s of processor time"
    )
    say(f"verbs {dict(verbs)}, exit codes {dict(codes)}")
    for verb, own in sorted((verb, sorted(one for one in times if one[2] == verb)) for verb in verbs):
        median, most, worst = own[len(own) // 2][0], own[-max(len(own) // 100, 1)][0], own[-1]
        say(
            f"{verb:10s} median {median:6.2f} s, 99 % within {most:6.2f} s, slowest {worst[0]:6.2f} s (case {worst[1]})"
        )
    for problem, times in finds.most_common():
        say(f"{times:6d}  {problem}")
    say("nothing found" if not finds else f"{len(finds)} kinds of finds")
    return 1 if finds else 0


if __name__ == "__main__":
    raise SystemExit(main())
