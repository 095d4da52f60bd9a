"""Files that are either whole or not there: written under a temporary name, then moved into place."""

import os
import secrets
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from maipp.errors import InputError

_STAGE = ".maipp-"  # how the names of temporary folders begin


def read_text(path: str | os.PathLike[str], what: str, give: str) -> str:
    """The text of a UTF-8 file, without a byte order mark.

    Raises `InputError` where it is none or cannot be read; `what` says what it holds, `give` what would be right.
    """
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot read the {what}: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start}); give {give}") from None
    except ValueError:  # a NUL in the name
        raise InputError(f"{str(path)!r}: not the name of a file") from None


def read_bytes(path: str | os.PathLike[str], what: str, most: int) -> bytes:
    """The content of a file of at most so many bytes.

    Raises `InputError` where it is larger or cannot be read; `what` says what it holds.
    """
    try:
        with open(path, "rb") as file:
            content = file.read(most + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot read the {what}: {error.strerror or error}") from None
    except ValueError:  # a NUL in the name
        raise InputError(f"{str(path)!r}: not the name of a file") from None
    if len(content) > most:
        raise InputError(f"{path}: has more than {most / 1e6:.0f} MB; cut or simplify it")
    return content


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path beside `path`, with its suffix, that replaces it when the block ends without an error.

    For writers that open the file themselves. On an error, an interrupt included, `path` is left as it was and the
    temporary file is removed. Raises `InputError` where the file cannot be written.
    """
    target = Path(path)
    # The suffix is kept: Pillow, Matplotlib and ffmpeg read the format from it.
    temporary = target.parent / f".{secrets.token_hex(8)}{target.suffix}"
    with _errors_of(target):
        try:
            yield temporary
            with open(temporary, "rb+") as file:
                os.fsync(file.fileno())
            os.replace(temporary, target)
        finally:
            temporary.unlink(missing_ok=True)


def write_atomic(path: str | os.PathLike[str], content: bytes | str) -> None:
    """Replace the file by this content (text as UTF-8, line ends as they are), or leave it untouched.

    Raises `InputError` where the file cannot be written.
    """
    with atomic_path(path) as temporary:
        temporary.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


def make_folder(folder: Path) -> None:
    """Make the folder where it is missing. Raises `InputError` where that cannot be done."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror or error}") from error


@contextmanager
def staged_folder(folder: str | os.PathLike[str], *, gone: Sequence[str] = ()) -> Iterator[Path]:
    """A temporary folder whose files replace those of `folder`, made if need be, when the block ends well.

    All of them or none: on an error or an interrupt, one that comes halfway included, the files of `folder` are what
    they were. Files named in `gone` that the block does not write are removed with the others replaced. When the block
    has ended, all are on the disk (fsync), and until then no other process can write to `folder` in this way.
    Every file is whole, old or new, at any moment. To move several is not one operation, though: a kill or a power cut
    between two moves leaves some new beside some old. A kill also leaves a hidden folder, which the next call removes
    where the file system has locks.
    Raises `InputError` where `folder` is a file, is in use or cannot be written to, and where one of the files cannot
    be replaced.
    """
    target = Path(folder)
    with _errors_of(target, "cannot be written to"):
        if target.exists() and not target.is_dir():
            raise InputError(f"{target}: is a file; give a folder")
        made = [path for path in (target, *target.parents) if not path.exists()]
        target.mkdir(parents=True, exist_ok=True)
        for path in made:
            sync_folder(path.parent)
    with _locked(target) as locked:
        with _errors_of(target, "cannot be written to"):
            for left in target.glob(f"{_STAGE}*") if locked else ():  # by a kill
                shutil.rmtree(left, ignore_errors=True)
            stage = Path(tempfile.mkdtemp(prefix=_STAGE, dir=target))
        try:
            with _errors_of(target, "cannot be written to"):
                (stage / "new").mkdir()
                (stage / "old").mkdir()
            yield stage / "new"
            _replace_all(stage, target, gone)
        except _HalfwayError:
            raise  # the stage has what is missing
        except BaseException:
            shutil.rmtree(stage, ignore_errors=True)
            raise
        shutil.rmtree(stage, ignore_errors=True)


def sync_folder(folder: Path) -> None:
    """Make the names in a folder outlast a power cut, where the system can open folders."""
    if os.name == "posix":
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


class _HalfwayError(InputError):
    """Some files are new, and could not be put back."""


def _replace_all(stage: Path, target: Path, gone: Sequence[str]) -> None:
    """Replace the files of `target` by those in `stage / "new"`; on an error or interrupt put all back."""
    new, old = stage / "new", stage / "old"
    with _errors_of(target):
        names = sorted(path.name for path in new.iterdir())
        names += [name for name in gone if name not in names and _is_there(target / name)]
        had = {name: _is_there(target / name) for name in names}
    for name in names:
        if (target / name).is_dir() and not (target / name).is_symlink():
            raise InputError(f"{target / name}: cannot be written: it is a folder; move it, or give another place")
        with _errors_of(target / name):
            if _is_there(new / name):
                with open(new / name, "rb+") as file:
                    os.fsync(file.fileno())
            if had[name]:
                _keep(target / name, old / name)
    begun = []
    try:
        for name in names:
            begun.append(name)
            with _errors_of(target / name):
                if _is_there(new / name):
                    os.replace(new / name, target / name)
                else:
                    os.unlink(target / name)
        with _errors_of(target):
            sync_folder(target)
    except BaseException as error:
        lost = None
        while lost is None:
            try:
                lost = [name for name in begun if not _put_back(name, had[name], stage, target)]
            except KeyboardInterrupt:  # a second one: as it was first, then out
                continue
        if lost:
            raise _HalfwayError(
                f"{str(error) or 'interrupted'}; {', '.join(lost)} could not be put back: "
                f"the old ones are in {old} until the next try"
            ) from error
        raise


def _is_there(path: Path) -> bool:
    """Whether there is anything of that name; unlike `os.path.lexists`, an error is not taken for a no."""
    try:
        os.lstat(path)
    except FileNotFoundError:
        return False
    return True


def _keep(path: Path, kept: Path) -> None:
    """A second name for the file, or a copy where the file system has no such names."""
    try:
        os.link(path, kept, follow_symlinks=False)
    except (OSError, NotImplementedError):
        shutil.copy2(path, kept, follow_symlinks=False)


def _put_back(name: str, had: bool, stage: Path, target: Path) -> bool:
    """Undo a move that may or may not have happened, or been undone; False where that cannot be done."""
    try:
        if had and _is_there(stage / "old" / name):
            os.replace(stage / "old" / name, target / name)
        elif not had and not _is_there(stage / "new" / name):
            (target / name).unlink(missing_ok=True)
    except OSError:
        return False
    return True


@contextmanager
def _locked(folder: Path) -> Iterator[bool]:
    """Hold the folder's lock; False where the system has none. Raises `InputError` where another process holds it."""
    try:
        import fcntl
    except ImportError:  # Windows
        yield False
        return
    with _errors_of(folder, "cannot be written to"):
        descriptor = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            locked = True
        except BlockingIOError:
            raise InputError(f"{folder}: another process is writing to it; wait, or give another folder") from None
        except OSError:  # some network file systems
            locked = False
        yield locked
    finally:
        os.close(descriptor)


@contextmanager
def _errors_of(path: Path, problem: str = "cannot be written") -> Iterator[None]:
    """Tell the operating system's errors by this path."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: {problem}: {error.strerror or error}") from error
