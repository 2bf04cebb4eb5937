"""Files that a command reads and writes: inputs are kept, contents stay private, a full disk is one sentence."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import pretouch as pt
from pretouch._core.errors import OutputError
from pretouch._core.files import is_own_unchanged, write_text
from pretouch.cli import main
from pretouch.report import write_report
from refusals import refused

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
VERBS = {
    "fit": ("fit", "sensor.csv"),
    "design": ("design", "fingertip.toml"),
    "sweep": ("sweep", "approach.toml", "--axis", "gain=-1:-0.1:5"),
    "pareto": ("pareto", "approach.toml"),
    "robust": ("robust", "robust.toml", "--samples", "64"),
    "simulate": ("simulate", "loop.toml", "--gain", "-0.7"),
    "verify": ("verify", "loop.toml", "--runs", "4", "--no-changes"),
    "reproduce": ("reproduce", "table-1"),
}
FULL = pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Copy the examples into a folder, which becomes the working folder."""
    for path in [*EXAMPLES.glob("*.toml"), EXAMPLES / "sensor.csv"]:
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def run(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    def run(*arguments: str) -> tuple[Any, str, str]:
        monkeypatch.setattr(sys, "argv", ["pretouch", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code, *capsys.readouterr()

    return run


# --- standard output


@pytest.mark.slow(keep=1)
@FULL
@pytest.mark.parametrize("more", [(), ("--json",)], ids=["text", "json"])
@pytest.mark.parametrize("verb", VERBS)
def test_an_output_that_takes_nothing_is_one_sentence(
    run: Any, monkeypatch: pytest.MonkeyPatch, verb: str, more: tuple[str, ...]
) -> None:
    plain = () if more or verb == "sweep" else ("--no-report",)
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stdout", full)
        code, _, err = run(*VERBS[verb], *more, *plain)
    assert (code, err) == (3, "pretouch: standard output: cannot be written (No space left on device)\n")


@pytest.mark.slow(keep=4)
@FULL
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize(
    "arguments", [("--help",), ("--version",), ("design", "--help"), ("design", "none.toml", "--json")]
)
def test_so_are_help_and_mistakes_in_a_process_of_their_own(
    folder: Path, arguments: tuple[str, ...], unbuffered: str
) -> None:
    """What is still in a buffer fails again when Python ends, unless it is let go."""
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        done = subprocess.run(
            [sys.executable, "-m", "pretouch", *arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
            check=False,
        )
    assert done.returncode == 3
    assert done.stderr.splitlines()[-1] == "pretouch: standard output: cannot be written (No space left on device)"
    assert "Traceback" not in done.stderr


@pytest.mark.slow
@FULL
def test_the_report_is_written_where_the_answer_cannot_be_printed(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stdout", full)
        code, _, err = run("design", "approach.toml")
    assert code == 3
    assert "standard output" in err
    assert Path("approach-design.html").read_text(encoding="utf-8").rstrip().endswith("</html>")


def test_streams_that_are_closed_are_no_traceback(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    code, _, err = run("design", "approach.toml", "--no-report")
    assert (code, err) == (3, "pretouch: standard output: cannot be written (it is closed)\n")
    monkeypatch.setattr(sys, "stderr", None)
    assert run("design", "none.toml")[0] == 2


# --- inputs


def spelled(name: str) -> dict[str, str]:
    """Write the name of a file in several ways, by links as well."""
    Path("link").symlink_to(name)
    os.link(name, "second-name")
    return {"as it is": name, "another": f"./sub/../{name}", "whole": str(Path(name).resolve())} | {
        "symbolic link": "link",
        "hard link": "second-name",
    }


@pytest.mark.slow(keep=5)
@pytest.mark.skipif(os.name == "nt", reason="POSIX links")
@pytest.mark.parametrize("spelling", ["as it is", "another", "whole", "symbolic link", "hard link"])
@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("design", "fingertip.toml"), "fingertip.toml"),
        (("design", "fingertip.toml"), "sensor.csv"),
        (("design", "fingertip.toml", "--json"), "sensor.csv"),
        (("simulate", "loop.toml", "--gain", "-0.7"), "loop.toml"),
        (("fit", "sensor.csv", "--model", "exponential-1"), "sensor.csv"),
        (("fit", "sensor.csv", "--no-object", "dark.csv", "--model", "exponential-1"), "dark.csv"),
    ],
)
def test_no_input_is_ever_written_over(
    run: Any, folder: Path, arguments: tuple[str, ...], name: str, spelling: str
) -> None:
    (folder / "sub").mkdir()
    Path("dark.csv").write_text("20\n21\n", encoding="utf-8")
    before = Path(name).read_bytes()
    code, out, err = run(*arguments, "--output", spelled(name)[spelling], "--force")
    assert code == 2
    assert ": the output would overwrite the input file " in err
    assert f"{name}. Choose another name with --output" in err
    assert Path(name).read_bytes() == before
    assert "--json" not in arguments or json.loads(out)["status"] == "error"


def test_nor_by_a_sweep_its_figure_or_python(run: Any, folder: Path) -> None:
    text = Path("fingertip.toml").read_text(encoding="utf-8").replace("sensor.csv", "sensor.png")
    Path("fingertip.toml").write_text(text, encoding="utf-8")
    Path("sensor.csv").rename("sensor.png")
    before = Path("sensor.png").read_bytes()
    code, _, err = run("sweep", "fingertip.toml", "--axis", "gain=-1:-0.1:5", "--figure", "sensor.png", "--force")
    assert code == 2
    assert "sensor.png: the output would overwrite the input file " in err
    task = pt.load_scenario("fingertip.toml")
    design = pt.design(task)
    for path in ("sensor.png", "fingertip.toml"):
        with refused(path, error=pt.errors.OutputExistsError, remedy="--output"):
            write_report(design, path, source=task.source, overwrite=True)
    assert Path("sensor.png").read_bytes() == before
    assert Path("fingertip.toml").read_text(encoding="utf-8") == text


# --- contents

SECRETS = {
    "a line of colons": "root:x:0:0:root:/root:/bin/sh\nmallory:x:7:7::/:/bin/sh\n",
    "a table": "user,mallory\n1,swordfish\n2,3\n",
    "a header": "mallory [mm],swordfish [V]\n1,2\n2,mallory\n",
    "another unit": "distance [mallory],output [V]\n1,2\n",
    "a distance without a unit": "distance,mallory\n1,2\n3,4\n",
    "a line": "mallory\n",
    "a row too long": "distance [mm],output [V]\n1,2\n1,2,mallory\n",
    "a negative distance": "distance [mm],output [V]\n1,2\n-4711,2\n",
    "two distances": "distance mallory [mm],range mallory [mm],output [V]\n1,2,3\n2,3,4\n",
    "numbers above": "1,2\n4711,4711\ndistance [mm],output [V]\n1,2\n",
    "no reading": "distance [mm],output [V],mallory\ninf,4711,a\ninf,4711,b\n",
    "a number beyond": "distance [mm],output [V]\n4711e300,2\n",
}


@pytest.mark.parametrize("kind", SECRETS)
def test_a_scenario_does_not_show_what_stands_in_a_file_that_is_no_calibration(run: Any, kind: str) -> None:
    """A scenario from a stranger may name any file: what is wrong is said, and where, but not with its words."""
    Path("secret").write_text(SECRETS[kind], encoding="utf-8")
    text = Path("fingertip.toml").read_text(encoding="utf-8").replace("sensor.csv", "secret")
    Path("fingertip.toml").write_text(text, encoding="utf-8")
    code, out, err = run("design", "fingertip.toml", "--json")
    assert code == 2
    line = text[: text.index("calibration")].count("\n") + 1
    assert err.startswith(f"pretouch: fingertip.toml, line {line}: sensor.calibration: secret")
    assert err.rstrip().endswith("to see more, run: pretouch fit secret")
    for word in ("mallory", "swordfish", "root", "4711"):
        assert word not in err + out
    code, _, err = run("fit", "secret")
    assert (code, err.startswith("pretouch: secret")) == (2, True)
    if kind in {"a line of colons", "a line", "a header"}:
        assert "root" in err or "mallory" in err  # who names the file himself sees what stands there


# --- limits of a scenario file


@pytest.mark.parametrize("key", [".".join(["a"] * 300_000), ".".join(["'b c'"] * 50), f"[{'.'.join(['s'] * 300_000)}]"])
def test_keys_of_very_many_parts_are_refused_before_they_are_read(run: Any, key: str) -> None:
    Path("deep.toml").write_text(f"# a.b.c\n{key}{'' if key[0] == '[' else ' = 1'}\n", encoding="utf-8")
    code, out, err = run("design", "deep.toml")
    assert (code, out) == (2, "")
    assert err == (
        "pretouch: deep.toml, line 2: the key has more than 32 parts, but keys of a scenario file have the form "
        "section.key\n"
    )


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="POSIX pipes and devices")
def test_a_scenario_that_never_ends_is_none(run: Any) -> None:
    os.mkfifo("pipe")
    for path, what in (("pipe", "a pipe"), ("/dev/zero", "a device or a socket")):
        code, _, err = run("design", path)
        assert code == 2
        assert f"{path}: this path is {what}, but pretouch needs a regular file" in err
    Path("large.toml").write_text("#" * 1_000_001, encoding="utf-8")
    assert "large.toml: this file is too large; the largest allowed size is 1 MB" in run("design", "large.toml")[2]


@pytest.mark.parametrize("kind", ["a table", "a header", "a line", "a distance without a unit"])
@pytest.mark.parametrize(
    ("key", "line"),
    [
        ("columns", 'columns = { distance = "1 [mm]", output = "9 [V]" }'),
        ("columns", 'columns = { distance = "range" }'),
        ("labels", 'columns = { distance = "1 [mm]", output = "2 [V]" }\nlabels = ["side"]'),
    ],
)
def test_a_scenario_with_wrong_columns_does_not_show_a_file_that_is_no_calibration(
    run: Any, kind: str, key: str, line: str
) -> None:
    """With columns by number any table can be read: what does not fit is said at its key, without the file's words."""
    Path("secret").write_text(SECRETS[kind], encoding="utf-8")
    text = Path("fingertip.toml").read_text(encoding="utf-8")
    text = text.replace('calibration = "sensor.csv"', f'calibration = "secret"\n{line}')
    Path("fingertip.toml").write_text(text, encoding="utf-8")
    code, out, err = run("design", "fingertip.toml", "--json")
    assert code == 2
    assert err.rstrip().endswith("to see more, run: pretouch fit secret")
    assert f": sensor.{key}: found {key} that do not fit secret" in err or "sensor.calibration: secret" in err
    for word in ("mallory", "swordfish"):
        assert word not in err + out


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_gets_the_output_and_is_never_read(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    assert not is_own_unchanged(pipe)  # reading it would wait for ever
    with pytest.raises(OutputError, match="no program reads this pipe"):
        write_text(pipe, "lost")
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_text(pipe, "kept")
        assert os.read(reader, 100) == b"kept"
    finally:
        os.close(reader)


@FULL
def test_a_device_gets_the_output_or_says_why_not() -> None:
    write_text("/dev/null", "gone")
    with pytest.raises(OutputError, match="No space left"):
        write_text("/dev/full", "too much")
