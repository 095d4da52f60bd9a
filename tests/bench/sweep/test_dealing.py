"""Cells computed by a process per core: each once, the same numbers, nobody left behind."""

import copy
import importlib
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.bench.cells import CELLS, cells, fill
from maipp.bench.sweep import local
from maipp.bench.sweep.dealing import Where, choose, run_sweep
from maipp.bench.sweep.local import MOST_DEATHS, default_workers, pinned_cores
from maipp.bench.tables import Row, SampleSize
from maipp.errors import InputError
from tests.bench.sweep.held_jobs import Held, held, started

SAMPLE = SampleSize(instances=2, trials=2, seed=3)
ONE, TWO = Where(workers=1), Where(workers=2)


@pytest.fixture(scope="module")
def every(tiny_table):
    return list(cells(tiny_table, tiny_table.rows, SAMPLE))


def test_two_workers_make_what_one_makes_and_up_to_rounding_what_this_process_does(every, tmp_path):
    told = []
    count = fill(every, tmp_path / "two", lambda *one: told.append(one), where=TWO)
    assert count == len(every) == len(list((tmp_path / "two" / CELLS).iterdir()))
    assert multiprocessing.active_children() == []
    for wanted in (False, True):
        assert sorted(number for _, number, _, done in told if done is wanted) == list(range(count))
    assert all(cell is every[number] and of == count for cell, number, of, _ in told)
    fill(every, tmp_path / "one", where=ONE)
    fill(every, tmp_path / "here")
    for cell in every:
        two, one, here = (cell.load(tmp_path / folder).values for folder in ("two", "one", "here"))
        for metric, values in two.items():
            np.testing.assert_array_equal(values, one[metric])
            np.testing.assert_allclose(values, here[metric], rtol=1e-3)
    # On a core each.
    made = [json.loads(path.read_text(encoding="utf-8")) for path in (tmp_path / "two" / CELLS).iterdir()]
    assert {one["machine"]["devices"] for one in made} == {1}
    assert fill(every, tmp_path / "two", where=TWO) == 0


def test_what_is_wrong_with_a_cell_is_told_and_nobody_is_left(every, tmp_path):
    """An option that only shows when missions are drawn; here a field file that has gone."""
    missing = replace(every[0], scenario=every[0].scenario.replace(field=str(tmp_path / "gone.npy")))
    with pytest.raises(InputError, match=r"gone\.npy"):
        fill([missing, *every[:2]], tmp_path / "run", where=TWO)
    assert multiprocessing.active_children() == []


def swept(jobs, where=ONE, **told):
    kept = {}
    run_sweep(jobs, kept.__setitem__, where=where, **told)
    assert multiprocessing.active_children() == []
    return kept


def test_an_error_of_ours_shows_its_traceback(tmp_path):
    with pytest.raises(RuntimeError, match="Traceback"):
        swept([Held(0, str(tmp_path), fails=True)])


def test_a_job_that_would_come_to_something_else_is_refused(tmp_path):
    with pytest.raises(InputError, match="job 0: would come to something else on .*: process is "):
        swept([Held(0, str(tmp_path), moody=True)])


class Unreadable:
    """What a worker cannot unpickle."""

    def __reduce__(self):
        return importlib.import_module, ("no_such_module",)


def test_what_a_worker_cannot_import_is_told(tmp_path):
    broken = Held(0, str(tmp_path))
    object.__setattr__(broken, "folder", Unreadable())
    with pytest.raises(InputError, match="cannot make the job: ModuleNotFoundError: No module named 'no_such"):
        swept([broken])


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="nobody is killed so there")
def test_what_a_killed_worker_did_is_done_again_and_nothing_else(tmp_path):
    """As the system does where memory runs out."""
    jobs = held(6, tmp_path, dies={2: 1})
    assert swept(jobs, TWO) == {n: n * n for n in range(6)}
    assert sorted(key for key, _ in started(tmp_path)) == sorted([*(job.key for job in jobs), jobs[2].key])


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="nobody is killed so there")
def test_a_job_that_kills_every_worker_is_given_up(tmp_path):
    with pytest.raises(InputError, match="computed job 0, was ended by signal 9, .* memory, and so were 2 .*fewer"):
        swept(held(1, tmp_path, dies={0: MOST_DEATHS}))
    assert multiprocessing.active_children() == [] and len(started(tmp_path)) == MOST_DEATHS


def test_a_worker_that_ends_by_itself_is_told(tmp_path):
    """Such as a script without a guard, which fails while the worker begins."""
    with pytest.raises(InputError, match=r"job 0, ended by itself \(exit code 3\).*__main__"):
        swept([Held(0, str(tmp_path), ends=True)])


