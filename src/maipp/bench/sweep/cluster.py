"""The workers of a Dask cluster that work on a sweep: `maipp worker` on any machine that reaches the scheduler."""

import importlib.metadata
import time
import warnings
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping
from concurrent.futures import CancelledError
from contextlib import suppress
from pathlib import Path
from typing import Any
from uuid import uuid4

from maipp.bench.sweep.address import UNPROTECTED, quiet, read_address, security
from maipp.bench.sweep.jobs import LOST, Job, answer, asked
from maipp.errors import InputError, first_line

_CONNECT = 10.0  # seconds in which a scheduler that is there answers
_LOOK = 2.0  # seconds after which the list of workers is asked for again


def introduction() -> dict[str, Any]:
    """What a worker computes with: numbers are the same where this is."""
    import jax
    import jax.numpy as jnp

    from maipp.bench.provenance import SIMULATION, code_digest, library_versions, versions

    return {
        **versions(),
        **library_versions(),
        "distributed": importlib.metadata.version("distributed"),
        "code of maipp": code_digest((*SIMULATION, "maipp.planners")),
        "backend": jax.default_backend(),
        "precision": str(jnp.result_type(float)),
    }


class Cluster:
    """A crew of the workers that a scheduler knows, each asked first what it computes with.

    The scheduler gives the job of a worker that dies to another. Where this client dies, or the scheduler, jobs under
    way are lost. Raises `InputError` where nobody answers at the address.
    """

    def __init__(self, address: str, tls: Path | None, patience: float, note: Callable[[str], None]) -> None:
        where = read_address(address, "--cluster")
        protection = security(where.scheme, tls)
        if not where.protected:
            note(UNPROTECTED.format(where))
        self._name, self._patience, self._note = str(where), patience, note
        self._client = _connected(str(where), protection)
        self._here = introduction()
        self._introduced: dict[str, Any] = {}  # futures by the address of a worker
        self._useful: set[str] = set()
        self._refused: dict[str, str] = {}  # why, by the address
        self._there: set[str] = set()  # workers that the scheduler knows
        self._at: dict[Any, tuple[str, int, Job]] = {}  # by the future
        self._looked = -_LOOK
        self._idle_since = self._heard = time.monotonic()

    def free(self) -> Collection[Hashable]:
        """The addresses of workers that have nothing to do."""
        self._look()
        busy = {seat for seat, *_ in self._at.values()}
        return sorted((self._useful & self._there) - busy)

    def give(self, seat: Hashable, number: int, job: Job) -> None:
        """Have a worker do a job; another does it if that one dies."""
        where: dict[str, Any] = {"workers": [seat], "allow_other_workers": True}
        self._at[self._submit(answer, asked(job), key=f"maipp-{job.key}", **where)] = str(seat), number, job

    def wait(self) -> Iterable[tuple[int, Any]]:
        """What jobs came to within a while. Raises `InputError` where there has been nobody to do them for too long."""
        from distributed import wait

        futures = [*self._at, *self._introduced.values()]
        if futures and self._client.status == "running":
            # Nothing yet, or some are cancelled, as they tell below.
            with suppress(TimeoutError, CancelledError, OSError), self._client.as_current():
                wait(futures, timeout=_LOOK, return_when="FIRST_COMPLETED")
        else:
            time.sleep(_LOOK / 4)
        for future in [future for future in self._at if future.status != "pending"]:
            _, number, job = self._at[future]
            try:
                result = self._result(future, job)
            except TimeoutError:  # the worker has gone with it: the scheduler has it computed again
                continue
            del self._at[future]
            # Now: as long as anything still refers to it, it would be computed again if the worker that has it died.
            future.release()
            yield number, result
        self._look()

    def close(self) -> None:
        """Take back what is under way, and leave the cluster as it is."""
        with suppress(Exception):  # there may be no scheduler left to tell
            self._client.cancel([*self._at, *self._introduced.values()], asynchronous=False)
        self._at.clear()
        self._introduced.clear()
        with suppress(Exception):
            self._client.close(timeout=5)

    def _result(self, future: Any, job: Job) -> Any:
        """What a job came to that is no longer pending."""
        from distributed.scheduler import KilledWorker

        if future.status in ("cancelled", "lost"):  # the line to the scheduler was cut
            return LOST
        try:
            return future.result(timeout=_CONNECT)
        except TimeoutError:
            raise
        except KilledWorker:
            return InputError(
                f"--cluster: {job.words}: every worker that computed it died, perhaps for want of memory; the same "
                "command goes on, give fewer --workers there"
            )
        except Exception as error:
            return InputError(f"--cluster: {job.words}: {type(error).__name__}: {first_line(error)}")

    def _look(self) -> None:
        """Ask who is there, and whoever is new what it computes with."""
        now = time.monotonic()
        if now - self._looked >= _LOOK:
            self._looked = now
            self._there = self._workers()
            self._useful &= self._there  # whoever comes back at the same address may be another
            for seat in self._there - self._useful - self._introduced.keys() - self._refused.keys():
                # The key is new: what a worker computes with may change while its address stays.
                key = f"maipp-introduction-{uuid4()}"
                self._introduced[seat] = self._submit(introduction, workers=[seat], key=key, priority=100)
        for seat, future in [*self._introduced.items()]:
            if seat not in self._there:
                del self._introduced[seat]
            elif future.status != "pending":
                del self._introduced[seat]
                self._meet(seat, future)
        if self._useful & self._there or self._introduced:
            self._idle_since = now
        elif now - self._idle_since > self._patience:
            why = next((f"; {reason}" for reason in self._refused.values()), "; start some with: maipp worker ADDRESS")
            raise InputError(f"--cluster: no worker at {self._name} for {self._patience:g} s{why}")

    def _submit(self, *inputs: Any, **named: Any) -> Any:
        """The future of a call. Raises `InputError` where there is no scheduler any more."""
        from distributed.client import ClosedClientError

        try:
            return self._client.submit(*inputs, pure=False, **named)
        except ClosedClientError as error:
            raise self._gone(error) from None

    def _gone(self, error: Exception) -> InputError:
        return InputError(
            f"--cluster: the scheduler at {self._name} does not answer any more ({first_line(error)}); start it again, "
            "and the same command goes on"
        )

    def _meet(self, seat: str, future: Any) -> None:
        """Take a worker on, or refuse it for what it said."""
        if future.status in ("cancelled", "lost"):
            return
        try:
            there = future.result(timeout=_CONNECT)
        except Exception as error:
            there = {"maipp": f"one that cannot say ({type(error).__name__}: {first_line(error)})"}
        reason = _difference(self._here, there)
        if reason is None:
            self._useful.add(seat)
        else:
            self._refused[seat] = f"worker {seat} is refused: {reason}"
            self._note(self._refused[seat])

    def _workers(self) -> set[str]:
        """The addresses of the workers that the scheduler knows. Raises `InputError` where it has long been silent."""
        now = time.monotonic()
        try:
            if self._client.status != "running":
                raise OSError(f"the line to it is {self._client.status}")
            info = self._client.sync(self._client.scheduler.identity, n_workers=-1, callback_timeout=_CONNECT)
            self._heard = time.monotonic()
            return {str(seat) for seat in info["workers"]}
        except (OSError, TimeoutError) as error:
            if now - self._heard > self._patience or self._client.status == "closed":
                raise self._gone(error) from None
            return self._there


