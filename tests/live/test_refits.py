"""The kernel is refitted under way: a function of what was measured, in the journal, used by whatever is decided."""

import json

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maipp.belief import Interest
from maipp.belief.refit import Hyperparameters, HyperPrior
from maipp.errors import InputError
from maipp.live import LiveSurvey, refits
from maipp.live.belief_query import believe
from maipp.live.gate import LEVEL, Gate
from maipp.live.incremental_posterior import correlations
from maipp.live.journal import Journal, read_journal
from maipp.live.recorded_survey import read_record
from maipp.live.refits import Refits
from maipp.live.scaled_measurement import ScaledMeasurement
from maipp.live.simulate import simulate
from maipp.results.field_map import field_map
from maipp.results.journals import taken_live
from maipp.scenario import Scenario
from maipp.surveys.standardise import prepare
from maipp.surveys.survey_io import parse_survey

GUESS = Hyperparameters(0.0, 1.0, 0.45, 1e-3)
PRIOR = HyperPrior(0.45, 1e-3)
UNKNOWN = HyperPrior(0.45, 1e-3, weight=0.01, level_known=False, noise_spread=1.5)
SMALL = Scenario(agents=2, budget=3.0, start=(0.5, 0.5), grid=8, nodes=16, neighbours=5, length_scale=0.8, noise=1e-3)


def field(points):
    """Shorter than the scenario thinks."""
    return np.sin(11 * points[:, 0]) * np.cos(9 * points[:, 1])


