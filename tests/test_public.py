"""The public face: its names, what installed packages add to it, and fields of one's own."""

import importlib.util
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import maipp
from maipp import extensions
from maipp.belief import condition
from maipp.engine.score import kernel_of
from maipp.errors import InputError
from maipp.fields.raster import load_raster
from maipp.planners import planner_names

# What others rely on: names may be added, none may go or change its meaning without a note in CHANGELOG.md.
NAMES = """
Belief Decision Environment Episode InputError Interest LiveSurvey Metrics Mission Observation PathSampler PlanSearch
Planner Raster Scenario State Vehicle __version__ belief_at compare condition draw_missions feasible_edges evaluate
extend keep_compiled load_policy load_scenario load_survey make_planner option part predicted_trace predicted_variance
prepare read_episode read_field register run_missions score_missions trajectories use_all_cores write_episode
"""

SCENARIO = maipp.Scenario(agents=2, budget=0.6, grid=8, nodes=12, neighbours=4)

OWN = """
import numpy as np
from maipp import Decision, Planner
from maipp.fields.raster import RasterData

class Stays(Planner):
    def decide(self, key, observation, memory):
        return Decision(observation.position[None], (), memory, True)

def read(path):
    rows = [[float(cell) for cell in line.split()] for line in path.read_text().splitlines()]
    return RasterData(np.array(rows), np.arange(2.0), np.arange(2.0))

def breaks(path):
    return rows
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Another package, with entry points."""
    (tmp_path / "bringer.py").write_text(OWN, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "bringer", raising=False)
    points = [
        EntryPoint("stays", "bringer:Stays", extensions.PLANNERS),
        EntryPoint("lost", "bringer:Lost", extensions.PLANNERS),
        EntryPoint("twice", "bringer:Stays", extensions.PLANNERS),
        EntryPoint("twice", "other:Stays", extensions.PLANNERS),
        EntryPoint("grd", "bringer:read", extensions.READERS),
        EntryPoint("bad", "bringer:breaks", extensions.READERS),
    ]
    monkeypatch.setattr(extensions, "entry_points", lambda group: [each for each in points if each.group == group])
    return tmp_path


def test_the_names_are_stable():
    assert maipp.__all__ == NAMES.split()


def test_planners_of_installed_packages_go_by_their_names(installed):
    assert planner_names()[-3:] == ("lost", "stays", "twice")
    assert type(maipp.make_planner("stays", SCENARIO)).__name__ == "Stays"
    for name, told in (("lost", "bringer:Lost cannot be loaded: .*Lost"), ("twice", "two packages bring one: bringer")):
        with pytest.raises(InputError, match=f"^planner {name}: {told}"):
            maipp.make_planner(name, SCENARIO)
    with pytest.raises(InputError, match=r"did you mean stays\?"):
        maipp.make_planner("stay", SCENARIO)


def test_readers_of_installed_packages_go_by_the_file_s_ending(installed):
    for name in ("map.grd", "map.bad", "map.xyz"):
        (installed / name).write_text("1 2\n3 4\n", encoding="utf-8")
    np.testing.assert_array_equal(load_raster(installed / "map.grd").values, [[1, 2], [3, 4]])
    with pytest.raises(InputError, match="bringer cannot read it: NameError: name 'rows'"):
        load_raster(installed / "map.bad")
    with pytest.raises(InputError, match="leave out value=depth"):
        load_raster(installed / "map.grd", value="depth")
    with pytest.raises(InputError, match="unknown suffix '.xyz'; .*, .bad or .grd file"):
        load_raster(installed / "map.xyz")


def waves(points):
    """Of JAX."""
    return 0.5 + 0.5 * jnp.sin(6 * points[:, 0]) * points[:, 1]


def sampled(points):
    """The same of NumPy, which JAX cannot trace."""
    x, y = np.array(points, float).T
    return 0.5 + 0.5 * np.sin(6 * x) * y


def test_a_field_may_be_a_plain_function():
    def draw(field):
        return maipp.draw_missions(SCENARIO, seed=1, instances=2, roadmaps=False, field=field)

    missions, other = draw(waves), draw(sampled)
    np.testing.assert_allclose(missions.truth[1], sampled(missions.grid[1]), atol=1e-6)
    # Between points 1/256 apart, the second derivative of 18 leaves at most 18 / 8 / 256^2.
    np.testing.assert_allclose(missions.truth, other.truth, atol=4e-5)
    places = jax.random.uniform(jax.random.key(0), (50, 2))
    first = jax.tree.map(lambda array: array[0], other.field)
    np.testing.assert_allclose(first(places), sampled(places), atol=4e-5)


@pytest.mark.parametrize(
    ("field", "told"),
    [
        (3, "field: int is no field; give a function of points"),
        (lambda points: points, r"gives \(3, 2\) for 3 points; give \(3,\)"),
        (lambda points: points.nothing(), "neither JAX nor NumPy points .* AttributeError"),
        (
            lambda points: np.where(np.array(points)[:, 0] > 0.5, np.nan, 0.0),
            "its value at 0.5.* is not a finite number",
        ),
    ],
)
def test_what_is_no_field_is_told(field, told):
    with pytest.raises(InputError, match=told):
        maipp.draw_missions(SCENARIO, seed=1, instances=2, roadmaps=False, field=field)


def test_beliefs_and_ways_can_be_had_of_a_survey():
    planner = maipp.make_planner("lawnmower", SCENARIO, {"rows": 2})
    missions = maipp.draw_missions(SCENARIO, seed=1, instances=2, planner=planner)
    states = maipp.run_missions(planner, missions, jax.random.key(0))
    points = np.array([[0.1, 0.2], [3.0, 3.0]])
    mean, variance = maipp.belief_at(missions, states, points, mission=1, time=0.5)
    when = states.measurement_time[1].reshape(-1) <= 0.5
    place, value = states.measurement_x[1].reshape(-1, 2), states.measurement_y[1].reshape(-1)
    belief = condition(kernel_of(SCENARIO), place, value, when, jnp.asarray(points), SCENARIO.noise)
    np.testing.assert_allclose(mean, belief.mean, atol=1e-5)
    np.testing.assert_allclose(variance, belief.variance, atol=1e-5)
    assert variance[1] > 0.99  # far away nothing is known
    for agent, way in enumerate(maipp.trajectories(states)[1]):
        np.testing.assert_array_equal(way[0, 1:], missions.start[1, agent])
        assert np.hypot(*np.diff(way[:, 1:], axis=0).T).sum() == pytest.approx(0.6, abs=1e-5)
    with pytest.raises(InputError, match="mission: 2 is not one of the 2 of the batch"):
        maipp.belief_at(missions, states, points, mission=2)


def test_the_example_is_a_planner_in_less_than_forty_lines():
    path = Path(__file__).parents[1] / "docs" / "examples" / "my_planner.py"
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    assert len(lines) < 40 and importlib.util.spec_from_file_location("my_planner", path) is not None
    assert {line.split()[1] for line in lines if line.startswith("from")} == {"maipp"}  # nothing but the public face
