"""Paired tests agree with their definitions."""

import numpy as np
import pytest
from scipy.stats import ttest_rel, wilcoxon

from maipp.bench.paired import holm, paired


def test_it_is_the_difference_of_instance_means():
    rng = np.random.default_rng(0)
    a, b = rng.normal(1.0, 1.0, (12, 3)), rng.normal(0.0, 1.0, (12, 2))  # trials may differ in number
    test = paired(a, b)
    assert test.mean == pytest.approx(a.mean() - b.mean())
    assert test.se is not None
    assert test.mean / test.se == pytest.approx(ttest_rel(a.mean(axis=1), b.mean(axis=1)).statistic)
    assert test.p == pytest.approx(wilcoxon(a.mean(axis=1), b.mean(axis=1))[1])
    assert test.interval == pytest.approx(ttest_rel(a.mean(axis=1), b.mean(axis=1)).confidence_interval(0.95))


def test_nothing_differs_from_itself():
    values = np.random.default_rng(0).normal(size=(5, 2))
    assert paired(values, values) == (0.0, 0.0, (0.0, 0.0), 1.0)


def test_one_instance_tells_nothing_of_errors():
    assert paired(np.array([[3.0, 5.0]]), np.array([[1.0]])) == (3.0, None, None, None)


def test_holm_steps_down():
    # By hand: .01 x 4, then .02 x 3, .03 x 2 and .04 x 1 which may not fall below the one before.
    assert holm([0.04, 0.01, None, 0.03, 0.02]) == pytest.approx([0.06, 0.04, None, 0.06, 0.06])
    assert holm([0.6, 0.7]) == [1.0, 1.0] and holm([]) == []
