"""Seeds: everything that takes one takes those from 0 to 2**32 - 1, and refuses others in one line."""

import dataclasses

import jax
import numpy as np
import pytest

from maipp.bench.evaluate import evaluate
from maipp.cli.main import main
from maipp.engine import draw_missions
from maipp.engine.episode_io import read_episode
from maipp.errors import InputError
from maipp.live import LiveSurvey
from maipp.scenario import Scenario
from maipp.seeds import LARGEST_SEED, check_seed
from maipp.surveys.survey_io import parse_survey
from maipp.training.config import TRAINING_SEEDS, TrainConfig
from maipp.training.config_io import override
from maipp.training.worlds import draw_bank, training_scenario

SCENARIO = Scenario(agents=2, budget=0.6, grid=8, nodes=12, neighbours=4)
TINY = [f"scenario.{each}" for each in "agents=2 budget=0.6 grid=8 nodes=12 neighbours=4".split()]
LARGE = (3_000_000_000, LARGEST_SEED)
TOO_LARGE = LARGEST_SEED + 1
# Drawn before keys were made outside of the compiled function.
STARTS_OF_SEED_7 = [[0.987564206123352, 0.01973593235015869], [0.2391601800918579, 0.3878861665725708]]
TRUTHS_OF_SEED_7 = [14.187142372131348, 13.609296798706055]
MISSION = """\
area: [[0, 0], [400, 0], [400, 300], [0, 300]]
metres: true
robots:
  - {start: [10, 10], speed: 2, budget_m: 200}
measurement_spacing_m: 80
planner: random
scenario: {grid: 8, nodes: 12, neighbours: 4}
kernel: {length_scale_m: 100}
"""


@pytest.fixture(autouse=True)
def devices_are_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("maipp.devices._configured", True)  # JAX is running already


@pytest.mark.parametrize("seed", [0, 1, *LARGE, np.int64(3_000_000_000), np.uint32(LARGEST_SEED), np.array(7)])
def test_a_seed_is_given_back_as_a_python_integer(seed):
    assert check_seed(seed) == int(seed) and type(check_seed(seed)) is int


@pytest.mark.parametrize("seed", [-1, TOO_LARGE, 10**30, True, 1.0, "1", None, np.array([1, 2]), np.int64(-1)])
def test_what_is_no_seed_is_told(seed):
    with pytest.raises(InputError, match=r"^here: .* is no seed; give a whole number from 0 to 4294967295$"):
        check_seed(seed, "here")


def test_the_largest_seed_is_the_last_with_a_key_of_its_own():
    keys = [jax.random.key_data(jax.random.key(seed)).tolist() for seed in (0, *LARGE, TOO_LARGE)]
    assert keys == [[0, 0], [0, LARGE[0]], [0, LARGE[1]], [0, 0]]


def test_missions_take_every_seed():
    starts = [np.asarray(draw_missions(SCENARIO, seed=seed, instances=2).start) for seed in (0, 2**31 - 1, *LARGE)]
    assert len({start.tobytes() for start in starts}) == len(starts)
    with pytest.raises(InputError, match=f"seed: {TOO_LARGE} is no seed"):
        draw_missions(SCENARIO, seed=TOO_LARGE, instances=1)


def test_the_worlds_of_a_small_seed_stay_what_they_are():
    missions = draw_missions(SCENARIO, seed=7, instances=2)
    np.testing.assert_array_equal(np.asarray(missions.start[:, 0]), np.array(STARTS_OF_SEED_7, np.float32))
    np.testing.assert_allclose(np.asarray(missions.truth.sum(axis=1)), TRUTHS_OF_SEED_7, rtol=1e-5)


@pytest.mark.parametrize("seed", LARGE)
def test_evaluations_and_missions_and_live_surveys_take_large_seeds(seed):
    assert evaluate(SCENARIO, "random", instances=1, trials=1, seed=seed, timing=False).seed == seed
    with LiveSurvey.from_scenario(SCENARIO, "random", seed=seed) as survey:
        assert survey.setup.seed == seed
    assert parse_survey(MISSION + f"seed: {seed}\n").seed == seed


@pytest.mark.parametrize("seed", [-1, TOO_LARGE])
def test_evaluations_and_missions_and_live_surveys_refuse_others(seed):
    takers = (
        lambda: evaluate(SCENARIO, "random", instances=1, trials=1, seed=seed, timing=False),
        lambda: LiveSurvey.from_scenario(SCENARIO, "random", seed=seed),
        lambda: parse_survey(MISSION + f"seed: {seed}\n"),
    )
    for taker in takers:
        with pytest.raises(InputError, match=f"seed: {seed} is not? .*a whole number from 0 to 4294967295$"):
            taker()


def test_training_takes_seeds_whose_worlds_have_one_too():
    largest = LARGEST_SEED - TRAINING_SEEDS
    for seed in (3_000_000_000, largest):
        config = override(TrainConfig(), [f"seed={seed}", "bank=1"])
        draw_bank(config, dataclasses.replace(training_scenario(config), nodes=12, neighbours=4, grid=8), 2)
    for seed in (largest + 1, LARGEST_SEED, TOO_LARGE):
        with pytest.raises(InputError, match=f"^--set: seed: '{seed}' is not a whole number from 0 to {largest}$"):
            override(TrainConfig(), [f"seed={seed}"])


@pytest.mark.parametrize("seed", LARGE)
def test_plan_takes_large_seeds(seed, tmp_path):
    out = tmp_path / "out"
    arguments = ["--planner", "random", "--seed", str(seed), "--no-animation", "--out", str(out)]
    assert main(["plan", *arguments, "--set", *TINY]) == 0
    assert read_episode(out / "episode.json").seed == seed
    text = (out / "episode.json").read_text(encoding="utf-8").replace(f'"seed": {seed}', f'"seed": {TOO_LARGE}')
    (out / "episode.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=f"seed: {TOO_LARGE} is not a whole number"):
        read_episode(out / "episode.json")


def test_survey_takes_large_seeds(tmp_path, capsys):
    (tmp_path / "m.yaml").write_text(MISSION, encoding="utf-8")
    assert main(["survey", str(tmp_path / "m.yaml"), "--seed", str(LARGEST_SEED), "--out", str(tmp_path / "out")]) == 0
    rehearsal = ["--rehearse", "--seed", str(LARGEST_SEED), "--out", str(tmp_path / "rehearsed")]
    assert main(["survey", str(tmp_path / "m.yaml"), *rehearsal]) == 0, capsys.readouterr().err


@pytest.mark.parametrize(
    "command",
    [
        "plan",
        "evaluate --planner random",
        "survey MISSION",
        "live MISSION --journal JOURNAL",
        "benchmark table1 --out OUT",
        "benchmark figures --out OUT",
        "benchmark latency --out OUT",
        "benchmark scaling --out OUT",
    ],
)
@pytest.mark.parametrize("seed", [TOO_LARGE, 10**30])
def test_every_command_refuses_larger_ones_in_one_line(command, seed, tmp_path, capsys):
    (tmp_path / "MISSION").write_text(MISSION, encoding="utf-8")
    words = [str(tmp_path / word) if word.isupper() else word for word in command.split()]
    assert main([*words, "--seed", str(seed)]) == 2
    told = capsys.readouterr().err
    assert told == f"error: --seed: {seed} is no seed; give a whole number from 0 to 4294967295\n"
    assert not (tmp_path / "OUT").exists() and not (tmp_path / "JOURNAL").exists()
