"""Jobs of a sweep: what a process is asked, and what it answers. JAX is imported only once there is something to do."""

import hashlib
import json
import os
import pickle
import platform
import signal
import threading
import traceback
from collections.abc import Hashable, Mapping
from enum import Enum
from multiprocessing import parent_process
from multiprocessing.connection import wait
from typing import Any, Protocol, runtime_checkable

from maipp.devices import use_one_core
from maipp.errors import InputError


class _Lost(Enum):
    LOST = "lost"


LOST = _Lost.LOST  # what a job comes to whose worker is no more


@runtime_checkable
class Job(Protocol):
    """One piece of a sweep. It can be pickled, and what it comes to depends on nothing but what `made_by` says."""

    @property
    def key(self) -> str:
        """Its name: jobs of one name come to the same."""
        ...

    @property
    def kind(self) -> Hashable:
        """Equal for jobs that run the same compiled programs."""
        ...

    @property
    def words(self) -> str:
        """What it is, for a line about it."""
        ...

    @property
    def made_by(self) -> Mapping[str, Any]:
        """Everything that decides its result; worked out anew by whoever computes it."""
        ...

    def compute(self) -> Any:
        """The result. Raises `InputError` for bad input."""
        ...


def digest(made_by: Mapping[str, Any]) -> str:
    """What stands for `Job.made_by` in a key."""
    return hashlib.sha256(json.dumps(made_by, sort_keys=True).encode()).hexdigest()[:12]


def asked(job: Job) -> bytes:
    """The message by which a process is asked for a job."""
    return pickle.dumps((job, job.made_by))


def answer(message: bytes) -> Any:
    """What the job that is asked for comes to, or the error: an `InputError`, or a `RuntimeError` of the traceback.

    A job that would come to something else than where it was asked is an error, too: it runs other code, or weights.
    """
    try:
        job, made_by = pickle.loads(message)
    except Exception as error:
        return InputError(
            f"a process of its own cannot make the job: {type(error).__name__}: {error}; put what it needs in a module "
            "that can be imported there, or give --workers 0"
        )
    try:
        here = job.made_by
        for name in sorted({*here, *made_by}):
            if here.get(name) != made_by.get(name):
                return InputError(
                    f"{job.words}: would come to something else on {platform.node()}: {name} is "
                    f"{here.get(name)!r:.200} there, and {made_by.get(name)!r:.200} where it was asked; give both the "
                    "same"
                )
        return job.compute()
    except InputError as error:
        return error
    except Exception:
        return RuntimeError(traceback.format_exc())


def begin(core: int | None) -> None:
    """Make this process one that answers: on a core of its own where it is given, and no longer than its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C meets the whole group; the parent ends its workers
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    use_one_core(core)


def _end_with_the_parent() -> None:
    """A parent that is killed cannot end its workers. What they are at is lost, as with an interrupt."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
