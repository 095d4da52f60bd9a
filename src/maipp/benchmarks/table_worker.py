"""A process that computes cells on a core of its own. It imports JAX only once it is on that core."""

import os
import pickle
import signal
import threading
import traceback
from multiprocessing import parent_process
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from maipp.devices import use_one_core
from maipp.errors import InputError

if TYPE_CHECKING:  # it imports JAX
    from maipp.benchmarks.cells import Cell


class Progress(NamedTuple):
    """How far the cell under way is."""

    missions: int  # done


class Done(NamedTuple):
    """The cell is kept."""


class Failed(NamedTuple):
    """The cell cannot be computed."""

    reason: str
    by_input: bool  # an `InputError`, and the reason its words; otherwise the reason is a traceback


def work(channel: Connection, folder: Path, core: int | None) -> None:
    """Compute the cells that come through the channel and keep them in the folder, until the channel is closed.

    Answers with `Progress`, and then `Done` or `Failed`.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C meets the whole group; the parent ends its workers
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    use_one_core(core)
    try:
        while True:
            _compute(channel, folder)
    except (EOFError, BrokenPipeError):  # the parent needs no more
        return


def _end_with_the_parent() -> None:
    """A parent that is killed cannot end its workers. What they are at is lost, as with an interrupt."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _read(message: bytes) -> "Cell":
    """The cell that was sent. Raises `InputError` where this process cannot import what it is made of."""
    try:
        return pickle.loads(message)
    except Exception as error:
        raise InputError(
            f"--workers: a process of its own cannot make the cell: {type(error).__name__}: {error}; put what it needs "
            "in a module that can be imported, or give --workers 0"
        ) from error


def _compute(channel: Connection, folder: Path) -> None:
    message = channel.recv_bytes()
    try:
        cell = _read(message)
        cell.fill(folder, lambda missions, _: channel.send(Progress(missions)))
        answer: Done | Failed = Done()
    except BrokenPipeError:
        raise
    except InputError as error:
        answer = Failed(str(error), by_input=True)
    except Exception:
        answer = Failed(traceback.format_exc(), by_input=False)
    channel.send(answer)
