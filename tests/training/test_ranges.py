"""Numbers that each mission of a training run draws for itself."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.errors import InputError
from maipp.training.config import NAMED, RANGES, TrainConfig, ends
from maipp.training.config_io import config_to_dict, override, parse_config
from maipp.training.learner import Learner
from maipp.training.ranges import draw_params, extreme_scenarios
from maipp.training.worlds import training_scenario, training_shape

SMOKE = NAMED["smoke"]


def drawn(config, count=400):
    scenario = training_scenario(config)
    keys = jax.random.split(jax.random.key(0), count)
    return jax.jit(jax.vmap(lambda key: draw_params(config, scenario, jnp.asarray(1.0), key)))(keys)


def test_every_number_of_smoke_is_drawn_from_its_range():
    params = drawn(SMOKE)
    for name in RANGES:
        low, high = ends(getattr(SMOKE, name))
        values = np.asarray(params.speeds if name == "speed" else getattr(params, name))
        assert low < high and (values >= low - 1e-9).all() and (values <= high + 1e-6).all()
        assert values.mean() == pytest.approx((low + high) / 2, abs=0.1 * (high - low))
        assert len(np.unique(values)) > 300
    inverse = 1 / np.asarray(params.comm_range)  # uniform from none to the shortest range
    assert inverse.max() <= 1 / 0.3 + 1e-5 and inverse.mean() == pytest.approx(0.5 / 0.3, rel=0.1)
    team = np.asarray(params.present).sum(axis=1)
    assert set(team) == {2, 3} and 120 < (team == 2).sum() < 280
    assert np.asarray(params.present)[:, :2].all()


def test_a_number_alone_is_every_mission_s():
    params = drawn(TrainConfig(), 3)
    assert (np.asarray(params.length_scale) == np.float32(0.45)).all() and np.isinf(params.comm_range).all()
    assert np.asarray(params.present).all() and (np.asarray(params.budgets) == 1.0).all()


def test_one_shape_holds_all_missions():
    shape = training_shape(SMOKE)
    assert shape.slots == 10 and shape.limited and shape.agents == 3  # 2.0 of budget, every 0.2
    low, high = extreme_scenarios(SMOKE)
    assert (low.comm_range, high.comm_range) == (0.3, None) and low.length_scale == 0.2 and high.threshold == 0.5


@pytest.mark.slow
def test_smoke_learns_from_missions_of_different_numbers():
    config = SMOKE.replace(missions=4, events=6, minibatch=24, bank=2, shards=1)
    learner = Learner(config, jax.devices()[:1])
    state = learner.initial()
    worlds = state.shards.environments.world.params
    assert len(np.unique(worlds.length_scale)) == len(np.unique(worlds.threshold)) == 4
    state, metrics = learner.update(state)
    assert all(np.isfinite(float(metrics[name])) for name in ("loss", "value_loss", "entropy", "gradient_norm"))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("length_scale: [0.8, 0.2]", "length_scale: \\(0.8, 0.2\\); give \\[low, high\\] with low <= high"),
        ("length_scale: [0.0, 0.2]", "length_scale: 0.0 is not a length > 0"),
        ("threshold: [0.1, 0.2, 0.3]", "threshold: .* is not a finite number or 2 values"),
        ("comm_range: [null, 0.3]", "comm_range\\[0\\]: None does not fit"),
        ("comm_range: [far, 0.3]", "does not fit; give a finite number or 2 values such as 0.3,none or none"),
        ("team: [2, 4]", "team: \\(2, 4\\); give \\[fewest, most\\] with 1 <= fewest <= most <= agents, 3"),
        ("zones: [0, 2]", "zones: \\(0, 2\\); the teacher knows no zones; give imitation=0"),
        ("team: [0, 2]", "team\\[0\\]: 0 does not fit; give"),
    ],
)
def test_what_is_no_range_is_told(text, says):
    with pytest.raises(InputError, match=says) as caught:
        parse_config(text, source="own.yaml")
    assert "\n" not in str(caught.value)


def test_ranges_are_read_and_written():
    config = override(TrainConfig(), ["length_scale=0.2,0.8", "comm_range=0.3,none", "threshold=0.5", "team=1,3"])
    assert config.length_scale == (0.2, 0.8) and config.comm_range == (0.3, None) and config.team == (1, 3)
    assert config.threshold == 0.5
    assert TrainConfig(**config_to_dict(config)) == config
    assert parse_config("comm_range: [0.3, null]\nteam: null").comm_range == (0.3, None)
