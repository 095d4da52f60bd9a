"""What cannot be is kept out, what can be is not, and no order of reports matters."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maipp.belief.refit import Hyperparameters
from maipp.live import incremental_posterior
from maipp.live.gate import LEVEL, Gate
from maipp.live.incremental_posterior import ConditionedSamples, correlations
from maipp.live.scaled_measurement import ScaledMeasurement

KERNEL = Hyperparameters(0.0, 1.0, 0.45, 0.0025)


def survey(seed, kernel=KERNEL, count=90, scale=1.0, guess=None):
    """Three robots that wander, and what they measure of a field drawn from the kernel."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.2, 0.8, (3, 2))
    heading, rows = rng.uniform(0, 2 * np.pi, 3), []
    for step in range(count // 3):
        heading += rng.normal(0, 0.6, 3)
        places = np.clip(places + 0.07 * np.stack([np.cos(heading), np.sin(heading)], axis=-1), 0, 1)
        rows += [(step + robot / 10, robot, *place) for robot, place in enumerate(places.tolist())]
    x = np.array([row[2:] for row in rows])
    covariance = kernel.std**2 * correlations(kernel, x, x) + (kernel.noise + 1e-9) * np.eye(count)
    values = scale * np.linalg.cholesky(covariance) @ rng.normal(size=count)
    return [
        ScaledMeasurement(row[0], row[1], row[2], row[3], value)
        for row, value in zip(rows, values.tolist(), strict=True)
    ]


def out(samples, kernel=KERNEL, **more):
    return np.array([verdict.out is not None for verdict in Gate(kernel, LEVEL, **more).judge(samples)])


@pytest.mark.parametrize("length_scale", [0.15, 0.45])
@pytest.mark.parametrize("noise", [1e-4, 0.01])
def test_of_clean_measurements_hardly_one_is_kept_out(length_scale, noise):
    kernel = Hyperparameters(0.0, 1.0, length_scale, noise)
    found = [out(survey(seed, kernel), kernel).sum() for seed in range(12)]
    assert sum(found) <= 1  # 1 in 1,000 of 1,080; none with these seeds


def test_surprises_are_standard_normal_under_the_kernel():
    scores = [each.surprise or 0.0 for seed in range(20) for each in Gate(KERNEL, LEVEL).judge(survey(seed))]
    assert np.mean(scores) == pytest.approx(0, abs=0.1) and np.std(scores) == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize(("guess", "scale"), [(0.15, 1.0), (0.6, 1.0), (0.45, 3.0)])
def test_a_wrong_kernel_keeps_out_hardly_anything(guess, scale):
    kernel = KERNEL._replace(length_scale=guess)
    found = [out(survey(seed, scale=scale), kernel).mean() for seed in range(10)]
    assert np.mean(found) < 0.02


@pytest.mark.parametrize("share", [0.01, 0.05, 0.1])
def test_spikes_are_kept_out_and_nothing_else(share):
    rng, hits, bad, false = np.random.default_rng(1), 0, 0, 0
    for seed in range(8):
        samples = survey(seed)
        spiked = rng.random(90) < share
        sizes = rng.choice([-1, 1], 90) * rng.uniform(6, 100, 90)
        samples = [s._replace(value=s.value + size * hit) for s, size, hit in zip(samples, sizes, spiked, strict=True)]
        found = out(samples)
        hits, bad, false = hits + (found & spiked).sum(), bad + spiked.sum(), false + (found & ~spiked).sum()
    assert hits >= 0.95 * bad and false <= 2  # a spike among the first few may let those near it wait


def test_what_later_ones_agree_with_is_let_in():
    samples = [s._replace(value=0.1 * s.value) for s in survey(2)]
    near = sorted(range(90), key=lambda i: np.hypot(samples[i].x - samples[60].x, samples[i].y - samples[60].y))
    plume = sorted(i for i in near[:12] if i >= 45)
    assert len(plume) >= 4
    plumed = [s._replace(value=s.value + 8 * (i in plume)) for i, s in enumerate(samples)]
    verdicts = [Gate(KERNEL, LEVEL).judge(plumed[: i + 1])[i].out for i in range(90)]
    assert verdicts[plume[0]] == "surprise"  # when it came
    assert not out(plumed)[plume[0]]  # at the end


def test_a_stuck_sensor_is_kept_out_but_for_its_first_value():
    samples = survey(3)
    stuck = [i for i, sample in enumerate(samples) if sample.robot == 1][10:20]
    samples = [s._replace(value=samples[stuck[0]].value) if i in stuck else s for i, s in enumerate(samples)]
    verdicts = Gate(KERNEL, LEVEL).judge(samples)
    assert [verdicts[i].out for i in stuck] == [None] + ["stuck"] * 9 and verdicts[stuck[-1]].run == 10
    # A sensor that rounds says the same again where the field is flat.
    coarse = [s._replace(value=round(s.value, 1)) for s in survey(3)]
    assert not out(coarse).any()


def test_values_that_stand_for_none_agree_with_nothing():
    samples = [s._replace(value=-5000.0, stray=True) if i % 9 == 4 else s for i, s in enumerate(survey(4))]
    assert out(samples).tolist() == [sample.stray for sample in samples]


def test_old_samples_count():
    samples = survey(5)
    old = np.array([(s.x, s.y) for s in samples]), np.array([s.value + 4 for s in samples]), np.full(90, 0.04)
    later = [ScaledMeasurement(1.0, 0, samples[30].x, samples[30].y, samples[30].value)]
    assert out(later, old=ConditionedSamples(*old)).all() and not out(later).any()


def test_kept_ones_count_and_without_a_level_all_do():
    samples = [s._replace(value=s.value + 50 * (i == 40)) for i, s in enumerate(survey(6))]
    assert Gate(KERNEL, LEVEL).judge(samples, {samples[40]})[40].out is None
    assert all(each == (None, None, 1) for each in Gate(KERNEL, 0.0).judge(samples))


@settings(max_examples=8)
@given(data=st.data(), seed=st.integers(0, 5))
def test_neither_order_nor_history_matters(data, seed):
    samples = survey(seed, count=24)
    hit = data.draw(st.sets(st.integers(0, 23), max_size=8))
    level = data.draw(st.sampled_from([8.0, -30.0]))
    samples = [s._replace(value=s.value + level * (i in hit)) for i, s in enumerate(samples)]
    gate, have = Gate(KERNEL, LEVEL), []
    for sample in data.draw(st.permutations(samples)):
        have = sorted([*have, sample])
        found = gate.judge(have)
    assert found == Gate(KERNEL, LEVEL).judge(samples)


def test_of_very_many_the_nearest_tell_as_much(monkeypatch):
    """Beyond 512 only the nearest 96 or so are asked; what they expect differs by a small part of a deviation."""
    samples = survey(3, count=660)
    by_near = [verdict.surprise or 0.0 for verdict in Gate(KERNEL, LEVEL).judge(samples)]
    monkeypatch.setattr(incremental_posterior, "_MOST", 10_000)
    by_all = [verdict.surprise or 0.0 for verdict in Gate(KERNEL, LEVEL).judge(samples)]
    np.testing.assert_array_equal(by_near[:512], by_all[:512])
    apart = np.abs(np.subtract(by_near[512:], by_all[512:]))
    assert 0 < np.median(apart) < 0.05 and apart.max() < 0.5  # standard deviations


def test_of_very_many_order_and_history_do_not_matter():
    samples = survey(4, count=600)
    whole, gate = Gate(KERNEL, LEVEL).judge(samples), Gate(KERNEL, LEVEL)
    late = {20, 300, 511, 512, 513, 550}
    gate.judge([sample for index, sample in enumerate(samples) if index not in late])
    assert gate.judge(samples) == whole
