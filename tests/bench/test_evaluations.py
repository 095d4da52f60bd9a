"""Comparisons in pairs and their tests, and evaluations that were made in parts."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import ttest_rel, wilcoxon

from maipp.bench.evaluate import evaluate
from maipp.bench.evaluations import compare, find, holm, label, merged, paired, read_evaluations, save_evaluations, what
from maipp.engine import Decision, Planner
from maipp.errors import InputError
from maipp.planners import make_planner
from maipp.planners.any_planner import given_planner
from maipp.scenario import Scenario

SCENARIO = Scenario(agents=2, budget=0.6, grid=8, nodes=12, neighbours=4)


def run(planner, instances=4, first=0):
    return evaluate(SCENARIO, planner, instances=instances, first=first, trials=2, seed=5, timing=False)


@pytest.fixture(scope="module")
def random():
    return run("random")


@pytest.fixture(scope="module")
def greedy():
    return run("greedy")


def test_differences_are_those_of_the_pairs(random, greedy):
    budgets = [dataclasses.replace(each, scenario=SCENARIO.replace(budget=0.7)) for each in (greedy, random)]
    found = compare([greedy, random, *budgets], "greedy")
    traces = [each for each in found if each.metric == "trace"]
    assert [each.evaluation.scenario.budget for each in traces] == [0.6, 0.7]
    expected = paired(random.values["trace"], greedy.values["trace"])
    assert all(each.difference == expected for each in traces)
    assert [each.holm for each in traces] == holm([expected.p, expected.p])
    # A team without a limited range believes alike, and nobody was stopped: the latter says nothing, and is left out.
    assert {each.metric for each in found} >= {"trace", "own_trace", "true_trace", "rmse"}
    assert not {each.metric for each in found} & {"not_finite", "record_full"}
    assert traces[0].to_dict() | {"scenario": None} == {
        "planner": "random", "reference": "greedy", "scenario": None, "metric": "trace", "holm": traces[0].holm,
        "mean": expected.mean, "se": expected.se, "interval": [*(expected.interval or ())], "p": expected.p,
    }  # fmt: skip


def test_a_reference_has_to_be_there_once(random, greedy):
    with pytest.raises(InputError, match="--reference: ti is none of the planners compared, random, greedy"):
        compare([random, greedy], "ti")
    other = dataclasses.replace(greedy, seed=6)
    with pytest.raises(InputError, match="greedy was not evaluated in the worlds of random"):
        compare([random, other], "greedy")
    shared = dataclasses.replace(greedy, options={"shared": True})
    with pytest.raises(InputError, match="greedy was evaluated 2 times, with other options, in the worlds of random"):
        compare([random, greedy, shared], "greedy")
    assert label(shared, greedy, random) == "greedy shared=True" and label(random, greedy) == "random"


@pytest.mark.parametrize("planner", ["greedy", "random"])  # one draws its roadmaps only, the other all it does
def test_parts_are_the_whole(planner, request, tmp_path):
    whole = request.getfixturevalue(planner)
    parts = [run(planner, first=3, instances=1), run(planner, instances=3)]
    save_evaluations(parts, tmp_path / "parts.json")
    read = read_evaluations(tmp_path / "parts.json")
    (again,) = merged(read)
    assert (again.first, again.instances, again.options) == (0, 4, whole.options)
    for metric, values in whole.values.items():
        # Batches of other sizes round otherwise; 64 points of variance at most 1 in single precision.
        np.testing.assert_allclose(again.values[metric], values, rtol=1e-4, atol=1e-5)
    wanted = what(whole.planner, whole.options, whole.scenario, 5, 2)
    assert find(read, wanted, 3, 1, parts[0].fingerprint, timing=False) is read[0]
    assert find(read, wanted, 3, 1, parts[0].fingerprint, timing=True) is None  # it was not timed
    assert find(read, wanted, 3, 2, parts[0].fingerprint, timing=False) is None
    assert find(read, wanted, 3, 1, "of other code", timing=False) is None


def test_parts_have_to_fit(greedy):
    def part(first, **changes):
        return dataclasses.replace(greedy, first=first, **changes)

    with pytest.raises(InputError, match="--merge: instances 4:5 of greedy are in none of the parts"):
        merged([part(5), part(0)])
    with pytest.raises(InputError, match="--merge: instances 3:4 of greedy are in more than one of the parts"):
        merged([part(0), part(3)])
    with pytest.raises(InputError, match="parts of greedy were made by different code, .*the versions are the same"):
        merged([part(0), part(4, fingerprint="other")])
    old = {**greedy.versions, "jax": "0.1"}
    with pytest.raises(InputError, match=r"different code, weights or libraries \(jax .* and 0.1\)"):
        merged([part(0), part(4, fingerprint="other", versions=old)])
    assert [each.seed for each in merged([part(0), part(4, seed=9)])] == [5, 9]  # two evaluations


def test_other_files_are_refused(tmp_path, greedy):
    path = tmp_path / "out.json"
    for text, problem in (
        ("{}", "format: is not 'maipp-evaluations'"),
        ('{"format": "maipp-evaluations", "evaluations": [{}]}', r"evaluations\[0\]"),
        ("[", "not JSON, or cut short"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=problem):
            read_evaluations(path)
    short = {name: values[:-1] for name, values in greedy.values.items()}
    save_evaluations([dataclasses.replace(greedy, values=short)], path)
    with pytest.raises(InputError, match=r"evaluations\[0\].values.trace: has 3 entries; give 4"):
        read_evaluations(path)


class ToTheMiddle(Planner):
    """Goes to the middle."""

    def decide(self, key, observation, memory):
        return Decision(jnp.full((1, 2), 0.5), (), memory)


def to_the_middle(key, observation, memory):
    """Goes to the middle."""
    return jnp.full(2, 0.5)


def make_middle(scenario):
    return ToTheMiddle(scenario)


def test_every_form_of_a_planner_is_the_same_planner():
    forms = (ToTheMiddle, to_the_middle, make_middle, ToTheMiddle(SCENARIO.replace(budget=2.0)))
    first, *others = map(run, forms)
    assert [each.planner for each in others] == ["to_the_middle", "make_middle", "ToTheMiddle"]
    for each in others:
        np.testing.assert_array_equal(each.values["trace"], first.values["trace"])
        assert each.scenario == SCENARIO and each.fingerprint  # its code has a file


@pytest.mark.parametrize(
    ("form", "options", "problem"),
    [
        (int, {}, "planner int: it is no planner"),
        (lambda scenario: 3, {}, "planner <lambda>: gives a int; give a function that makes a planner, or decides"),
        (ToTheMiddle(SCENARIO), {"fast": 1}, r"planner ToTheMiddle: is made already; .* \(fast\)"),
        (ToTheMiddle, {"fast": 1}, "planner ToTheMiddle: no option 'fast'"),
    ],
)
def test_what_is_no_planner_is_refused(form, options, problem):
    with pytest.raises(InputError, match=problem):
        given_planner(form, SCENARIO, options)


def test_a_planner_keeps_its_weights_in_another_scenario():
    made = make_planner("sga-catnipp", SCENARIO.replace(budget=2.0), {"weights": "untrained"})
    name, again = given_planner(made, SCENARIO)
    assert name == "SgaCatnipp" and again.scenario == SCENARIO


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
