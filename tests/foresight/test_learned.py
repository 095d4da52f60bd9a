"""The learned foresight: what it starts from, what it may not depend on, and where it gives up."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.scipy.ndimage import map_coordinates
from matplotlib.cbook import get_sample_data

from maipp.belief import Matern32, condition
from maipp.engine import draw_missions
from maipp.errors import InputError
from maipp.fields.gp_field import draw_fields
from maipp.fields.mixture import evaluation_grid
from maipp.foresight import make_foresight
from maipp.foresight.fitted import fitted_foresight
from maipp.foresight.learned import LearnedForesight
from maipp.foresight.model import GROUPS, FieldModel, group_of
from maipp.foresight.own_kernel import any_length_scale
from maipp.foresight.shipped import FORESIGHT, model_named, shipped_file
from maipp.policy import save_weights
from maipp.problem import problem_of
from maipp.scenario import Scenario

SIDE, SLOTS = 12, 24
SCENARIO = Scenario(grid=SIDE)
GRID = evaluation_grid(SIDE)
GOLDEN_PLACES = np.array([0, 40, 77, 143])
GOLDEN_SHIFT, GOLDEN_STRETCH = [0.044, -0.127, -0.140, -0.363], [1.188, 1.109, 0.641, 0.848]


@pytest.fixture(scope="module")
def ask():
    """Laws of the fitted and of a learned foresight after some measurements, and whether the network is trusted."""

    @jax.jit
    def laws(foresight, x, y, mask):
        belief = condition(Matern32(0.45), x, y, mask, GRID)
        return foresight.fitted(belief), foresight(belief), foresight.correction(belief).trusted

    def of(model, x, y, count=SLOTS):
        foresight = LearnedForesight(SCENARIO, fitted_foresight(SCENARIO), model).on(problem_of(SCENARIO))
        arrays = (jnp.asarray(each, jnp.float32) for each in (x, y))
        return laws(foresight, *arrays, jnp.arange(SLOTS) < count)

    return of


@pytest.fixture(scope="module")
def errors(ask):
    """Mean squared errors of the fitted and the shipped foresight on fields, and how often the network is trusted."""

    def of(fields, count):
        rng, rows = np.random.default_rng(5), []
        for field in fields:
            x = rng.random((SLOTS, 2)).astype(np.float32)
            fitted, learned, trusted = ask(model_named(), x, field(jnp.asarray(x)), count)
            truth = field(GRID)
            rows.append([jnp.mean((fitted.mean - truth) ** 2), jnp.mean((learned.mean - truth) ** 2), trusted])
        return np.mean(np.array(rows, float), axis=0)

    return of


@pytest.fixture(scope="module")
def surveyed():
    """Places that three robots measured, and a field of the benchmark there and on the grid."""
    mission = jax.tree.map(lambda a: a[0], draw_missions(SCENARIO, seed=660_101, instances=1, roadmaps=False))
    x = np.random.default_rng(3).random((SLOTS, 2)).astype(np.float32)
    return x, np.asarray(mission.field(jnp.asarray(x))), np.asarray(mission.truth)


@pytest.fixture(scope="module")
def wild():
    """A model whose corrections are random, and far from zero."""
    model = FieldModel(jax.random.key(1), width=48, depth=3)
    head = 0.5 * jax.random.normal(jax.random.key(2), model.network.head.weight.shape)
    return eqx.tree_at(lambda m: m.network.head.weight, model, head)


def test_a_network_that_corrects_nothing_is_the_fitted_foresight(ask, surveyed):
    x, y, _ = surveyed
    for count in (0, 7, SLOTS):
        fitted, learned, trusted = ask(FieldModel(jax.random.key(0), width=48, depth=3), x, y, count)
        assert trusted
        # Worked out beside the network, the same sums may be rounded otherwise.
        np.testing.assert_allclose(learned.mean, fitted.mean, atol=1e-6)
        np.testing.assert_allclose(learned.deviation, fitted.deviation, atol=1e-6)


def test_the_order_of_measurements_means_nothing(ask, surveyed, wild):
    """To within the rounding of a Cholesky factor in float32, whose order of rows is another."""
    x, y, _ = surveyed
    order = np.random.default_rng(0).permutation(SLOTS)
    fitted, one, _ = ask(wild, x, y)
    _, other, _ = ask(wild, x[order], y[order])
    assert np.abs(one.mean - fitted.mean).max() > 0.05  # it does correct
    np.testing.assert_allclose(one.mean, other.mean, atol=2e-3)
    np.testing.assert_allclose(one.deviation, other.deviation, atol=2e-3)


def test_what_it_was_not_trained_on_is_left_to_the_fitted_foresight(ask, surveyed, wild):
    """Numbers out of their range, at counts that were never met, or not finite: the law is the fitted one."""
    x, y, _ = surveyed
    group = int(group_of(jnp.int32(SLOTS)))
    strict = eqx.tree_at(lambda m: m.high, wild, wild.high.at[group].set(-1e3))
    for model, values in ((strict, y), (wild, np.where(np.arange(SLOTS) == 3, np.nan, y))):
        fitted, learned, trusted = ask(model, x, values)
        assert not trusted
        np.testing.assert_allclose(learned.mean, fitted.mean, atol=1e-6)
        np.testing.assert_allclose(learned.deviation, fitted.deviation, atol=1e-6)
    assert ask(strict, x, y, 2)[2]  # a group that it knows


@pytest.mark.parametrize("known", [{"field": "relief.npz"}, {"field_family": "any"}])
def test_a_field_of_no_known_family_is_left_to_the_fitted_foresight(surveyed, wild, known):
    x, y, _ = surveyed
    scenario = SCENARIO.replace(**known)
    foresight = LearnedForesight(scenario, fitted_foresight(scenario), wild)
    belief = condition(Matern32(0.45), jnp.asarray(x), jnp.asarray(y), jnp.ones(SLOTS, bool), GRID)
    np.testing.assert_array_equal(foresight(belief).mean, foresight.fitted(belief).mean)
    np.testing.assert_array_equal(foresight.fitted(belief).mean, any_length_scale(belief).law.mean)


def test_groups_of_counts():
    counts = jnp.array([0, 1, 3, 4, 8, 9, 15, 16, 24, 25, 36, 37, 60, 61, 500])
    assert group_of(counts).tolist() == [0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7] and GROUPS == 8


def test_weights_are_read_as_they_were_written(tmp_path, wild):
    path = tmp_path / "final.safetensors"
    save_weights(wild, path, {}, FORESIGHT)
    for one, other in zip(jax.tree.leaves(model_named(tmp_path)), jax.tree.leaves(wild), strict=True):
        np.testing.assert_array_equal(one, other)
    with pytest.raises(InputError, match="ti.json: schema: 'maipp.policy/1' is not"):
        model_named(shipped_file().parents[2] / "policy" / "trained" / "ti.safetensors")


def test_a_copy_without_weights_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr("maipp.foresight.shipped.files", lambda _: tmp_path)
    with pytest.raises(InputError, match="foresight learned: this copy of maipp has no weights"):
        make_foresight("learned", SCENARIO)


def test_in_the_benchmark_s_fields_the_shipped_network_errs_less_than_the_fitted_foresight(errors):
    """Of 40 fields that training never saw."""
    missions = draw_missions(SCENARIO, seed=660_102, instances=40, roadmaps=False)
    fields = [jax.tree.map(lambda a, i=i: a[i], missions.field) for i in range(40)]
    for count in (12, SLOTS):
        fitted, learned, trusted = errors(fields, count)
        assert trusted > 0.95 and learned < fitted


def test_in_fields_of_other_families_it_errs_no_more_than_the_fitted_foresight(errors):
    """Draws of a Gaussian process and cuts of relief, standardised: the scores of the measurements tell both apart."""
    draws = draw_fields(jax.random.key(660_103), Matern32(0.3, 1.0), 12)
    fields = [jax.tree.map(lambda a, i=i: a[i], draws) for i in range(12)]
    fitted, learned, _ = errors(fields, SLOTS)
    assert learned < 1.05 * fitted
    with np.load(str(get_sample_data("topobathy.npz", asfileobj=False))) as file:
        heights = [file["topo"][i : i + 40, j : j + 40].astype(float) for i, j in ((5, 5), (10, 75), (50, 40))]
    relief = [_standardised(height) for height in heights]
    fitted, learned, _ = errors(4 * relief, SLOTS)
    assert learned < 1.05 * fitted


def _standardised(height):
    """A cut of relief on the unit square."""
    values = jnp.asarray((height - height.mean()) / height.std(), jnp.float32)

    def field(points):
        return map_coordinates(values, (points * (values.shape[0] - 1)).T, order=1)

    return field


def test_the_shipped_weights_give_what_they_gave(ask, surveyed):
    """Numbers of the weights that ship, in deviations of the fitted law; processors round factors of it otherwise."""
    x, y, _ = surveyed
    fitted, learned, trusted = ask(model_named(), x, y)
    assert trusted
    shift = (learned.mean - fitted.mean) / fitted.deviation
    np.testing.assert_allclose(shift[GOLDEN_PLACES], GOLDEN_SHIFT, atol=0.02)
    np.testing.assert_allclose((learned.deviation / fitted.deviation)[GOLDEN_PLACES], GOLDEN_STRETCH, atol=0.02)
