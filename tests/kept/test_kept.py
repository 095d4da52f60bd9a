"""Programs that outlast the process: found again where all that made them is the same, else made anew."""

import functools
import os
import subprocess
import sys
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.engine.keys import _folded, _key, folded, key_of
from maipp.engine.options import option
from maipp.engine.rollout import step
from maipp.kept import program, store, surroundings
from maipp.kept.names import UnnamedError, name_of
from maipp.scenario import Scenario


class _Foreign(eqx.Module):
    """A module of nobody's: its code is in no name."""

    number: int = option(1)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A cache folder of its own."""
    monkeypatch.setenv("MAIPP_CACHE", str(tmp_path))
    return tmp_path / "programs"


@pytest.fixture
def traced(monkeypatch):
    """The names of the functions that are traced from here on; a new process knows no program."""
    names = []
    for kept in (_key, _folded):
        function = kept._function

        @functools.wraps(function)
        def noted(*args, function=function):
            names.append(function.__name__)
            return function(*args)

        monkeypatch.setattr(kept, "_function", noted)
    anew(monkeypatch)
    return names


def anew(monkeypatch):
    """Forget in memory what a new process would not know."""
    for kept in (_key, _folded):
        monkeypatch.setattr(kept, "_programs", {})


def same(key, other):
    return np.array_equal(jax.random.key_data(key), jax.random.key_data(other))


@pytest.mark.parametrize("seed", [0, 5, 2**32 - 1])
def test_gives_what_jax_gives_traced_or_read(seed, folder, traced, monkeypatch):
    for _ in range(2):
        anew(monkeypatch)
        assert same(key_of(seed), jax.random.key(seed))
        assert same(folded(key_of(seed), 3, 4), jax.random.fold_in(jax.random.fold_in(jax.random.key(seed), 3), 4))
    assert sorted(traced) == ["_folded", "_key"]  # once each


def test_another_source_is_traced_again_and_not_compiled(folder, traced, monkeypatch):
    key_of(1)
    anew(monkeypatch)
    monkeypatch.setattr(program, "source", lambda: "another")
    monkeypatch.setattr(program, "_compiled_whole", lambda _: pytest.fail("compiled again"))
    assert same(key_of(1), jax.random.key(1))
    assert traced == ["_key", "_key"]


@pytest.mark.parametrize("what", ["jax", "machine", "flags", "option", "x64"])
def test_other_surroundings_are_compiled_anew(what, folder, traced, monkeypatch):
    key_of(1)
    before = set(os.listdir(folder))
    anew(monkeypatch)
    surroundings.platform_here.cache_clear()
    monkeypatch.setattr(program, "platform_here", surroundings.platform_here.__wrapped__)
    option = program.options()
    if what == "jax":
        monkeypatch.setattr(surroundings, "version", lambda name: f"{name} 99")
    elif what == "machine":
        monkeypatch.setattr(surroundings, "_machine", lambda: "another")
    elif what == "flags":
        monkeypatch.setenv("XLA_FLAGS", os.environ["XLA_FLAGS"] + " ")
    elif what == "option":
        monkeypatch.setattr(program, "options", lambda: (*option, ("jax_new", True)))
    with jax.enable_x64(what == "x64"):
        assert same(key_of(1), jax.random.key(1))
    assert len(set(os.listdir(folder)) - before) == 2  # a call and its program


@pytest.mark.parametrize("spoil", ["cut", "flipped", "empty", "foreign", "another's", "writable"])
@pytest.mark.parametrize("kind", ["call", "program"])
def test_a_file_that_is_not_whole_or_not_ours_is_made_anew(kind, spoil, folder, traced, monkeypatch, capfd):
    key_of(1)
    (path,) = folder.glob(f"{kind}-*")
    (other,) = folder.glob("program-*" if kind == "call" else "call-*")
    content = path.read_bytes()
    if spoil == "cut":
        path.write_bytes(content[: len(content) // 2])
    elif spoil == "flipped":
        path.write_bytes(content[:-9] + bytes([content[-9] ^ 1]) + content[-8:])
    elif spoil == "empty":
        path.write_bytes(b"")
    elif spoil == "foreign":
        store.write(path.name, b"no pickle")
    elif spoil == "another's":
        path.write_bytes(other.read_bytes())
    else:
        path.chmod(0o666)
    anew(monkeypatch)
    assert same(key_of(1), jax.random.key(1))
    assert traced == ["_key", "_key"]
    anew(monkeypatch)
    assert same(key_of(1), jax.random.key(1))
    assert len(traced) == 2  # it is whole again
    assert capfd.readouterr().err == ""


def test_without_a_folder_or_with_one_that_cannot_be_nothing_is_kept(tmp_path, traced, monkeypatch):
    monkeypatch.setenv("MAIPP_CACHE", "")
    assert same(key_of(1), jax.random.key(1))
    (tmp_path / "file").write_text("a file, no folder")
    monkeypatch.setenv("MAIPP_CACHE", str(tmp_path / "file"))
    assert same(key_of(2), jax.random.key(2))
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_what_was_not_used_for_longest_makes_room(folder, monkeypatch):
    monkeypatch.setattr(store, "_MOST_FILES", 3)
    for number in range(5):
        store.write(f"program-{number}", b"x")
        os.utime(folder / f"program-{number}", (number, number))
    store.write("program-5", b"x")
    assert sorted(path.name for path in folder.iterdir()) == ["program-3", "program-4", "program-5"]
    assert store.read("program-5") == b"x" and store.read("program-0") is None


def first_alone(arrays):
    """Of a list of any length."""
    return arrays[0] + 1.0


def test_arguments_that_are_not_read_count(folder, monkeypatch):
    """Calls with more of them have the same text, and programs of their own."""
    first_alone.__module__ = "maipp.kept"  # one that has names
    monkeypatch.setattr("maipp.kept.first_alone", first_alone, raising=False)
    for _ in range(2):
        function = program.kept(first_alone)  # as in a new process
        for count in (1, 3, 2):
            assert function([jnp.full(2, float(number)) for number in range(count)]).tolist() == [1.0, 1.0]
    assert len([path for path in folder.iterdir() if path.name.startswith("program-")]) == 3


def test_inside_of_jit_it_is_a_part_of_the_program(folder, traced):
    outer = jax.jit(lambda seed: _key(seed))
    assert same(outer(np.uint32(7)), jax.random.key(7))
    assert not folder.exists()


def test_names_tell_apart_what_traces_apart():
    one, two = np.zeros(3, np.float32), np.zeros(4, np.float32)
    parts = [one, two, jnp.zeros(3), jnp.zeros(3, jnp.int32), 1, 1.0, True, "1", None, (1,), [1], {"a": 1}, {"b": 1}]
    parts += [
        step,
        Scenario,
        functools.partial(option, 1),
        np.dtype("f4"),
        np.dtype("f8"),
        Scenario().replace(agents=4),
    ]
    names = [name_of(part) for part in parts]
    assert len(set(names)) == len(names)
    assert name_of(np.ones(3, np.float32)) == name_of(one)  # numbers are arguments
    assert name_of(Scenario()) == name_of(Scenario())


@pytest.mark.parametrize(
    "thing", [lambda: 1, _Foreign(), functools.partial(lambda x: x, 1), object(), {1, 2}, (1, _Foreign)]
)
def test_code_that_no_name_stands_for_has_none(thing):
    with pytest.raises(UnnamedError):
        name_of(thing)


_ONE_SURVEY = """
import sys, jax, numpy as np
from maipp import Scenario, draw_missions, make_planner, run_missions, score_missions
names = []
jax.monitoring.register_event_duration_secs_listener(
    lambda event, _, **told: event.endswith("backend_compile_duration") and names.append(told["fun_name"]))
scenario = Scenario().replace(agents=2, grid=8, nodes=12, neighbours=4, measurement_interval=1.0)
planner = make_planner("greedy", scenario, {})
missions = draw_missions(scenario, seed=3, instances=3, planner=planner)
states = run_missions(planner, missions, jax.random.key(0))
print(np.asarray(score_missions(missions, states).trace).tobytes().hex(), *(name for name in names if "run" in name))
"""


def test_a_second_process_reads_what_the_first_compiled_and_computes_the_same(tmp_path):
    source = str(Path(surroundings.__file__).parents[2])
    environment = os.environ | {"MAIPP_CACHE": str(tmp_path), "PYTHONPATH": source}

    def survey():
        done = subprocess.run(
            [sys.executable, "-c", _ONE_SURVEY], env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout.split()

    first, second = survey(), survey()
    assert first[0] == second[0]  # to the last bit, over two devices
    assert first[1:] and not second[1:]
