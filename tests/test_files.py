"""Atomic writes: a reader sees the old file or the new one, and nothing is left behind."""

import os
import signal
from pathlib import Path

import pytest

from maipp import files
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


OLD = {"a": "old a", "b": "old b", "gone": "old gone", "other": "other"}
NEW = {"a": "new a", "b": "new b", "c": "new c", "other": "other"}
OPERATIONS = ("replace", "link", "fsync", "open", "unlink", "mkdir", "rmdir", "scandir", "listdir", "lstat")


def visible(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir() if not path.name.startswith(".")}


def old_folder(folder: Path) -> Path:
    folder.mkdir()
    for name, text in OLD.items():
        (folder / name).write_text(text)
    return folder


def stage_new(folder: Path) -> None:
    with staged_folder(folder, gone=("gone", "never")) as stage:
        for name in ("a", "b", "c"):
            (stage / name).write_text(NEW[name])


class Faults:
    """Raises before or after the n-th operation on files, for every n in `at`."""

    def __init__(self, patch: pytest.MonkeyPatch, fault: type[BaseException], at: set[int], after: bool) -> None:
        self.fault, self.at, self.after, self.count = fault, at, after, 0
        for name in OPERATIONS:
            patch.setattr(os, name, self._failing(getattr(os, name)))
        patch.setattr(files, "open", self._failing(open), raising=False)

    def _failing(self, operation):
        def call(*args, **kwargs):
            self.count += 1
            hit = self.count in self.at
            if hit and not self.after:
                raise self.fault(5, "injected")
            result = operation(*args, **kwargs)
            if hit:
                raise self.fault(5, "injected")
            return result

        return call


def test_staged_files_replace_and_remove(tmp_path):
    out = old_folder(tmp_path / "out")
    stage_new(out)
    assert visible(out) == NEW and len(list(out.iterdir())) == len(NEW)


@pytest.mark.parametrize(
    ("fault", "after", "times"),
    [
        (OSError, False, 1),
        (KeyboardInterrupt, False, 1),
        (KeyboardInterrupt, True, 1),
        (KeyboardInterrupt, False, 3),
        (KeyboardInterrupt, True, 2),
    ],
)
def test_whatever_operation_fails_all_files_are_old_or_all_new(tmp_path, fault, after, times):
    raised, n = [], 0
    while True:
        n += 1
        out = old_folder(tmp_path / str(n))
        with pytest.MonkeyPatch.context() as patch:
            faults = Faults(patch, fault, set(range(n, n + times)), after)
            try:
                stage_new(out)
                failed = False
            except (InputError, KeyboardInterrupt) as error:
                failed = True
                assert isinstance(error, InputError) == (fault is OSError)
        # Only an interrupt while the temporary folder is removed comes too late to keep the old ones.
        assert visible(out) in ((OLD, NEW) if fault is KeyboardInterrupt else (OLD,) if failed else (NEW,)), n
        raised.append((failed, visible(out) == OLD))
        stage_new(out)
        assert visible(out) == NEW and len(list(out.iterdir())) == len(NEW)
        if faults.count < n:
            break
    assert len(raised) > 30 and (True, True) in raised
    assert raised[-1] == (False, False)


def test_a_folder_in_the_place_of_a_file_is_told_before_anything_is_replaced(tmp_path):
    out = old_folder(tmp_path / "out")
    (out / "b").unlink()
    (out / "b").mkdir()
    with pytest.raises(InputError, match="b: cannot be written: it is a folder; move it"):
        stage_new(out)
    assert (out / "a").read_text() == OLD["a"] and sorted(p.name for p in out.iterdir()) == sorted(OLD)


def test_what_cannot_be_put_back_is_told_and_kept(tmp_path, monkeypatch):
    out, calls, replace = old_folder(tmp_path / "out"), [], os.replace

    def once(*args):
        calls.append(args)
        if len(calls) > 1:
            raise OSError(30, "Read-only file system")
        replace(*args)

    monkeypatch.setattr(os, "replace", once)
    with pytest.raises(InputError, match=r"b: cannot be written: Read-only file system; a, b could not be") as error:
        stage_new(out)
    kept = Path(str(error.value).partition("the old ones are in ")[2].removesuffix(" until the next try"))
    assert (kept / "a").read_text() == OLD["a"] and visible(out) == OLD | {"a": NEW["a"]}


def test_a_folder_that_another_process_writes_to_is_refused(tmp_path):
    pytest.importorskip("fcntl")
    with staged_folder(tmp_path) as stage:
        (stage / "a").write_text("1")
        with pytest.raises(InputError, match="another process is writing to it"), staged_folder(tmp_path):
            raise AssertionError("must not get here")
    assert visible(tmp_path) == {"a": "1"}


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="kills a forked process")
def test_killed_at_any_moment_every_file_is_whole_and_the_next_call_cleans_up(tmp_path):
    mixed, n = 0, 0
    while True:
        n += 1
        out = old_folder(tmp_path / str(n))
        child = os.fork()
        if child == 0:
            try:
                Faults(pytest.MonkeyPatch(), _Kill, {n}, False)
                stage_new(out)
            finally:
                os._exit(0)
        died = os.WIFSIGNALED(os.waitpid(child, 0)[1])
        found = visible(out)
        assert all(text in (OLD.get(name), NEW.get(name)) for name, text in found.items())
        assert set(OLD) - {"gone"} <= set(found)
        mixed += found not in (OLD, NEW)
        stage_new(out)
        assert visible(out) == NEW and len(list(out.iterdir())) == len(NEW)
        if not died:
            break
    assert mixed  # which the docstring says


class _Kill(BaseException):
    def __init__(self, *_: object) -> None:
        os.kill(os.getpid(), signal.SIGKILL)