def samples(seed, count=48, true=0.2, level=0.0, size=1.0):
    """Two robots that wander in a field with a shorter length scale than the guess."""
    rng = np.random.default_rng(seed)
    x = np.clip(np.cumsum(rng.normal(0, 0.08, (count // 2, 2, 2)), axis=0) + 0.5, 0, 1).reshape(-1, 2)
    covariance = correlations(GUESS._replace(length_scale=true), x, x) + 1e-3 * np.eye(count)
    values = level + size * np.linalg.cholesky(covariance) @ rng.normal(size=count)
    return [
        ScaledMeasurement(float(i), i % 2, px, py, value)
        for i, ((px, py), value) in enumerate(zip(x.tolist(), values, strict=True))
    ]


def gate(prior=PRIOR, level=LEVEL):
    return Gate(GUESS, level, None, Refits(prior))


@settings(max_examples=8)
@given(data=st.data(), seed=st.integers(0, 3))
def test_the_kernel_is_a_function_of_the_set(data, seed):
    """Whatever was judged in between, of whatever part of the measurements."""
    every = [s._replace(value=s.value + 30 * (i % 17 == 9)) for i, s in enumerate(samples(seed))]
    at_once, bit_by_bit = gate(), gate()
    wanted = at_once.judge(every)
    for _ in range(data.draw(st.integers(1, 4))):
        part = data.draw(st.sets(st.integers(0, 47)))
        bit_by_bit.judge([each for i, each in enumerate(every) if i in part])
    assert bit_by_bit.judge(every) == wanted and bit_by_bit.kernel == at_once.kernel
    assert at_once.kernel.length_scale < 0.4


def test_of_clean_measurements_of_an_unknown_level_none_is_kept_out():
    out = [
        sum(
            verdict.out is not None for verdict in gate(UNKNOWN).judge(samples(seed, level=300.0, size=0.01 * 10**seed))
        )
        for seed in range(5)
    ]
    assert sum(out) <= 1  # of 240


def test_a_spike_among_the_first_is_kept_out():
    for at in (0, 2, 5, 9):
        spiked = [s._replace(value=s.value + 1e4 * (i == at)) for i, s in enumerate(samples(1, level=20.0))]
        verdicts = gate(UNKNOWN).judge(spiked)
        assert [i for i, verdict in enumerate(verdicts) if verdict.out] == [at]


def test_without_a_gate_the_kernel_is_fitted_all_the_same():
    judge = gate(level=0.0)
    verdicts = judge.judge(samples(2))
    assert all(verdict.out is None and verdict.surprise is None for verdict in verdicts)
    assert judge.kernel.measurements > 40 and judge.kernel.length_scale < 0.4


@pytest.fixture(scope="module")
def surveyed(tmp_path_factory):
    """A survey of a field whose length scale was guessed too long, its journal, belief and state."""
    journal = tmp_path_factory.mktemp("refits") / "survey.journal"
    with LiveSurvey.from_scenario(SMALL, "shared-greedy", adapt=True, journal=journal) as survey:
        simulate(survey, field, 0)
        return journal, survey.belief(), survey.state()


def error(belief):
    return float(np.sqrt(np.mean((np.array(belief["mean"]) - field(np.array(belief["points"]))) ** 2)))


def test_the_state_tells_the_kernel_and_the_belief_is_of_it(surveyed):
    _, belief, state = surveyed
    kernel = state["kernel"]
    assert kernel["measurements"] >= 20 and 0.1 < kernel["length_scale"] < 0.5
    with LiveSurvey.from_scenario(SMALL, "shared-greedy") as survey:
        simulate(survey, field, 0)
        assert "kernel" not in survey.state()
        told = survey.belief()
    assert np.mean(told["std"]) < 0.7 * np.mean(belief["std"])  # the guess promises too much
    assert error(belief) < 1.1 * error(told)


def test_a_restart_has_the_same_bits_and_fits_nothing_anew(surveyed, monkeypatch):
    journal, belief, state = surveyed
    monkeypatch.setattr(refits, "refit", lambda *_: pytest.fail("fitted anew"))
    with LiveSurvey.from_scenario(SMALL, "shared-greedy", adapt=True, journal=journal) as survey:
        assert survey.belief() == belief and survey.state() == state
    lines = [json.loads(line) for line in journal.read_bytes().splitlines()[1:]]
    assert sum(len(line.get("kernels", {})) for line in lines) >= 10


def test_a_journal_with_refits_is_of_another_survey_than_one_without(surveyed):
    with pytest.raises(InputError, match="another survey"):
        LiveSurvey.from_scenario(SMALL, "shared-greedy", journal=surveyed[0])


def test_under_the_guess_the_belief_is_that_without_refits():
    """Offsets times the identity, values times 1: rounding of float32 at most."""
    with (
        LiveSurvey.from_scenario(SMALL, "shared-greedy", adapt=True) as adapting,
        LiveSurvey.from_scenario(SMALL, "shared-greedy") as fixed,
    ):
        for number, (x, y) in enumerate(((0.2, 0.3), (0.8, 0.6), (0.4, 0.9))):
            event = {"event": "measurement", "id": f"m{number}", "robot": "robot1", "time": float(number)}
            for survey in (adapting, fixed):
                survey.handle(event | {"position": [x, y], "value": 0.3 * number})
        np.testing.assert_allclose(adapting.belief()["mean"], fixed.belief()["mean"], atol=1e-5)
        np.testing.assert_allclose(adapting.belief()["std"], fixed.belief()["std"], atol=1e-5)


def test_the_result_is_of_the_fitted_kernel(surveyed, monkeypatch):
    """Read back without the mission: the same belief to the digits of the answer, and Tr(P) in the same values."""
    journal, belief, state = surveyed
    monkeypatch.setattr(refits, "refit", lambda *_: pytest.fail("fitted anew"))
    mean, std = read_record(journal).belief(np.array(belief["points"]))
    np.testing.assert_allclose(mean, belief["mean"], atol=1e-6)
    np.testing.assert_allclose(std, belief["std"], atol=1e-6)
    episode = taken_live(journal).episode
    known = episode.beliefs(np.array([np.inf]))
    values = episode.drawn.to_user_values(known.mean[0]), episode.drawn.to_user_std(np.sqrt(known.variance[0]))
    if "direction" not in state["kernel"]:
        # Conditioned in another order of the slots: what float32 rounds.
        np.testing.assert_allclose(values[0], belief["mean"], atol=2e-3)
        np.testing.assert_allclose(values[1], belief["std"], atol=2e-3)
    # The map's cells, asked at their middles, are the belief there.
    taken = taken_live(journal)
    drawn = field_map(taken, cells=10)
    rows, columns = drawn.mean.shape
    x = drawn.west + drawn.cell[0] * (np.arange(columns) + 0.5)
    y = drawn.north - drawn.cell[1] * (np.arange(rows) + 0.5)
    mean, std = read_record(journal).belief(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    np.testing.assert_allclose(drawn.mean.ravel(), mean, atol=1e-5)
    np.testing.assert_allclose(drawn.std.ravel(), std, atol=1e-5)
    assert episode.drawn.to_user_values(episode.scenario.threshold) == pytest.approx(SMALL.threshold, abs=1e-6)


MISSION = """
metres: true
area: [[0, 0], [400, 0], [400, 300], [0, 300]]
robots: [{name: boat, start: [10, 10], speed: 1.0, budget_m: 3000}]
measurement_spacing_m: 80
threshold: 12
kernel: {length_scale_m: 120, mean: 8, std: 4, adapt: true}
planner: shared-greedy
"""


@pytest.mark.parametrize("changed", [None, 10.0])  # to what the threshold is changed under way
@pytest.mark.parametrize("given", [None, 1.5])  # the mission's own confidence
@pytest.mark.parametrize("earlier", [False, True])  # a journal that does not say whether it follows
def test_a_result_judges_interest_as_the_decisions_did(changed, given, earlier, tmp_path):
    settings = {"grid": 8, "nodes": 16, "neighbours": 5} | ({} if given is None else {"beta": given})
    prepared = prepare(parse_survey(MISSION + f"scenario: {json.dumps(settings)}"))
    with LiveSurvey.from_prepared(prepared, journal=tmp_path / "j") as survey:
        for number, (x, y) in enumerate(np.random.default_rng(0).uniform((10, 10), (390, 290), (30, 2)).tolist()):
            event = {"event": "measurement", "id": f"m{number}", "robot": "boat", "position": [x, y]}
            value = 9.0 + 2.5 * float(field(np.array([[x, y]]) / 400)[0])
            survey.handle(event | {"time": float(number), "value": value})
        if changed is not None:
            survey.handle({"event": "threshold", "id": "t", "threshold": changed, "time": 40.0})
        measurements = survey._measurements
        world = survey.world.known(measurements.kernel, survey.setup.beta_follows)
        mean, std = believe(survey.world.mission, measurements, np.asarray(world.mission.grid))
    if earlier:
        forget(tmp_path / "j", "beta_follows")
    taken, problem, (level, scale) = taken_live(tmp_path / "j"), world.mission.problem, measurements.standard
    scenario = taken.episode.scenario
    assert (scenario.threshold, scenario.beta) == pytest.approx((float(problem.threshold), float(problem.beta)))
    if given is None:
        assert abs(scenario.beta - survey.world.scenario.beta) > 0.1
    else:
        assert scenario.beta == given
    interest = Interest(problem.threshold, problem.beta, problem.interest_rule)
    trace = interest.trace(*map(jnp.asarray, ((mean - level) / scale, (std / scale) ** 2, world.mission.inside)))
    # Conditioned in another order of the slots: what float32 rounds.
    assert taken.episode.metrics.trace == pytest.approx(float(trace), rel=1e-3)


def forget(journal, key):
    """Write the journal anew without a key of its place."""
    (header, *others), _ = read_journal(journal)
    del header["place"][key]
    journal.unlink()
    again = Journal(journal)
    for record in (header, *others):
        again.append(record)
    again.close()
