"""Settings every test runs under. They must be in place before jax or maipp is first imported."""

import gc
import os
from dataclasses import replace
from pathlib import Path

CACHE = Path(__file__).parents[1] / ".cache" / "jax-tests"

# Through the environment, so that commands started by tests inherit them. A value already set wins:
# JAX_PLATFORMS=cuda pytest runs the suite on a GPU.
for name, value in {
    "JAX_PLATFORMS": "cpu",
    "JAX_NUM_CPU_DEVICES": "2",  # sharded code meets a real mesh
    "NPROC": "5",  # see maipp.devices: too few threads can wait for each other forever
    "OPENBLAS_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false --xla_disable_hlo_passes=cpu-parallel-task-assigner "
    # Half the time of a compilation, which is what tests cost; what it makes is slower and rounds otherwise.
    "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false",
    "JAX_COMPILATION_CACHE_DIR": str(CACHE),
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.1",  # below that, reading back costs what compiling does
    "MPLBACKEND": "Agg",
    "MAIPP_CACHE": "",  # tests change code in memory, which no name of a kept program tells
}.items():
    os.environ.setdefault(name, value)

import jax  # noqa: E402
import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402
from jaxtyping import install_import_hook  # noqa: E402

# Shapes and types of every annotated signature in maipp are enforced while the tests run.
install_import_hook("maipp", "beartype.beartype")

TINY = {"agents": 2, "grid": 8, "nodes": 12, "neighbours": 4, "measurement_interval": 1.0}


def slow(*values: object):
    """Values of a test that `make test` leaves out and `make test-all` runs."""
    return pytest.param(*values, marks=pytest.mark.slow)


# Every planner, with options that compile quickly; `ti-star` is `intent-paths` with other options.
_SEARCH = {"horizon": 2, "candidates": 4, "elites": 2, "steps": 1, "points": 16}
_PATHS = {"weights": "untrained", "paths": 2, "steps": 2}
TINY_PLANNERS = {
    "random": {},
    "greedy": {},
    "shared-greedy": {},
    "lawnmower": {},
    "sga-rrt": {"nodes": 8, "lengths": (0.2, 0.3)},
    "receding-horizon": _SEARCH,
    "sga-catnipp": {"weights": "untrained"},
    "di": _PATHS,
    "ti": _PATHS,
    "intent-paths": _PATHS,
    "intent-search": {"weights": "untrained", "paths": 2, "nodes": 2} | _SEARCH,
}


def some_planners(*names: str):
    """A test of these planners by `name`, and in `make test-all` of all others: for what hardly depends on them."""
    return pytest.mark.parametrize("name", [name if name in names else slow(name) for name in TINY_PLANNERS])


# No deadline: the first example of a test pays for compilation.
settings.register_profile("maipp", deadline=None, max_examples=50, derandomize="CI" in os.environ)
settings.load_profile("maipp")

MAPS = Path("/proc/self/maps")
MOST_MAPS = 30_000  # Linux allows a process 65,530 by default, and LLVM dies without a word beyond


def pytest_collection_finish():
    """Tracing makes many objects: what the imports left is not looked through for garbage again and again."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 20, 50)


def pytest_collection_modifyitems(items):
    """Files with slow tests first: at the end, one worker would wait for them."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


@pytest.fixture(scope="module", autouse=True)
def _room_for_compiled_code():
    """Forget what earlier modules compiled before its many small mappings of memory are too many."""
    if MAPS.exists() and MAPS.read_bytes().count(b"\n") > MOST_MAPS:
        jax.clear_caches()
    yield


@pytest.fixture(params=TINY_PLANNERS)
def tiny_planner(request):
    """The name of every planner in turn, and options for it."""
    return request.param, TINY_PLANNERS[request.param]


@pytest.fixture(scope="session")
def tiny_table():
    """Table IV of the benchmark with two ranges, two budgets, missions and rows that compile quickly."""
    from maipp.bench.tables import TABLES, TablePart

    table = TABLES["table4"]
    parts = tuple(TablePart(part.scenario.replace(**TINY), part.printed) for part in table.parts[1:])
    rows = tuple(row for row in table.rows if row.name in ("random", "greedy", "lawnmower"))
    return replace(table, rows=rows, parts=parts, columns=(2.0, 3.0), reference="greedy")
