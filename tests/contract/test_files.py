"""No file is ever destroyed: written whole or not at all, never over another one unasked."""

from __future__ import annotations

import os
import stat
import threading
from pathlib import Path

import pytest

from pretouch._core import files
from pretouch._core.errors import InvalidInputError, OutputError, OutputExistsError
from pretouch._core.files import is_own_unchanged, read_regular_file, sign, write_text
from refusals import refused

PAGE = "<!doctype html>\n<html><head>\n<title>ξ(l)</title></head><body>1\r\n2</body></html>\n"


def names(folder):
    return sorted(p.name for p in folder.iterdir())


def test_a_text_is_written_as_it_is_and_nothing_else_is_left(tmp_path):
    text = "ξ\r\nµ\n"
    assert write_text(tmp_path / "a.txt", text) == tmp_path / "a.txt"
    assert (tmp_path / "a.txt").read_bytes() == text.encode()
    assert names(tmp_path) == ["a.txt"]


def test_an_existing_file_is_not_overwritten_unasked(tmp_path):
    file = tmp_path / "a.txt"
    write_text(file, "first")
    with refused(str(file), error=OutputExistsError, remedy="--force"):
        write_text(file, "second")
    assert file.read_text() == "first"
    write_text(file, "third", overwrite=True)
    assert file.read_text() == "third"
    assert names(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("hard_links", [True, False])
def test_of_many_writers_at_once_exactly_one_wins(tmp_path, monkeypatch, hard_links):
    if not hard_links:

        def refuse(source, target):
            raise OSError(95, "Operation not supported")

        monkeypatch.setattr(os, "link", refuse)
    outcome = []

    def write(i):
        try:
            write_text(tmp_path / "a.txt", str(i))
            outcome.append(i)
        except OutputExistsError:
            pass

    threads = [threading.Thread(target=write, args=(i,)) for i in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(outcome) == 1
    assert (tmp_path / "a.txt").read_text() == str(outcome[0])
    assert names(tmp_path) == ["a.txt"]


def test_a_crash_while_writing_leaves_the_old_file_and_no_half_one(tmp_path, monkeypatch):
    file = tmp_path / "a.txt"
    write_text(file, "old")

    def fail(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", fail)
    with refused(str(file), error=OutputError, value="No space left on device"):
        write_text(file, "new", overwrite=True)
    assert file.read_text() == "old"
    assert names(tmp_path) == ["a.txt"]


def test_a_missing_folder_and_a_folder_in_the_way_are_refused(tmp_path):
    with refused(str(tmp_path / "none" / "a.txt")):
        write_text(tmp_path / "none" / "a.txt", "")
    with refused(str(tmp_path), error=OutputExistsError, remedy="--force"):
        write_text(tmp_path, "")
    with refused(str(tmp_path), error=OutputError):
        write_text(tmp_path, "", overwrite=True)
    assert names(tmp_path) == []


def test_what_a_killed_write_left_is_removed_by_a_later_one_of_the_same_name(tmp_path):
    """An hour after its last change nobody writes to it any more; other files and fresh ones are left alone."""
    old, fresh, other = (
        tmp_path / f".{name}.tmp" for name in ("a.txt.0123456789ab", "a.txt.ba9876543210", "b.txt.0123456789ab")
    )
    folder, foreign = tmp_path / ".a.txt.00000000ffff.tmp", tmp_path / ".a.txt.notes.tmp"
    folder.mkdir()
    (folder / "chunk").write_text("half")
    for path in (old, fresh, other, foreign):
        path.write_text("half")
    for path in (old, other, foreign, folder):
        os.utime(path, (0, 0))
    write_text(tmp_path / "a.txt", "whole")
    assert names(tmp_path) == sorted([fresh.name, other.name, foreign.name, "a.txt"])


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="POSIX pipes and devices")
def test_a_device_a_pipe_and_a_file_that_is_too_large_are_not_read(tmp_path):
    """Each of them would never end: the pipe waits for somebody who writes."""
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", "/dev/zero"):
        with refused(str(path)):
            read_regular_file(path, most=10, refuse=InvalidInputError)
    (tmp_path / "large").write_bytes(bytes(2_000_001))
    with refused(str(tmp_path / "large"), limit=2_000_000):
        read_regular_file(tmp_path / "large", most=2_000_000, refuse=InvalidInputError)
    assert len(read_regular_file(tmp_path / "large", most=2_000_001, refuse=InvalidInputError)) == 2_000_001
    with pytest.raises(IsADirectoryError):
        read_regular_file(tmp_path, most=10, refuse=InvalidInputError)


@pytest.mark.skipif(os.name == "nt", reason="POSIX permissions and links")
def test_links_stay_links_and_permissions_follow_the_mask(tmp_path):
    (tmp_path / "link.txt").symlink_to(tmp_path / "target.txt")
    mask = os.umask(0o027)
    try:
        write_text(tmp_path / "link.txt", "through")
    finally:
        os.umask(mask)
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "target.txt").read_text() == "through"
    assert stat.S_IMODE((tmp_path / "target.txt").stat().st_mode) == 0o640


def test_a_signed_report_is_known_as_our_own(tmp_path):
    file = write_text(tmp_path / "report.html", sign(PAGE))
    assert is_own_unchanged(file)
    assert '<head>\n<meta name="generator" content="pretouch sha256:' in file.read_text()
    assert sign(file.read_bytes().decode()) == file.read_bytes().decode()


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("1", "3"),
        lambda text: text + " ",
        lambda text: text.replace("\r\n", "\n"),
        lambda text: text.replace("sha256:", "sha256:0", 1),
        lambda text: text.replace("<head>", "<head>" + sign("<head>").removeprefix("<head>"), 1),
        lambda text: PAGE + text[:0],
        lambda text: text[:0],
    ],
)
def test_a_report_that_was_changed_is_not_our_own_any_more(tmp_path, change):
    file = tmp_path / "report.html"
    file.write_bytes(change(sign(PAGE)).encode())
    assert not is_own_unchanged(file)


def test_what_is_no_page_is_neither_signed_nor_known(tmp_path):
    with refused("html"):
        sign("text")
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    assert not is_own_unchanged(tmp_path / "binary")
    assert not is_own_unchanged(tmp_path)
    assert not is_own_unchanged(Path(tmp_path, "nothing"))