def _connected(address: str, protection: Any) -> Any:
    """A client of the scheduler. Raises `InputError` where nobody answers, or one who cannot be talked with."""
    quiet()
    from dask import config
    from distributed import Client

    with warnings.catch_warnings(), config.set({"distributed.comm.timeouts.connect": f"{_CONNECT}s"}):
        warnings.simplefilter("ignore")  # of versions: those that matter are compared below
        try:
            client = Client(address, timeout=_CONNECT, security=protection, set_as_default=False, name="maipp")
            scheduler: Any = client.get_versions()
            packages = scheduler["scheduler"]["packages"]
        except (OSError, TimeoutError, ValueError, RuntimeError) as error:
            raise InputError(
                f"--cluster: no scheduler answers at {address} ({first_line(error)}); start one with: maipp scheduler"
            ) from None
    here = {name: importlib.metadata.version(name) for name in ("distributed", "msgpack", "cloudpickle")}
    reason = _difference(here, {name: packages.get(name) for name in here})
    if reason is not None:
        client.close(timeout=5)
        raise InputError(f"--cluster: the scheduler at {address} is refused: {reason}")
    return client


def _difference(here: Mapping[str, Any], there: Mapping[str, Any]) -> str | None:
    """What differs first, in words; None where nothing does."""
    for name in here:
        if here[name] != there.get(name):
            return f"its {name} is {there.get(name)}, here it is {here[name]}; give both the same"
    return None
