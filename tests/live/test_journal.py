import errno
import json
import os
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.live import journal as module
from maipp.live.journal import Journal


def write(path, count):
    journal = Journal(path)
    for index in range(count):
        journal.append({"event": {"id": f"e{index}"}, "value": 0.1 * index})
    journal.close()
    return path.read_bytes()


def test_records_come_back(tmp_path):
    path = tmp_path / "j"
    write(path, 3)
    journal = Journal(path)
    assert [record["seq"] for record in journal.records] == [0, 1, 2]
    assert [record["value"] for record in journal.records] == [0.0, 0.1, 0.2]
    assert journal.cut == 0
    journal.append({"value": 3})
    journal.close()
    again = Journal(path)
    assert [record["value"] for record in again.records] == [0.0, 0.1, 0.2, 3]
    again.close()


def test_every_line_is_json_by_itself(tmp_path):
    lines = write(tmp_path / "j", 2).splitlines()
    assert [set(json.loads(line)) for line in lines] == [{"sum", "seq", "event", "value"}] * 2


@given(part=st.floats(0, 1, exclude_max=True), count=st.integers(1, 3))
def test_a_torn_last_line_is_cut_away(tmp_path_factory, part, count):
    path = tmp_path_factory.mktemp("torn") / "j"
    whole = write(path, count)
    last = whole.splitlines(keepends=True)[-1]
    kept = int(part * len(last))
    path.write_bytes(whole[: len(whole) - len(last) + kept])
    journal = Journal(path)
    assert len(journal.records) == count - 1 and journal.cut == kept
    journal.append({"event": {"id": f"e{count - 1}"}, "value": 0.1 * (count - 1)})
    journal.close()
    assert path.read_bytes() == whole


def test_a_torn_block_of_zeros_is_cut_away(tmp_path):
    path = tmp_path / "j"
    whole = write(path, 2)
    path.write_bytes(whole + b"\0" * 512)
    with pytest.raises(InputError, match="line 1 is no line"):
        Journal(tmp_path / "j2" if (tmp_path / "j2").write_bytes(b"\0" * 9) else path)
    journal = Journal(path)
    assert len(journal.records) == 2 and journal.cut == 512
    journal.close()
    assert path.read_bytes() == whole


@given(line=st.integers(0, 2), where=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_a_changed_bit_is_told_with_its_line(tmp_path_factory, line, where, bit):
    path = tmp_path_factory.mktemp("bit") / "j"
    lines = write(path, 3).splitlines(keepends=True)
    changed = bytearray(lines[line])
    at = int(where * (len(changed) - 1))  # not the line's end
    changed[at] ^= 1 << bit
    if changed[at] == ord("\n"):
        return  # two lines now, the first of them damaged all the same
    path.write_bytes(b"".join([*lines[:line], bytes(changed), *lines[line + 1 :]]))
    with pytest.raises(InputError, match=f"line {line + 1} ") as error:
        Journal(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "change", [lambda x: x[:1] + x[2:], lambda x: [x[0], x[2], x[1]], lambda x: [*x[:2], x[1], x[2]]]
)
def test_lines_removed_moved_or_doubled_are_told(tmp_path, change):
    path = tmp_path / "j"
    lines = write(path, 3).splitlines(keepends=True)
    path.write_bytes(b"".join(change(lines)))
    with pytest.raises(InputError, match=r"line [23] is damaged, or lines before it are missing"):
        Journal(path)


@pytest.mark.parametrize("content", [b"name,value\n1,2\n", b"{}", b'{"a": 1}\n', b"\n", b"\xff\xfe\n"])
def test_another_file_is_left_alone(tmp_path, content):
    path = tmp_path / "notes.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match="line 1 is no line of a journal"):
        Journal(path)
    assert path.read_bytes() == content


def test_two_at_once_are_refused_in_one_process_and_in_two(tmp_path):
    path = tmp_path / "j"
    journal = Journal(path)
    with pytest.raises(InputError, match="another process is using this journal"):
        Journal(path)
    code = f"from maipp.live.journal import Journal; Journal({str(path)!r})"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment)
    assert "another process is using this journal" in other.stderr
    journal.close()
    Journal(path).close()


def test_what_cannot_be_written_leaves_the_journal_as_it_was(tmp_path, monkeypatch):
    path = tmp_path / "j"
    journal = Journal(path)
    journal.append({"value": 1})
    before = path.read_bytes()
    write_all = os.write

    def disk_full(file, content):
        write_all(file, content[:9])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(module.os, "write", disk_full)
    with pytest.raises(InputError, match="cannot write the journal: No space left"):
        journal.append({"value": 2})
    assert path.read_bytes() == before
    monkeypatch.undo()
    journal.append({"value": 3})
    journal.close()
    again = Journal(path)
    assert [record["value"] for record in again.records] == [1, 3]
    again.close()


def test_a_journal_that_cannot_be_mended_takes_no_more_lines(tmp_path, monkeypatch):
    path = tmp_path / "j"
    journal = Journal(path)

    def broken(*_):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(module.os, "fsync", broken)
    with pytest.raises(InputError, match="cannot write"):
        journal.append({"value": 1})
    monkeypatch.undo()
    with pytest.raises(InputError, match="cannot write"):
        journal.append({"value": 2})


def test_a_folder_is_told(tmp_path):
    with pytest.raises(InputError, match="cannot open the journal"):
        Journal(tmp_path)
