"""A process that computes cells on a core of its own. It imports JAX only once it is on that core."""

import os
import pickle
import signal
import threading
import traceback
from contextlib import suppress
from multiprocessing import parent_process
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import TYPE_CHECKING

from maipp.devices import use_one_core
from maipp.errors import InputError

if TYPE_CHECKING:  # it imports JAX
    from maipp.benchmarks.cells import Cell


def work(channel: Connection, folder: Path, core: int | None) -> None:
    """Compute the cells that come through the channel and keep them in the folder, until the channel is closed.

    Answers with the number of missions done, now and then, and at last with None when the cell is kept, or with the
    error: an `InputError`, or a `RuntimeError` of the traceback.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C meets the whole group; the parent ends its workers
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    use_one_core(core)
    with suppress(EOFError, BrokenPipeError):  # the parent needs no more
        while True:
            channel.send(_computed(channel, folder))


def _end_with_the_parent() -> None:
    """A parent that is killed cannot end its workers. What they are at is lost, as with an interrupt."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _computed(channel: Connection, folder: Path) -> Exception | None:
    """Compute the next cell and keep it; gives the error where that cannot be done."""
    message = channel.recv_bytes()
    try:
        _read(message).fill(folder, lambda missions, _: channel.send(missions))
    except BrokenPipeError:
        raise
    except InputError as error:
        return error
    except Exception:
        return RuntimeError(traceback.format_exc())


def _read(message: bytes) -> "Cell":
    """The cell that was sent. Raises `InputError` where this process cannot import what it is made of."""
    try:
        return pickle.loads(message)
    except Exception as error:
        raise InputError(
            f"--workers: a process of its own cannot make the cell: {type(error).__name__}: {error}; put what it needs "
            "in a module that can be imported, or give --workers 0"
        ) from error
