"""Atomic writes: a reader sees the old file or the new one, and nothing is left behind."""

import pytest

from maipp.errors import InputError
from maipp.files import atomic_path, staged_folder, write_atomic


def test_content_is_written_as_it_is(tmp_path):
    write_atomic(tmp_path / "text.csv", "a\r\nµ\n")
    write_atomic(tmp_path / "bytes", b"\x00\xff")
    assert (tmp_path / "text.csv").read_bytes() == "a\r\nµ\n".encode()
    assert (tmp_path / "bytes").read_bytes() == b"\x00\xff"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bytes", "text.csv"]


@pytest.mark.parametrize("interruption", [RuntimeError, KeyboardInterrupt])
def test_an_interrupted_write_leaves_the_old_file_and_no_other(tmp_path, interruption):
    target = tmp_path / "file.png"
    target.write_text("old")
    with pytest.raises(interruption), atomic_path(target) as temporary:
        assert temporary.suffix == ".png" and temporary.parent == tmp_path
        temporary.write_text("half")
        raise interruption
    assert [p.name for p in tmp_path.iterdir()] == ["file.png"]
    assert target.read_text() == "old"


def test_a_path_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(InputError, match=r"missing.file\.json: cannot be written: No such file"):
        write_atomic(tmp_path / "missing" / "file.json", "{}")
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="folder: cannot be written"):
        write_atomic(tmp_path / "folder", "text")
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]


def test_staged_files_arrive_together_or_not_at_all(tmp_path):
    out = tmp_path / "new" / "out"
    with staged_folder(out) as stage:
        (stage / "a").write_text("1")
        assert not (out / "a").exists()
    with pytest.raises(KeyboardInterrupt), staged_folder(out) as stage:
        (stage / "a").write_text("2")
        (stage / "b").write_text("2")
        raise KeyboardInterrupt
    assert [(p.name, p.read_text()) for p in out.iterdir()] == [("a", "1")]


def test_a_file_is_no_folder_to_stage_in(tmp_path):
    (tmp_path / "file").write_text("kept")
    for bad in ("file", "file/below"):
        with pytest.raises(InputError, match="file"), staged_folder(tmp_path / bad):
            raise AssertionError("must not get here")
    assert (tmp_path / "file").read_text() == "kept"