@pytest.mark.parametrize(("quota", "cores"), [(None, [0, 1]), (1, [None])])
def test_workers_have_cores_of_their_own_but_not_of_a_quota(monkeypatch, quota, cores):
    monkeypatch.setattr(local, "cores_here", lambda: [0, 1])
    monkeypatch.setattr(local, "core_count", lambda: quota or 2)
    assert pinned_cores() == cores


@pytest.fixture
def running(tmp_path):
    """A process that fills a table by two workers, in a group of its own; both are at a cell."""
    words = ["benchmark", "table1", "--out", str(tmp_path), "--workers", "2", "--instances", "400", "--trials", "1"]
    words += ["--planners", "random", "lawnmower"]
    # Tests that run in the background may have been told to ignore Ctrl-C.
    code = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
    code += f"from maipp.cli.main import main; sys.exit(main({words!r}))"
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True, start_new_session=True)
    try:
        assert process.stderr is not None
        lines = [process.stderr.readline(), process.stderr.readline()]
        assert all(line.startswith("cell ") for line in lines), lines
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def assert_nobody_is_left(group):
    for _ in range(100):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return
        time.sleep(0.1)
    pytest.fail("a process of the group is left")


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals to a group")
def test_ctrl_c_ends_all_processes_and_says_how_to_go_on(running):
    os.killpg(running.pid, signal.SIGINT)
    assert "the same command goes on" in running.communicate(timeout=60)[1]
    assert running.returncode == 130
    assert_nobody_is_left(running.pid)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals to a group")
def test_workers_end_with_a_parent_that_is_killed(running):
    running.kill()
    running.wait()
    assert_nobody_is_left(running.pid)


KINDS = st.lists(st.sampled_from("abcde"), min_size=1, max_size=30)


@given(KINDS, st.sampled_from([None, *"abcde"]), st.sets(st.sampled_from("abcde")))
def test_a_worker_goes_on_with_what_it_has_compiled_then_begins_what_nobody_has(kinds, last, busy):
    waiting = list(range(len(kinds)))
    number = choose(waiting, kinds, last, busy)
    kind = kinds[number]
    if last in kinds or set(kinds) - busy:
        assert kind == last if last in kinds else kind == next(k for k in kinds if k not in busy)
        assert kind not in kinds[number + 1 :]  # the largest budget first
    else:
        assert kinds.count(kind) == max(map(kinds.count, kinds))
        assert kind not in kinds[:number]


@given(KINDS, st.integers(1, 4), st.randoms())
def test_every_cell_is_chosen_once_and_a_kind_is_shared_only_at_the_end(kinds, workers, random):
    waiting, last, taken = list(range(len(kinds))), [None] * workers, []
    while waiting:
        worker = random.randrange(workers)
        busy = {kind for other, kind in enumerate(last) if other != worker}
        number = choose(waiting, kinds, last[worker], busy)
        assert kinds[number] not in busy or {kinds[n] for n in waiting} <= busy | {last[worker]}
        waiting.remove(number)
        taken.append(number)
        last[worker] = kinds[number]
    assert sorted(taken) == list(range(len(kinds)))


def test_there_is_a_worker_per_core_where_memory_allows(monkeypatch):
    monkeypatch.setattr(local, "core_count", lambda: 6)
    for memory, limit, workers in [
        (64 << 30, None, 6),
        (64 << 30, 1 << 62, 6),
        (8 << 30, None, 4),
        (64 << 30, 8 << 30, 4),
        (1 << 30, 8 << 30, 1),
    ]:
        monkeypatch.setattr(os, "sysconf", lambda name, memory=memory: {"SC_PAGE_SIZE": 1}.get(name, memory))
        monkeypatch.setattr(local, "memory_limit", lambda limit=limit: limit)
        assert default_workers() == workers
    monkeypatch.delattr(os, "sysconf")
    assert default_workers() == 4
    monkeypatch.setattr(local, "memory_limit", lambda: None)
    assert default_workers() == 6
    monkeypatch.setattr("jax.default_backend", lambda: "gpu")
    assert default_workers() == 0


def test_cells_that_share_a_compilation_are_of_one_kind(every):
    kinds = [cell.kind for cell in every]
    assert kinds[0] == kinds[1] != kinds[2]  # both budgets of random, then greedy
    assert kinds[4] == kinds[5]  # and those of lawnmower
    assert len({kinds[0], replace(every[0], row=Row("other", "random")).kind}) == 2


def test_a_cell_that_travels_works_out_anew_what_it_is_made_by(every):
    assert "_made_by" in every[0].__dict__ or every[0].made_by
    assert "_made_by" not in copy.copy(every[0]).__dict__
