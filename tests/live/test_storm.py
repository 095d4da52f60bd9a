"""A small part of the storm: disorder, copies, kills, torn lines. `python tests/live/storm.py` is the whole."""

import importlib.util
import sys
from pathlib import Path

import pytest

SMALL = "agents: 2\nbudget: 3\nstart: [0.5, 0.5]\ngrid: 8\nnodes: 16\nneighbours: 5\n"


@pytest.fixture(scope="module")
def storm():
    path = Path(__file__).with_name("storm.py")
    spec = importlib.util.spec_from_file_location("live_storm", path)
    assert spec is not None and spec.loader is not None
    module = sys.modules["live_storm"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    del sys.modules["live_storm"]


@pytest.mark.slow  # each start of the process takes seconds
def test_nothing_is_lost_and_the_belief_is_that_of_the_undisturbed_run(storm, tmp_path):
    run = {"planner": "shared-greedy", "events": 300, "kills": 3, "per_leg": 6, "seed": 1, "adapt": True}
    seen = storm.storm(tmp_path, SMALL, **run, progress=False)
    assert seen["kernel"]["measurements"] > 50
    assert min(seen["changes"].values()) > 0
    assert seen["events"] > 150 and seen["starts"] >= 4 and seen["answers compared"] > 150


def test_disorder_has_every_event_and_its_copies(storm):
    import numpy as np

    events = [{"id": str(i)} for i in range(700)]
    order = [int(event["id"]) for event in storm.disordered(events, np.random.default_rng(0), 0.3)]
    assert set(order) == set(range(700)) and len(order) == 1000 and order != sorted(order)
