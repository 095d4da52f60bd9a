"""Training of a foresight: it learns, it resumes to the bit, and what it leaves is what is read."""

import dataclasses
import json
import os
import signal
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.errors import InputError
from maipp.foresight.model import GROUPS, group_of
from maipp.foresight.shipped import model_named
from maipp.training.config_io import ConfigKind, dump_config, override, parse_config
from maipp.training.foresight.bank import Routes, make_bank, parts
from maipp.training.foresight.config import NAMED, ForesightConfig
from maipp.training.foresight.learner import ForesightLearner
from maipp.training.foresight.run import train_foresight
from maipp.training.training_log import read_log

TINY = NAMED["smoke"].replace(width=8, updates=6, evaluate_every=3, validation=16, area=1.0, average=0.9)


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    """A run from its start to its end, its learner, and what it reported."""
    out, steps = tmp_path_factory.mktemp("straight"), []
    routes = make_bank(TINY, out)
    assert routes is not None
    learner = ForesightLearner(TINY, routes)
    result = train_foresight(TINY, out, progress=steps.append, about={"machine": "abacus"}, learner=learner)
    assert not result.interrupted and result.record.update == TINY.updates
    return out, learner, steps


def test_a_short_run_foretells_better_than_what_it_corrects(straight):
    """Of so few samples it learns, before anything else, that intervals of the fitted foresight are not exact."""
    _, _, steps = straight
    found = [step.evaluation for step in steps if step.evaluation]
    assert found[0]["learned_nll"] == found[0]["fitted_nll"]  # a new network corrects nothing
    assert found[-1]["loss"] < found[0]["loss"]


def test_what_a_run_leaves(straight):
    out, _, _ = straight
    assert {path.name for path in out.iterdir()} == {
        "bank", "checkpoints", "config.yaml", "final.json", "final.safetensors", "log.jsonl",
    }  # fmt: skip
    rows = read_log(out)
    assert [row["update"] for row in rows if "evaluation" not in row] == list(range(1, TINY.updates + 1))
    card = json.loads((out / "final.json").read_text())
    assert (card["schema"], card["machine"], card["seed"]) == ("maipp.foresight/1", "abacus", TINY.seed)
    model = model_named(out)
    assert model.architecture == {"width": TINY.width, "depth": TINY.blocks}
    # It knows what it was trained on, at the numbers of measurements that it met, and nothing else.
    known = np.all(np.asarray(model.low <= model.high), axis=1)
    most = int(group_of(jnp.int32(TINY.slots)))
    assert known[:most].all() and not known[most + 1 :].any() and most + 1 < GROUPS
    assert np.all(np.asarray(model.widening) > 0.3) and np.all(np.asarray(model.widening) < 3.0)


@pytest.mark.slow
def test_interrupted_and_resumed_a_run_ends_with_the_same_bytes(straight, tmp_path):
    out, learner, _ = straight

    def stop(step):
        if step.update == 2:
            os.kill(os.getpid(), signal.SIGTERM)

    first = train_foresight(TINY, tmp_path, progress=stop, learner=learner)
    assert first.interrupted and first.record.update == 2
    with pytest.raises(InputError, match="--resume goes on with it"):
        train_foresight(TINY, tmp_path, learner=learner)
    assert not train_foresight(TINY, tmp_path, resume=True, learner=learner).interrupted
    for name in ("final.safetensors", "bank/00.npz"):
        assert (tmp_path / name).read_bytes() == (out / name).read_bytes()


def test_routes_are_in_the_order_of_time_and_as_many_as_fit(straight):
    out, _, _ = straight
    routes = make_bank(TINY, out)
    assert isinstance(routes, Routes) and len(routes.x) == sum(part.surveys for part in parts(TINY))
    assert routes.x.shape[1:] == (TINY.slots, 2) and routes.count.max() <= TINY.slots
    assert np.all(routes.x >= 0) and np.all(routes.x <= 1)
    # Robots set out together: after the first measurements they are near, at the end they are not.
    early = np.linalg.norm(routes.x[:, 0] - routes.x[:, 1], axis=-1).mean()
    late = np.mean([np.ptp(x[:k], axis=0).max() for x, k in zip(routes.x, routes.count, strict=True)])
    assert early < late
    (out / "bank" / "00.npz").write_bytes(b"no archive")
    with pytest.raises(InputError, match=r"00\.npz: not a part of a bank"):
        make_bank(TINY, out)


def test_a_configuration_goes_through_yaml_and_says_what_is_wrong():
    kind = ConfigKind(NAMED, "docs/training-keys.md")
    for config in (ForesightConfig(), TINY):
        assert parse_config(dump_config(config), kind=kind) == config
    assert override(TINY, ["batch=4", "planners=random"]) == dataclasses.replace(TINY, batch=4, planners=("random",))
    wrongs: list[tuple[dict[str, Any], str]] = [
        ({"planners": ("gipsy",)}, "gipsy is none of receding-horizon"),
        ({"width": 7}, "give an even number"),
        ({"gradient_norm": 0.0}, "give a number > 0"),
    ]
    for wrong, text in wrongs:
        with pytest.raises(InputError, match=text):
            ForesightConfig(**wrong)


def test_a_batch_holds_what_its_configuration_asks_for(straight):
    """Samples of one key are the same again; all within what the route and the slots allow."""
    _, learner, _ = straight
    batch, again = (learner._draw(jnp.int32(3), learner.routes, learner.kinds) for _ in range(2))
    for one, other in zip(jax.tree.leaves(batch), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(one, other)
    assert sum(part.count.shape[0] for part in batch) == TINY.batch
    assert max(int(part.count.max()) for part in batch) <= TINY.slots
    for part in batch:
        assert np.isfinite(np.asarray(part.maps)).all() and np.isfinite(np.asarray(part.numbers)).all()
        assert np.all(np.asarray(part.truth) <= 1.0 + 0.2)  # divided by the maximum over a grid
