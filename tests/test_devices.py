"""One JAX device per core. Every case is a process of its own: JAX counts its devices once."""

import json
import os
import subprocess
import sys
import textwrap

import pytest

from maipp import devices
from maipp.devices import core_count, cores_here

CORES = range(core_count())
SETTINGS = ("NPROC", "OPENBLAS_NUM_THREADS", "XLA_FLAGS")
FLAGS = "--xla_cpu_multi_thread_eigen=false --xla_disable_hlo_passes=cpu-parallel-task-assigner"
REPORT = """
import json, os, jax
from maipp.devices import missions_devices
print(json.dumps({
    "devices": len(jax.local_devices()),
    "missions": len(missions_devices()),
    **{name: os.environ.get(name) for name in ("NPROC", "OPENBLAS_NUM_THREADS", "XLA_FLAGS")},
}))
"""


def run(code, **environment):
    """What the report prints after `code` ran in a fresh process, without the settings of the tests."""
    clean = {k: v for k, v in os.environ.items() if k not in SETTINGS and k != "JAX_NUM_CPU_DEVICES"}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code) + REPORT],
        env=clean | {"JAX_PLATFORMS": "cpu", "PYTHONPATH": os.pathsep.join(sys.path)} | environment,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_without_it_missions_run_on_one_device():
    """Also where JAX was told to show more: someone who did not ask for all cores may have other plans for them."""
    found = run("", JAX_NUM_CPU_DEVICES="3")
    assert (found["devices"], found["missions"]) == (3, 1)


def test_every_core_becomes_a_device():
    found = run("from maipp.devices import use_all_cores; use_all_cores()")
    assert found["devices"] == found["missions"] == len(CORES)


def test_the_number_of_cores_may_be_given_and_the_first_call_counts():
    found = run("from maipp.devices import use_all_cores; use_all_cores(3); use_all_cores(5)")
    assert found["devices"] == found["missions"] == 3
    assert int(found["NPROC"]) >= 2 * 3 + 1
    assert found["OPENBLAS_NUM_THREADS"] == "1"
    assert found["XLA_FLAGS"] == FLAGS


def test_a_process_of_one_core_stays_on_it_with_one_thread():
    """Whatever its parent asked for, which has all cores."""
    code = """
    import os
    from maipp.devices import cores_here, use_one_core
    last = cores_here()[-1]
    use_one_core(last)
    assert not hasattr(os, "sched_getaffinity") or cores_here() == [last]
    """
    found = run(code, NPROC="9")
    assert found["devices"] == found["missions"] == 1
    assert found["NPROC"] == "1" and found["OPENBLAS_NUM_THREADS"] == "1" and found["XLA_FLAGS"] == FLAGS


def test_what_the_user_set_stays():
    code = "from maipp.devices import use_all_cores; use_all_cores(2)"
    flags = "--xla_cpu_multi_thread_eigen=true --xla_disable_hlo_passes=dce"
    given = {"NPROC": "64", "OPENBLAS_NUM_THREADS": "3", "XLA_FLAGS": flags}
    found = run(code, **given)
    assert {name: found[name] for name in SETTINGS} == given
    kept = run(code, XLA_FLAGS="--xla_cpu_enable_fast_math=false")
    assert kept["XLA_FLAGS"] == f"--xla_cpu_enable_fast_math=false {FLAGS}"


def test_importing_maipp_devices_does_not_import_jax():
    """Its settings come too late for an XLA that is already loaded."""
    code = "import sys, maipp.devices; sys.exit('jax' in sys.modules)"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    assert subprocess.run([sys.executable, "-c", code], env=environment, timeout=60).returncode == 0


def test_too_late_a_call_is_an_error():
    """JAX cannot add devices once it has counted them; going on with one core would be silent and slow."""
    code = """
    import jax
    jax.devices()
    from maipp.devices import use_all_cores
    try:
        use_all_cores(2)
    except RuntimeError as error:
        assert "before" in str(error), error
    else:
        raise AssertionError("accepted")
    """
    found = run(code)
    assert (found["devices"], found["missions"]) == (1, 1)


@pytest.mark.parametrize(("call", "devices"), [("use_all_cores(2)", 2), ("use_one_core()", 1)])
def test_missions_run_on_all_devices_of_a_process_that_asked_for_them(call, devices):
    """Two devices hung with a thread pool of one thread per device; one device does not."""
    code = f"""
    from maipp.devices import use_all_cores, use_one_core
    {call}
    import jax
    from maipp.planners.greedy import Greedy
    from maipp.scenario import Scenario
    from maipp.engine import draw_missions, run_missions
    scenario = Scenario(agents=2, budget=0.6, grid=8, nodes=20, neighbours=5)
    missions = draw_missions(scenario, seed=0, instances=4)
    states = run_missions(Greedy(scenario), missions, jax.random.key(0))
    assert not states.active.any()
    assert len(states.route.sharding.device_set) == {devices}
    """
    assert run(code)["missions"] == devices


@pytest.mark.skipif(len(CORES) < 2, reason="XLA cuts nothing for a single core")
@pytest.mark.parametrize(("flags", "cut"), [("", False), ("--xla_disable_hlo_passes=none", True)])
def test_loops_are_not_cut_into_pieces_for_threads(flags, cut):
    """XLA knows the pass that does so by a name that may change: then this says so, and only speed is lost."""
    code = f"""
    from maipp.devices import use_all_cores
    use_all_cores(2)
    import jax, jax.numpy as jnp
    field = jax.ShapeDtypeStruct((4096, 4096), jnp.float32)
    compiled = jax.jit(lambda x: jnp.exp(x) * jnp.sin(x)).lower(field).compile()
    assert ("outer_dimension_partitions" in compiled.as_text()) is {cut}
    """
    run(code, XLA_FLAGS=flags)


@pytest.mark.parametrize("value", ["", " ", "many"])
def test_an_empty_number_of_threads_is_none(value):
    found = run("from maipp.devices import use_all_cores; use_all_cores(2)", NPROC=value)
    assert found["devices"] == 2 and int(found["NPROC"]) >= 2 * 2 + 1


def test_a_quota_of_time_is_a_number_of_cores(monkeypatch):
    monkeypatch.setattr(devices, "cores_here", lambda: list(range(64)))
    for quota, cores in [(None, 64), (2.0, 2), (1.5, 2), (0.1, 1), (100.0, 64)]:
        monkeypatch.setattr(devices, "cpu_quota", lambda quota=quota: quota)
        assert core_count() == cores
    assert cores_here() != []
