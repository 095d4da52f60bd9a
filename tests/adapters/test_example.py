"""The example in docs/ trains: after a few rounds its policy leaves less than chance."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pettingzoo")

from maipp.adapters.pettingzoo import aec_env  # noqa: E402

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "pettingzoo_train.py"


@pytest.mark.slow
def test_the_example_learns(small, capsys):
    spec = importlib.util.spec_from_file_location("pettingzoo_train", EXAMPLE)
    assert spec is not None and spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    rng = np.random.default_rng(0)
    env = aec_env(small, reward="log-trace")
    weights = example.train(env, rng, rounds=4, draws=12, worlds=3)
    traces = example.compare(env, weights, rng, worlds=24)
    assert capsys.readouterr().out.count("round ") == 4
    gain = traces["random"] - traces["trained"]
    assert gain.mean() > 3 * gain.std(ddof=1) / np.sqrt(len(gain))
