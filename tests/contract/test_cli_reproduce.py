"""`pretouch reproduce`: what it prints, what it writes, how it ends; what it computes has its own tests."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from command_text import command, strict

import pretouch.letter
from letter_samples import bad, good
from pretouch._core.errors import InvalidInputError
from pretouch._core.files import is_own_unchanged, plain

DEFAULT = Path("letter-reproduction.html")


class StandIn:
    """Stands in for `reproduce`, which takes half a minute: remembers what it was asked for."""

    def __init__(self):
        self.report = good()
        self.asked = []

    def __call__(self, ids=(), *, progress=None):
        self.asked.append(tuple(ids))
        if "table-9" in ids:
            raise InvalidInputError("ids: found 'table-9', expected one of table-1, table-2")
        for part in self.report.reproductions:
            if progress is not None:
                progress(part.id)
        return self.report


@pytest.fixture
def computed(monkeypatch):
    stand_in = StandIn()
    monkeypatch.setattr(pretouch.letter, "reproduce", stand_in)
    return stand_in


@pytest.fixture
def run(tmp_path, monkeypatch, capsys, computed):
    monkeypatch.chdir(tmp_path)
    return command(monkeypatch, capsys)


def test_it_prints_what_came_out_and_where_the_report_is(run, computed):
    code, out, err = run("reproduce")
    assert (code, err) == (0, "")
    assert out.startswith(str(good()))
    assert out.splitlines()[-1] == f"Report with figures: {DEFAULT}"
    assert is_own_unchanged(DEFAULT)
    assert "The gains of table-2" in DEFAULT.read_text(encoding="utf-8")
    assert computed.asked == [()]


def test_what_is_named_is_what_is_computed(run, computed):
    assert run("reproduce", "figure-6", "table-2", "--no-report")[0] == 0
    assert computed.asked == [("figure-6", "table-2")]


def test_what_does_not_come_out_ends_with_1_and_is_shown(run, computed):
    computed.report = bad()
    code, out, err = run("reproduce")
    assert (code, err) == (1, "")
    assert "NOT REPRODUCED" in out
    assert "not reproduced" in DEFAULT.read_text(encoding="utf-8")
    code, out, err = run("reproduce", "--json")
    assert (code, err) == (1, "")
    assert strict(out)["holds"] is False


def test_an_unknown_id_ends_with_2(run):
    code, out, err = run("reproduce", "table-9")
    assert (code, out) == (2, "")
    assert err == "pretouch: ids: found 'table-9', expected one of table-1, table-2\n"
    code, out, _ = run("reproduce", "table-9", "--json")
    assert code == 2
    assert strict(out)["status"] == "error"
    assert not DEFAULT.exists()


def test_as_json_it_is_one_object_and_writes_nothing(run, tmp_path):
    code, out, err = run("reproduce", "--json")
    assert (code, err) == (0, "")
    assert strict(out) == plain(good().to_dict())
    assert list(tmp_path.iterdir()) == []


def test_with_json_a_report_is_written_only_where_it_is_asked_for(run):
    code, out, _ = run("reproduce", "--json", "--output", "mine.html")
    assert code == 0
    assert strict(out)["holds"] is True
    assert is_own_unchanged("mine.html")
    assert not DEFAULT.exists()


def test_without_a_report_nothing_is_written(run, tmp_path):
    assert run("reproduce", "--no-report")[0] == 0
    assert list(tmp_path.iterdir()) == []


def test_a_report_is_written_again_but_nothing_of_the_user_is_overwritten(run):
    assert run("reproduce")[0] == 0
    assert run("reproduce")[0] == 0
    DEFAULT.write_text("mine")
    code, _, err = run("reproduce")
    assert code == 2
    assert err.startswith(f"pretouch: {DEFAULT}: this file already exists, and pretouch does not overwrite it")
    assert DEFAULT.read_text() == "mine"
    assert run("reproduce", "--output", "other.html")[0] == 0
    assert is_own_unchanged("other.html")
    assert run("reproduce", "--force")[0] == 0
    assert is_own_unchanged(DEFAULT)


def test_a_person_at_a_terminal_sees_what_is_computed(run, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    code, out, err = run("reproduce", "--json")
    assert code == 0
    assert err == "pretouch: computing table-2\npretouch: computing figure-6\n"
    assert strict(out)["holds"] is True


def test_the_help_lists_every_id(run, monkeypatch):
    for width in ("40", "80", "200"):
        monkeypatch.setenv("COLUMNS", width)
        code, out, _ = run("reproduce", "--help")
        assert code == 0
        listed = out.partition("ID is one of:")[2].partition("Exit status")[0]
        assert tuple(listed.split()) == pretouch.letter.IDS


def test_the_reference_lists_every_id():
    text = (Path(__file__).parents[2] / "docs" / "reference/cli.md").read_text(encoding="utf-8")
    section = text.partition("## pretouch reproduce")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `([a-z0-9-]+)` \|", section, re.MULTILINE)
    assert tuple(rows) == pretouch.letter.IDS


def test_help_loads_none_of_the_letter():
    code = (
        "import sys; sys.argv = ['pretouch', 'reproduce', '--help']\n"
        "from pretouch.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print([m for m in sys.modules if m.startswith(('pretouch.letter', 'numpy', 'scipy', 'matplotlib'))])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
