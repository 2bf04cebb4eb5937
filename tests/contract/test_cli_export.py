"""`pretouch export`: what it writes, what it refuses, and that a folder is complete or absent."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from command_text import in_this_process as run

import pretouch as pt
from pretouch.cli.export import Target
from pretouch.config.schema import keys_of
from pretouch.control import Limits, VirtualDamper
from pretouch.errors import InvalidInputError, OutputError, OutputExistsError
from pretouch.exports import TARGETS, export
from pretouch.exports.folder import MANIFEST, write_folder
from pretouch.report.pages import page_of
from refusals import refused

pytestmark = pytest.mark.usefixtures("short_rest")

ROOT = Path(__file__).parents[2]
LOOP = ROOT / "examples/loop.toml"
PARAMETERS = "src/pretouch_controller_parameters.yaml"
PAGES = {
    path.stem: path.read_text(encoding="utf-8")
    for path in (ROOT / "docs/how-to/export.md", *sorted((ROOT / "docs/how-to/export").glob("*.md")))
}
SESSIONS = [
    pytest.param(session, id=f"{name}-{session.split()[1]}")
    for name, page in PAGES.items()
    for session in re.findall(r"```console\n(\$ make .*?)```", page, re.DOTALL)
]


@pytest.mark.slow
def test_a_verified_law_is_written_with_its_verdict_and_date(tmp_path: Path) -> None:
    gain = ["--gain", "-0.86 N*s", "--json"]
    answer = run("export", "c", str(LOOP), "-o", "law", *gain, folder=tmp_path, SOURCE_DATE_EPOCH="1700000000")
    assert answer.returncode == 0, answer.stderr
    told = json.loads(answer.stdout)
    assert (told["status"], told["verdict"]) == ("exported", "holds")
    assert {Path(name).name for name in told["files"]} == {p.name for p in (tmp_path / "law").iterdir()} - {MANIFEST}
    header = (tmp_path / "law/pretouch_design.h").read_text()
    assert "(2023-11-14): Holds" in header
    assert "loop.toml, SHA-256 " in header
    assert "D_p = -0.86 N s" in header


@pytest.mark.slow
def test_a_law_that_does_not_hold_is_not_written(tmp_path: Path) -> None:
    answer = run("export", "c", str(LOOP), "-o", "law", folder=tmp_path)
    assert answer.returncode == 1
    assert answer.stdout.startswith("Nothing was exported")
    assert (
        'Next: run pretouch verify with the same file and --gain "-0.746' in answer.stdout
    )  # the verdict of the same gain
    assert not list(tmp_path.iterdir())


def test_without_verification_the_files_say_so(tmp_path: Path) -> None:
    answer = run("export", "c", str(LOOP), "-o", "law", "--unverified", folder=tmp_path)
    assert answer.returncode == 0
    assert "not verified" in answer.stdout.splitlines()[0]
    for name in ("pretouch_design.h", "README.md"):
        assert "Not verified" in (tmp_path / "law" / name).read_text()


@pytest.mark.parametrize("target", TARGETS)
def test_an_unverified_law_that_pulls_toward_the_object_needs_an_option_that_names_it(
    target: str, tmp_path: Path
) -> None:
    task = pt.load_scenario(LOOP).replace(gain=0.5)
    with refused("gain", remedy="--toward-object"):
        export(task, tmp_path / "law", target, verify=False)
    assert not list(tmp_path.iterdir())
    if target == "fmu":  # compiling takes long, and the rule is that of all targets
        return
    written = export(task, tmp_path / "law", target, verify=False, toward_object=True)
    assert written.is_written
    assert written.attraction
    (text,) = [text for text in page_of(written).warnings if "chase" in text]
    assert text.startswith("PT316")
    told = "".join(p.read_text(errors="ignore") for p in (tmp_path / "law").rglob("*") if p.is_file())
    assert "Not verified" in told
    assert "makes the robot chase the object" in " ".join(told.split())


@pytest.mark.parametrize(("gain", "count"), [(-0.7, 1), (0.0, 2)])
def test_an_unverified_export_says_what_nobody_knows(gain: float, count: int, tmp_path: Path) -> None:
    written = export(pt.load_scenario(LOOP).replace(gain=gain), tmp_path / "law", "json", verify=False)
    assert sum(text.startswith("PT316") for text in page_of(written).warnings) == count
    assert written.is_idle == (gain == 0)
    assert "verify" in written.next_step


def test_a_number_that_no_law_can_have_is_not_exported(tmp_path: Path) -> None:
    drag = pt.load_scenario(LOOP.with_name("drag.toml"))
    for task in (pt.load_scenario(LOOP).replace(gain=float("nan")), drag.replace(gain=-0.01)):
        with pytest.raises(InvalidInputError):
            export(task, tmp_path / "law", verify=False, toward_object=True)
    assert not list(tmp_path.iterdir())


def test_the_option_for_laws_toward_the_object_is_for_unverified_ones(tmp_path: Path) -> None:
    answer = run("export", "json", str(LOOP), "-o", "law", "--toward-object", folder=tmp_path)
    assert (answer.returncode, "needs --unverified" in answer.stderr) == (2, True)


@pytest.mark.slow
def test_a_law_without_limits_is_written_with_a_warning_and_the_reason_of_its_verdict(tmp_path: Path) -> None:
    task = pt.load_scenario(LOOP).replace(constraints=(), gain=-0.86)
    free = replace(task.loop.law, limits=Limits())
    for law, gain, warned in ((task.loop.law, -0.86, False), (free, -0.86, True), (free, -1.2, True)):
        written = export(task.replace(loop=replace(task.loop, law=law), gain=gain), tmp_path / f"{gain}{warned}")
        assert ("PT416" in str(written)) == warned
        assert written.verdict is not None
        narrow = "".join(f" (holds narrowly: {reason})." for reason in written.verdict.reasons[:1])
        assert bool(narrow) == (gain == -1.2)
        assert written.headline.endswith(narrow or " (holds).")


def test_the_same_design_gives_the_same_files(tmp_path: Path) -> None:
    task = pt.load_scenario(LOOP).replace(gain=-0.86)
    for name in ("a", "b"):
        export(task, tmp_path / name, verify=False)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["c", "no.toml", "-o", "law"], "no.toml"),
        (["c", "LOOP", "-o", "no/law"], "does not exist"),
        (["c", "LOOP", "-o", "file"], "a file or link"),
        (["c", "LOOP", "-o", "full"], "already exists"),
        (["c", "LOOP", "-o", "full", "--force"], "notes.txt"),
        (["c", "LOOP", "-o", "law", "--gain", "-0.86 m"], "--gain"),
        (["c", "APPROACH", "-o", "law"], "[controller]"),
    ],
    ids=["missing file", "missing parent", "file", "full", "foreign file", "wrong unit", "no loop"],
)
def test_a_mistake_is_one_sentence_and_writes_nothing(words: list[str], told: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    write_folder(tmp_path / "full", {"law.c": b"int x;"})
    (tmp_path / "full/notes.txt").write_text("mine")
    before = sorted(tmp_path.rglob("*"))
    places = {"LOOP": str(LOOP), "APPROACH": str(LOOP.with_name("approach.toml"))}
    answer = run("export", *[places.get(word, word) for word in words], folder=tmp_path)
    assert answer.returncode == 2
    assert answer.stdout == ""
    assert answer.stderr.startswith("pretouch: ")
    assert told in answer.stderr
    assert "Traceback" not in answer.stderr
    assert sorted(tmp_path.rglob("*")) == before


def test_an_earlier_export_is_replaced_only_on_demand_and_only_unchanged(tmp_path: Path) -> None:
    target = tmp_path / "law"
    write_folder(target, {"law.c": b"old", "a/b.c": b"old"})
    with refused(str(target), error=OutputExistsError, remedy="--force"):
        write_folder(target, {"law.c": b"new"})
    (target / "build").mkdir()
    (target / "build/test_law").write_bytes(b"compiled")
    write_folder(target, {"law.c": b"new"}, overwrite=True)
    assert sorted(p.name for p in target.iterdir()) == ["law.c", MANIFEST]
    (target / "law.c").write_bytes(b"edited")
    with pytest.raises(OutputExistsError, match=r"The file law\.c was added or changed after the export"):
        write_folder(target, {"law.c": b"newer"}, overwrite=True)
    assert (target / "law.c").read_bytes() == b"edited"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["law"]


def test_an_export_that_cannot_be_finished_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written = Path.write_bytes

    def full(path: Path, content: bytes) -> int:
        if path.name == "second":
            raise OSError(28, "No space left on device")
        return written(path, content)

    monkeypatch.setattr(Path, "write_bytes", full)
    with refused(error=OutputError, value="No space left on device"):
        write_folder(tmp_path / "law", {"first": b"1", "second": b"2"})
    assert not list(tmp_path.iterdir())


def test_the_command_line_has_every_target(tmp_path: Path) -> None:
    """The command line lists the targets without importing the exports, so that --help is quick."""
    assert [target.value for target in Target] == list(TARGETS)
    with refused("target", value="matlab", limit=("arduino", "c", "fmu", "json", "ros2")):
        export(pt.load_scenario(LOOP), tmp_path / "law", "matlab")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("target", "path"), [("fmu", "README.md"), ("ros2", "README.md"), ("ros2", PARAMETERS)])
def test_files_with_a_parameter_for_the_gain_say_that_a_weaker_one_is_not_verified(
    target: str, path: str, tmp_path: Path
) -> None:
    export(pt.load_scenario(LOOP).replace(gain=-0.86), tmp_path / "law", target, verify=False)
    text = " ".join((tmp_path / "law" / path).read_text().split())
    assert re.search(r"weaker gain .*harder.* verification", text)


@pytest.mark.parametrize("target", list(TARGETS))
def test_a_written_page_names_keys_that_scenario_files_have(target: str, tmp_path: Path) -> None:
    """The page of ROS 2 named a delay in [plant], which has none."""
    export(pt.load_scenario(LOOP).replace(gain=-0.86), tmp_path / "law", target, verify=False)
    pages = " ".join(" ".join(page.read_text().split()) for page in (tmp_path / "law").rglob("*.md"))
    named = re.findall(r"(?:`(\w+)`|\bit) in `\[(\w+)\]`", pages)
    assert all(key in keys_of(section) for key, section in named), named
    assert len(named) >= (5 if target == "ros2" else 0)


def test_an_empty_folder_is_used(tmp_path: Path) -> None:
    (tmp_path / "law").mkdir()
    write_folder(tmp_path / "law", {"law.c": b"new"})
    assert (tmp_path / "law/law.c").read_bytes() == b"new"


def test_a_custom_law_has_no_c_source(tmp_path: Path) -> None:
    class Own(VirtualDamper):
        """A law that could compute anything in its own step."""

    task = pt.load_scenario(LOOP)
    loop = replace(task.loop, law=replace(task.loop.law, law=Own(gain=-0.86)))
    with refused("law"):
        export(task.replace(loop=loop), tmp_path / "law")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("session", SESSIONS)
def test_the_test_of_the_exported_law_prints_what_the_page_shows(session: str, tmp_path: Path) -> None:
    if not all(map(shutil.which, ["make", "cc"])):
        pytest.skip("no make or no compiler")
    command, _, expected = session.partition("\n")
    export(pt.load_scenario(LOOP).replace(gain=-0.86), tmp_path / "law", verify=False)
    done = subprocess.run(
        [*shlex.split(command)[1:], "-s"], capture_output=True, text=True, check=True, cwd=tmp_path
    ).stdout
    pattern = re.escape(expected).replace(r"\.\.\.", r"\S+")
    shown = "\n".join(line for line in done.splitlines() if not line.startswith("make")) + "\n"
    assert re.fullmatch(pattern, shown), shown


def test_the_python_example_of_the_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"```python\n(.*?)```", PAGES["export"], re.DOTALL)
    exec(compile(block, "export.md", "exec"), {})  # noqa: S102 - our own page
    assert "holds" in capsys.readouterr().out
    assert (tmp_path / "law_from_python/pretouch_design.h").is_file()


def test_the_c_example_of_the_page_compiles(tmp_path: Path) -> None:
    if shutil.which("cc") is None:
        pytest.skip("no compiler")
    export(pt.load_scenario(LOOP).replace(gain=-0.86), tmp_path / "law", verify=False)
    (source,) = re.findall(r"```c\n(.*?)```", PAGES["c"], re.DOTALL)
    (tmp_path / "use.c").write_text(source)
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", f"-I{tmp_path / 'law'}", "-c", "-o", str(tmp_path / "use.o")]
    subprocess.run(["cc", *flags, str(tmp_path / "use.c")], check=True)
