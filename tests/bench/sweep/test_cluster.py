"""A cluster of two workers on loopback: what it makes, whom it refuses, and what is lost when its parts are killed.

Everything is a process of its own with a limit of time: a stuck cluster fails these tests and does not hang them.
"""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from maipp.bench.cells import CELLS
from maipp.bench.sweep.address import read_address, security
from maipp.bench.sweep.cluster import difference
from maipp.bench.sweep.dealing import Where, run_sweep
from maipp.cli.main import main
from maipp.errors import InputError
from tests.bench.sweep.held_jobs import HOLD, STARTED, held, started

ROOT = Path(__file__).parents[3]
LIMIT = 120  # seconds for what takes a few on a quiet machine


@pytest.mark.parametrize("text", ["localhost", "tcp://host", "http://host:80", "tcp://host:99999", "tcp://a b:1", ""])
def test_what_is_no_address_is_told(text):
    with pytest.raises(InputError, match="--cluster: .* is no address of a scheduler; give tcp://HOST:8786"):
        read_address(text, "--cluster")


@pytest.mark.parametrize(
    ("text", "protected"),
    [
        ("tcp://127.0.0.1:1", True),
        ("tcp://[::1]:1", True),
        ("tcp://localhost:1", True),
        ("tcp://10.0.0.1:1", False),
        ("tcp://shore:1", False),
        ("tls://shore:1", True),
    ],
)
def test_only_loopback_goes_without_tls_unwarned(text, protected):
    assert read_address(text, "--cluster").protected is protected


def test_a_cluster_without_its_extra_says_what_to_install(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match="a cluster needs distributed"):
        run_sweep(held(1, tmp_path), lambda *_: None, where=Where(cluster="tcp://127.0.0.1:9"))
    for command in (["worker", "tcp://127.0.0.1:9"], ["scheduler"]):
        assert main(command) == 2
        captured = capsys.readouterr().err
        assert captured.count("\n") == 1 and "pip install 'maipp[cluster]'" in captured


def test_another_version_is_told_by_its_name():
    assert difference({"jax": "1", "maipp": "2"}, {"jax": "1", "maipp": "2", "more": "3"}) is None
    assert difference({"jax": "1", "maipp": "2"}, {"jax": "1"}) == (
        "its maipp is None, here it is 2; give both the same"
    )


distributed = pytest.importorskip("distributed", reason="the extra cluster is not installed")


def test_certificates_are_asked_for_by_their_names(tmp_path):
    with pytest.raises(InputError, match="--tls: tls:// needs certificates; give a folder with ca.pem, cert.pem"):
        security("tls", None)
    with pytest.raises(InputError, match="has no ca.pem"):
        security("tls", tmp_path)
    with pytest.raises(InputError, match="--tls: tcp:// is not encrypted"):
        security("tcp", tmp_path)


def start(*words: str, **more: str) -> subprocess.Popen:
    environment = os.environ | more | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "src"), *sys.path])}
    return subprocess.Popen([sys.executable, *words], env=environment, cwd=ROOT, stderr=subprocess.PIPE, text=True)


def end(process: subprocess.Popen) -> None:
    with suppress(ProcessLookupError):
        process.kill()
    process.wait(timeout=LIMIT)


def until(true: Callable[[], object]) -> None:
    """Wait for something; fails where it takes too long."""
    limit = time.monotonic() + LIMIT
    while not true():
        assert time.monotonic() < limit, "it takes too long"
        time.sleep(0.05)


def scheduler(*words: str) -> tuple[subprocess.Popen, str]:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"{'tls' if words else 'tcp'}://127.0.0.1:{free.getsockname()[1]}"
    process = start("-m", "maipp", "scheduler", address, *words)
    assert process.stderr is not None and address in process.stderr.readline()
    return process, address


def workers(address: str, *words: str, **more: str) -> subprocess.Popen:
    """One worker, once it works; `more` is of its environment."""
    process = start("-m", "maipp", "worker", address, "--workers", "1", *words, **more)
    assert process.stderr is not None and "1 workers for" in process.stderr.readline()
    return process


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """The address of a scheduler with two workers, each of a nanny of its own."""
    process, address = scheduler()
    there = [process]
    try:
        there += [workers(address), workers(address)]
        yield address
    finally:
        for process in reversed(there):
            end(process)


def client(address: str, folder: Path, count: int, *tls: str) -> subprocess.Popen:
    return start("-c", "from tests.bench.sweep.held_jobs import main; main()", address, str(folder), str(count), *tls)


def finished(process: subprocess.Popen) -> str:
    """What a client says until it has ended well."""
    try:
        said = process.communicate(timeout=LIMIT)[1]
    except subprocess.TimeoutExpired:
        end(process)
        raise
    assert process.returncode == 0, said
    return said


def parents(folder: Path) -> dict[int, int]:
    """The nanny's process of each worker that has begun a job."""
    lines = (folder / STARTED).read_text(encoding="utf-8").splitlines()
    return {int(process): int(parent) for _, process, parent in map(str.split, lines)}


def counts(folder: Path) -> Counter[str]:
    return Counter(key for key, _ in started(folder))


def begun(folder: Path, count: int) -> bool:
    return len(started(folder)) >= count


COUNT = 6


def kept(folder: Path) -> dict[str, int]:
    return {job.key: int((folder / job.key).read_text()) for job in held(COUNT, folder) if (folder / job.key).exists()}


TABLE = """
scenario: {agents: 2, grid: 8, nodes: 12, neighbours: 4, measurement_interval: 1}
columns: {budget: [2, 3]}
rows: [random, greedy]
instances: 2
trials: 2
"""


@pytest.mark.slow
def test_a_table_is_that_of_processes_of_this_machine_to_the_last_digit(cluster, tmp_path):
    (tmp_path / "own.yaml").write_text(TABLE, encoding="utf-8")
    made = []
    for name, where in (("cluster", ["--cluster", cluster]), ("here", ["--workers", "2"])):
        out = tmp_path / name
        said = finished(start("-m", "maipp", "benchmark", str(tmp_path / "own.yaml"), "--out", str(out), *where))
        assert "4 cells: 4 computed" in said
        made.append({path.name: json.loads(path.read_text())["values"] for path in (out / CELLS).iterdir()})
    assert made[0] == made[1] and len(made[0]) == 4


@pytest.mark.slow
@pytest.mark.parametrize("whom", ["worker", "client"])
def test_a_kill_costs_what_was_under_way(cluster, tmp_path, whom):
    (tmp_path / HOLD).touch()
    running = client(cluster, tmp_path, COUNT)
    try:
        until(lambda: begun(tmp_path, 4) and len(kept(tmp_path)) == 2)  # the others are held
        under_way = [one for one in started(tmp_path) if one[0] not in kept(tmp_path)]
        if whom == "client":
            end(running)
        else:
            # One that has done what is kept: that is not to be done again.
            os.kill(dict(started(tmp_path))["held-5"], signal.SIGKILL)
            until(lambda: begun(tmp_path, 5))  # another does it
        (tmp_path / HOLD).unlink()
        if whom == "client":
            running = client(cluster, tmp_path, COUNT)
        finished(running)
    finally:
        end(running)
    assert kept(tmp_path) == {f"held-{n}": n * n for n in range(COUNT)}
    twice = {key for key, times in counts(tmp_path).items() if times > 1}
    assert twice <= {key for key, _ in under_way} and max(counts(tmp_path).values()) <= 2


@pytest.mark.slow
def test_the_death_of_a_machine_costs_what_it_was_at(cluster, tmp_path):
    """Its nannies die with it; here the whole of a third `maipp worker`."""
    third = workers(cluster)
    (tmp_path / HOLD).touch()
    running = client(cluster, tmp_path, COUNT)
    try:
        until(lambda: begun(tmp_path, 5) and len(kept(tmp_path)) == 2)  # the others are held
        theirs = [key for key, process in started(tmp_path) if parents(tmp_path)[process] == third.pid]
        theirs = [key for key in theirs if key not in kept(tmp_path)]
        assert len(theirs) == 1
        end(third)
        until(lambda: begun(tmp_path, 6) or not (tmp_path / HOLD).unlink())
        finished(running)
    finally:
        end(running)
        end(third)
    assert kept(tmp_path) == {f"held-{n}": n * n for n in range(COUNT)}
    assert [key for key, times in counts(tmp_path).items() if times > 1] in ([], theirs)


@pytest.mark.slow
def test_nobody_there_no_workers_and_the_end_of_a_scheduler_are_told(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("maipp.devices._configured", True)
    monkeypatch.setattr("maipp.bench.sweep.cluster._CONNECT", 1.0)
    table = ["benchmark", "table1", "--planners", "random", "--out", str(tmp_path / "run"), "--patience", "1"]
    assert main([*table, "--cluster", "tcp://127.0.0.1:9"]) == 2
    captured = capsys.readouterr().err
    assert captured.startswith("error: --cluster: no scheduler answers at tcp://127.0.0.1:9")
    assert captured.count("\n") == 1
    process, address = scheduler()
    try:
        assert main([*table, "--cluster", address]) == 2
        captured = capsys.readouterr().err
        assert captured == (
            f"error: --cluster: no worker at {address} for 1 s; start some with: maipp worker ADDRESS\n"
        )
        assert main(["scheduler", address]) == 2
        captured = capsys.readouterr().err
        assert captured.startswith(f"error: ADDRESS: {address}: cannot listen there: ") and captured.count("\n") == 1
        other = workers(address, JAX_ENABLE_X64="1")
        assert main([*table, "--cluster", address]) == 2
        end(other)
        note, error = capsys.readouterr().err.splitlines()
        assert "is refused: its precision is float64, here it is float32; give both the same" in note
        assert error.startswith(f"error: --cluster: no worker at {address} for 1 s; worker tcp://127.0.0.1:")
        working = workers(address)
        (tmp_path / HOLD).touch()
        running = client(address, tmp_path, 2)
        until(lambda: begun(tmp_path, 1))
        end(process)
        assert f"the scheduler at {address} does not answer any more" in running.communicate(timeout=LIMIT)[1]
        (tmp_path / HOLD).unlink()
        assert "has ended, and so have its workers" in working.communicate(timeout=LIMIT)[1]
        assert working.returncode == 0
    finally:
        end(process)


@pytest.mark.slow
def test_with_certificates_only_those_who_have_them_work(tmp_path):
    pytest.importorskip("cryptography", reason="it makes the certificates")
    assert main(["fleet", "keys", str(tmp_path / "keys"), "--robots", "cluster", "stranger"]) == 0
    tls = ["--tls", str(tmp_path / "keys" / "cluster")]
    process, address = scheduler(*tls)
    there = [process]
    try:
        there.append(workers(address, *tls))
        finished(client(address, tmp_path, COUNT, *tls[1:]))
        assert len(kept(tmp_path)) == COUNT
        stranger = start("-m", "maipp", "worker", address.replace("tls", "tcp"), "--patience", "2")
        assert "no scheduler answers" in stranger.communicate(timeout=LIMIT)[1] and stranger.returncode == 2
    finally:
        for process in reversed(there):
            end(process)
